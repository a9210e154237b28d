"""Traversal against brute force in all bits, whatever the tree, and its two backends against each other."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from lightloom.golden_model.contract.bitpack import equal
from lightloom.golden_model.contract.formats import HIT, RAY
from lightloom.golden_model.host.errors import InputError
from lightloom.golden_model.stimuli.ray_families import aimed
from lightloom.golden_model.tracing.brute_force import trace_brute_force
from lightloom.golden_model.tracing.bvh import ray_box
from lightloom.golden_model.tracing.bvh.build import Bvh, build
from lightloom.golden_model.tracing.bvh.traversal import backend_of, trace
from lightloom.golden_model.tracing.recorder import TestRecorder
from lightloom.verif.vectors import ray_vectors
from tests.golden_model import meshes
from tests.golden_model.tracing_cases import FAMILIES, random_soup
from tests.needs import needs_numba

BACKENDS = [
    "numpy",
    pytest.param("numba", marks=needs_numba),
]
SEEDS = 12


def assert_same(got: np.ndarray, expected: np.ndarray, rays: np.ndarray, origin: str) -> None:
    """Equal in all bits; otherwise fails with the first ray that differs. `origin` says how to make it again."""
    wrong = np.flatnonzero(~equal(got, expected))
    shown = [f"ray {k}: {rays[k]}: got {got[k]}, expected {expected[k]}" for k in wrong[:3]]
    assert not len(wrong), "\n".join([f"{origin}: {len(wrong)} of {len(got)} hits differ", *shown])


def random_tree(triangles: np.ndarray, rng: np.random.Generator) -> Bvh:
    """A tree with random splits of a random order: valid, and as bad as can be."""
    order = rng.permutation(len(triangles))
    corners = np.stack([triangles["v0"], triangles["v1"], triangles["v2"]])
    lower, upper = corners.min(axis=0)[order], corners.max(axis=0)[order]
    rows = []  # node after node: box, first, count
    runs, depth = [(0, len(order), 0)], 0
    for start, end, level in runs:  # grows while it is walked
        leaf = end - start == 1 or (end - start <= 4 and rng.integers(0, 2))
        depth = max(depth, level)
        rows.append(
            (lower[start:end].min(0), upper[start:end].max(0), start if leaf else len(runs), leaf * (end - start))
        )
        if not leaf:
            middle = int(rng.integers(start + 1, end))
            runs += [(start, middle, level + 1), (middle, end, level + 1)]
    low, high, firsts, counts = zip(*rows, strict=True)
    return Bvh(
        lower=np.array(low),
        upper=np.array(high),
        first=np.array(firsts, dtype=np.int32),
        count=np.array(counts, dtype=np.int32),
        primitive=order.astype(np.int32),
        triangles=triangles,
        depth=depth,
    )


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("family", FAMILIES)
def test_equals_brute_force(family: str, backend: str) -> None:
    hit = total = 0
    for seed in range(SEEDS):
        triangles, rays = FAMILIES[family](np.random.default_rng(seed))
        bvh, expected = build(triangles), trace_brute_force(triangles, rays)
        assert_same(trace(bvh, rays, backend=backend), expected, rays, f"{family} seed {seed}")
        shadow = trace_brute_force(triangles, rays, any_hit=True)
        assert_same(trace(bvh, rays, any_hit=True, backend=backend), shadow, rays, f"{family} seed {seed}, any hit")
        assert ((shadow["primitive"] == 0) == (expected["primitive"] >= 0)).all()
        hit, total = hit + (expected["primitive"] >= 0).sum(), total + len(rays)
    assert 0.1 < hit / total < 0.95, "the family tests too little"


@pytest.mark.long
@pytest.mark.parametrize("family", FAMILIES)
def test_equals_brute_force_many_times(family: str) -> None:
    for seed in range(SEEDS, SEEDS + 300):
        triangles, rays = FAMILIES[family](np.random.default_rng(seed))
        expected = trace_brute_force(triangles, rays)
        assert_same(trace(build(triangles), rays), expected, rays, f"{family} seed {seed}")


@pytest.mark.parametrize("family", sorted(set(FAMILIES) - {"specials"}))
def test_any_tree_gives_the_same_hits(family: str) -> None:
    for seed in range(4):
        rng = np.random.default_rng([seed, 1])
        triangles, rays = FAMILIES[family](rng)
        expected = trace_brute_force(triangles, rays)
        for _ in range(3):
            got = trace(random_tree(triangles, rng), rays, backend="numpy")
            assert_same(got, expected, rays, f"{family} seed {[seed, 1]}")


@pytest.mark.parametrize("backend", BACKENDS)
def test_the_order_of_triangles_only_renames_them(backend: str) -> None:
    rng = np.random.default_rng(20)
    triangles = random_soup(rng, 2000)
    rays = aimed(triangles, rng.normal(size=(20_000, 3)) * 2, rng)
    order = rng.permutation(len(triangles))
    one, two = trace(build(triangles), rays, backend=backend), trace(build(triangles[order]), rays, backend=backend)
    two["primitive"] = np.where(two["primitive"] >= 0, order[two["primitive"]], -1)
    assert_same(two, one, rays, "seed 20")


@needs_numba
def test_backends_agree_on_hits_and_tests() -> None:
    """Not only the hits: the same nodes visited, and the same tests made."""
    rng = np.random.default_rng(30)
    triangles = np.concatenate([meshes.mixed_winding(meshes.octasphere(5), rng), random_soup(rng, 100)])
    bvh = build(triangles)
    rays = aimed(triangles, rng.normal(size=(100_000, 3)), rng)
    rays = np.concatenate([rays, aimed(triangles, rays["origin"][:1000] * 1000, rng)])
    for any_hit in (False, True):
        recorders = {name: TestRecorder(2000, seed=5) for name in ("numpy", "numba")}
        one, two = (
            trace(bvh, rays, any_hit=any_hit, backend=name, recorder=recorder) for name, recorder in recorders.items()
        )
        assert_same(one, two, rays, "seed 30")
        a, b = recorders.values()
        assert (a.rays, a.nodes, a.total) == (b.rays, b.nodes, b.total)
        assert np.array_equal(a.keys(), b.keys())
        assert equal(a.sample(), b.sample()).all()


@needs_numba
def test_backends_agree_on_adversarial_rays() -> None:
    for family in FAMILIES:
        for seed in range(5):
            triangles, rays = FAMILIES[family](np.random.default_rng([seed, 2]))
            recorders = [TestRecorder(10**6, seed=5) for _ in range(2)]
            one = trace(build(triangles), rays, backend="numpy", recorder=recorders[0])
            two = trace(build(triangles), rays, backend="numba", recorder=recorders[1])
            assert_same(one, two, rays, f"{family} seed {[seed, 2]}")
            assert recorders[0].nodes == recorders[1].nodes
            assert equal(recorders[0].sample(), recorders[1].sample()).all()


small = st.integers(-3, 3).map(np.float32)
odd = st.sampled_from([0.0, -0.0, 2.0**-149, 2.0**-126, 2.0**-100, 0.5, 1.0, -1.0, 3.0, 2.0**100]).map(np.float32)


@settings(max_examples=150, deadline=None)
@given(
    corners=arrays(np.float32, st.tuples(st.integers(1, 6), st.just(3), st.just(3)), elements=small),
    origin=arrays(np.float32, (8, 3), elements=st.one_of(small, odd)),
    direction=arrays(np.float32, (8, 3), elements=st.one_of(small, odd)),
    t_min=st.sampled_from([-np.inf, -1.0, 0.0, 1.0]),
)
def test_small_cases(corners: np.ndarray, origin: np.ndarray, direction: np.ndarray, t_min: float) -> None:
    triangles, rays = ray_vectors.triangles(corners), ray_vectors.rays(origin, direction)
    rays["t_min"] = t_min
    assert_same(trace(build(triangles), rays), trace_brute_force(triangles, rays), rays, "hypothesis")


def square() -> np.ndarray:
    """Two triangles in the plane z = 1, from (0, 0) to (2, 2), counter-clockwise as seen from the origin's side."""
    return ray_vectors.triangles(
        np.array([[[0, 0, 1], [0, 2, 1], [2, 2, 1]], [[0, 0, 1], [2, 2, 1], [2, 0, 1]]], float)
    )


