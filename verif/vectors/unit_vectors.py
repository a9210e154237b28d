"""Operands for every unit that has one stream in and one out, by the unit's name."""

from collections.abc import Callable

import numpy as np

from lightloom.golden_model.contract.interfaces import OPERATORS, PURE
from lightloom.verif.vectors.any_vectors import any_vectors
from lightloom.verif.vectors.box_vectors import box_setup_vectors, node_test_vectors, ray_time_vectors
from lightloom.verif.vectors.number_vectors import corner_vectors, random_vectors
from lightloom.verif.vectors.ray_vectors import ray_setup_vectors, ray_triangle_vectors
from lightloom.verif.vectors.texel_vectors import texel_blend_vectors, texel_match_vectors, texel_project_vectors

VECTORS: dict[str, Callable[[int, int], np.ndarray]] = {
    "ray_setup": ray_setup_vectors,
    "ray_triangle": ray_triangle_vectors,
    "ray_triangle_half": ray_triangle_vectors,
    "ray_time": ray_time_vectors,
    "box_setup": box_setup_vectors,
    "node_test": node_test_vectors,
    "texel_project": texel_project_vectors,
    "texel_match": texel_match_vectors,
    "texel_blend": texel_blend_vectors,
}
"""Functions of count and seed. A unit that is not here gets what fits its input format."""


def unit_vectors(unit: str, count: int, seed: int) -> np.ndarray:
    """`count` operands of a unit, plausible ones and corner cases mixed; the same for the same seed."""
    if unit not in OPERATORS:
        return _vectors(unit, count, seed)
    rng = np.random.default_rng(seed)
    corners = rng.choice(corner_vectors(unit), count // 2, replace=False)
    return rng.permutation(np.concatenate([corners, random_vectors(unit, count - len(corners), seed)]))


def many_vectors(unit: str, count: int, seed: int) -> np.ndarray:
    """`count` random operands and, of a number unit, all of its corner cases too."""
    if unit not in OPERATORS:
        return _vectors(unit, count, seed)
    return np.concatenate([corner_vectors(unit), random_vectors(unit, count, seed)])


def _vectors(unit: str, count: int, seed: int) -> np.ndarray:
    return VECTORS[unit](count, seed) if unit in VECTORS else any_vectors(PURE[unit].input, count, seed)
