"""How far computed hits lie outside the boxes of their triangles, against what the pad allows (docs/traversal.md)."""

import numpy as np
import pytest

from lightloom.golden_model.numerics.floats import canonical, quiet
from lightloom.golden_model.tracing import ray_triangle as unit
from lightloom.golden_model.tracing.brute_force import trace_brute_force
from lightloom.golden_model.tracing.bvh.build import build
from lightloom.golden_model.tracing.bvh.ray_box import PAD_ABSOLUTE, PAD_RELATIVE, box_rays, ray_box
from lightloom.golden_model.tracing.bvh.traversal import trace
from lightloom.golden_model.tracing.ray_setup import ray_setup
from lightloom.golden_model.tracing.ray_triangle import ray_triangle, triangle_tests
from lightloom.verif.vectors import ray_vectors
from tests.golden_model.tracing_cases import FAMILIES, Case

ROUNDING = 2.0**-24
DERIVED = 19.25
"""The bound of docs/traversal.md on a computed hit's distance from its box, in roundings of the reach."""
SLABS = 3
"""What the box test's own arithmetic may add, in the same unit."""


def all_hits(case: Case) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Every pair of ray and triangle that hits: ray (N,), canonical direction, t, and the triangle's box."""
    triangles, rays = case
    ray, index = np.divmod(np.arange(len(rays) * len(triangles)), len(triangles))
    hits = ray_triangle(triangle_tests(ray_setup(rays)[ray], triangles[index]))
    direction = quiet(canonical)(rays["direction"])
    found = np.flatnonzero(hits["hit"])
    ray, index, t = ray[found], index[found], hits["t"][found]
    corners = np.stack([triangles[name][index] for name in ("v0", "v1", "v2")])
    return rays[ray], direction[ray], t, corners.min(axis=0), corners.max(axis=0)


def test_the_pad_covers_what_was_derived() -> None:
    assert (DERIVED + SLABS) * ROUNDING < PAD_RELATIVE


@pytest.mark.parametrize("family", FAMILIES)
def test_hits_lie_within_the_derived_distance(family: str) -> None:
    with np.errstate(all="ignore"):
        worst = 0.0
        for seed in range(8):
            rays, direction, t, lower, upper = all_hits(FAMILIES[family](np.random.default_rng([seed, 3])))
            origin = rays["origin"].astype(np.float64)
            point = origin + direction.astype(np.float64) * t[:, None]
            outside = np.maximum(lower - point, point - upper).max(axis=1)
            underflow = PAD_ABSOLUTE * (1 + np.abs(direction.astype(np.float64)).max(axis=1))
            reach = np.maximum(np.abs(lower - origin), np.abs(upper - origin)).max(axis=1)
            units = (outside - underflow) / (reach * ROUNDING)
            assert not np.isnan(units).any()
            worst = max(worst, units.max(initial=0.0))
    assert worst <= DERIVED, f"{family}: a hit lies {worst:.1f} roundings outside its box"


@pytest.mark.parametrize("family", FAMILIES)
def test_the_box_of_a_hit_is_entered_before_it(family: str) -> None:
    """With the pad of this one triangle as the whole scene: the tightest that traversal ever uses."""
    for seed in range(8):
        rays, direction, t, lower, upper = all_hits(FAMILIES[family](np.random.default_rng([seed, 4])))
        prepared = ray_setup(rays)
        for k in range(0, len(rays), 7):
            one = slice(k, k + 1)
            slabs = box_rays(prepared[one], direction[one], lower[k], upper[k])
            entry, enters = ray_box(slabs, lower[one].T, upper[one].T, rays["t_min"][one], t[one])
            assert enters[0], f"{family} seed {[seed, 4]} hit {k}"
            assert entry[0] <= t[k], f"{family} seed {[seed, 4]} hit {k}"


def sliver_beside_the_ray() -> Case:
    """A sliver 2**-126 wide whose edge functions towards the ray underflow, and the ray far to its left."""
    e = 2.0**-126
    triangles = ray_vectors.triangles(np.array([[[0.5, e, 1], [1, e, 1], [0.25, 2 * e, 1]]]))
    return triangles, ray_vectors.rays(np.zeros((1, 3)), np.array([[0.0, 0, 1]]))


def test_small_determinants_miss() -> None:
    triangles, rays = sliver_beside_the_ray()
    assert trace_brute_force(triangles, rays)["primitive"].tolist() == [-1]


def test_small_determinants_would_hit_far_outside_their_box(monkeypatch: pytest.MonkeyPatch) -> None:
    """Why they must miss: no box would hold such a hit, and the result would depend on the tree."""
    monkeypatch.setattr(unit, "RECIPROCAL_LIMIT", np.float32(np.inf))
    triangles, rays = sliver_beside_the_ray()
    assert trace_brute_force(triangles, rays)["primitive"].tolist() == [0]
    pair = np.concatenate([triangles, ray_vectors.triangles(np.full((1, 3, 3), 9.0))])
    pair = np.repeat(pair, 5)
    assert trace(build(pair), rays, backend="numpy")["primitive"].tolist() == [-1]


def test_boxes_ahead_beside_behind_and_around() -> None:
    lower, upper = np.zeros(3, np.float32), np.ones(3, np.float32)
    rays = ray_vectors.rays(
        np.array([[0.5, 0.5, -1], [1.5, 0.5, -1], [0.5, 0.5, 2], [0.5, 0.5, 0.5], [1, 1, -1], [0.5, 0.5, -1]]),
        np.array([[0, 0, 1], [0, 0, 1], [0, 0, 1], [-0.0, 0, -1], [0, -0.0, 1], [0, 0, 1]], dtype=np.float32),
    )
    rays["t_max"][5] = 0.5
    slabs = box_rays(ray_setup(rays), rays["direction"], lower, upper)
    lowers, uppers = (np.repeat(corner[:, None], len(rays), axis=1) for corner in (lower, upper))
    entry, enters = ray_box(slabs, lowers, uppers, rays["t_min"], rays["t_max"])
    assert enters.tolist() == [True, False, False, True, True, False]
    assert entry[3] == 0
    assert np.abs(entry[[0, 4]] - 1).max() < 1e-5
    assert (entry[[0, 4]] < 1).all(), "the padded box begins before the true one"
