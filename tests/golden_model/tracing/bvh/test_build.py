"""The tree: every triangle once, boxes that hold what is under them, no shape that breaks the builder."""

import time

import numpy as np
import pytest

from lightloom.golden_model.contract.formats import TRIANGLE
from lightloom.golden_model.tracing.bvh.build import LEAF_SIZE, Bvh, build, refit
from lightloom.verif.vectors import ray_vectors
from tests.golden_model import meshes
from tests.golden_model.tracing_cases import random_soup


def check(bvh: Bvh) -> None:
    """Walks the whole tree, level by level."""
    corners = np.stack([bvh.triangles["v0"], bvh.triangles["v1"], bvh.triangles["v2"]])
    finite = np.flatnonzero(np.isfinite(corners).all(axis=(0, 2)))
    assert np.array_equal(np.sort(bvh.primitive), finite), "every finite triangle has exactly one slot"
    assert bvh.lower.dtype == bvh.upper.dtype == np.float32

    seen_nodes, seen_slots, levels = 0, [np.zeros(0, dtype=np.int64)], 0
    level = np.arange(min(len(bvh.count), 1))
    while len(level):
        seen_nodes += len(level)
        first, count = bvh.first[level], bvh.count[level]
        leaf = count > 0
        assert (count[leaf] <= LEAF_SIZE).all()
        for node, start, size in zip(level[leaf], first[leaf], count[leaf], strict=True):
            held = corners[:, bvh.primitive[start : start + size]]
            assert (bvh.lower[node] == held.min(axis=(0, 1))).all(), "a leaf's box is the one of its triangles"
            assert (bvh.upper[node] == held.max(axis=(0, 1))).all()
            seen_slots.append(np.arange(start, start + size))
        inner, left = level[~leaf], first[~leaf]
        assert (bvh.lower[inner] == np.minimum(bvh.lower[left], bvh.lower[left + 1])).all()
        assert (bvh.upper[inner] == np.maximum(bvh.upper[left], bvh.upper[left + 1])).all()
        level = np.concatenate([left, left + 1])
        levels += bool(len(level))
    assert seen_nodes == len(bvh.count)
    assert np.array_equal(np.sort(np.concatenate(seen_slots)), np.arange(len(bvh.primitive)))
    assert levels == bvh.depth


@pytest.mark.parametrize("count", [0, 1, 2, 3, 4, 5, 8, 33, 1000])
def test_every_triangle_is_in_one_leaf(count: int) -> None:
    for seed in range(3):
        check(build(random_soup(np.random.default_rng([seed, count]), count)))


def test_bunny_builds_in_time_and_well() -> None:
    triangles = meshes.bunny()
    start = time.perf_counter()
    bvh = build(triangles)
    assert time.perf_counter() - start < 10
    check(bvh)
    assert bvh.depth < 30
    assert bvh.sah_cost < 35, "the surface area heuristic has stopped working"


def test_build_is_deterministic() -> None:
    triangles = random_soup(np.random.default_rng(3), 5000)
    one, two = build(triangles), build(triangles.copy())
    for name in ("lower", "upper", "first", "count", "primitive"):
        assert np.array_equal(getattr(one, name), getattr(two, name)), name


@pytest.mark.parametrize("count", [2, 5, 64, 10_000])
def test_coincident_triangles_make_a_balanced_tree(count: int) -> None:
    bvh = build(np.repeat(random_soup(np.random.default_rng(4), 1), count))
    check(bvh)
    assert bvh.depth <= np.ceil(np.log2(count))


def test_coincident_centres_of_different_sizes() -> None:
    shape = random_soup(np.random.default_rng(5), 1)
    corners = np.stack([shape[name] for name in TRIANGLE.names or ()], axis=1)
    bvh = build(ray_vectors.triangles(corners * np.linspace(1, 2, 500).reshape(-1, 1, 1)))
    check(bvh)


def test_points_lines_and_flat_triangles() -> None:
    rng = np.random.default_rng(6)
    triangles = random_soup(rng, 300)
    for name in TRIANGLE.names or ():
        triangles[name][:100] = triangles["v0"][:100]
        triangles[name][100:200, 1] = 0
        triangles[name][200:, 1:] = 0
    check(build(triangles))


def test_deep_trees() -> None:
    """Sizes in powers of two make the heuristic split off one triangle after the other."""
    corners = np.eye(3) * np.exp2(-np.arange(140)).reshape(-1, 1, 1)
    bvh = build(ray_vectors.triangles(corners))
    check(bvh)
    assert bvh.depth > 30


def test_extreme_and_infinite_vertices() -> None:
    rng = np.random.default_rng(7)
    triangles = random_soup(rng, 200)
    for name in TRIANGLE.names or ():
        chosen = rng.integers(0, 8, triangles[name].shape) == 0
        triangles[name][chosen] = ray_vectors.specials((int(chosen.sum()),), rng)
    bvh = build(triangles)
    check(bvh)
    assert 0 < len(bvh.primitive) < 200
    assert np.isfinite(bvh.sah_cost)


def test_cost_of_one_triangle_is_one_test() -> None:
    assert build(random_soup(np.random.default_rng(8), 1)).sah_cost == 1.0


def test_the_heuristic_separates_clusters() -> None:
    """Two far clusters of four: a root with two full leaves costs a node and hardly a box of the tests."""
    rng = np.random.default_rng(9)
    triangles = random_soup(rng, 8)
    for name in TRIANGLE.names or ():
        triangles[name] *= 0.01
        triangles[name][::2] += np.float32(100)
    bvh = build(triangles)
    left, right = bvh.first[0], bvh.first[0] + 1
    assert bvh.upper[left].max() < 50 < bvh.lower[right].min()
    assert bvh.sah_cost < 1.1


@pytest.mark.parametrize("count", [0, 1, 3, 1000])
def test_refitted_boxes_hold_their_triangles_wherever_they_go(count: int) -> None:
    rng = np.random.default_rng([11, count])
    before, after = random_soup(rng, count), random_soup(rng, count)
    bvh = build(before)
    moved = refit(bvh, after)
    check(moved)
    assert moved.first is bvh.first, "the shape of the tree is kept"
    same = refit(moved, before)
    assert (same.lower == bvh.lower).all()
    assert (same.upper == bvh.upper).all()


def test_refitting_leaves_out_what_building_left_out() -> None:
    triangles = random_soup(np.random.default_rng(12), 100)
    triangles["v1"][:50] = np.nan
    bvh = refit(build(triangles), triangles)
    check(bvh)
    assert len(bvh.primitive) == 50


def test_leaves_can_be_asked_to_hold_one_triangle() -> None:
    bvh = build(random_soup(np.random.default_rng(13), 100), leaf_size=1)
    check(bvh)
    assert bvh.count.max() == 1


@pytest.mark.long
def test_a_million_triangles() -> None:
    bvh = build(random_soup(np.random.default_rng(10), 1_000_000))
    assert np.array_equal(np.sort(bvh.primitive), np.arange(1_000_000))
    assert bvh.depth < 64
