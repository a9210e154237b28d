"""Meshes for the tests of tracing: bunny, dragon, and closed or gridded ones whose inner points no ray may pass."""

from pathlib import Path

import numpy as np
import trimesh

from lightloom.verif.vectors import ray_vectors
from tests import ROOT
from tests.needs import need, needs

BUNNY = ROOT / "build/meshes/bunny.obj"
DRAGON = BUNNY.with_name("dragon.ply")


needs_bunny = needs(BUNNY.is_file(), "build/meshes/bunny.obj is missing: make meshes")


def bunny() -> np.ndarray:
    """TRIANGLE (69666,): the Stanford bunny. Skips the test where the mesh is missing, but not in CI."""
    return _scan(BUNNY)


def dragon() -> np.ndarray:
    """TRIANGLE (871414,): the Stanford dragon. Skips the test where the mesh is missing, but not in CI."""
    return _scan(DRAGON)


def _scan(path: Path) -> np.ndarray:
    need(path.exists(), f"{path.relative_to(path.parents[2])} is missing: make meshes")
    return ray_vectors.triangles(np.asarray(trimesh.load_mesh(path, process=False).triangles))


def quads(points: np.ndarray) -> np.ndarray:
    """Grid points (m, n, 3) to the corners (2(m-1)(n-1), 3, 3) of its triangles."""
    a, b, c, d = points[:-1, :-1], points[1:, :-1], points[1:, 1:], points[:-1, 1:]
    return np.stack([np.stack([a, b, c], axis=2), np.stack([a, c, d], axis=2)], axis=2).reshape(-1, 3, 3)


def torus(around: int, across: int) -> tuple[np.ndarray, np.ndarray]:
    """A closed ring of 2*around*across triangles, radii 1 and 0.4; also the ring's centre line (around, 3)."""
    angle = 2 * np.pi * np.arange(around) / around
    ring = np.stack([np.cos(angle), np.zeros(around), np.sin(angle)], axis=1)
    tilt = (2 * np.pi * np.arange(across) / across).reshape(1, -1, 1)
    points = ring[:, None] * (1 + 0.4 * np.cos(tilt)) + np.array([0, 0.4, 0]) * np.sin(tilt)
    return quads(np.pad(points.astype(np.float32), ((0, 1), (0, 1), (0, 0)), mode="wrap")), ring


def octasphere(level: int) -> np.ndarray:
    """A closed unit sphere of 8 * 4**level triangles, symmetric, with vertices in the axis planes."""
    corners = np.array([[[x, 0, 0], [0, y, 0], [0, 0, z]] for x in (1, -1) for y in (1, -1) for z in (1, -1)], float)
    for _ in range(level):
        a, b, c = corners.transpose(1, 0, 2)
        ab, bc, ca = a + b, b + c, c + a
        parts = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
        corners = np.concatenate([np.stack(part, axis=1) for part in parts])
        # Symmetric in its operands, so that neighbours agree on the bits of the vertices that they share.
        corners /= np.sqrt((corners**2).sum(axis=2, keepdims=True))
    return corners.astype(np.float32)


def height_field(rows: int, columns: int, rng: np.random.Generator) -> np.ndarray:
    """2*rows*columns triangles over the unit square with heights 0 to 0.05; half of them over a lattice of dyadics."""
    x, z = np.meshgrid(np.arange(rows + 1) / rows, np.arange(columns + 1) / columns, indexing="ij")
    y = rng.uniform(0, 0.05, x.shape)
    return quads(np.stack([x, y, z], axis=-1).astype(np.float32))


def mixed_winding(corners: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """(T, 3, 3) to TRIANGLE (T,) in random order, each with its vertices in random order."""
    order = rng.permuted(np.tile(np.arange(3), (len(corners), 1)), axis=1)
    return ray_vectors.triangles(rng.permutation(np.take_along_axis(corners, order[:, :, None], axis=1)))
