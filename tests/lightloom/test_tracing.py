"""Both backends of `lightloom trace` give the same bits, whatever the scene. The simulator is the base preset's."""

from functools import cache

import numpy as np
import pytest

from lightloom.golden_model.contract import bitpack
from lightloom.golden_model.scene.files.load import load_scene
from lightloom.golden_model.stimuli.ray_families import adversarial_rays
from lightloom.hardware import tracers
from lightloom.hardware.tracers import Tracer, golden_tracer, rtl_tracer

SEED = 61

pytestmark = pytest.mark.usefixtures("quickly_built")


@cache
def scene(count: int) -> np.ndarray:
    """The Cornell box's first triangles."""
    return load_scene("cornell-box").triangles[:count]


def traced(tracer: Tracer, rays: np.ndarray, any_hit: bool) -> np.ndarray:
    done: list[float] = []
    hits = tracer(rays, any_hit=any_hit, advance=done.append)
    assert sum(done) == len(rays)
    return hits


@pytest.mark.parametrize("any_hit", [False, True])
@pytest.mark.parametrize("count", [0, 1, 32])
def test_backends_agree(count: int, any_hit: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tracers, "RTL_BATCH", 200)
    rays = adversarial_rays(scene(32), 500, SEED)
    golden, rtl = (traced(tracer(scene(count)), rays, any_hit) for tracer in (golden_tracer, rtl_tracer))
    assert bitpack.equal(golden, rtl).all(), f"seed {SEED}"
    assert (golden["primitive"] >= 0).any() == (count > 0)


def test_triangles_that_are_not_finite_are_not_there() -> None:
    triangles = scene(2).copy()
    triangles["v0"] = np.nan
    assert (traced(rtl_tracer(triangles), adversarial_rays(scene(32), 100, SEED), False)["primitive"] == -1).all()


def test_no_rays() -> None:
    assert len(traced(rtl_tracer(scene(32)), adversarial_rays(scene(32), 1, SEED)[:0], False)) == 0
