"""Scenes of frames: what moves, what stays, what every frame has in common, and what has changed between two."""

from dataclasses import fields
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from lightloom.golden_model.charts.unwrap import unwrap
from lightloom.golden_model.scene.files.cornell_box import cornell_box
from lightloom.golden_model.scene.pose import moved_records, posed, scene_at
from lightloom.golden_model.scene.scene import Scene, require_light
from lightloom.golden_model.tables.lightmap import BURIED, EMPTY, VALID, Lightmaps
from lightloom.golden_model.tracing.bvh import build, traversal
from tests.golden_model.moving_scenes import MOVING, ROOM, scene_of


@pytest.fixture(scope="module")
def moving(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    return scene_of(tmp_path_factory.mktemp("moving"), MOVING)


@pytest.fixture(scope="module")
def maps(moving: Scene) -> Lightmaps:
    return unwrap(moving, trace=partial(traversal.trace, build.build(moving.triangles)))


def of(scene: Scene, name: str) -> np.ndarray:
    """Corners of an object's triangles."""
    return scene.corners[scene.object_id == scene.object_names.index(name)]


def test_a_static_scene_is_its_own_frames() -> None:
    scene = cornell_box()
    frame = scene_at(scene, 30)
    assert not scene.dynamic
    assert frame.camera.position.tolist() == scene.camera_path[1].position.tolist()
    for name in ("triangles", "normals", "emission", "point_lights", "rotation"):
        assert getattr(frame, name) is getattr(scene, name), name
    assert scene_at(frame, 0).camera.position.tolist() == scene.camera.position.tolist()


def test_a_scene_without_any_path_is_the_same_object(tmp_path: Path) -> None:
    scene = scene_of(tmp_path, ROOM)
    assert scene_at(scene, 17) is scene
    assert scene.last_frame == 0


def test_frames_can_be_asked_for_in_any_order(moving: Scene) -> None:
    direct, detour = posed(moving, 7), scene_at(scene_at(scene_at(moving, 3), 11), 7)
    for item in fields(Scene):
        one, other = getattr(direct, item.name), getattr(detour, item.name)
        if isinstance(one, np.ndarray):
            assert one.tobytes() == other.tobytes(), item.name
    assert detour.frame == 7
    assert scene_at(moving, 7) is detour, "asked for a moment ago"
    assert detour.rest is moving
    assert moving.last_frame == 12


def test_objects_go_where_their_keyframes_say(moving: Scene) -> None:
    middle = of(scene_at(moving, 6), "ball").reshape(-1, 3)
    assert np.allclose((middle.min(axis=0) + middle.max(axis=0)) / 2, [0.5, 1.25, 0.5], atol=0.02)
    assert np.allclose(np.linalg.norm(middle - [0.5, 1.25, 0.5], axis=1), 0.7, atol=1e-6), "still a ball"
    assert (of(scene_at(moving, 12), "ball") == of(moving, "ball")).all(), "the loop ends where it began"
    # The door turns by 90 degrees about its edge at x = 2, z = -1: from along -x to along +z.
    door = of(scene_at(moving, 6), "door").reshape(-1, 3)
    assert np.allclose(door.min(axis=0), [1.95, 0, -1], atol=1e-6)
    assert np.allclose(door.max(axis=0), [2.05, 2, 0], atol=1e-6)
    for name in ("floor", "wall", "lamp"):
        assert of(scene_at(moving, 6), name).tobytes() == of(moving, name).tobytes(), name


def test_normals_turn_with_their_triangles(moving: Scene) -> None:
    frame = scene_at(moving, 5)
    corners = of(frame, "ball").astype(np.float64)
    normals = frame.normals[frame.object_id == frame.object_names.index("ball")]
    middle = corners.reshape(-1, 3)
    centre = (middle.min(axis=0) + middle.max(axis=0)) / 2
    assert np.abs(normals - (corners - centre) / 0.7).max() < 0.03
    assert np.abs(np.linalg.norm(normals, axis=2) - 1).max() < 1e-6


def test_absent_objects_are_nowhere(moving: Scene) -> None:
    frame = scene_at(moving, 9)
    assert np.isnan(of(frame, "door")).all()
    assert frame.present.tolist() == [name != "door" for name in frame.object_names]
    assert np.isfinite(of(scene_at(moving, 11), "door")).all()


def test_emission_and_lights_follow_their_keyframes(moving: Scene) -> None:
    lamp = moving.object_names.index("lamp")
    assert scene_at(moving, 0).emission[moving.material_object == lamp].tolist() == [[8, 6, 4]]
    assert scene_at(moving, 6).emission[moving.material_object == lamp].tolist() == [[5, 3.75, 2.5]]
    assert scene_at(moving, 99).glow[lamp] == 0.25
    light = scene_at(moving, 5).point_lights[0]
    assert light["position"].tolist() == [1, 2, 2]
    assert light["intensity"].tolist() == [0.5, 1.5, 2.5]


def test_what_numbers_are_scaled_by_holds_in_every_frame(tmp_path: Path) -> None:
    far = """
[[box]]
center = [1, 1, 0]
size = [1, 1, 1]
emission = [1, 1, 1]
[[box.path]]
frame = 0
emission = 0
[[box.path]]
frame = 10
translate = [40, 0, 0]
rotate = [1, 0.2, 0.3, 0.4]
emission = 32
[[point_light]]
position = [0, 1, 0]
intensity = [0, 0, 0]
[[point_light.path]]
frame = 0
[[point_light.path]]
frame = 3
intensity = [7, 0, 0]
"""
    scene = scene_of(tmp_path, ROOM + far)
    assert (scene.spans == scene_at(scene, 10).spans).all()
    for frame in range(0, 13, 2):
        moved = scene_at(scene, frame)
        assert np.nanmax(np.abs(moved.corners)) <= scene.reach
        assert moved.emission.max() <= scene.brightest
        assert moved.point_lights["intensity"].max(initial=0) <= scene.brightest_lights
    assert scene.brightest == moved.brightest == 32
    assert scene.brightest_lights == 7
    require_light(scene)


def test_records_move_with_their_objects(moving: Scene, maps: Lightmaps) -> None:
    ball = moving.object_names.index("ball")
    for frame in (0, 5, 9):
        moved = moved_records(maps, scene_at(moving, frame))
        texels = moved.texels[moved.texels["object"] == ball]
        texels = texels[texels["state"] == VALID]
        corners = of(scene_at(moving, frame), "ball").reshape(-1, 3)
        centre = (corners.min(axis=0) + corners.max(axis=0)) / 2
        out = texels["position"] - centre
        assert len(texels) > 50
        assert np.linalg.norm(out, axis=1).max() < 0.72
        assert (out * texels["normal"]).sum(axis=1).min() > 0.6
        assert np.abs((texels["normal"] * texels["tangent"]).sum(axis=1)).max() < 1e-5
    still = moved.texels["object"] == moving.object_names.index("floor")
    assert moved.texels[still].tobytes() == maps.texels[still].tobytes()


def test_absent_objects_have_no_valid_texels(moving: Scene, maps: Lightmaps) -> None:
    door = maps.texels["object"] == moving.object_names.index("door")
    assert (maps.texels["state"][door] == VALID).any()
    gone = moved_records(maps, scene_at(moving, 9))
    assert not (gone.texels["state"][door] == VALID).any()
    assert (gone.texels["state"][~door] == maps.texels["state"][~door]).all()
    back = moved_records(maps, scene_at(moving, 11))
    assert (back.texels["state"] == maps.texels["state"]).all()


BLOCK = '[[box]]\nname = "block"\ncenter = [0, 0.5, 0]\nsize = [1, 1, 1]\n'


@pytest.mark.parametrize(
    ("motion", "hidden"), [("", True), ("[[box.path]]\nframe = 3\ntranslate = [1, 0, 0]\n", False)]
)
def test_only_what_stays_buries_texels(tmp_path: Path, motion: str, hidden: bool) -> None:
    """The floor under a block is never seen, unless the block can move away."""
    scene = scene_of(tmp_path, ROOM + BLOCK + motion)
    maps = unwrap(scene, trace=partial(traversal.trace, build.build(scene.triangles)))
    texels = maps.texels[maps.texels["object"] == scene.object_names.index("floor")]
    under = (np.abs(texels["position"][:, [0, 2]]) < 0.4).all(axis=1) & (texels["state"] != EMPTY)
    assert under.sum() > 4
    assert (texels["state"][under] == (BURIED if hidden else VALID)).all()


def test_mirrors_and_glass_have_no_texels(tmp_path: Path) -> None:
    ball = '[[sphere]]\ncenter = [0, 1, 0]\nradius = 0.5\nsubdivisions = 1\nmaterial = "glass"\n'
    scene = scene_of(tmp_path, ROOM + ball)
    number = scene.object_names.index("sphere")
    assert scene.lightmapped.tolist() == [True, True, True, False]
    maps = unwrap(scene)
    mine = maps.texels["object"] == number
    assert mine.sum() == 1
    assert maps.texels["state"][mine] == EMPTY
    assert maps.fill[mine] == -1
