"""The commands, each on something small but real."""

import json
import re
import shlex
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.main import get_command

from lightloom.cli import app
from lightloom.golden_model.contract.formats import RAY
from lightloom.golden_model.contract.interfaces import PURE
from lightloom.golden_model.scene.files.load import load_scene
from lightloom.golden_model.tracing.bvh.traversal import trace
from lightloom.pages import command_line
from lightloom.rtl.catalogue import CATALOGUE
from lightloom.rtl.config import PRESETS
from tests import ROOT

from .conftest import PROGRAM, Run, files_below

COMMANDS: dict[str, Any] = get_command(app).commands  # type: ignore[attr-defined]
EXAMPLE = re.compile(r"^ +(lightloom .*)$", re.MULTILINE)


# --- help -----------------------------------------------------------------------------------------------------------


def test_page_is_the_programs_help() -> None:
    page = ROOT / "docs" / "command-line.md"
    assert page.read_text() == command_line.page() + "\n", "renew it: python -m lightloom.pages.command_line > docs/…"


def test_the_table_of_parameters_is_the_programs() -> None:
    page = ROOT / "docs" / "emission.md"
    table = re.search(r"^\| parameter \|.*?(?=\n\n)", page.read_text(), re.MULTILINE | re.DOTALL)
    assert table is not None
    assert table[0] == command_line.parameters(), "renew it: python -m lightloom.pages.command_line parameters"


@pytest.mark.parametrize("name", COMMANDS)
def test_help_has_examples_that_parse(cli: Run, name: str) -> None:
    text = cli(name, "--help").out
    examples = EXAMPLE.findall(text)
    assert examples
    for example in examples:
        words = shlex.split(example.split(">")[0])
        command = COMMANDS[words[1]]
        with command.make_context(words[1], words[2:]) as context:
            assert context.params


def test_presets_have_their_meaning_in_the_help(cli: Run) -> None:
    text = cli("emit", "--help").out
    for preset in PRESETS:
        assert re.search(rf"^ +{preset} +\S", text, re.MULTILINE)


def test_without_arguments_there_is_help(cli: Run) -> None:
    assert cli().out == cli("--help").out
    assert cli().code == 0


def test_version(cli: Run) -> None:
    assert re.fullmatch(r"lightloom \d+\.\d+\.\d+\n", cli("--version").out)


