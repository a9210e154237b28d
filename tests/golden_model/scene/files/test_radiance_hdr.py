"""Radiance pictures against Mitsuba's own writer, and damaged ones."""

from pathlib import Path

import numpy as np
import pytest

from lightloom.golden_model.host.errors import InputError, InputWarning
from lightloom.golden_model.scene.files.radiance_hdr import USUAL_PRIMARIES, read_hdr
from tests.golden_model.mitsuba_scenes import mitsuba

HEAD = b"#?RADIANCE\n# of a test\nFORMAT=32-bit_rle_rgbe\n\n"


@pytest.mark.parametrize("shape", [(5, 7), (3, 8), (4, 300), (2, 129)])
def test_what_mitsuba_writes(tmp_path: Path, shape: tuple[int, int]) -> None:
    """Narrow ones plainly, wide ones in runs, of which flat pictures have long ones; the same bits as it reads."""
    mi = mitsuba()
    rng = np.random.default_rng(7)
    light = rng.uniform(0, 1, (*shape, 3)) * 2.0 ** rng.integers(-12, 12, (*shape, 1))
    light[:, : shape[1] // 2] = [0.5, 0, 3]
    light[0, -1] = 0
    path = tmp_path / "a.hdr"
    mi.Bitmap(light.astype(np.float32)).write(str(path))
    found = read_hdr(path)
    assert found.dtype == np.float32
    np.testing.assert_array_equal(
        found, np.array(mi.Bitmap(str(path)).convert(component_format=mi.Struct.Type.Float32))
    )
    assert np.abs(found - light).max(axis=-1) == pytest.approx(0, abs=light.max() / 128)


def test_by_hand(tmp_path: Path) -> None:
    path = tmp_path / "a.hdr"
    path.write_bytes(HEAD + b"-Y 1 +X 3\n" + bytes([128, 64, 0, 129, 1, 2, 3, 0, 255, 1, 1, 136]))
    assert read_hdr(path).tolist() == [[[1, 0.5, 0], [0, 0, 0], [255, 1, 1]]]
    runs = bytes([2, 2, 0, 9, 137, 7, 9, 1, 2, 3, 4, 5, 6, 7, 8, 9, 137, 0, 130, 128, 135, 136])
    path.write_bytes(HEAD + b"-Y 1 +X 9\n" + runs)
    found = read_hdr(path)[0]
    assert found[:, 1].tolist() == [k / 256 for k in range(1, 3)] + [float(k) for k in range(3, 10)]
    assert found[:, 0].tolist() == [7 / 256] * 2 + [7.0] * 7


@pytest.mark.parametrize("line", ["PRIMARIES=.7 .3 .2 .7 .1 .1 .3 .3", "PIXASPECT=2", "GAMMA=2.2"])
def test_what_is_left_out_is_said(tmp_path: Path, line: str) -> None:
    path = tmp_path / "a.hdr"
    path.write_bytes(HEAD.replace(b"# of a test", line.encode()) + b"-Y 1 +X 1\n" + bytes([128, 64, 0, 129]))
    with pytest.warns(InputWarning, match=f"a.hdr: left out: `{line.partition('=')[0]}`"):
        assert read_hdr(path).tolist() == [[[1, 0.5, 0]]]
    usual = "PRIMARIES=" + USUAL_PRIMARIES
    path.write_bytes(HEAD.replace(b"# of a test", usual.encode()) + b"-Y 1 +X 1\n" + bytes([128, 64, 0, 129]))
    assert read_hdr(path).tolist() == [[[1, 0.5, 0]]]


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (b"", "it does not begin as one"),
        (b"GIF89a\n\n", "it does not begin as one"),
        (HEAD.replace(b"rgbe", b"xyze") + b"-Y 1 +X 1\n1234", "its FORMAT is not"),
        (HEAD.replace(b"# of a test", b"EXPOSURE=2") + b"-Y 1 +X 1\n1234", "it has an EXPOSURE"),
        (HEAD + b"+X 1 -Y 1\n1234", "its rows do not run downwards"),
        (HEAD + b"-Y 1 +X 20000\n1234", "larger than 16384"),
        (HEAD + b"-Y 0 +X 8\n", "or empty"),
        (HEAD + b"-Y one +X 8\n", "invalid literal"),
        (HEAD + b"-Y 1 +X 2\n1234123", "it ends too early"),
        (HEAD + b"-Y 1 +X 2\n" + bytes([9, 9, 9, 9, 1, 1, 1, 2]), "run lengths of the old kind"),
        (HEAD + b"-Y 1 +X 9\n" + bytes([2, 2, 0, 8]), "another width"),
        (HEAD + b"-Y 1 +X 9\n" + bytes([2, 2, 0, 9, 138, 7]), "a run is too long"),
        (HEAD + b"-Y 1 +X 9\n" + bytes([2, 2, 0, 9, 0, 7]), "a run is too long"),
        (HEAD + b"-Y 1 +X 9\n" + bytes([2, 2, 0, 9, 9, 1, 2]), "it ends too early"),
        (HEAD + b"-Y 1 +X 9\n" + bytes([2, 2, 0, 9]), "index out of range"),
    ],
)
def test_damaged_ones_are_refused(tmp_path: Path, data: bytes, said: str) -> None:
    path = tmp_path / "a.hdr"
    path.write_bytes(data)
    with pytest.raises(InputError, match=said) as caught:
        read_hdr(path)
    assert str(caught.value).startswith(f"{path}: not a readable Radiance picture")
