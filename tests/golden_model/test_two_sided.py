"""Two-sided surfaces: leaves, curtains and what hangs close before a wall, lit and seen from either side."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lightloom.golden_model.charts.unwrap import unwrap
from lightloom.golden_model.engine.sampling.settings import Sampling
from lightloom.golden_model.frame.frame_rays import FrameShading
from lightloom.golden_model.oracle.converged_maps import Reference
from lightloom.golden_model.oracle.true_picture import true_picture
from lightloom.golden_model.renderer import FrameResult, Pipeline, Renderer
from lightloom.golden_model.scene.mesh import closed
from lightloom.golden_model.scene.pose import back_rows_of
from lightloom.golden_model.scene.scene import Scene
from lightloom.golden_model.scene.shapes import box, icosphere
from lightloom.golden_model.structures.structure import Structure
from lightloom.golden_model.tables.lightmap import BURIED, VALID
from tests.golden_model.moving_scenes import scene_of
from tests.golden_model.scene.test_scene import refusal

SEED = 20250713
SKY = "[sky]\nradiance = [0.25, 0.5, 1]\n"
LIGHT = np.array([0.25, 0.5, 1])
LEAF = (
    "[[quad]]\nname = 'leaf'\ncorners = [[-1, 1, 1], [1, 1, 1], [1, 1, -1], [-1, 1, -1]]\n"
    "albedo = [0.4, 0.8, 0.2]\ntwo_sided = true\n"
)
ALBEDO = np.array([0.4, 0.8, 0.2])
CURTAIN = LEAF.replace(
    "[[-1, 1, 1], [1, 1, 1], [1, 1, -1], [-1, 1, -1]]", "[[-1, 0, 0], [1, 0, 0], [1, 2, 0], [-1, 2, 0]]"
)
FLOOR = "[[quad]]\nname = 'floor'\ncorners = [[-3, -0.5, 3], [3, -0.5, 3], [3, -0.5, -3], [-3, -0.5, -3]]\n"


def camera(*position: float) -> str:
    return f"texel_size = 0.25\n[camera]\nposition = {list(position)}\ntarget = [0, 1, 0]\nfov_y_tan = 0.5\n"


ABOVE, BELOW = camera(0.5, 4, 1), camera(0.5, -2, 1)
BEFORE, BEHIND = camera(0, 1, 4), camera(0, 1, -4)


def rendered(scene: Scene, frames: int = 1, **options: Any) -> tuple[Renderer, FrameResult]:
    renderer = Renderer(scene, width=36, height=24, budget=10**6, **options)
    for _ in range(frames):
        result = renderer.frame()
    return renderer, result


def shown(text: str, folder: Path, **options: Any) -> np.ndarray:
    """What the pixels of the scene's first object show, (N, 3)."""
    _, result = rendered(scene_of(folder, text), **options)
    return result.image[result.gbuffer["object"] == 0]


@pytest.mark.parametrize("view", [ABOVE, BELOW])
def test_a_leaf_in_the_open_shows_its_albedo_from_both_sides(tmp_path: Path, view: str) -> None:
    pixels = shown(view + LEAF + SKY, tmp_path)
    assert len(pixels) > 50
    np.testing.assert_allclose(pixels, [ALBEDO * LIGHT] * len(pixels), rtol=2e-3)
    once = shown(view + LEAF.replace("two_sided = true", "") + SKY, tmp_path)
    assert once.any() == (view is ABOVE), "what is not two-sided is black from behind"


@pytest.mark.parametrize("direct", ["maps", "rays"])
@pytest.mark.parametrize("view", [BEFORE, BEHIND])
def test_a_curtain_is_lit_on_the_side_of_the_lamp(tmp_path: Path, view: str, direct: Any) -> None:
    lamp = "[[point_light]]\nposition = [0, 1, -1.5]\nintensity = [6, 6, 6]\n"
    options = {"sampling": Sampling(direct=direct), "pipeline": Pipeline(shading=FrameShading(direct=direct))}
    pixels = shown(view + CURTAIN + lamp, tmp_path, **options)
    assert len(pixels) > 50
    if view is BEFORE:
        assert not pixels.any()
    else:
        assert pixels.max(axis=0) == pytest.approx(ALBEDO / np.pi * 6 / 1.5**2, rel=0.05)
        assert pixels.min() > 0


@pytest.mark.parametrize("view", [ABOVE, BELOW])
def test_maps_come_to_what_paths_find(tmp_path: Path, view: str) -> None:
    """A leaf over a floor, the sun above: rays from the floor read the leaf's back, which the floor lights."""
    sun = "[sun]\ntowards = [1, 1.5, 0.5]\nirradiance = [4, 4, 4]\nangle = 5\n"
    text = view.replace("-2", "-0.3") + LEAF + FLOOR + sun + SKY
    renderer, result = rendered(scene_of(tmp_path, text), 16)
    true = true_picture(result.scene, result.gbuffer, Structure(result.scene).trace, 256, SEED).astype(np.float64)
    leaf = result.gbuffer["object"] == 0
    assert leaf.sum() > 50
    maps = Reference(renderer.scene, renderer.lightmaps, rays=128).published(0)
    for image in (result.image, renderer.picture(result, maps)):
        ratio = image[leaf].sum(axis=0, dtype=np.float64) / true[leaf].sum(axis=0)
        assert ratio == pytest.approx([1, 1, 1], rel=0.04), f"seed {SEED}"


