"""`lightloom sim`: a unit's bench from the command line, its waves and their save file, and what it refuses."""

import json
import re
from pathlib import Path

import pytest

from lightloom.cli import run
from lightloom.hardware.benches import Run, bench_of
from lightloom.hardware.simulate import simulate
from lightloom.sim import toolchain
from lightloom.sim.emitted import emitted
from tests.simulators import SIMULATORS, needs_waves

UNIT = "float_compare"


@needs_waves
@pytest.mark.parametrize("simulator", SIMULATORS)
def test_waves_by_fields(simulator: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The waves are an FST file, and what the save file shows is there: every port, and all bits of a payload."""
    out = tmp_path / "out"
    arguments = ["sim", UNIT, "--waves", "--only", "full_rate|reset", "--seed", "7", "--out", str(out), "--json"]
    assert run(arguments + (["--icarus"] if simulator == "icarus" else [])) == 0
    report = json.loads(capsys.readouterr().out)
    assert report["passed"]
    assert [test["test"].rpartition(".")[2] for test in report["tests"]] == ["full_rate", "reset_in_flight"]
    assert all(test["passed"] and not test["message"] for test in report["tests"])
    assert [Path(report[name]).name for name in ("log", "waves", "save")] == ["log.txt", f"{UNIT}.fst", f"{UNIT}.gtkw"]
    assert all(Path(report[name]).exists() for name in ("log", "waves", "save"))
    # An FST file begins with its header block: type 0, then 329 in eight bytes.
    assert (out / f"{UNIT}.fst").read_bytes()[:9] == b"\0" + (329).to_bytes(8, "big")
    saved = (out / f"{UNIT}.gtkw").read_text()
    ports = set(re.findall(r"^\+\{(\w+)\}", saved, re.MULTILINE))
    assert ports == {"clk", "rst", *(f"{side}__{name}" for side in "io" for name in ("valid", "ready", "payload"))}
    fields = {name: bits.split() for name, bits in re.findall(r"^#\{(.+?)\} (.*i__payload.*)$", saved, re.MULTILINE)}
    assert list(fields) == ["a", "b", "tag"]
    # From the left, where the tag is: 8 bits of tag, then b, then a.
    shown = fields["tag"] + fields["b"] + fields["a"]
    assert shown == [f"({place}){UNIT}.i__payload[71:0]" for place in range(72)]


def test_a_broken_unit_is_told(tmp_path: Path) -> None:
    bench = bench_of(UNIT)
    broken = emitted(UNIT, bench.config).replace("if (i__ready) tag0", "tag0")
    seen = simulate(UNIT, Run(folder=tmp_path, config=bench.config, verilog=broken, only="stalled"))
    assert not seen.passed
    assert any("a waiting result changed" in test["message"] for test in seen.tests if not test["passed"])


def test_a_table(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["sim", UNIT, "--only", "full_rate", "--preset", "tiny", "--out", str(tmp_path / "out")]) == 0
    out = capsys.readouterr().out
    assert "simulator: verilator\npreset: tiny\nseed: 2024\n" in out
    assert "full_rate" in out
    assert f"log: {tmp_path / 'out' / 'log.txt'}" in out


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["float_compar"], "did you mean float_compare"),
        ([UNIT, "--preset", "tin"], "did you mean tiny"),
        ([UNIT, "--seed", "-1"], "--seed -1: must be 0 to"),
        ([UNIT, "--only", "("], "--only (: is no regular expression"),
        ([UNIT, "--only", "nothing_is_called_so"], "--only nothing_is_called_so: no test of float_compare"),
    ],
)
def test_bad_input(arguments: list[str], said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["sim", *arguments, "--out", str(tmp_path / "out")]) == 2
    assert said in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_a_missing_library_is_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(toolchain, "has_header", lambda name: name != "lz4.h")
    assert run(["sim", UNIT, "--waves", "--out", str(tmp_path / "out")]) == 2
    assert "lz4.h not found; install it (Debian: apt install liblz4-dev)" in capsys.readouterr().err
