"""Light with a texture: what it comes to over a triangle, what it lights, and how it is seen."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from lightloom.golden_model.host.errors import InputError
from lightloom.golden_model.oracle.true_picture import require_path_traced
from lightloom.golden_model.rays.light_samples import direct_candidates
from lightloom.golden_model.renderer import Renderer
from lightloom.golden_model.scene.lights import lights_of
from lightloom.golden_model.scene.texture_means import mean_over
from tests.golden_model.moving_scenes import scene_of
from tests.golden_model.scene.test_scene import refusal

SEED = 20250714
SCREEN = (
    "[[quad]]\nname = 'screen'\ncorners = [[-2, 0, -2], [2, 0, -2], [2, 4, -2], [-2, 4, -2]]\n"
    "albedo = [0, 0, 0]\nemission = [4, 2, 1]\n"
)
FLOOR = "[[quad]]\nname = 'floor'\ncorners = [[-2, 0, 3], [2, 0, 3], [2, 0, -2], [-2, 0, -2]]\n"
CAMERA = "texel_size = 0.5\n[camera]\nposition = [0, 2, 6]\ntarget = [0, 1.9, 0]\nfov_y_tan = 0.5\n"
EMISSION = np.array([4, 2, 1])


def dense(picture: np.ndarray, corners: np.ndarray, count: int = 400_000) -> np.ndarray:
    """The mean over a triangle from random points of it, by a bilinear read of its own."""
    u, v = np.random.default_rng(SEED).random((2, count))
    u, v = np.where(u + v > 1, 1 - u, u), np.where(u + v > 1, 1 - v, v)
    size = np.array([picture.shape[1], picture.shape[0]])
    x, y = ((corners[0] * (1 - u - v)[:, None] + corners[1] * u[:, None] + corners[2] * v[:, None]) * size - 0.5).T
    i, j = np.floor(x).astype(int), np.floor(y).astype(int)
    corner = [picture[(j + m) % len(picture), (i + k) % picture.shape[1]] for m in (0, 1) for k in (0, 1)]
    fx, fy = (x - i)[:, None], (y - j)[:, None]
    mixed = (corner[0] * (1 - fx) + corner[1] * fx) * (1 - fy) + (corner[2] * (1 - fx) + corner[3] * fx) * fy
    return np.asarray(mixed.mean(axis=0))


def test_the_mean_over_a_triangle() -> None:
    random = np.random.default_rng(SEED)
    for height, width in ((1, 1), (2, 2), (5, 3), (16, 64)):
        picture = random.random((height, width, 3)).astype(np.float32)
        for corners in (np.array([[0, 0], [1, 0], [1, 1]]), random.uniform(-2, 2, (3, 2))):
            np.testing.assert_allclose(mean_over(picture, corners), dense(picture, corners), atol=3e-3)
    half = np.zeros((64, 64, 3), dtype=np.float32)
    half[:, :32] = 1
    # Of the lower triangle of the unit square a quarter has u below a half.
    assert mean_over(half, np.array([[0, 0], [1, 0], [1, 1]])) == pytest.approx([0.25] * 3, abs=0.01)


def write_half(folder: Path) -> None:
    """A picture of which the left half is black."""
    pixels = np.zeros((16, 16, 3), dtype=np.uint8)
    pixels[:, 8:] = 255
    Image.fromarray(pixels).save(folder / "half.png")


def test_what_it_lights_is_lit_by_its_mean(tmp_path: Path) -> None:
    write_half(tmp_path)
    textured = scene_of(tmp_path, SCREEN + "emission_texture = 'half.png'\n" + FLOOR)
    share = textured.emission_share
    assert share is not None
    assert share[:2, 0] == pytest.approx([0.75, 0.25], abs=0.03)
    assert (share[2:] == 1).all()
    lights = lights_of(textured)
    np.testing.assert_array_equal(lights.emitted, (share[:2] * EMISSION).astype(np.float32))
    chance = np.diff(lights.begin.astype(np.float64)) / float(lights.begin[-1])
    assert chance == pytest.approx(share[:2, 0] / share[:2, 0].sum(), rel=1e-6)

    plain = lights_of(scene_of(tmp_path, SCREEN + FLOOR))
    place = np.array([[0, 0, 60]], dtype=np.float32)
    facing = np.array([[0, 0, -1]], dtype=np.float32)
    far = [
        direct_candidates(each, place, facing, np.arange(1), samples=4096)[1].astype(np.float64).sum(axis=1)
        for each in (lights, plain)
    ]
    np.testing.assert_allclose(far[0] / far[1], 0.5, rtol=0.01)


def test_it_is_seen_as_it_is(tmp_path: Path) -> None:
    """Directly, and in a floor that is a mirror."""
    write_half(tmp_path)
    mirror = FLOOR + "material = 'mirror'\nalbedo = [1, 1, 1]\n"
    scene = scene_of(tmp_path, CAMERA + SCREEN + "emission_texture = 'half.png'\n" + mirror)
    result = Renderer(scene, width=48, height=40, budget=3000).frame()
    for number in (0, 1):
        seen = result.gbuffer["object"] == number
        column = np.broadcast_to(np.arange(48), seen.shape)
        dark, bright = result.image[seen & (column < 22)], result.image[seen & (column > 25)]
        lit = bright[bright.any(axis=1)]  # of the floor a part shows what is above the screen
        assert len(lit) > 50
        assert (dark == 0).all(axis=1).mean() > 0.8, "all but the edge, where the picture begins again"
        np.testing.assert_allclose(np.median(lit, axis=0), EMISSION, rtol=1e-5)


def test_light_that_bounces_in_a_room_of_pictures(tmp_path: Path) -> None:
    """A checkered ceiling lights the floor below it like an even one of its mean, within a few per cent."""
    shown = []
    for more, emission in (("emission_texture = 'checker'\ntexture_scale = 8\n", "[8, 8, 8]"), ("", "[5, 5, 5]")):
        ceiling = (
            "[[quad]]\nname = 'ceiling'\ncorners = [[-2, 2, -2], [2, 2, -2], [2, 2, 3], [-2, 2, 3]]\n"
            f"emission = {emission}\n{more}"
        )
        renderer = Renderer(scene_of(tmp_path, CAMERA + ceiling + FLOOR), width=24, height=16, budget=10**6)
        for _ in range(8):
            result = renderer.frame()
        shown.append(result.image[result.gbuffer["object"] == 1].mean(axis=0))
    np.testing.assert_allclose(shown[0], shown[1], rtol=0.02)


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ("texture = 'half.png'\nemission_texture = 'checker'\n", "must have as many pixels as each other"),
        ("emission_texture = 'none.png'\n", "none.png"),
    ],
)
def test_what_is_refused(tmp_path: Path, more: str, said: str) -> None:
    write_half(tmp_path)
    path = tmp_path / "scene.toml"
    path.write_text(SCREEN + more + FLOOR)
    assert said in refusal(path)


def test_without_emission_it_is_of_no_use_and_paths_do_not_know_it(tmp_path: Path) -> None:
    path = tmp_path / "scene.toml"
    path.write_text(FLOOR + "emission_texture = 'checker'\n")
    assert "`emission_texture` is of use with an `emission` only" in refusal(path)
    with pytest.raises(InputError, match="textures, which are not path-traced"):
        require_path_traced(scene_of(tmp_path, SCREEN + "emission_texture = 'checker'\n"))
