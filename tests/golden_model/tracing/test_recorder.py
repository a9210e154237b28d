"""The recorder of triangle tests: counts all, keeps a fair sample that depends on them and the seed alone."""

import numpy as np
import pytest

from lightloom.golden_model.contract.bitpack import equal
from lightloom.golden_model.stimuli.ray_families import aimed
from lightloom.golden_model.tracing.bvh import traversal
from lightloom.golden_model.tracing.bvh.build import build
from lightloom.golden_model.tracing.bvh.traversal import trace
from lightloom.golden_model.tracing.ray_setup import ray_setup
from lightloom.golden_model.tracing.ray_triangle import ray_triangle
from lightloom.golden_model.tracing.recorder import TestRecorder
from tests.golden_model.tracing.bvh.test_traversal import BACKENDS
from tests.golden_model.tracing_cases import random_soup

SEED = 50


@pytest.fixture(scope="module")
def scene() -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(SEED)
    triangles = random_soup(rng, 500)
    return triangles, aimed(triangles, rng.normal(size=(5000, 3)) * 2, rng)


@pytest.mark.parametrize("backend", BACKENDS)
def test_all_tests_are_kept_up_to_the_limit(scene: tuple[np.ndarray, np.ndarray], backend: str) -> None:
    triangles, rays = scene
    recorder = TestRecorder(10**6, seed=1)
    hits = trace(build(triangles), rays, backend=backend, recorder=recorder)
    sample, keys = recorder.sample(), recorder.keys()
    assert recorder.rays == len(rays)
    assert recorder.total == len(sample) == len(np.unique(keys)) > len(rays)
    assert recorder.nodes > recorder.total / 4

    # Each is what the unit was given ...
    prepared = ray_setup(rays)[keys["ray"]]
    for name in ("origin", "shear", "axis", "flip", "t_min"):
        assert np.array_equal(sample[name], prepared[name])
    for name in ("v0", "v1", "v2"):
        assert np.array_equal(sample[name], triangles[name][keys["primitive"]])
    assert not sample["cull"].any()
    # ... and replayed, they give the trace's hits: the nearest of each ray.
    results = ray_triangle(sample)
    replayed = np.full(len(rays), np.inf, dtype=np.float32)
    np.minimum.at(replayed, keys["ray"][results["hit"]], results["t"][results["hit"]])
    assert np.array_equal(replayed, np.where(hits["primitive"] >= 0, hits["t"], np.float32(np.inf)))
    # t_max is the best hit by then: it shrinks while a ray goes on, from the ray's own to at least its final hit.
    assert (sample["t_max"] <= prepared["t_max"]).all()
    assert (sample["t_max"] >= replayed[keys["ray"]]).all()
    assert (sample["t_max"] < prepared["t_max"]).any()


@pytest.mark.parametrize("backend", BACKENDS)
def test_any_hit_keeps_the_rays_own_range(scene: tuple[np.ndarray, np.ndarray], backend: str) -> None:
    triangles, rays = scene
    recorder = TestRecorder(10**6, seed=1)
    hits = trace(build(triangles), rays, any_hit=True, backend=backend, recorder=recorder)
    sample, keys = recorder.sample(), recorder.keys()
    assert np.array_equal(sample["t_max"], rays["t_max"][keys["ray"]])
    occluded = np.unique(keys["ray"][ray_triangle(sample)["hit"]])
    assert np.array_equal(occluded, np.flatnonzero(hits["primitive"] == 0))


def test_the_sample_does_not_depend_on_batches(
    scene: tuple[np.ndarray, np.ndarray], monkeypatch: pytest.MonkeyPatch
) -> None:
    triangles, rays = scene
    bvh = build(triangles)
    whole, parts, small = (TestRecorder(3000, seed=2) for _ in range(3))
    trace(bvh, rays, recorder=whole)
    for start in range(0, len(rays), 777):
        trace(bvh, rays[start : start + 777], backend="numpy", recorder=parts)
    monkeypatch.setattr(traversal, "CHUNK", 100)
    trace(bvh, rays, recorder=small)
    for other in (parts, small):
        assert (other.rays, other.nodes, other.total) == (whole.rays, whole.nodes, whole.total)
        assert np.array_equal(other.keys(), whole.keys())
        assert equal(other.sample(), whole.sample()).all()


def test_the_limit_is_kept_and_reached(scene: tuple[np.ndarray, np.ndarray]) -> None:
    triangles, rays = scene
    bvh = build(triangles)
    every = TestRecorder(10**6, seed=3)
    trace(bvh, rays, recorder=every)
    for limit in (1, 10, 1000, every.total - 1, every.total, every.total + 1):
        recorder = TestRecorder(limit, seed=3)
        trace(bvh, rays, recorder=recorder)
        assert recorder.total == every.total
        assert len(recorder.sample()) == min(limit, every.total)
        assert np.isin(recorder.keys(), every.keys()).all()


def test_seeds_choose_different_and_even_samples(scene: tuple[np.ndarray, np.ndarray]) -> None:
    triangles, rays = scene[0], scene[1][:2000]
    bvh = build(triangles)
    every = TestRecorder(10**6, seed=0)
    trace(bvh, rays, recorder=every)
    limit, seeds = every.total // 10, 40
    chosen = np.zeros(every.total, dtype=int)
    for seed in range(seeds):
        recorder = TestRecorder(limit, seed=seed)
        trace(bvh, rays, recorder=recorder)
        chosen += np.isin(every.keys(), recorder.keys())
    # Each test was chosen in about a tenth of the samples: the spread is the binomial one.
    assert abs(chosen.mean() / seeds - 0.1) < 1e-3
    assert abs(chosen.var() / (seeds * 0.1 * 0.9) - 1) < 0.1
    half = chosen[: every.total // 2].mean() / seeds
    assert abs(half - 0.1) < 0.005


def test_a_recorder_without_tests_is_empty() -> None:
    recorder = TestRecorder(5, seed=-1)
    assert len(recorder.sample()) == len(recorder.keys()) == recorder.total == 0
    with pytest.raises(ValueError, match="limit must be at least 1"):
        TestRecorder(0, seed=0)
