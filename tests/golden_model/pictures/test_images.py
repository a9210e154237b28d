"""Pictures: display mapping, files that read back, the atlas."""

from pathlib import Path

import numpy as np
import OpenEXR
import pytest
from PIL import Image

from lightloom.golden_model.host.errors import InputError
from lightloom.golden_model.pictures.images import atlas, exposure_for, tonemap, write_exr, write_film, write_png
from tests.golden_model.engine.publishing.test_publisher import maps_of


def test_tonemap_is_srgb_below_the_shoulder_and_monotonic_above() -> None:
    ramp = np.linspace(0, 40, 20001)[:, None, None] * np.ones((1, 1, 3))
    shown = tonemap(ramp)[:, 0, 0]
    assert (np.diff(shown.astype(int)) >= 0).all()
    assert shown[0] == 0
    assert shown[-1] <= 255
    half = tonemap(np.full((1, 1, 3), 0.5))[0, 0, 0]
    assert half == 188  # sRGB of linear 0.5
    assert tonemap(np.full((1, 1, 3), 0.25), exposure=2)[0, 0, 0] == half
    checkers = np.indices((8, 6)).sum(axis=0)[..., None] % 2 * np.ones(3) * 0.5
    assert (tonemap(checkers, pixels=2) == tonemap(np.full((4, 3, 3), 0.25))).all()


def test_tonemap_keeps_the_colour_of_a_light() -> None:
    shown = tonemap(np.array([[[17.0, 12.0, 4.0]]]))[0, 0]
    assert shown[0] > 250
    assert shown[0] > shown[1] > shown[2]


def test_tonemap_survives_what_is_not_a_number() -> None:
    shown = tonemap(np.array([[[np.nan, np.inf, -np.inf], [-1, 0, 0]]]))
    assert shown[0, 0, 1] > 250
    assert shown[0, 0, 0] == shown[0, 0, 2] == shown[0, 1, 0] == 0


def test_exposure_takes_the_bright_walls_to_the_level() -> None:
    image = np.full((10, 10, 3), 0.2)
    image[0, 0] = 100  # a light
    assert exposure_for(image) == pytest.approx(0.8 / 0.2)
    assert exposure_for(np.zeros((4, 4, 3))) == 1.0


def test_png_reads_back(tmp_path: Path) -> None:
    image = np.random.default_rng(0).integers(0, 256, (7, 5, 3), dtype=np.uint8)
    write_png(tmp_path / "a.png", image)
    assert (np.asarray(Image.open(tmp_path / "a.png")) == image).all()


@pytest.mark.parametrize("dtype", [np.float32, np.float16])
@pytest.mark.parametrize("channels", [3, 4])
def test_exr_reads_back_all_bits(tmp_path: Path, dtype: type, channels: int) -> None:
    image: np.ndarray = np.random.default_rng(0).normal(size=(6, 9, channels)).astype(dtype)
    write_exr(tmp_path / "a.exr", image)
    with OpenEXR.File(str(tmp_path / "a.exr")) as file:
        pixels = file.channels()["RGB" if channels == 3 else "RGBA"].pixels
    assert pixels.dtype == dtype
    assert (pixels == image).all()
    assert [p.name for p in tmp_path.iterdir()] == ["a.exr"]


@pytest.mark.parametrize("suffix", [".webp", ".gif", ".png"])
def test_film_has_every_frame(tmp_path: Path, suffix: str) -> None:
    shade = np.linspace(0, 255, 5).astype(np.uint8)
    frames = [np.broadcast_to(s, (16, 24, 3)).copy() for s in shade]
    write_film(tmp_path / f"film{suffix}", frames)
    with Image.open(tmp_path / f"film{suffix}") as film:
        assert getattr(film, "n_frames", 1) == len(frames)
        for k, s in enumerate(shade):
            film.seek(k)
            assert np.abs(np.asarray(film.convert("RGB")).astype(int) - int(s)).max() <= 4
    assert len(list(tmp_path.iterdir())) == 1


def test_a_place_that_cannot_be_written_is_one_clear_line(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("x")
    image = np.zeros((2, 2, 3), dtype=np.uint8)
    for write in (
        lambda: write_png(tmp_path / "file" / "a.png", image),
        lambda: write_exr(tmp_path / "file" / "a.exr", image.astype(np.float32)),
        lambda: write_film(tmp_path / "file" / "a.gif", [image]),
    ):
        with pytest.raises(InputError, match="cannot be written"):
            write()


def test_atlas_shows_every_texel_once() -> None:
    maps = maps_of([(5, 3), (2, 8), (4, 4), (1, 1)])
    values = np.arange(1, len(maps.texels) + 1, dtype=np.float32)[:, None]
    picture = atlas(maps, values)
    shown = picture[picture > 0]
    assert sorted(shown) == values[:, 0].tolist()
    left, top = np.argwhere(picture[..., 0] == values[maps.offset[0], 0])[0][::-1]
    assert (picture[top : top + 3, left : left + 5, 0].reshape(-1) == values[:15, 0]).all()
