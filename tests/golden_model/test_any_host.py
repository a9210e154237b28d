"""What a frame's bits may not depend on: which NaN an operation makes, and what a host makes of a cast that overflows.

Processors differ in both: the NaN of 0 * infinity has another sign on ARM than on x86, and there casts saturate. The
hardware has one NaN, drops it where it takes the smaller or larger of two numbers, and saturates.
"""

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lightloom.golden_model.charts.unwrap import unwrap
from lightloom.golden_model.engine.sampling.settings import Sampling
from lightloom.golden_model.frame.frame_rays import FrameShading
from lightloom.golden_model.renderer import FrameResult, Pipeline, Renderer
from lightloom.golden_model.scene.files.load import load_scene
from lightloom.golden_model.stimuli.layouts.catalogue import write_layout
from lightloom.golden_model.structures.structure import Structure
from tests import ROOT
from tests.golden_model.changed_hosts import MODEL, casts_are_errors, nans_are_random
from tests.golden_model.test_frame_loop import room

SEED = 8
HOST = (
    "tracing.bvh.",  # units follow `tracing.wide_bvh`
    "driver.changes",  # what is different, from poses: float64
    "driver.volumes",
    "scene.lights",  # `lights_of`, the table of lights: float64
    "scene.scene",
    "tables.ray_offset",
)
"""Modules that hardware does not follow in a frame: they prepare its tables."""


FOLDERS = ("driver", "engine", "frame", "numerics", "rays", "scene", "tracing")


def renderer_of(folder: Path, name: str, direct: Any) -> Renderer:
    """Of a room with mirrors and glass, of a film with textures, or of a layout of the suite; small."""
    path = ROOT / "scenes" / f"{name}.toml"
    if name == "room":
        scene = room(folder, SEED, specular=True)
    else:
        scene = load_scene(str(path if path.exists() else write_layout(name, 0, folder)))
    return Renderer(
        scene,
        lightmaps=unwrap(scene, 0.4, trace=Structure(scene).trace) if scene.textures else None,
        width=36,
        height=24,
        budget=1500,
        seed=SEED,
        sampling=Sampling(directions=4, priming=1, direct=direct),
        pipeline=Pipeline(shading=FrameShading(direct=direct)),
    )


def frames(renderer: Renderer) -> list[FrameResult]:
    """The next ones."""
    return [renderer.frame() for _ in range(2)]


def bits(results: list[FrameResult]) -> list[bytes]:
    """All that a frame leaves behind."""
    return [
        part.tobytes()
        for each in results
        for part in (each.image, each.lightmap, each.gbuffer, each.maintenance.texels, each.maintenance.plan.priority)
    ]


SCENES = [("room", "rays"), ("many-movers", "maps"), ("light-switch", "maps")]


@pytest.mark.parametrize(("scene", "direct"), SCENES)
def test_no_bit_depends_on_which_nan_it_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, scene: str, direct: str
) -> None:
    once = frames(renderer_of(tmp_path, scene, direct))
    met = nans_are_random(monkeypatch, SEED)
    again = frames(renderer_of(tmp_path, scene, direct))
    assert met() > 0, "no operation made a NaN: nothing was tried"
    assert bits(once) == bits(again), f"seed {SEED}"


@pytest.mark.parametrize(("scene", "direct"), SCENES)
def test_no_cast_depends_on_the_host(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, scene: str, direct: str) -> None:
    renderer = renderer_of(tmp_path, scene, direct)
    with casts_are_errors(monkeypatch):
        frames(renderer)


class Integers:
    """NumPy's function `name` for integers alone, as the model's modules see it; elsewhere for all numbers."""

    def __init__(self, name: str):
        self.name, self.function, self.calls = name, getattr(np, name), 0

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        module = sys._getframe(1).f_globals["__name__"].removeprefix(MODEL)
        if module.split(".")[0] in FOLDERS and module != "numerics.floats" and not module.startswith(HOST):
            self.calls += 1
            kinds = {np.asarray(each).dtype.kind for each in args}
            assert "f" not in kinds, f"np.{self.name} of numbers in {module}: float_minmax or float_to_fixed_down"
        return self.function(*args, **kwargs)

    def __getattr__(self, name: str) -> Any:
        return getattr(self.function, name)


@pytest.mark.parametrize(("scene", "direct"), SCENES)
def test_smaller_and_larger_numbers_are_those_of_the_units(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, scene: str, direct: str
) -> None:
    """NumPy's minimum keeps a NaN and its floor leaves a number to be cast: no frame asks for them."""
    renderer = renderer_of(tmp_path, scene, direct)
    watched = [Integers(name) for name in ("maximum", "minimum", "clip", "fmax", "fmin", "floor", "ceil")]
    for each in watched:
        monkeypatch.setattr(np, each.name, each)
    frames(renderer)
    assert sum(each.calls for each in watched) > 100