def test_help_is_quick() -> None:
    """What takes long to import is left to the commands that need it."""
    heavy = {
        "amaranth",
        "numba",
        "rich",
        "PIL",
        "pygltflib",
        "mapbox_earcut",
        "xatlas",
        "OpenEXR",
        "flip_evaluator",
        "jinja2",
    }
    program = (
        "import sys; from lightloom import cli; assert cli.run(['emit', '--help']) == 0; "
        f"print(sorted({heavy!r} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "[]"


# --- emit -----------------------------------------------------------------------------------------------------------


def test_emit(cli: Run, tmp_path: Path) -> None:
    names = ["float_compare", "float_minmax"]
    outcome = cli("emit", *names, "--preset", "tiny", "--out", tmp_path / "verilog", "--json")
    assert outcome.code == 0
    report = json.loads(outcome.out)
    assert [row["unit"] for row in report["units"]] == names
    for row in report["units"]:
        manifest = json.loads((tmp_path / "verilog" / f"{row['unit']}.json").read_text())
        assert (manifest["preset"], manifest["latency"]) == ("tiny", row["latency"])
        assert f"module {row['unit']}(" in (tmp_path / "verilog" / f"{row['unit']}.v").read_text()
    # A folder of an earlier call is replaced, not mixed with.
    assert cli("emit", names[0], "--out", tmp_path / "verilog").code == 0
    assert not (tmp_path / "verilog" / f"{names[1]}.v").exists()


def test_emit_list(cli: Run) -> None:
    rows = json.loads(cli("emit", "--list", "--json").out)["units"]
    assert [row["unit"] for row in rows] == list(CATALOGUE)
    for row in rows:
        if row["unit"] not in PURE:
            assert row["initiation_interval"] is row["latency"] is None
        else:
            assert row["initiation_interval"] >= 1
            assert row["latency"] >= 0
    assert "ray_triangle" in cli("emit", "--list").out


# --- render ---------------------------------------------------------------------------------------------------------

SMALL = ("--frames", 3, "--size", "24x16", "--budget", 600)


def test_render(cli: Run, tmp_path: Path, room: Path) -> None:
    for name, backend in (("a", "numpy"), ("b", "auto")):
        outcome = cli("render", room, *SMALL, "--exr", "--out", tmp_path / name, "--json", "--backend", backend)
        assert outcome.code == 0, outcome
    written = files_below(tmp_path / "a")
    assert {f"frames/000{k}.{kind}" for k in range(3) for kind in ("png", "exr")} <= written
    assert {"film.webp", "contact-sheet.png", "lightmap/0002.png", "lightmap/0002.exr", "render.json"} <= written
    report = json.loads(outcome.out)
    assert report == json.loads((tmp_path / "b" / "render.json").read_text())
    assert [sum(row["rays"].values()) <= 600 for row in report["frames"]] == [True] * 3
    assert sum(row["texels"] for row in report["frames"]) * 20 <= 3 * 600
    assert (
        report["lightmap"]["valid"] + report["lightmap"]["empty"] + report["lightmap"]["buried"]
        == (report["lightmap"]["texels"])
    )
    # Whatever traces the rays, the bits are the same.
    for kind in ("frames", "lightmap"):
        assert cli("compare", tmp_path / "a" / kind, tmp_path / "b" / kind).code == 0
    other = cli("render", room, *SMALL, "--exr", "--seed", 5, "--out", tmp_path / "c")
    assert "texels maintained" in other.out
    assert cli("compare", tmp_path / "a" / "lightmap", tmp_path / "c" / "lightmap").code == 1


def test_supersampled_frames_have_the_size_asked_for(cli: Run, tmp_path: Path, room: Path) -> None:
    from PIL import Image

    command = ["render", room, *SMALL, "--supersample", 3, "--exposure", 0.5, "--out", tmp_path / "a", "--json"]
    report = json.loads(cli(*command).out)
    assert (report["width"], report["height"], report["exposure"]) == (24, 16, 0.5)
    with Image.open(tmp_path / "a" / "frames" / "0000.png") as image:
        assert image.size == (24, 16)


def test_interrupt_leaves_nothing(tmp_path: Path, room: Path) -> None:
    before = files_below(tmp_path)
    command = [str(PROGRAM), "render", str(room), "--frames", "100000", "--size", "64x64", "--out", "out"]
    for how, code in ((signal.SIGINT, 130), (signal.SIGTERM, 143)):
        # In the background of a shell these tests ignore interrupts, and what they start would too.
        handler = signal.signal(signal.SIGINT, signal.default_int_handler)
        process = subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        signal.signal(signal.SIGINT, handler)
        try:
            deadline = time.monotonic() + 60
            while not list(tmp_path.glob(".out.*/frames/0001.png")):
                assert time.monotonic() < deadline
                assert process.poll() is None, process.communicate()
                time.sleep(0.05)
            process.send_signal(how)
            out, err = process.communicate(timeout=60)
        finally:
            process.kill()  # where the test has failed
        assert (process.returncode, out) == (code, "")
        assert "Traceback" not in err
        assert files_below(tmp_path) == before


# --- trace and irradiance -------------------------------------------------------------------------------------------


def some_rays(count: int) -> np.ndarray:
    rng = np.random.default_rng(7)
    rays = np.zeros(count, dtype=RAY)
    rays["origin"] = (278, 273, 200)
    rays["direction"] = rng.normal(size=(count, 3))
    rays["direction"][0] = 0  # invalid: misses
    rays["t_max"] = np.where(np.arange(count) % 3, np.inf, 1.0)
    return rays


@pytest.fixture
def rays_file(tmp_path: Path) -> Path:
    rays = some_rays(300)
    np.savez(tmp_path / "rays.npz", **{name: rays[name] for name in rays.dtype.names or ()})  # type: ignore[arg-type]
    return tmp_path / "rays.npz"


@pytest.mark.usefixtures("quickly_built")
@pytest.mark.parametrize(("any_hit", "option"), [(False, "--tracer"), (True, "--backend")])
def test_trace(cli: Run, tmp_path: Path, rays_file: Path, any_hit: bool, option: str) -> None:
    from lightloom.golden_model.tracing.bvh.build import build

    options = ["--any-hit"] if any_hit else []
    golden, rtl = tmp_path / "golden.npz", tmp_path / "rtl.npz"
    assert cli("trace", "cornell-box", "--rays", rays_file, "--out", golden, *options).code == 0
    outcome = cli("trace", "cornell-box", "--rays", rays_file, "--out", rtl, option, "rtl", "--json", *options)
    assert outcome.code == 0, outcome
    assert json.loads(outcome.out)["backend"] == "rtl"
    want = trace(build(load_scene("cornell-box").triangles), some_rays(300), any_hit=any_hit)
    with np.load(golden) as file:
        assert set(file.files) == {"primitive", "t", "u", "v"}
        assert file["primitive"].dtype == np.int32
        for name in file.files:
            np.testing.assert_array_equal(file[name], want[name])
    assert json.loads(outcome.out)["hits"] == int((want["primitive"] >= 0).sum())
    assert 0 < json.loads(outcome.out)["hits"] < 300
    assert cli("compare", golden, rtl).code == 0
    assert golden.read_bytes() == rtl.read_bytes()


def test_no_rays(cli: Run, tmp_path: Path, room: Path) -> None:
    rays = some_rays(1)[:0]
    np.savez(tmp_path / "rays.npz", **{name: rays[name] for name in rays.dtype.names or ()})  # type: ignore[arg-type]
    assert cli("trace", room, "--rays", tmp_path / "rays.npz", "--out", tmp_path / "hits.npz").code == 0
    with np.load(tmp_path / "hits.npz") as file:
        assert {name: file[name].shape for name in file.files} == dict.fromkeys(("primitive", "t", "u", "v"), (0,))


def test_irradiance(cli: Run, tmp_path: Path, room: Path) -> None:
    """Below the lamp it is light, behind the wall it is dark; the normal's length does not matter."""
    position = np.array([[0, 0.01, 0], [0, 0.01, 0], [0, 1, -2.5]], dtype=np.float32)
    normal = np.array([[0, 1, 0], [0, 7, 0], [0, 0, -1]], dtype=np.float32)
    np.savez(tmp_path / "points.npz", position=position, normal=normal)
    command = ["irradiance", room, "--points", tmp_path / "points.npz", "--samples", 64, "--json"]
    for name in ("a.npz", "b.npz"):
        outcome = cli(*command, "--out", tmp_path / name)
        assert outcome.code == 0, outcome
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()
    with np.load(tmp_path / "a.npz") as file:
        light = file["irradiance"]
    assert (light.shape, light.dtype) == ((3, 3), np.float32)
    # The lamp alone, a square of side 2 at height 3 with radiance 5; then there is what the wall reflects.
    quarter = 2 / np.sqrt(10) * np.arctan(1 / np.sqrt(10)) / (2 * np.pi)
    lamp = 4 * quarter * np.pi * 5
    assert (light[:2] > 0.98 * lamp).all()
    assert (light[:2] < 1.4 * lamp).all()
    assert (light[2] == 0).all()
    assert json.loads(outcome.out)["points"] == 3


# --- bench ----------------------------------------------------------------------------------------------------------


@pytest.mark.usefixtures("quick_verilog", "coarse_cornell_box")
def test_bench(cli: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    """It runs and has its keys; how fast is no matter of tests."""
    for module in ("lightloom.bench.tree", "lightloom.bench.frames"):
        monkeypatch.setattr(f"{module}.BUNNY", Path("no such file"))
    for name, less in {"SIDE": 48, "BUDGET": 1000, "WARM_UP": 1, "FRAMES": 2}.items():
        monkeypatch.setattr(f"lightloom.bench.frames.{name}", less)
    outcome = cli("bench", "--vectors", 1000, "--rays", 200, "--json")
    assert outcome.code == 0, outcome
    report = json.loads(outcome.out)
    assert {row["benchmark"] for row in report["results"]} == {"ray-triangle", "tracing", "frames", "emission"}
    for row in report["results"]:
        assert set(row) == {"benchmark", "what", "value", "unit"}
        assert row["value"] >= 0
    assert report["machine"]["cores"] >= 1
    assert "numpy" in report["versions"]
