"""`lightloom compare`: measures against values worked out by hand, and what it refuses."""

import json
from pathlib import Path

import numpy as np
import OpenEXR
import pytest
from PIL import Image

from lightloom.shared.difference import compare_bits, energy_ratio, relative_mse
from lightloom.shared.pictures import linear_to_srgb, srgb_to_linear

from .conftest import Run


def write_exr(path: Path, pixels: np.ndarray) -> Path:
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    with OpenEXR.File(header, {"RGB": pixels.astype(np.float32)}) as file:
        file.write(str(path))
    return path


def write_png(path: Path, pixels: np.ndarray) -> Path:
    Image.fromarray(pixels.astype(np.uint8)).save(path)
    return path


GREY = np.full((24, 32, 3), 128)


def test_bits_of_zero_and_nan() -> None:
    a = np.array([0.0, -0.0, np.nan, 1.0], dtype=np.float32)
    assert compare_bits("x", a, a.copy()).identical
    b = a.copy()
    b[1] = 0.0
    b.view(np.uint32)[2] = 0x7FC00001
    result = compare_bits("x", a, b)
    assert (result.identical, result.differing) == (False, 2)
    assert result.first is not None
    assert (result.first["index"], result.first["a_hex"], result.first["b_hex"]) == ([1], "0x80000000", "0x00000000")


def test_other_shape_or_type_differs() -> None:
    a = np.zeros((2, 3), dtype=np.float32)
    assert compare_bits("x", a, a.astype(np.float64)).note == "float32 2x3 against float64 2x3"
    assert compare_bits("x", a, a[:1]).note == "float32 2x3 against float32 1x3"


def test_measures() -> None:
    a, b = np.array([1.0, 3.0, np.inf]), np.array([1.0, 2.0, 5.0])
    assert relative_mse(a, b) == pytest.approx((0 + 1 / 4.01) / 2)
    assert energy_ratio(a, b) == pytest.approx(4 / 3)
    assert energy_ratio(a, np.zeros(3)) is None


def test_srgb_both_ways() -> None:
    x = np.arange(256) / 255
    np.testing.assert_array_equal(np.rint(255 * linear_to_srgb(srgb_to_linear(x))), np.arange(256))


def test_same_pictures(cli: Run, tmp_path: Path) -> None:
    a, b = (write_png(tmp_path / name, GREY) for name in ("a.png", "b.png"))
    outcome = cli("compare", a, b, "--json")
    assert outcome.code == 0
    (found,) = json.loads(outcome.out)["comparisons"]
    assert (found["identical"], found["relative_mse"], found["energy_ratio"], found["flip"]) == (True, 0, 1, 0)
    assert "same" in cli("compare", a, b).out


def test_different_pictures(cli: Run, tmp_path: Path) -> None:
    brighter = GREY.copy()
    brighter[5, 7, 2] += 40
    a, b = write_png(tmp_path / "a.png", brighter), write_png(tmp_path / "b.png", GREY)
    outcome = cli("compare", a, b, "--json", "--out", tmp_path / "out")
    assert outcome.code == 1
    (found,) = json.loads(outcome.out)["comparisons"]
    assert (found["differing"], found["first"]["index"]) == (1, [5, 7, 2])
    assert (found["first"]["a_hex"], found["first"]["b_hex"]) == ("0xA8", "0x80")
    assert found["energy_ratio"] > 1
    assert 0 < found["flip"] < 0.05
    assert json.loads((tmp_path / "out" / "difference.json").read_text()) == json.loads(outcome.out)
    with Image.open(tmp_path / "out" / "a.difference.png") as picture:
        assert picture.width > 2 * 320


@pytest.mark.parametrize("reference", [0.0, 1e-30, 0.25], ids=["black", "almost black", "grey"])
def test_light(cli: Run, tmp_path: Path, reference: float) -> None:
    """FLIP's own library would end the process on a black reference."""
    a = write_exr(tmp_path / "a.exr", np.full((16, 16, 3), 0.5))
    b = write_exr(tmp_path / "b.exr", np.full((16, 16, 3), reference))
    outcome = cli("compare", a, b, "--json")
    assert outcome.code == 1
    (found,) = json.loads(outcome.out)["comparisons"]
    assert found["relative_mse"] == pytest.approx((0.5 - reference) ** 2 / (reference**2 + 0.01))
    assert found["flip"] > 0.1


