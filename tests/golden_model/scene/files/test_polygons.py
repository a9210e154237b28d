"""Polygons to triangles: each point covered once, all triangles turned as the polygon is, no corner lost."""

from collections import Counter
from collections.abc import Callable

import numpy as np
import pytest

from lightloom.golden_model.scene.files.polygons import FAN_CORNERS, triangulated
from lightloom.golden_model.scene.mesh import area_vectors

SEED = 20260513


def star(rng: np.random.Generator, size: int) -> np.ndarray:
    """A polygon around the origin with corners at random distances."""
    angle = np.sort(rng.uniform(0, 2 * np.pi, size)) + 0.01 * np.arange(size) / size
    gaps = np.diff(angle, append=angle[0] + 2 * np.pi)
    radius = rng.uniform(0.1, 1, size)
    if gaps.max() > 3:  # the origin must lie inside
        return star(rng, size)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)


def comb(rng: np.random.Generator, size: int) -> np.ndarray:
    """A polygon with teeth, which no corner sees whole."""
    teeth = max((size - 3) // 2, 2)
    top = [(k, rng.uniform(2, 9) if k % 2 else rng.uniform(0.2, 1)) for k in range(2 * teeth + 1)]
    return np.array([(0, 0), (2 * teeth, 0), *top[::-1]], dtype=np.float64)[:, :2]


def tilted(rng: np.random.Generator, flat: np.ndarray) -> np.ndarray:
    """(n, 2) in a random plane of space, begun at a random corner: (n, 3)."""
    frame, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    flat = np.roll(flat, rng.integers(len(flat)), axis=0)[:: rng.choice([1, -1])]
    return rng.normal(size=3) * 5 + flat @ frame[:2] * 10 ** rng.uniform(-3, 3)


def check(ring: np.ndarray, triangles: np.ndarray) -> None:
    """Edges inside are those of two triangles, the others the polygon's: with all turned alike, no overlap, no gap."""
    size = len(ring)
    areas = area_vectors(ring[triangles])
    normal = area_vectors(ring[[[0, k, k + 1] for k in range(1, size - 1)]]).sum(axis=0)
    assert (areas @ normal > 0).all()
    edges = Counter((int(a), int(b)) for t in triangles for a, b in zip(t, np.roll(t, -1), strict=True))
    border = {edge for edge in edges if edge[::-1] not in edges}
    assert max(edges.values()) == 1
    assert border == {(k, (k + 1) % size) for k in range(size)}
    assert len(triangles) == size - 2


@pytest.mark.parametrize("shape", [star, comb])
def test_random_polygons_are_covered_once(shape: Callable[[np.random.Generator, int], np.ndarray]) -> None:
    rng = np.random.default_rng(SEED)
    rings = [tilted(rng, shape(rng, int(size))) for size in rng.integers(5, 30, 150)]
    rings += [tilted(rng, shape(rng, FAN_CORNERS + 40))]
    sizes = np.array([len(ring) for ring in rings])
    first = np.cumsum(sizes) - sizes
    corners = rng.permutation(sizes.sum())
    points = np.empty((sizes.sum(), 3))
    points[corners] = np.concatenate(rings)
    cut = triangulated(points, corners, sizes)
    assert not len(cut.crossing)
    assert (np.diff(cut.face) >= 0).all()
    for k, ring in enumerate(rings):
        try:
            check(ring, cut.corner[cut.face == k] - first[k])
        except AssertionError:
            print(f"seed {SEED}, polygon {k}: {ring.tolist()}")
            raise


def cut_one(*ring: tuple[float, ...]) -> tuple[list[list[int]], int]:
    points = np.array([point if len(point) == 3 else (*point, 0.0) for point in ring], dtype=np.float64)
    cut = triangulated(points, np.arange(len(points)), np.array([len(points)]))
    return cut.corner.tolist(), len(cut.crossing)


def test_a_convex_polygon_is_a_fan_around_its_first_corner() -> None:
    assert cut_one((0, 0), (2, 0), (3, 1), (1, 2)) == ([[0, 1, 2], [0, 2, 3]], 0)
    assert cut_one((0, 0), (2, 0, 1), (3, 1), (1, 2)) == ([[0, 1, 2], [0, 2, 3]], 0), "though not quite flat"


def test_a_concave_quad_is_a_fan_around_its_dent() -> None:
    assert cut_one((0, 0), (2, 1), (0, 4), (1, 1)) == ([[1, 2, 3], [1, 3, 0]], 0)


def test_corners_on_a_straight_line_stay_corners() -> None:
    """Another polygon may have an edge that ends there."""
    assert cut_one((0, 0), (1, 0), (2, 0), (2, 2), (0, 2)) == ([[1, 2, 3], [1, 3, 4], [1, 4, 0]], 0)


def test_a_polygon_with_a_hole_by_a_bridge() -> None:
    """The edge from the outline to the hole is there twice: area 9 - 1, no triangle turned over."""
    ring = [(0, 0), (3, 0), (3, 3), (0, 3), (0, 0), (1, 1), (1, 2), (2, 2), (2, 1), (1, 1)]
    points = np.pad(np.array(ring, dtype=np.float64), ((0, 0), (0, 1)))
    cut = triangulated(points, np.arange(10), np.array([10]))
    area = area_vectors(points[cut.corner])[:, 2] / 2
    assert (area > 0).all()
    assert area.sum() == 8
    assert not len(cut.crossing)


@pytest.mark.parametrize(
    ("ring", "crossing"),
    [
        (((0, 0), (2, 2), (2, 0), (0, 2)), 1),  # no area in all: a bow tie
        (((0, 0), (2, 2), (3, 0), (0, 1)), 1),
        (((0, 0), (1, 0), (2, 0), (3, 0)), 0),  # no area at all
        (((1, 1), (1, 1), (1, 1), (1, 1)), 0),
        (((0, 0), (1, 0), (1, 0), (0, 1)), 0),  # a triangle with a corner twice
        (((0, 0), (float("nan"), 0), (1, 1), (0, 1)), 0),
    ],
)
def test_polygons_that_are_none(ring: tuple[tuple[float, ...], ...], crossing: int) -> None:
    """Nothing of them is lost without a word: points that are not finite stay, crossing ones are told."""
    corners, crosses = cut_one(*ring)
    assert crosses == crossing
    if np.isnan(ring).any():
        assert sorted({corner for row in corners for corner in row}) == [0, 1, 2, 3]


def test_no_polygons() -> None:
    cut = triangulated(np.zeros((0, 3)), np.zeros(0, dtype=int), np.zeros(0, dtype=int))
    assert cut.corner.shape == (0, 3)
