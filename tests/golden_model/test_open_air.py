"""Scenes under sun and sky as they are rendered: closed forms, all modes, the path tracer, Mitsuba 3, equal bits."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lightloom.golden_model.contract.formats import HIT
from lightloom.golden_model.driver.geometry import shapes_of
from lightloom.golden_model.engine.sampling.settings import Sampling
from lightloom.golden_model.frame.frame_rays import FrameShading
from lightloom.golden_model.oracle.converged_maps import Reference
from lightloom.golden_model.oracle.path_tracer import irradiance
from lightloom.golden_model.oracle.true_picture import true_picture
from lightloom.golden_model.pictures.images import write_exr
from lightloom.golden_model.rays.hit_surface import surface_at
from lightloom.golden_model.renderer import Pipeline, Renderer
from lightloom.golden_model.scene.scene import Scene
from lightloom.golden_model.structures.structure import Structure
from lightloom.golden_model.tables.lightmap import VALID
from tests.golden_model.mitsuba_scenes import mitsuba, mitsuba_irradiance
from tests.golden_model.moving_scenes import scene_of
from tests.golden_model.scene.test_sky import centres

SEED = 20250712
CAMERA = "texel_size = 0.5\n[camera]\nposition = [0, 3, 6]\ntarget = [0, 0.5, 0]\nfov_y_tan = 0.6\n"
GROUND = (
    "[[quad]]\nname = 'ground'\ncorners = [[-3, 0, 3], [3, 0, 3], [3, 0, -3], [-3, 0, -3]]\nalbedo = [0.5, 0.4, 0.3]\n"
)
BOX = "[[box]]\nname = 'box'\ncenter = [0.4, 0.61, 0.2]\nsize = [1.2, 1.2, 1.2]\nalbedo = [0.3, 0.6, 0.7]\n"
BALL = "[[sphere]]\ncenter = [0, 1, 0]\nradius = 1\nsubdivisions = 2\n"
EVEN = "[sky]\nradiance = [0.25, 0.5, 1]\n"
LIGHT = np.array([0.25, 0.5, 1])
SUN = "[sun]\ntowards = [-1, 1, 0.4]\nirradiance = [3, 2.7, 2.2]\nangle = {angle}\n"


def rendered(scene: Scene, frames: int = 1, budget: int = 10**7, **options: Any) -> tuple[Renderer, Any]:
    renderer = Renderer(scene, width=36, height=24, budget=budget, **options)
    for _ in range(frames):
        result = renderer.frame()
    return renderer, result


def both(direct: Any, **sampling: Any) -> dict[str, Any]:
    return {
        "sampling": Sampling(direct=direct, **sampling),
        "pipeline": Pipeline(shading=FrameShading(direct=direct)),
    }


@pytest.mark.parametrize(
    "options", [{}, {"sampling": Sampling(balanced=False)}, both("rays")], ids=["balanced", "not balanced", "rays"]
)
@pytest.mark.parametrize(
    "body", [BOX.replace("[0.3, 0.6, 0.7]", "[0.5, 0.4, 0.3]"), BALL + "albedo = [0.5, 0.4, 0.3]\n"]
)
def test_furnace_under_an_even_sky(tmp_path: Path, options: dict[str, Any], body: str) -> None:
    """A convex body of albedo a shows a L, at every place, in front of a sky that shows L.

    A ball's shading normals lean away from its flat faces: at some places a ray in sixteen meets the ball itself.
    """
    scene = scene_of(tmp_path, CAMERA + body + EVEN)
    renderer, result = rendered(scene, **options)
    worst, mean = (0.06, 5e-3) if body.startswith(BALL) else (1e-3, 1e-3)
    irradiance = renderer.state["irradiance"][renderer.lightmaps.texels["state"] == VALID]
    np.testing.assert_allclose(irradiance, [np.pi * LIGHT] * len(irradiance), rtol=worst)
    np.testing.assert_allclose(irradiance.mean(axis=0), np.pi * LIGHT, rtol=mean)
    empty = result.gbuffer["primitive"] < 0
    assert 100 < empty.sum() < empty.size - 20
    assert (result.image[empty] == LIGHT.astype(np.float32)).all()
    shown = result.image[~empty]
    np.testing.assert_allclose(shown, [LIGHT * (0.5, 0.4, 0.3)] * len(shown), rtol=worst + 1e-3)


@pytest.mark.parametrize("kind", ["mirror", "glass"])
def test_a_mirror_and_clear_glass_cannot_be_told_from_an_even_sky(tmp_path: Path, kind: str) -> None:
    """Of glass a few paths end inside, at the last pane that they may meet."""
    scene = scene_of(tmp_path, CAMERA + BALL + f"material = '{kind}'\nalbedo = [1, 1, 1]\n" + EVEN)
    _, result = rendered(scene, budget=20_000)
    shown = result.image[result.gbuffer["primitive"] >= 0]
    assert len(shown) > 20
    assert np.isclose(shown, LIGHT, rtol=1e-5).all(axis=1).mean() >= (1 if kind == "mirror" else 0.8)
    np.testing.assert_allclose(shown.mean(axis=0), LIGHT, rtol=1e-5 if kind == "mirror" else 0.05)


def test_pixels_show_the_sun(tmp_path: Path) -> None:
    text = CAMERA.replace("target = [0, 0.5, 0]", "target = [-1, 5, 6.4]")
    scene = scene_of(tmp_path, text + GROUND + EVEN + SUN.format(angle=20).replace("0.4", "0.2"))
    _, result = rendered(scene, budget=20_000)
    image = result.image[result.gbuffer["primitive"] < 0]
    sky = (image == LIGHT.astype(np.float32)).all(axis=1)
    assert 0.6 < sky.mean() < 0.99
    disc = 3 / (np.pi * np.sin(np.radians(10)) ** 2)
    np.testing.assert_allclose(image[~sky][:, 0], disc + 0.25, rtol=1e-5)


@pytest.mark.parametrize("direct", ["maps", "rays"])
@pytest.mark.parametrize("angle", [0, 0.53])
def test_a_plain_in_the_sun(tmp_path: Path, direct: str, angle: float) -> None:
    """Irradiance is that of the sun times cosine, whichever way it is found."""
    _, result = rendered(scene_of(tmp_path, CAMERA + GROUND + SUN.format(angle=angle)), **both(direct))
    ground = result.gbuffer["primitive"] >= 0
    expected = np.array([3, 2.7, 2.2]) / np.sqrt(1 + 1 + 0.16) * (0.5, 0.4, 0.3) / np.pi
    np.testing.assert_allclose(result.image[ground].mean(axis=0), expected, rtol=2e-3)
    np.testing.assert_allclose(result.image[ground], [expected] * int(ground.sum()), rtol=5e-3)


def gradient(height: int = 64) -> np.ndarray:
    """A sky with a wide bright place, brighter up than down, (H, 2 H, 3) float32."""
    return shade(centres(height)).astype(np.float32)


def shade(away: np.ndarray) -> np.ndarray:
    """Radiance from directions (..., 3), (..., 3)."""
    spot = np.exp(40 * (away @ (np.array([-0.6, 0.7, 0.4]) / np.sqrt(1.01)) - 1))
    return np.asarray((0.3 + 0.2 * away[..., 1] + 8 * spot)[..., None] * np.array([1, 0.9, 0.7]))


def outdoors(folder: Path, more: str = "") -> Scene:
    write_exr(folder / "sky.exr", gradient())
    return scene_of(folder, CAMERA + GROUND + BOX + "[sky]\nimage = 'sky.exr'\n" + more)


def test_maps_come_to_what_paths_find(tmp_path: Path) -> None:
    """Sky with a bright place, sun and a box: converged maps and maintained ones against path-traced pictures."""
    scene = outdoors(tmp_path, SUN.format(angle=10))
    renderer, result = rendered(scene, 24)
    true = true_picture(scene, result.gbuffer, Structure(scene).trace, 128, SEED).astype(np.float64)
    seen = result.gbuffer["primitive"] >= 0
    maps = Reference(scene, renderer.lightmaps, rays=128).published(0)
    for image in (result.image, renderer.picture(result, maps)):
        ratio = image[seen].sum(axis=0, dtype=np.float64) / true[seen].sum(axis=0)
        assert ratio == pytest.approx([1, 1, 1], rel=0.03), f"seed {SEED}"


def test_both_ways_to_find_direct_light_show_the_same(tmp_path: Path) -> None:
    """Shadow rays of pixels choose from the sky's table, too; a mirror shows what each makes of the ground."""
    ball = BALL.replace("[0, 1, 0]", "[-1.5, 1, 0.5]") + "material = 'mirror'\nalbedo = [1, 1, 1]\n"
    scene = outdoors(tmp_path, SUN.format(angle=0.53) + ball)
    images = []
    for direct in ("maps", "rays"):
        renderer, result = rendered(scene, 8, **both(direct))
        more = [renderer.frame().image for _ in range(24)]
        images.append(np.asarray(np.mean([result.image, *more], axis=0, dtype=np.float64)))
    seen = result.gbuffer["primitive"] >= 0
    assert images[0][seen].sum(axis=0) == pytest.approx(images[1][seen].sum(axis=0), rel=0.02)


