"""Scenes that are a billion times darker or brighter: the same picture, as many times darker or brighter."""

from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lightloom.golden_model.contract.formats import POINT_LIGHT
from lightloom.golden_model.engine.sampling.settings import Sampling
from lightloom.golden_model.frame.frame_rays import FrameShading
from lightloom.golden_model.oracle.converged_maps import Reference
from lightloom.golden_model.rays.surface_shading import readable
from lightloom.golden_model.renderer import FrameResult, Pipeline, Renderer
from lightloom.golden_model.scene.files.cornell_box import cornell_box
from lightloom.golden_model.scene.files.exr import read_exr
from lightloom.golden_model.scene.keyframes import LightKey, LightPath
from lightloom.golden_model.scene.light_unit import around_point_lights, in_unit, light_exponent
from lightloom.golden_model.scene.scene import Scene
from lightloom.golden_model.tables.pinhole import pixel_rays
from lightloom.render.sequence import write_lightmaps

COARSE = replace(cornell_box(), texel_size=50.0)
SIZE: dict[str, Any] = {"width": 24, "height": 20, "budget": 4000}
BRIGHTEST = COARSE.brightest


def shining(radiance: float) -> Scene:
    """The Cornell box whose lamp has its colour, and a brightest channel of `radiance`."""
    return replace(COARSE, emission=(COARSE.emission.astype(np.float64) * (radiance / BRIGHTEST)).astype(np.float32))


def with_point_light(intensity: float) -> Scene:
    """The Cornell box with its lamp off and a point light in the middle, half as bright in frame 1."""
    light = np.zeros(1, dtype=POINT_LIGHT)
    light["position"], light["intensity"] = (278, 400, 280), intensity
    keys = tuple(
        LightKey(frame=k, position=light["position"][0], intensity=light["intensity"][0] / np.float32(1 + k))
        for k in (0, 1)
    )
    return replace(COARSE, emission=COARSE.emission * 0, point_lights=light, light_path=(LightPath(keys=keys),))


def pictures(scene: Scene, frames: int = 2) -> np.ndarray:
    """Without the pixels that show the lamp: it is brighter than all else together, and in no map."""
    renderer = Renderer(scene, **SIZE)
    return np.stack([without_emitters(scene, renderer.frame()) for _ in range(frames)])


def without_emitters(scene: Scene, result: FrameResult) -> np.ndarray:
    emission = scene.emission[scene.material[np.maximum(result.gbuffer["primitive"], 0)]]
    return np.where(emission.any(axis=-1, keepdims=True), 0, result.image.astype(np.float64))


@cache
def usual_pictures() -> np.ndarray:
    return pictures(shining(BRIGHTEST))


@cache
def usual_pictures_of_a_point_light() -> np.ndarray:
    return pictures(with_point_light(1e6), 8)


@pytest.mark.parametrize("radiance", [1e-6, 1e-3, 1e6, 1e7, 1e30])
def test_energy_is_that_of_the_usual_scene(radiance: float) -> None:
    usual, found = usual_pictures(), pictures(shining(radiance))
    assert found.sum() / usual.sum() == pytest.approx(radiance / BRIGHTEST, rel=0.01)
    # Smoothing knows noise and differences in half octaves: what it takes of which neighbour differs a little.
    assert np.abs(found * (BRIGHTEST / radiance) - usual).sum() < 0.01 * usual.sum()


@pytest.mark.parametrize("intensity", [1e-9, 1e3, 1e12])
def test_energy_of_point_lights_too(intensity: float) -> None:
    usual, found = usual_pictures_of_a_point_light(), pictures(with_point_light(intensity), 8)
    assert found.sum() / usual.sum() == pytest.approx(intensity / 1e6, rel=0.01)
    assert found[-1].sum() < 0.9 * found[0].sum(), "the path is in the unit too"