@pytest.mark.parametrize("backend", BACKENDS)
def test_what_a_hit_says(backend: str) -> None:
    rays = ray_vectors.rays(np.array([[0.5, 1, 0], [1, 0.5, 0], [0.5, 1, 2], [3, 1, 0]]), np.array([[0, 0, 0.5]] * 4))
    rays["direction"][2] = (0, 0, -1)
    hits = trace(build(square()), rays, backend=backend)
    assert hits.dtype == HIT
    assert hits["primitive"].tolist() == [0, 1, 0, -1]
    assert hits["t"].tolist() == [2, 2, 1, 0]
    assert hits["u"].tolist() == [0.25, 0.25, 0.25, 0]
    assert hits["v"].tolist() == [0.25, 0.25, 0.25, 0]
    assert hits["front"].tolist() == [True, True, False, False]
    shadows = trace(build(square()), rays, any_hit=True, backend=backend)
    assert shadows["primitive"].tolist() == [0, 0, 0, -1]
    assert not shadows["t"].any()


@pytest.mark.parametrize("backend", BACKENDS)
def test_the_range_is_open_below_and_closed_above(backend: str) -> None:
    rays = ray_vectors.rays(np.tile([0.5, 1, 0], (6, 1)), np.tile([0, 0, 1], (6, 1)))
    below, above = np.nextafter(np.float32(1), np.array([0, 2], dtype=np.float32))
    rays["t_min"] = [0, 1, below, 0, 2, np.nan]
    rays["t_max"] = [1, 2, 1, below, above, 2]
    assert trace(build(square()), rays, backend=backend)["primitive"].tolist() == [0, -1, 0, -1, -1, -1]