def test_irradiance_against_mitsuba(tmp_path: Path) -> None:
    """Under a picture of a sky and the sun, beside and on a box: energy within 2 %, median within 2 %."""
    mi = mitsuba()
    scene = outdoors(tmp_path, SUN.format(angle=0))
    random = np.random.default_rng(SEED)
    hits = np.zeros(120, dtype=HIT)
    hits["primitive"] = np.array([0, 1, 4, 5, 6, 7, 8, 9, 12, 13])[np.arange(120) % 10]
    u, v = random.uniform(0.05, 0.95, (2, 120))
    hits["u"], hits["v"] = np.where(u + v > 1, 1 - u, u), np.where(u + v > 1, 1 - v, v)
    hits["front"] = True
    surface = surface_at(shapes_of(scene), hits)
    under = (np.abs(surface.place[:, [0, 2]] - (0.4, 0.2)).max(axis=1) < 0.61) & (surface.place[:, 1] == 0)
    place, facing = surface.place[~under], surface.facing[~under]
    material = scene.material[hits["primitive"][~under]]
    ours = irradiance(scene, Structure(scene).trace, place, facing, 1024, SEED).astype(np.float64)
    theirs = mitsuba_irradiance(mi, scene, place, facing, material, 512, SEED, sky=shade)
    ratio = ours / theirs
    energy = ours.sum(axis=0) / theirs.sum(axis=0)
    print(f"{len(place)} points, ours / Mitsuba {mi.__version__}: median {np.median(ratio):.4f}, energy {energy}")
    assert energy == pytest.approx([1, 1, 1], rel=0.02), f"seed {SEED}"
    assert np.median(ratio) == pytest.approx(1, rel=0.02), f"seed {SEED}"


