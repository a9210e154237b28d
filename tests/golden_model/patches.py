"""Rays at the vertices, edges and faces of gridded meshes, each with all triangles that it might hit: one must be hit.

A mesh is a height field over a square grid, its triangles wound at random. Only the 18 triangles of the 3 x 3 cells
around the point aimed at are tested: the slopes are such that no rounding takes the ray out of them.
"""

import numpy as np

from lightloom.golden_model.tracing.ray_setup import ray_setup
from lightloom.golden_model.tracing.ray_triangle import triangle_tests
from lightloom.verif.vectors.ray_vectors import rays, triangles

PATCH = 18
"""Triangles a ray is tested against."""
CORNERS = np.array([[(0, 0), (1, 0), (1, 1)], [(0, 0), (1, 1), (0, 1)]])
"""Grid offsets of the vertices of the two triangles of a cell."""


def _heights(i: np.ndarray, j: np.ndarray, cells: int, seed: int) -> np.ndarray:
    """Pseudo-random heights of grid vertices, float64 in units of half a cell: a pure function of vertex and seed."""
    mixed = (i * 73856093) ^ (j * 19349663) ^ (seed * 83492791)
    return ((mixed * 2654435761 >> 7) % 1021 / 1021 - 0.5) * (0.5 / cells)


def _vertices(i: np.ndarray, j: np.ndarray, cells: int, seed: int, scale: float) -> np.ndarray:
    """(…, 3) float32, over the square from -scale to scale."""
    planar = [(2 * k / cells - 1) for k in (i, j)]
    return (np.stack([*planar, _heights(i, j, cells, seed)], axis=-1) * scale).astype(np.float32)


def patches(count: int, cells: int, seed: int, scale: float = 1.0) -> np.ndarray:
    """RAY_TRIANGLE (count, PATCH): rays from all sides at a mesh of 2 * cells**2 triangles (cells at least 8).

    A third of the rays is aimed at vertices, a third at edges, a third at faces; half of the origins are whole cells,
    so that many rays meet edges exactly.
    """
    rng = np.random.default_rng(seed)
    cell = rng.integers(1, cells - 1, (count, 2))

    weight = rng.dirichlet([1.0, 1.0, 1.0], count)
    kind = rng.integers(0, 3, count)
    weight[kind == 0] = np.eye(3)[rng.integers(0, 3, (kind == 0).sum())]
    weight[(kind == 1), rng.integers(0, 3, (kind == 1).sum())] = 0
    weight /= weight.sum(axis=1, keepdims=True)
    index = cell[:, None, :] + CORNERS[rng.integers(0, 2, count)]
    aimed = _vertices(index[..., 0], index[..., 1], cells, seed, scale).astype(np.float64)
    target = (aimed * weight[:, :, None]).sum(axis=1)

    # Steeper than any slope of the mesh, from above or below.
    height = rng.choice([-1, 1], count) * np.exp2(rng.uniform(-2, 3, count))
    origin = np.stack([*(rng.uniform(-1, 1, (2, count)) * height), height], axis=1) * scale
    origin[:, :2] += target[:, :2]
    whole = rng.integers(0, 2, count).astype(bool)
    origin[whole, :2] = np.rint(origin[whole, :2] / scale * cells) / cells * scale
    origin = origin.astype(np.float32)

    offsets = np.stack(np.meshgrid([-1, 0, 1], [-1, 0, 1], indexing="ij"), axis=-1).reshape(-1, 1, 1, 2)
    index = (cell[:, None, None, None, :] + offsets + CORNERS).reshape(count, PATCH, 3, 2)
    vertices = _vertices(index[..., 0], index[..., 1], cells, seed, scale)
    vertices = vertices[:, :, rng.permutation(3)]
    reverse = rng.integers(0, 2, (count, PATCH)).astype(bool)
    vertices[reverse] = vertices[reverse][:, ::-1]

    # The axes are exchanged and mirrored, so that every dominant axis and sign occurs.
    order = np.array([(0, 1, 2), (1, 2, 0), (2, 0, 1), (0, 2, 1), (2, 1, 0), (1, 0, 2)])[rng.integers(0, 6, count)]
    mirror = rng.choice(np.array([-1, 1], dtype=np.float32), (count, 3))
    origin = np.take_along_axis(origin, order, axis=1) * mirror
    target = np.take_along_axis(target, order, axis=1) * mirror
    vertices = np.take_along_axis(vertices, order[:, None, None, :], axis=3) * mirror[:, None, None, :]

    prepared = ray_setup(rays(origin, target - origin))
    flat = triangle_tests(np.repeat(prepared, PATCH), triangles(vertices.reshape(-1, 3, 3)))
    return flat.reshape(count, PATCH)
