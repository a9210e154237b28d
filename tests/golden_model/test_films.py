"""The films in scenes/: what each is made to show is really there, and nothing in it spoils the picture."""

import itertools
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from lightloom.golden_model.charts.unwrap import unwrap
from lightloom.golden_model.contract.engine_image import DIFFUSE, GLASS, MIRROR
from lightloom.golden_model.contract.formats import RAY
from lightloom.golden_model.frame.rasterizer import Mesh, draw
from lightloom.golden_model.host.errors import InputError
from lightloom.golden_model.oracle.path_tracer import irradiance
from lightloom.golden_model.scene.files.load import load_scene
from lightloom.golden_model.scene.pose import scene_at
from lightloom.golden_model.scene.scene import RenderDefaults, Scene
from lightloom.golden_model.structures.structure import Structure
from lightloom.golden_model.tables.lightmap import VALID, Lightmaps, bilinear_taps
from lightloom.golden_model.tables.pinhole import look_at
from tests import ROOT
from tests.golden_model.meshes import needs_bunny

SCENES = ROOT / "scenes"
INDOORS = ["moving-viewpoint", "introduced-object", "light-switch", "door", "spheres"]
FILMS = [*INDOORS, "outdoor"]
SIZE = 240, 160


@dataclass(frozen=True)
class Film:
    """A scene with its lightmaps."""

    scene: Scene
    lightmaps: Lightmaps

    @property
    def valid(self) -> np.ndarray:
        """(N,) bool."""
        return self.lightmaps.texels["state"] == VALID

    def gbuffer(self, frame: int) -> np.ndarray:
        """What the camera sees, GBUFFER (H, W)."""
        scene = scene_at(self.scene, frame)
        camera = scene.camera
        view = look_at(camera.position, camera.target, camera.up, camera.fov_y_tan, *SIZE)
        mesh = Mesh(
            triangles=scene.triangles,
            normals=scene.normals,
            object_id=scene.object_id,
            lightmap_uv=self.lightmaps.uv,
        )
        return draw(view, mesh).gbuffer

    def seen(self, frame: int) -> np.ndarray:
        """Valid texels that the pixels of a frame read, (N,) bool."""
        gbuffer = self.gbuffer(frame)
        pixel = gbuffer[gbuffer["object"] >= 0]
        texel, weight = bilinear_taps(self.lightmaps, pixel["object"], pixel["lightmap"])
        out = np.zeros(len(self.valid), dtype=bool)
        out[texel[weight > 0]] = True
        return out & self.valid

    def of(self, name: str) -> int:
        """The number of an object."""
        return self.scene.object_names.index(name)


@cache
def film(name: str) -> Film:
    scene = load_scene(SCENES / f"{name}.toml")
    return Film(scene, unwrap(scene, trace=Structure(scene).trace))


def rays(origin: np.ndarray, direction: np.ndarray) -> np.ndarray:
    out = np.zeros(len(origin), dtype=RAY)
    out["origin"], out["direction"], out["t_max"] = origin, direction, np.inf
    return out


# --- all of them --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", FILMS)
def test_a_film_is_of_modest_size_and_says_how_to_render_it(name: str) -> None:
    wish = film(name).scene.render
    assert wish.frames is not None
    assert 48 <= wish.frames <= 96
    assert wish.size is not None
    assert wish.budget is not None
    assert film(name).scene.last_frame <= wish.frames, "nothing happens after its end"
    assert 8_000 <= film(name).valid.sum() <= 30_000