def test_beyond_the_range_a_factor_of_two_is_exact() -> None:
    """Two scenes that are brought into the range become the same: all bits of the pictures, but for the exponent."""
    for one, two in ((3e7, 6e7), (1e-7, 2e-7)):
        assert light_exponent(shining(two)) == light_exponent(shining(one)) + 1
        assert (pictures(shining(two)) == 2 * pictures(shining(one))).all()


def test_what_is_in_range_stays_as_it_is() -> None:
    for radiance in (2.0**-5, 1.0, 18.0, 2.0**13.9):
        assert light_exponent(shining(radiance)) == 0, radiance
    assert light_exponent(shining(2.0**14)) == 1
    assert light_exponent(shining(2.0**-5.1)) == -1
    assert around_point_lights(with_point_light(1e6)) < 2**6
    assert light_exponent(with_point_light(1e6)) == 0


def test_light_that_no_format_holds_is_counted() -> None:
    """A thousandth of the room away from its floor a point light is too bright; elsewhere nothing is clipped."""
    near = with_point_light(1e6)
    near.point_lights["position"] = (278, 0.6, 280)
    for scene, clipped in ((replace(near, light_path=()), True), (with_point_light(1e6), False), (COARSE, False)):
        renderer = Renderer(scene, **SIZE)
        assert (sum(renderer.frame().maintenance.clipped for _ in range(20)) > 0) == clipped


def test_light_of_a_picture_that_no_format_holds_is_counted() -> None:
    """Where rays of pixels bring it: the light is a unit of length away from what the middle pixel sees."""
    seen = Renderer(COARSE, **SIZE).frame()
    middle = 10 * SIZE["width"] + 12
    fragment, ray = seen.gbuffer.reshape(-1)[middle], pixel_rays(seen.view)[middle]
    near = with_point_light(1e6)
    near.point_lights["position"] = ray["origin"] + ray["direction"] * fragment["depth"] + fragment["normal"]
    shading = FrameShading(direct="rays", shadow_samples=1)
    by_rays: dict[str, Any] = {"sampling": Sampling(direct="rays"), "pipeline": Pipeline(shading=shading)}
    for scene, clipped in ((replace(near, light_path=()), True), (with_point_light(1e6), False), (COARSE, False)):
        renderer = Renderer(scene, **SIZE, **by_rays)
        assert (renderer.frame().frame_rays.clipped > 0) == clipped


def test_coarse_geometry_is_in_the_unit_too() -> None:
    """What rays of pixels meet of it shines as what they meet of the scene itself."""
    scene = shining(1e7)
    exponent = light_exponent(scene)
    assert exponent > 0
    reduced = in_unit(replace(scene, coarse=scene), exponent).coarse
    assert reduced is not None
    assert (reduced.emission == in_unit(scene, exponent).emission).all()
    assert reduced.brightest == scene.brightest / 2.0**exponent


def test_maps_are_exported_in_the_scenes_own_unit(tmp_path: Path) -> None:
    """In EXR a map has the irradiance of the scene's lights, whatever unit the renderer keeps it in."""
    texels = []
    for name, radiance in (("usual", BRIGHTEST), ("dark", BRIGHTEST * 2.0**-12)):
        renderer = Renderer(shining(radiance), **SIZE)
        write_lightmaps(tmp_path / name, renderer, exposure=1.0)
        texels.append(read_exr(tmp_path / f"{name}.exr")[..., :3].astype(np.float64))
    assert renderer.exponent < 0
    assert texels[0].sum() > 0
    assert texels[1].sum() * 2.0**12 == pytest.approx(texels[0].sum(), rel=0.01)


def test_the_reference_is_in_the_same_unit() -> None:
    scene = shining(1e7)
    renderer = Renderer(scene, **SIZE)
    maps = Reference(scene, renderer.lightmaps, rays=32).published(0)
    assert np.isfinite(readable(maps)).all()
    result = renderer.frame()
    shown = without_emitters(scene, replace(result, image=renderer.picture(result, maps)))
    assert shown.sum() / pictures(scene, 1).sum() == pytest.approx(1, rel=0.1)