def test_the_unit_of_light_knows_sun_and_sky(tmp_path: Path) -> None:
    """A billion times as bright or dim: the same picture, as many times as bright."""
    images = []
    for scale in (1.0, 2.0**30, 2.0**-30):
        light = f"[sky]\nradiance = [{scale}, {scale}, {scale}]\n" + SUN.format(angle=0.53).replace(
            "[3, 2.7, 2.2]", f"[{3 * scale}, {2 * scale}, {scale}]"
        )
        _, result = rendered(scene_of(tmp_path, CAMERA + GROUND + BOX + light), 2, 6000)
        images.append(result.image.astype(np.float64) / scale)
    for other in images[1:]:
        assert np.isfinite(other).all()
        assert other.sum() == pytest.approx(images[0].sum(), rel=1e-3)


def test_bits_do_not_depend_on_backend_or_threads(tmp_path: Path) -> None:
    scene = outdoors(
        tmp_path, SUN.format(angle=0.53) + BALL.replace("[0, 1, 0]", "[-1.5, 1, 0.5]") + "material = 'glass'\n"
    )
    found = []
    for options in ({"backend": "numpy"}, {"backend": "numba"}, {"backend": "numba", "threads": 2}):
        renderer, result = rendered(scene, 2, 3000, **options)
        found.append((result.image.tobytes(), renderer.state.tobytes(), renderer.published.tobytes()))
    assert found[0] == found[1] == found[2]
