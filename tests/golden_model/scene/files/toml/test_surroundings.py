"""Sky and sun of scene descriptions: what they say, and every way in which they can be wrong."""

from pathlib import Path

import numpy as np
import OpenEXR
import pytest

from lightloom.golden_model.host.errors import InputError, InputWarning
from lightloom.golden_model.pictures.images import write_exr
from lightloom.golden_model.scene.pose import scene_at
from lightloom.golden_model.scene.scene import Scene, require_light
from tests.golden_model.moving_scenes import scene_of
from tests.golden_model.scene.test_scene import refusal

QUAD = "[[quad]]\ncorners = [[-2, 0, 2], [2, 0, 2], [2, 0, -2], [-2, 0, -2]]\n"
SUN = "[sun]\ntowards = [0, 3, 4]\nirradiance = [3, 2, 1]\n"


def of(folder: Path, text: str) -> Scene:
    return scene_of(folder, QUAD + text)


def picture(height: int = 2, width: int = 4) -> np.ndarray:
    return np.random.default_rng(3).uniform(0, 9, (height, width, 3)).astype(np.float32)


def test_a_scene_without_lies_in_the_dark(tmp_path: Path) -> None:
    assert not of(tmp_path, "").environment


def test_a_sky_that_is_the_same_all_over(tmp_path: Path) -> None:
    scene = of(tmp_path, "[sky]\nradiance = [0.25, 0.5, 1]\n")
    assert scene.environment.sun is None
    assert scene.environment.sky is not None
    assert scene.environment.sky.radiance.tolist() == [[[0.25, 0.5, 1]]]
    assert scene.environment.sky.rotation.tolist() == np.eye(3).tolist()
    assert scene_at(scene, 7).environment is scene.environment


@pytest.mark.parametrize("dtype", [np.float16, np.float32])
@pytest.mark.parametrize("channels", [3, 4])
def test_a_sky_from_exr(tmp_path: Path, dtype: type[np.floating], channels: int) -> None:
    stored = np.concatenate([picture(), np.ones((2, 4, 1), dtype=np.float32)], axis=2)[..., :channels].astype(dtype)
    write_exr(tmp_path / "sky.exr", stored)
    sky = of(tmp_path, "[sky]\nimage = 'sky.exr'\nscale = [1, 2, 4]\nrotate = [1, 0, 1, 0]\n").environment.sky
    assert sky is not None
    assert sky.radiance.dtype == np.float32
    np.testing.assert_array_equal(
        sky.radiance, stored[..., :3].astype(np.float32) * np.array([1, 2, 4], dtype=np.float32)
    )
    assert sky.rotation @ np.array([0, 0, -1], dtype=np.float32) == pytest.approx([-1, 0, 0]), "a quarter turn about y"


def test_channels_of_an_exr_file_that_are_no_colours_are_said(tmp_path: Path) -> None:
    planes = {name: np.full((2, 4), value, dtype=np.float32) for name, value in zip("RGBZ", (1, 2, 3, 9), strict=True)}
    OpenEXR.File({"type": OpenEXR.scanlineimage}, planes).write(str(tmp_path / "sky.exr"))
    with pytest.warns(InputWarning, match="sky.exr: left out: channel `Z`"):
        sky = of(tmp_path, "[sky]\nimage = 'sky.exr'\n").environment.sky
    assert sky is not None
    assert (sky.radiance == [1, 2, 3]).all()


def test_a_sun(tmp_path: Path) -> None:
    sun = of(tmp_path, SUN).environment.sun
    assert sun is not None
    assert sun.towards == pytest.approx([0, 0.6, 0.8])
    assert (sun.irradiance.tolist(), sun.angle) == ([3, 2, 1], 0.53)
    small = of(tmp_path, SUN.replace("[0, 3, 4]", "[0, 3e-38, 4e-38]") + "angle = 0\n").environment.sun
    assert small is not None
    assert (small.towards.tolist(), small.angle) == (sun.towards.tolist(), 0)


def test_it_is_light_enough_for_a_scene(tmp_path: Path) -> None:
    for text in (SUN, "[sky]\nradiance = [1, 1, 1]\n"):
        require_light(of(tmp_path, text))
    with pytest.raises(InputError, match="no light"):
        require_light(of(tmp_path, "[sky]\nradiance = [0, 0, 0]\n"))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[sky]\n", "[sky]: give either `radiance` or `image`"),
        ("[sky]\nradiance = [1, 1, 1]\nimage = 'a.exr'\n", "[sky]: give either `radiance` or `image`"),
        ("[sky]\nradiance = [1, -1, 1]\n", "`radiance` must not be negative"),
        ("[sky]\nradiance = 1\n", "`radiance` must be 3 numbers"),
        ("[sky]\nradiance = [1, 1, 1]\nscale = 2\n", "`scale` is of use with an `image` only"),
        ("[sky]\nradiance = [1, 1, 1]\nrotate = [1, 0, 1, 0]\n", "`rotate` is of use with an `image` only"),
        ("[sky]\nimag = 'a.exr'\n", "did you mean `image`?"),
        ("[sky]\nimage = 'a.exr'\n", "no such file"),
        ("[sky]\nimage = 'scene.toml'\n", "is not linear light; give an .exr or .hdr file"),
        ("[sky]\nimage = 'sky.exr'\nscale = 0\n", "`scale` must be greater than 0"),
        ("[sky]\nimage = 'sky.exr'\nrotate = [0, 0, 0, 0]\n", "`rotate` must not be all zero"),
        ("[sky]\nimage = 'square.exr'\n", "has 4x4 pixels; a sky by latitude and longitude is twice as wide as high"),
        ("[sky]\nimage = 'negative.exr'\n", "is negative, not finite or too bright in row 1, column 2"),
        ("[sky]\nimage = 'sky.exr'\nscale = 1e38\n", "not finite or too bright in row"),
        ("[sky]\nimage = 'cut.exr'\n", "not a readable EXR file"),
        ("[sky]\nimage = 'cut.hdr'\n", "not a readable Radiance picture"),
        ("[[sky]]\nradiance = [1, 1, 1]\n", "[sky]: must be a table"),
        ("[sun]\nirradiance = [1, 1, 1]\n", "`towards` is missing"),
        ("[sun]\ntowards = [0, 1, 0]\n", "`irradiance` is missing"),
        (SUN.replace("[0, 3, 4]", "[0, 0, 0]"), "`towards` must not be all zero"),
        (SUN.replace("[3, 2, 1]", "[3, 2, -1]"), "`irradiance` must not be negative"),
        (SUN + "angle = -1\n", "`angle` must lie within 0 to 90 degrees, not -1"),
        (SUN + "angle = 91\n", "`angle` must lie within 0 to 90 degrees, not 91"),
        (SUN + "size = 1\n", "[sun]: unknown key `size`"),
    ],
)
def test_what_is_refused(tmp_path: Path, text: str, said: str) -> None:
    write_exr(tmp_path / "sky.exr", picture())
    write_exr(tmp_path / "square.exr", picture(4, 4))
    negative = picture()
    negative[1, 2, 0] = -1
    write_exr(tmp_path / "negative.exr", negative)
    (tmp_path / "cut.exr").write_bytes((tmp_path / "sky.exr").read_bytes()[:100])
    (tmp_path / "cut.hdr").write_bytes(b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 2 +X 4\n\0\0\0\0")
    path = tmp_path / "scene.toml"
    path.write_text(QUAD + text)
    message = refusal(path)
    assert said in message
    assert message.startswith(str(path))