@pytest.mark.parametrize("name", INDOORS)
def test_the_camera_sees_fronts_and_no_holes(name: str) -> None:
    last = film(name).scene.render.frames or 0
    for frame in range(0, last, last // 4):
        gbuffer = film(name).gbuffer(frame)
        assert (gbuffer["object"] >= 0).all(), f"frame {frame}: nothing is behind some pixels"
        assert gbuffer["front"].all(), f"frame {frame}: backs are black"


# --- each of them -------------------------------------------------------------------------------------------------


def test_the_viewpoint_moves_through_places_not_seen_before() -> None:
    walk = film("moving-viewpoint")
    assert not walk.scene.dynamic, "nothing but the camera moves"
    frames = range(0, 96, 8)
    seen = [walk.seen(frame) for frame in frames]
    share = [texels.sum() / walk.valid.sum() for texels in seen]
    assert all(0.04 < s < 0.2 for s in share)
    assert 0.08 < np.mean(share) < 0.14, "a policy that samples what is seen can do ten times as much for it"
    ever = np.any(seen, axis=0).sum()
    assert ever > 1.4 * max(texels.sum() for texels in seen)


def test_the_shaded_part_of_the_object_comes_into_view() -> None:
    walk = film("moving-viewpoint")
    texels = walk.lightmaps.texels
    shaded = (texels["object"] == walk.of("object 464")) & (texels["position"][:, 1] < 1.06)
    shaded |= (texels["object"] == walk.of("surface 465")) & (texels["normal"][:, 1] < -0.5)
    before, after = (int((walk.seen(frame) & shaded).sum()) for frame in (0, 90))
    assert after > 1.5 * before, "FIG. 15: the camera has gone down"


def test_the_surface_keeps_the_light_from_the_object_below_it() -> None:
    scene = film("moving-viewpoint").scene
    turned = np.array([-8 / 17, 0, 15 / 17], dtype=np.float32)  # the normal of the block's side towards the lamp
    middle = np.array([-0.45, 0, -0.3], dtype=np.float32) + np.float32(0.43) * turned
    points = middle + np.array([[0, 1.9, 0], [0, 1.2, 0], [0, 0.6, 0]], dtype=np.float32)
    light = irradiance(scene, Structure(scene).trace, points, np.tile(turned, (3, 1)), samples=256)
    assert light[0, 0] > 3 * light[2, 0], "shadow 467"
    tint = light[:, 0] / light[:, 2]
    assert tint[1] > 1.1 * tint[0], "reflection pattern 468: the surface's orange, near the surface"


def test_the_van_brings_its_shadow_and_the_sky_is_over_all() -> None:
    yard = film("outdoor")
    (van,) = (k for k, path in enumerate(yard.scene.object_path) if path is not None)
    sun = yard.scene.environment.sun
    assert sun is not None
    ground = yard.lightmaps.texels[(yard.lightmaps.texels["object"] == yard.of("ground")) & yard.valid]
    shaded = []
    for frame in (0, 44):
        scene = scene_at(yard.scene, frame)
        towards = np.broadcast_to(sun.towards, ground["position"].shape)
        hits = Structure(scene).trace(rays(ground["position"], towards))
        shaded.append((hits["primitive"] >= 0) & (scene.object_id[hits["primitive"]] == van))
        seen = yard.gbuffer(frame)
        assert 0.2 < (seen["object"] < 0).mean() < 0.5, "sky"
        assert seen["front"][seen["object"] >= 0].all(), "backs are black"
        assert (seen["object"] == van).any() == (frame == 44)
    assert shaded[1].sum() > 50
    assert not (shaded[0] & shaded[1]).any(), "it comes from elsewhere"


def test_the_introduced_object_throws_its_reflection_on_the_shaded_part() -> None:
    scene = film("introduced-object").scene
    side = np.array([120, 0, 119], dtype=np.float32) / np.float32(169)  # the normal of the block's right side
    point = np.array([[-0.6, 0.6, 0.0]], dtype=np.float32) + np.float32(0.41) * side
    light = []
    for frame in (0, 30, 50, 90):
        posed = scene_at(scene, frame)
        light.append(irradiance(posed, Structure(posed).trace, point, side[None], samples=512)[0])
    red = np.array(light)[:, 0]
    assert red[2] > 2 * red[0], "reflection 540"
    assert red[0] < red[1] < red[2], "the more the nearer it is"
    assert abs(red[3] - red[0]) < 0.1 * red[0], "gone with the object"
    assert light[2][0] / light[2][2] > 2 * light[0][0] / light[0][2], "in its colour"


def test_the_lamp_is_switched_between_two_frames_and_the_window_stays() -> None:
    evening = film("light-switch")
    material = {name: int(np.flatnonzero(evening.scene.material_object == evening.of(name))[0]) for name in
                ("lamp", "window")}  # fmt: skip
    lamp = [float(scene_at(evening.scene, frame).emission[material["lamp"], 0]) for frame in (31, 32, 63, 64)]
    assert lamp == [lamp[0], 0, 0, lamp[0]]
    assert lamp[0] > 0
    window = [scene_at(evening.scene, frame).emission[material["window"]].tolist() for frame in (0, 40)]
    assert window[0] == window[1]
    assert min(window[0]) > 0


def test_no_light_passes_the_door_while_it_is_shut() -> None:
    scene = film("door").scene
    generator = np.random.default_rng(1)  # seed 1
    origin = np.array([0.35, 1.2, -1.2]) + generator.uniform(-0.8, 0.8, (40_000, 3))
    direction = generator.normal(size=(40_000, 3))

    def through(frame: int) -> int:
        posed = scene_at(scene, frame)
        hits = Structure(posed).trace(rays(origin, direction))
        met = hits["primitive"] >= 0
        reached = origin[met, 2] + hits["t"][met] * direction[met, 2]
        return int((reached > 0.05).sum())

    assert through(16) == 0
    assert 0 < through(30) < through(80)


def test_a_ball_goes_round_between_mirror_and_glass_and_touches_neither() -> None:
    room = film("spheres").scene
    surfaces = {name: int(room.surface[room.material_object == room.object_names.index(name)][0]) for name in
                ("mirror", "glass", "ball")}  # fmt: skip
    assert surfaces == {"mirror": MIRROR, "glass": GLASS, "ball": DIFFUSE}

    def extent(scene: Scene, name: str) -> tuple[np.ndarray, float]:
        points = scene.corners[scene.object_id == scene.object_names.index(name)].reshape(-1, 3).astype(np.float64)
        middle = (points.min(axis=0) + points.max(axis=0)) / 2
        return middle, float(np.sqrt(((points - middle) ** 2).sum(axis=1)).max())

    for frame in range(0, 96, 4):
        scene = scene_at(room, frame)
        (ball, own), (mirror, first), (glass, second) = (extent(scene, name) for name in ("ball", "mirror", "glass"))
        assert np.linalg.norm(ball - mirror) > own + first
        assert np.linalg.norm(ball - glass) > own + second
        assert ball[1] >= own - 1e-6, "on the floor"
    assert scene_at(room, 96).triangles.tobytes() == scene_at(room, 0).triangles.tobytes(), "once around"
    assert room.textures, "the floor's"


@needs_bunny
def test_the_bunny_goes_round_with_the_table_that_carries_it() -> None:
    scene = load_scene(SCENES / "bunny-turntable.toml")
    bunny, table = (scene.object_names.index(name) for name in ("bunny", "turntable"))
    side = []
    for frame in range(0, 97, 8):
        posed = scene_at(scene, frame)
        assert (posed.rotation[bunny] == posed.rotation[table]).all(), f"frame {frame}"
        side.append(posed.rotation[bunny][0])
    turns = [float(np.dot(a, b)) for a, b in itertools.pairwise(side)]
    assert np.allclose(turns, np.cos(np.pi / 6), atol=5e-3), "12 times 30 degrees"
    assert (side[0] == side[-1]).all()


# --- the [render] table -------------------------------------------------------------------------------------------

BOX = "[[box]]\ncenter = [0, 0, 0]\nsize = [1, 1, 1]\n"


def test_render_defaults_are_optional(tmp_path: Path) -> None:
    path = tmp_path / "a.toml"
    path.write_text(BOX)
    assert load_scene(path).render == RenderDefaults()
    path.write_text("[render]\nsize = [320, 200]\n" + BOX)
    assert scene_at(load_scene(path), 3).render == RenderDefaults(size=(320, 200))


@pytest.mark.parametrize(
    ("table", "key"),
    [
        ("frames = 0", "frames"),
        ("frames = 1.5", "frames"),
        ("size = [320]", "size"),
        ("size = [320, 0]", "size"),
        ("size = [320, 20.5]", "size"),
        ("size = [320, 100000]", "size"),
        ("budget = -1", "budget"),
        ("budgets = 1", "budgets"),
    ],
)
def test_unusable_render_defaults(tmp_path: Path, table: str, key: str) -> None:
    path = tmp_path / "a.toml"
    path.write_text(f"[render]\n{table}\n{BOX}")
    with pytest.raises(InputError, match=rf"a\.toml, \[render\].*`{key}`") as caught:
        load_scene(path)
    assert "\n" not in str(caught.value)
