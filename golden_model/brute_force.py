"""Every ray against every triangle: the oracle of traversal, and the way to trace through a unit in Verilog."""

from collections.abc import Callable

import numpy as np

from golden_model.formats import HIT
from golden_model.ray_setup import ray_setup
from golden_model.ray_triangle import ray_triangle, triangle_tests

BATCH = 1 << 18
"""Tests at a time: 20 MB of operands."""


def trace_brute_force(
    triangles: np.ndarray,
    rays: np.ndarray,
    *,
    any_hit: bool = False,
    setup: Callable[[np.ndarray], np.ndarray] = ray_setup,
    intersect: Callable[[np.ndarray], np.ndarray] = ray_triangle,
    advance: Callable[[float], None] = lambda rays: None,
) -> np.ndarray:
    """TRIANGLE (T,) and RAY (N,) to HIT (N,), as `traversal.trace` defines it, with all N*T tests made.

    `setup` takes RAY (N,) to PREPARED_RAY (N,), `intersect` RAY_TRIANGLE (M,) to TRIANGLE_HIT (M,): the models, or the
    RTL in a simulator. `advance` is told of rays that are done.
    """
    hits = np.zeros(len(rays), dtype=HIT)
    hits["primitive"] = -1
    prepared = setup(rays)
    step = max(BATCH // max(len(triangles), 1), 1)
    for start in range(0, len(rays), step):
        part = prepared[start : start + step]
        best = hits[start : start + step]
        for base in range(0, len(triangles), BATCH):
            _nearest(best, part, triangles[base : base + BATCH], base, intersect)
        advance(len(part))
    if any_hit:
        occluded = hits["primitive"] >= 0
        hits[:] = 0
        hits["primitive"] = np.where(occluded, 0, -1)
    return hits


def _nearest(
    best: np.ndarray,
    prepared: np.ndarray,
    triangles: np.ndarray,
    base: int,
    intersect: Callable[[np.ndarray], np.ndarray],
) -> None:
    """Tests PREPARED_RAY (N,) against TRIANGLE (T,), numbered from `base`, and keeps the best HIT (N,) of each ray."""
    rays, count = len(prepared), len(triangles)
    tests = triangle_tests(np.repeat(prepared, count), np.tile(triangles, rays))
    results = intersect(tests).reshape(rays, count)
    t = np.where(results["hit"], results["t"], np.float32(np.inf))
    index = np.argmin(t, axis=1)  # of equal ones the first
    found = results[np.arange(rays), index]
    better = found["hit"] & ((best["primitive"] < 0) | (found["t"] < best["t"]))
    best["primitive"][better] = base + index[better]
    for name in ("t", "u", "v", "front"):
        best[name][better] = found[name][better]