def test_both_sides_have_texels_at_the_same_places(tmp_path: Path) -> None:
    scene = scene_of(tmp_path, BEFORE + CURTAIN + FLOOR)
    lightmaps = unwrap(scene, trace=Structure(scene).trace)
    assert lightmaps.back_rows is not None
    rows, width = int(lightmaps.back_rows[0]), int(lightmaps.width[0])
    assert lightmaps.back_rows.tolist()[1] == 0
    map_of = lightmaps.texels[: width * int(lightmaps.height[0])].reshape(-1, width)
    front, back = map_of[: rows - 2], map_of[rows:]
    assert front.shape == back.shape
    np.testing.assert_array_equal(front["state"], back["state"])
    valid = front["state"] == VALID
    np.testing.assert_array_equal(front["normal"][valid], -back["normal"][valid])
    apart = back["position"][valid].astype(np.float64) - front["position"][valid]
    assert (apart[:, 2] < 0).all()
    assert np.abs(apart).max() < 1e-4
    charts = lightmaps.chart[: map_of.size].reshape(map_of.shape)
    assert not set(charts[: rows - 2][valid].tolist()) & set(charts[rows:][valid].tolist())
    assert len(np.unique(lightmaps.chart[lightmaps.chart >= 0])) == 3
    found = back_rows_of(lightmaps, scene)
    assert found is not None
    assert found.tolist() == [rows, rows, 0, 0]


def test_what_is_closed_needs_no_map_for_its_inside(tmp_path: Path) -> None:
    for shape in (box(np.ones(3)), icosphere(1)):
        assert closed(shape.astype(np.float32))
        assert not closed(shape[1:].astype(np.float32))
    block = "[[box]]\ncenter = [0, 0.5, 0]\nsize = [1, 1, 1]\n"
    plain, both = (scene_of(tmp_path, BEFORE + block + more + FLOOR) for more in ("", "two_sided = true\n"))
    assert not both.two_sided.any()
    assert unwrap(both).texels.tobytes() == unwrap(plain).texels.tobytes()


def test_what_lies_under_a_back_that_reflects_is_not_buried(tmp_path: Path) -> None:
    close = LEAF.replace(", 1, ", ", -0.45, ")
    for more, hidden in (("", False), ("two_sided = false\n", True)):
        scene = scene_of(tmp_path, ABOVE + close.replace("two_sided = true\n", more or "two_sided = true\n") + FLOOR)
        lightmaps = unwrap(scene, trace=Structure(scene).trace)
        assert (lightmaps.texels["state"] == BURIED).any() == hidden


def test_a_curtain_that_turns_shows_either_side_in_turn(tmp_path: Path) -> None:
    """Half a turn in eight frames, a wall of light on one side; same bits by both backends and two threads."""
    keys = ((0, [1, 0, 0, 0]), (4, [1, 0, 1, 0]), (8, [0, 0, 1, 0]))
    path = "".join(f"[[quad.path]]\nframe = {frame}\nrotate = {turn}\n" for frame, turn in keys)
    lamp = "[[quad]]\ncorners = [[-4, -2, 3], [-4, 5, 3], [4, 5, 3], [4, -2, 3]]\nemission = [1, 1, 1]\n"
    scene = scene_of(tmp_path, BEFORE.replace("4]", "2.9]") + CURTAIN + path + lamp + FLOOR)
    found, shades = [], []
    for options in ({"backend": "numpy"}, {"backend": "numba"}, {"backend": "numba", "threads": 2}):
        renderer = Renderer(scene, width=24, height=16, budget=4000, **options)
        images = []
        for _ in range(9):
            result = renderer.frame()
            seen = result.gbuffer["object"] == 0
            images.append(result.image.tobytes())
            shades.append((result.gbuffer["front"][seen].mean(), result.image[seen].mean()) if seen.any() else (0, 0))
        found.append((images, renderer.state.tobytes(), renderer.published.tobytes()))
    assert found[0] == found[1] == found[2]
    assert shades[0][0] == 1
    assert shades[8][0] == 0
    assert shades[0][1] > 0.1
    for _ in range(16):
        result = renderer.frame()
    back = result.image[result.gbuffer["object"] == 0].mean()
    assert back == pytest.approx(shades[0][1], rel=0.03), "the back looks as the front did"


def test_mirrors_and_glass_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "scene.toml"
    path.write_text(LEAF + "material = 'glass'\n")
    assert "mirrors and glass show both sides; leave `two_sided` out" in refusal(path)
