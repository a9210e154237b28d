"""Films and layouts of the suite at rest, held against pictures by Mitsuba 3, which reads no map: long.

A film goes on until it has been still for 60 frames, at its own size and budget; one that never is stays where its last
keyframes leave it. E true and energy are those of `lightloom policies --true`, over blocks of 8 x 8 pixels.
"""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lightloom.golden_model.charts.curved import default_cache
from lightloom.golden_model.charts.unwrap import unwrap
from lightloom.golden_model.frame.rasterizer import draw
from lightloom.golden_model.renderer import FrameResult, Renderer
from lightloom.golden_model.scene.files.load import load_scene
from lightloom.golden_model.scene.keyframes import ObjectPath
from lightloom.golden_model.scene.pose import scene_at
from lightloom.golden_model.scene.scene import Scene
from lightloom.golden_model.stimuli.layouts.catalogue import BUDGETS, write_layout
from lightloom.golden_model.stimuli.layouts.description import FRAMES, SIZE
from lightloom.golden_model.structures.structure import Structure
from lightloom.golden_model.tables.pinhole import look_at
from lightloom.policies.still import rest
from lightloom.policies.true_error import STILL, true_figures
from tests import ROOT
from tests.golden_model.mitsuba_scenes import mitsuba, mitsuba_picture

SEED = 4
PATHS = 64 * 480 * 320
"""In each of two pictures."""
FINE = 3
"""Pixels along each side that a pixel of the picture compared is the mean of."""
LATER = 180
"""Still frames after which the dark room behind the door is held against it: its light comes by one door only, so that
samples are noisy, and after `STILL` frames E true is 0.052."""
LONGEST = 400
"""Frames in which a film may come to rest."""
FILMS = ["moving-viewpoint", "introduced-object", "light-switch", "door", "bunny-turntable", "spheres", "outdoor"]
ROOMS = ["room", "arcade", "corridor", "hundred-lights"]

pytestmark = pytest.mark.long


def resting(scene: Scene, frames: int) -> int | None:
    """The last of the first `frames` frames in which nothing changes, from the last keyframe on; None: never."""
    return rest(scene, scene.last_frame, frames, LONGEST)


def held(scene: Scene) -> Scene:
    """The scene as its last keyframes have it, for all frames."""

    def last(path: ObjectPath | None) -> ObjectPath | None:
        return None if path is None else replace(path, keys=(replace(path.keys[-1], frame=0),), loop=0)

    assert not any(scene.light_path), "no film has a lamp without size that moves"
    camera = tuple(replace(each, frame=0) for each in scene.camera_path[-1:])
    return replace(scene, object_path=tuple(map(last, scene.object_path)), camera_path=camera)


def against_mitsuba(scene: Scene, size: tuple[int, int], budget: int, frames: int = STILL) -> dict[str, Any]:
    """E true, energy and the noise of both, in the last of `frames` frames at rest."""
    mi = mitsuba()
    frame = resting(scene, frames)
    if frame is None:
        scene = held(scene)
        frame = resting(scene, frames)
    assert frame is not None
    maps = unwrap(scene, trace=Structure(scene).trace, cache=default_cache())
    renderer = Renderer(scene, width=size[0], height=size[1], budget=budget, seed=SEED, lightmaps=maps)
    for _ in range(frame + 1):
        result = renderer.frame()
    image, straight = areas(renderer, result, result.lightmap, np.zeros_like(result.lightmap))
    samples = PATHS // (size[0] * size[1])
    pictures = [mitsuba_picture(mi, scene_at(scene, frame), size, samples, seed) - straight for seed in (1, 2)]
    return {"frame": frame, **true_figures(image, straight, np.stack(pictures), apart_from_emitters(straight))}


def areas(renderer: Renderer, result: FrameResult, *maps: np.ndarray) -> list[np.ndarray]:
    """The last frame with each of these maps, its pixels the means of `FINE` by `FINE`: (H, W, 3) float32.

    A pixel of Mitsuba's is the mean of an area, one of a frame what lies behind its centre.
    """
    camera, height, width = result.scene.camera, renderer.height, renderer.width
    view = look_at(camera.position, camera.target, camera.up, camera.fov_y_tan, FINE * width, FINE * height)
    gbuffer = draw(view, renderer._mesh(result.scene), renderer.pipeline.raster).gbuffer
    drawn = renderer._latest
    assert drawn is not None
    renderer._latest = replace(drawn, view=view, gbuffer=gbuffer)
    pictures = [renderer.picture(result, each) for each in maps]
    renderer._latest = drawn
    return [picture.reshape(height, FINE, width, FINE, 3).mean(axis=(1, 3)) for picture in pictures]


def apart_from_emitters(straight: np.ndarray) -> np.ndarray:
    """The pixels (H, W) bool next to which there is no straight light (H, W, 3).

    An emitter that covers a hundredth of a pixel can be brighter than all that the maps show there, and `areas` not
    see it.
    """
    some = np.pad(straight.any(axis=-1), 1)
    height, width = straight.shape[:2]
    return ~np.any([some[y : y + height, x : x + width] for y in range(3) for x in range(3)], axis=0)


def check(figures: dict[str, Any], name: str) -> None:
    print(name, figures)
    assert figures["true_error"] <= 0.04
    assert abs(figures["true_energy"] - 1) <= 0.02


@pytest.mark.parametrize("name", FILMS)
def test_films(name: str) -> None:
    scene = load_scene(str(ROOT / "scenes" / f"{name}.toml"))
    assert scene.render.size is not None
    assert scene.render.budget is not None
    frames = LATER if name == "door" else STILL
    check(against_mitsuba(scene, scene.render.size, scene.render.budget, frames), name)


@pytest.mark.parametrize("name", ROOMS)
def test_layouts(name: str, tmp_path: Path) -> None:
    assert FRAMES < LONGEST
    scene = load_scene(str(write_layout(name, SEED, tmp_path)))
    check(against_mitsuba(scene, (SIZE[0], SIZE[1]), BUDGETS["scarce"]), name)
