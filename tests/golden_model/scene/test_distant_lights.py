"""Light samples of sun and sky, and what rays count that leave the scene, against closed forms."""

from pathlib import Path

import numpy as np
import pytest

from lightloom.golden_model.numerics.directions import cosine_table, tangent_of, to_world
from lightloom.golden_model.rays.light_samples import direct_candidates, met_beyond
from lightloom.golden_model.scene.lights import lights_of
from lightloom.golden_model.scene.scene import Scene
from lightloom.golden_model.tables.lights import SKY, SUN
from tests.golden_model.moving_scenes import scene_of
from tests.golden_model.scene.test_sky import centres, unit, with_spot

QUAD = "[[quad]]\ncorners = [[-2, 0, 2], [2, 0, 2], [2, 0, -2], [-2, 0, -2]]\n"
SUN_TABLE = "[sun]\ntowards = [0.3, 1, -0.5]\nirradiance = [3, 2, 1]\nangle = {angle}\n"
LAMP = "[[point_light]]\nposition = [0, 1, 0]\nintensity = [2, 2, 2]\n"
NORMALS = unit(np.array([[0, 1, 0], [1, 1, 0], [-0.6, 0.8, -0.2], [0, 0.4, -1]])).astype(np.float32)


def found(scene: Scene, normal: np.ndarray, samples: int, rivals: float) -> tuple[np.ndarray, np.ndarray]:
    """Irradiance (N, 3) by light samples, and by rays that meet nothing, in the open."""
    lights, start = lights_of(scene), np.zeros_like(normal)
    _, weight = direct_candidates(
        lights, start, normal, np.arange(len(normal)), samples=samples, rivals=np.float32(rivals)
    )
    met = np.zeros((len(normal), 3))
    for k, facing in enumerate(normal):
        around = np.broadcast_to(facing, (4096, 3))
        rays = to_world(cosine_table(), around, tangent_of(around))
        met[k] = np.pi * met_beyond(lights, rays, around, np.float32(rivals)).astype(np.float64).mean(axis=0)
    return weight.astype(np.float64).sum(axis=1), met


@pytest.mark.parametrize("angle", [0, 1e-30, 1e-3, 0.53, 20, 60])
@pytest.mark.parametrize("lamp", ["", LAMP])
def test_sun(tmp_path: Path, angle: float, lamp: str) -> None:
    """Irradiance times cosine, whatever its size: its disc is nowhere below these horizons."""
    scene = scene_of(tmp_path, QUAD + SUN_TABLE.format(angle=angle) + lamp)
    towards = unit(np.array([[0.3, 1, -0.5]]))[0]
    lights = lights_of(scene)
    assert (lights.kind == SUN).sum() == 1
    for rivals in (0, 1):
        light, met = found(scene, NORMALS, 8192, rivals)
        lamps = np.zeros((4, 1)) if not lamp else 2 * np.maximum(NORMALS[:, 1:2].astype(np.float64), 0)
        expected = (NORMALS.astype(np.float64) @ towards)[:, None] * np.array([3, 2, 1]) + lamps
        # Few of the rays meet a small disc; what they count of it is next to nothing.
        np.testing.assert_allclose(light + met, expected, rtol=5e-3 if angle < 1 else 2e-2)
        assert met.any() == (rivals > 0 and angle > 1)


def test_a_sun_below_the_horizon_brings_nothing(tmp_path: Path) -> None:
    lights = lights_of(scene_of(tmp_path, QUAD + SUN_TABLE.format(angle=0.53)))
    rays, weight = direct_candidates(lights, np.zeros((1, 3), np.float32), -NORMALS[:1], np.arange(1), samples=64)
    assert not weight.any()
    assert not rays["t_max"].any()
    rays, weight = direct_candidates(lights, np.zeros((1, 3), np.float32), NORMALS[:1], np.arange(1), samples=64)
    assert np.isinf(rays["t_max"]).all()
    assert len(np.unique(rays["direction"], axis=1)[0]) > 60, "all over the disc"


def test_an_even_sky(tmp_path: Path) -> None:
    """pi times its radiance on every surface in the open, to the last places, by rays that meet nothing alone."""
    scene = scene_of(tmp_path, QUAD + "[sky]\nradiance = [0.25, 0.5, 1]\n")
    assert len(lights_of(scene)) == 0
    for rivals in (0, 4):
        light, met = found(scene, NORMALS, 16, rivals)
        assert not light.any()
        np.testing.assert_allclose(met, np.pi * np.array([[0.25, 0.5, 1]]) * np.ones((4, 1)), rtol=1e-6)


def sky_scene(folder: Path, more: str = "") -> Scene:
    from lightloom.golden_model.pictures.images import write_exr

    write_exr(folder / "sky.exr", with_spot().radiance)
    return scene_of(folder, QUAD + "[sky]\nimage = 'sky.exr'\n" + more)


@pytest.mark.parametrize("rivals", [0, 1, 4])
def test_a_sky_with_a_bright_spot(tmp_path: Path, rivals: float) -> None:
    """The integral of its pixels times cosine; balanced, both ways to find it add up to no more and no less."""
    scene = sky_scene(tmp_path)
    assert (lights_of(scene).kind == SKY).tolist() == [True]
    picture, away = with_spot().radiance.astype(np.float64), centres(64)
    solid = np.sin((np.arange(64) + 0.5) * np.pi / 64)[:, None] * (np.pi / 64) ** 2
    cosine = np.maximum(np.moveaxis(away @ NORMALS.T.astype(np.float64), 2, 0), 0)
    expected = (picture * (cosine * solid)[..., None]).sum(axis=(1, 2))
    light, met = found(scene, NORMALS, 4096, rivals)
    np.testing.assert_allclose(light + met, expected, rtol=0.03)
    assert met.any() == (rivals > 0)


def test_balanced_samples_of_a_sky_are_bounded(tmp_path: Path) -> None:
    """No light sample and no ray brings more than pi times the brightest cell over the number of rays."""
    scene = sky_scene(tmp_path, LAMP)
    normal = np.repeat(NORMALS, 256, axis=0)
    lights = lights_of(scene)
    _, weight = direct_candidates(
        lights, np.zeros_like(normal), normal, np.arange(len(normal)), samples=4, rivals=np.float32(4)
    )
    assert lights.sky is not None
    assert weight.max() <= np.pi / 16 * float(lights.sky.map.radiance.max())


def test_the_same_keys_give_the_same_bits_whatever_is_asked_together(tmp_path: Path) -> None:
    lights = lights_of(sky_scene(tmp_path, LAMP + SUN_TABLE.format(angle=5)))
    normal, start = np.tile(NORMALS, (5, 1)), np.zeros((20, 3), dtype=np.float32)
    rays, weight = direct_candidates(lights, start, normal, np.arange(20), first=3, samples=8)
    for k in (0, 7, 19):
        one, light = direct_candidates(lights, start[:1], normal[k : k + 1], np.array([k]), first=3, samples=8)
        assert one.tobytes() == rays[k].tobytes()
        assert light.tobytes() == weight[k].tobytes()
