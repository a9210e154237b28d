"""Spot lights against closed forms, and how many lights a scene may have."""

from pathlib import Path

import numpy as np
import pytest

from lightloom.golden_model.driver.limits import require_affordable
from lightloom.golden_model.engine.sampling.settings import Sampling
from lightloom.golden_model.host.errors import InputError
from lightloom.golden_model.rays.light_samples import direct_candidates
from lightloom.golden_model.renderer import Renderer
from lightloom.golden_model.scene.lights import light_count, lights_of
from tests.golden_model.moving_scenes import scene_of
from tests.golden_model.scene.test_scene import refusal

FLOOR = "[[quad]]\ncorners = [[-9, 0, 9], [9, 0, 9], [9, 0, -9], [-9, 0, -9]]\n"
SPOT = "[[spot_light]]\nposition = [0.5, 2, 0]\nintensity = [8, 4, 2]\ntowards = [0, -3, 0]\nangle = 60\n"
POINT = "[[point_light]]\nposition = [0.5, 2, 0]\nintensity = [8, 4, 2]\n"


def on_floor(text: str, folder: Path, x: np.ndarray, samples: int = 1) -> np.ndarray:
    """Irradiance at (x, 0, 0), (N, 3) float64."""
    position = np.stack([x, 0 * x, 0 * x], axis=1).astype(np.float32)
    normal = np.broadcast_to(np.array([0, 1, 0], dtype=np.float32), position.shape)
    lights = lights_of(scene_of(folder, FLOOR + text))
    _, weight = direct_candidates(lights, position, normal, np.arange(len(x)), samples=samples)
    return np.asarray(weight.astype(np.float64).sum(axis=1))


@pytest.mark.parametrize("inner", [0, 40, 60])
def test_a_cone_with_a_smooth_edge(tmp_path: Path, inner: float) -> None:
    """Inside as a point light, outside nothing, between x**2 (3 - 2 x) of the cosine."""
    x = np.linspace(-2, 3, 501)
    away = x - 0.5
    found = on_floor(SPOT + f"inner_angle = {inner}\n", tmp_path, x)
    cosine = 2 / np.sqrt(4 + away * away)
    outer, top = np.cos(np.radians(30)), np.cos(np.radians(inner / 2))
    part = np.clip((cosine - outer) / max(top - outer, 1e-9), 0, 1)
    expected = (part * part * (3 - 2 * part) * 2 / (4 + away * away) ** 1.5)[:, None] * np.array([8, 4, 2])
    clear = np.abs(cosine - outer) > 1e-4
    np.testing.assert_allclose(found[clear], expected[clear], rtol=1e-3, atol=1e-5)
    assert (found.any(axis=1) == (part > 0))[clear].all()


def test_a_spot_light_among_others(tmp_path: Path) -> None:
    """It and a point light bring what each does by itself; its chance goes with the part of all directions it has."""
    x = np.linspace(-1, 1, 9)
    together = on_floor(SPOT + POINT, tmp_path, x, 1 << 14)
    apart = on_floor(SPOT, tmp_path, x) + on_floor(POINT, tmp_path, x)
    np.testing.assert_allclose(together, apart, rtol=2e-3)
    weight = np.diff(lights_of(scene_of(tmp_path, FLOOR + SPOT + POINT)).begin.astype(np.float64))
    middle = (np.cos(np.radians(30)) + np.cos(np.radians(22.5))) / 2
    assert weight[1] / weight[0] == pytest.approx((1 - middle) / 2, rel=1e-3)


def test_a_spot_light_lights_a_film(tmp_path: Path) -> None:
    """It moves, and the maps know where its cone is."""
    path = "[[spot_light.path]]\nframe = 0\n[[spot_light.path]]\nframe = 2\nposition = [4, 2, 0]\n"
    scene = scene_of(tmp_path, "texel_size = 1.0\n" + FLOOR + SPOT + path)
    renderer = Renderer(scene, width=16, height=12, budget=10**6)
    for place in (0.5, 2.25, 4):
        renderer.frame()
        texels, light = renderer.lightmaps.texels, renderer.state["irradiance"][:, 0]
        off = np.hypot(texels["position"][:, 0] - place, texels["position"][:, 2])
        assert light[off > 1.2].max() < (1e-6 if place == 0.5 else 3)
        assert light[off < 0.6].min() > 0.5


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (SPOT.replace("angle = 60", ""), "`angle` is missing"),
        (SPOT.replace("angle = 60", "angle = 181"), "`angle` must lie within 0 to 180 degrees, not 181"),
        (SPOT + "inner_angle = 61\n", "`inner_angle` must lie within 0 to `angle`, 60, not 61"),
        (SPOT.replace("[0, -3, 0]", "[0, 0, 0]"), "`towards` must not be all zero"),
        (POINT + "angle = 3\n", "unknown key `angle`"),
    ],
)
def test_what_is_refused(tmp_path: Path, text: str, said: str) -> None:
    path = tmp_path / "scene.toml"
    path.write_text(FLOOR + text)
    assert said in refusal(path)


def test_too_many_lights_are_refused(tmp_path: Path) -> None:
    """In one line, before anything is made; each triangle that shines, point and spot lights, a sun, a sampled sky."""
    ball = "[[sphere]]\ncenter = [0, 3, 0]\nradius = 1\nsubdivisions = 3\nemission = [1, 1, 1]\n"
    sun = "[sun]\ntowards = [0, 1, 0]\nirradiance = [1, 1, 1]\n"
    scene = scene_of(tmp_path, FLOOR + ball + SPOT + POINT + sun)
    assert light_count(scene) == 1280 + 3 == len(lights_of(scene))
    with pytest.raises(InputError, match=r"1283 lights, of which each triangle that shines is one; at most 1024"):
        Renderer(scene, width=8, height=8, budget=1000)
    few = scene_of(tmp_path, FLOOR + ball.replace("= 3\n", "= 2\n"))
    require_affordable(Sampling(), 1000, few)
    with pytest.raises(InputError, match=r"320 lights.*at most 256"):
        require_affordable(Sampling(lights=256), 1000, few)
