"""EXR pictures: which channels are taken, and what a file may say that would make them another picture."""

import warnings
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR
import pytest

from lightloom.golden_model.host.errors import InputError, InputWarning
from lightloom.golden_model.scene.files.exr import USUAL, read_exr

RNG = np.random.default_rng(3)
PLANES = {name: RNG.uniform(0, 2, (2, 4)).astype(np.float32) for name in "RGBAY"}


def written(path: Path, names: str, **head: Any) -> Path:
    OpenEXR.File({"type": OpenEXR.scanlineimage, **head}, {name: PLANES[name] for name in names}).write(str(path))
    return path


@pytest.mark.parametrize(("names", "taken"), [("RGB", "RGB"), ("RGBA", "RGBA"), ("Y", "Y"), ("RGBY", "RGB")])
def test_channels(tmp_path: Path, names: str, taken: str) -> None:
    """Beside colours a luminance is no channel of the picture, and said to be left out."""
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        found = read_exr(written(tmp_path / "a.exr", names))
    assert found.tobytes() == np.stack([PLANES[name] for name in taken], axis=-1).tobytes()
    assert [str(each.message).rsplit(": ", 1)[-1] for each in said] == [
        f"channel `{n}`" for n in names if n not in taken
    ]


@pytest.mark.parametrize(
    ("name", "value"), [("pixelAspectRatio", 2.0), ("chromaticities", (0.7, 0.3, 0.2, 0.7, 0.1, 0.1, 0.3, 0.3))]
)
def test_what_is_left_out_is_said(tmp_path: Path, name: str, value: object) -> None:
    with pytest.warns(InputWarning, match=f"left out: `{name}`"):
        read_exr(written(tmp_path / "a.exr", "RGB", **{name: value}))


def test_the_usual_chromaticities_are_no_remark(tmp_path: Path) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        read_exr(written(tmp_path / "a.exr", "RGB", chromaticities=USUAL, pixelAspectRatio=1.0))


def test_a_second_part_is_said(tmp_path: Path) -> None:
    parts = [OpenEXR.Part({"type": OpenEXR.scanlineimage}, {n: PLANES[n] for n in "RGB"}, name) for name in ("a", "b")]
    OpenEXR.File(parts).write(str(tmp_path / "a.exr"))
    with pytest.warns(InputWarning, match="left out: 1 of 2 parts"):
        read_exr(tmp_path / "a.exr")


def test_a_part_of_a_picture_is_refused(tmp_path: Path) -> None:
    whole = (np.array([0, 0], dtype=np.int32), np.array([7, 3], dtype=np.int32))
    with pytest.raises(InputError, match="holds another part than the picture"):
        read_exr(written(tmp_path / "a.exr", "RGB", displayWindow=whole))