def test_light_that_is_not_finite(cli: Run, tmp_path: Path) -> None:
    pixels = np.full((16, 16, 3), 0.5)
    b = write_exr(tmp_path / "b.exr", pixels)
    pixels[3, 3] = np.nan
    a = write_exr(tmp_path / "a.exr", pixels)
    (found,) = json.loads(cli("compare", a, b, "--json").out)["comparisons"]
    assert (found["differing"], found["flip"], found["relative_mse"]) == (3, None, 0)


def test_arrays(cli: Run, tmp_path: Path) -> None:
    t = np.arange(5, dtype=np.float32)
    record = np.zeros(2, dtype=[("u", "<f4"), ("hit", "?")])
    np.savez(tmp_path / "a.npz", t=t, primitive=np.arange(5), record=record)
    later = t.copy()
    later[3] = np.nextafter(later[3], np.float32(9))
    np.savez(tmp_path / "b.npz", t=later, primitive=np.arange(5), record=record, more=t)
    outcome = cli("compare", tmp_path / "a.npz", tmp_path / "b.npz", "--json")
    assert outcome.code == 1
    found = {entry["name"]: entry for entry in json.loads(outcome.out)["comparisons"]}
    assert {name for name, entry in found.items() if entry["identical"]} == {"primitive", "record.u", "record.hit"}
    assert (found["t"]["first"]["a_hex"], found["t"]["first"]["b_hex"]) == ("0x40400000", "0x40400001")
    assert found["more"]["note"] == "only in B"
    assert "0x40400001" in cli("compare", tmp_path / "a.npz", tmp_path / "b.npz").out


def test_folders(cli: Run, tmp_path: Path) -> None:
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        write_png(tmp_path / name / "0000.png", GREY)
    a, b = tmp_path / "a", tmp_path / "b"
    assert cli("compare", a, b).code == 0
    write_png(b / "0001.png", GREY)
    write_png(a / "0002.png", GREY)
    write_png(b / "0002.png", GREY + 1)
    outcome = cli("compare", a, b, "--json", "--out", tmp_path / "out")
    assert outcome.code == 1
    found = {entry["name"]: entry for entry in json.loads(outcome.out)["comparisons"]}
    assert [found[f"000{k}.png"]["identical"] for k in range(3)] == [True, False, False]
    assert found["0001.png"]["note"] == "only in B"
    assert (tmp_path / "out" / "0002.difference.png").exists()


def test_refusals(cli: Run, tmp_path: Path) -> None:
    a = write_png(tmp_path / "a.png", GREY)
    (tmp_path / "empty").mkdir()
    cut = tmp_path / "cut.png"
    cut.write_bytes(a.read_bytes()[:60])
    for name in ("cut.exr", "cut.npz", "words.txt"):
        (tmp_path / name).write_bytes(b"PK\x03\x04 no such thing")
    whole = write_exr(tmp_path / "whole.exr", np.random.default_rng(0).random((40, 40, 3))).read_bytes()
    (tmp_path / "end.exr").write_bytes(whole[:-50])
    np.savez(tmp_path / "names.npz", names=np.array(["a", "b"]))
    cli("compare", a, tmp_path / "none.png").refused("none.png", "no such file")
    cli("compare", a, tmp_path / "empty").refused("one kind")
    cli("compare", tmp_path / "empty", tmp_path / "empty").refused("empty", ".png")
    cli("compare", a, cut).refused("cut.png", "not a readable PNG")
    cli("compare", tmp_path / "end.exr", tmp_path / "whole.exr").refused("end.exr", "not a readable EXR")
    for kind in ("exr", "npz"):
        cli("compare", tmp_path / f"cut.{kind}", tmp_path / f"cut.{kind}").refused(f"cut.{kind}", "not a readable")
    cli("compare", tmp_path / "words.txt", a).refused("words.txt", ".png, .exr or .npz")
    cli("compare", tmp_path / "names.npz", tmp_path / "names.npz").refused("names", "only numbers")
    # A folder with files of others is left as it is, even though the comparison itself would be done.
    cli("compare", a, a, "--out", tmp_path).refused("did not write")