@pytest.mark.parametrize("backend", BACKENDS)
def test_equal_distance_goes_to_the_lower_index(backend: str) -> None:
    copies = np.repeat(square(), 40)[::-1].copy()  # 0 to 39 are the second triangle
    rays = ray_vectors.rays(np.array([[1, 0.5, 0], [0.5, 1, 0], [1, 1, 0]]), np.array([[0, 0, 1]] * 3))
    assert trace(build(copies), rays, backend=backend)["primitive"].tolist() == [0, 40, 0]


@pytest.mark.parametrize("backend", BACKENDS)
def test_rays_that_cannot_hit(backend: str) -> None:
    rays = np.tile(ray_vectors.rays(np.array([[0.5, 1, 0]]), np.array([[0.0, 0, 1]])), 7)
    rays["direction"][0] = 0
    rays["direction"][1, 0] = np.nan
    rays["direction"][2, 1] = np.inf
    rays["direction"][3] = (0, 0, 2.0**127)
    rays["origin"][4, 1] = np.inf
    rays["t_max"][5] = np.nan
    assert trace(build(square()), rays, backend=backend)["primitive"].tolist() == [-1] * 6 + [0]


@pytest.mark.parametrize("backend", BACKENDS)
def test_nothing_to_trace(backend: str) -> None:
    ray = ray_vectors.rays(np.zeros((1, 3)), np.ones((1, 3)))
    assert trace(build(square()), np.zeros(0, dtype=RAY), backend=backend).shape == (0,)
    assert trace(build(square()[:0]), ray, backend=backend)["primitive"].tolist() == [-1]
    assert trace_brute_force(square()[:0], ray)["primitive"].tolist() == [-1]


@pytest.mark.parametrize("backend", BACKENDS)
def test_deep_trees_fit_their_stack(backend: str) -> None:
    corners = np.eye(3) * np.exp2(-np.arange(45)).reshape(-1, 1, 1)
    triangles = ray_vectors.triangles(corners)
    rng = np.random.default_rng(40)
    rays = aimed(triangles, rng.uniform(-1, 1, (500, 3)) * np.exp2(-rng.uniform(0, 40, (500, 1))), rng)
    for bvh in (build(triangles), random_tree(triangles, rng)):
        assert_same(trace(bvh, rays, backend=backend), trace_brute_force(triangles, rays), rays, "seed 40")


def test_an_unknown_backend_is_refused() -> None:
    with pytest.raises(InputError, match="backend cuda: unknown; choose one of auto, numpy, numba"):
        backend_of("cuda")


def test_the_pad_is_needed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without it the same tests fail: they do attack it."""
    monkeypatch.setattr(ray_box, "PAD_RELATIVE", np.float32(0))
    monkeypatch.setattr(ray_box, "PAD_ABSOLUTE", np.float32(0))
    lost = 0
    for family in ("flat_floor", "from_surfaces", "mixed_scales"):
        for seed in range(SEEDS):
            triangles, rays = FAMILIES[family](np.random.default_rng(seed))
            lost += (~equal(trace(build(triangles), rays), trace_brute_force(triangles, rays))).sum()
    assert lost > 0
