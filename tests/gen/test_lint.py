"""Emitted Verilog is clean for Verilator, up to the waivers in gen/lint.vlt, and for Icarus as Verilog-2001."""

import re
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from rtl.catalogue import CATALOGUE
from rtl.config import PRESETS
from sim import toolchain
from tests.simulators import needs_icarus

WAIVERS = Path(__file__).parents[2] / "gen" / "lint.vlt"


def lint(*files: Path, top: str) -> str:
    verilator = toolchain.verilator()
    command = [verilator.binary, "--lint-only", "-Wall", "--top-module", top, *map(str, files)]
    done = subprocess.run(command, env=verilator.env, capture_output=True, text=True)
    return done.stderr


@pytest.mark.parametrize("preset", PRESETS)
def test_verilator(emitted: Callable[[str], Path], preset: str) -> None:
    for unit in CATALOGUE:
        assert lint(WAIVERS, emitted(preset) / f"{unit}.v", top=unit) == "", unit


@pytest.mark.icarus
@needs_icarus
@pytest.mark.parametrize("preset", PRESETS)
def test_icarus_as_verilog_2001(emitted: Callable[[str], Path], preset: str) -> None:
    for unit in CATALOGUE:
        command = [toolchain.icarus(), "-g2001", "-Wall", "-tnull", "-s", unit, str(emitted(preset) / f"{unit}.v")]
        done = subprocess.run(command, capture_output=True, text=True)
        assert (done.returncode, done.stdout, done.stderr) == (0, "", ""), unit


def test_waivers_hide_no_real_fault(tmp_path: Path) -> None:
    """A register that nobody reads, a truncated sum and a latch are still heard."""
    source = tmp_path / "faulty.v"
    source.write_text(
        "module faulty (input clk, input [7:0] a, output reg [7:0] b, output [6:0] c);\n"
        "  reg [7:0] forgotten;\n"
        "  always @(posedge clk) forgotten <= a;\n"
        "  assign c = a + 8'd1;\n"
        "  always @* if (clk) b = a;\n"
        "endmodule\n"
    )
    heard = set(re.findall(r"%Warning-(\w+)", lint(WAIVERS, source, top="faulty")))
    assert heard >= {"UNUSEDSIGNAL", "WIDTHTRUNC", "LATCH"}


def test_every_waiver_has_a_reason_and_is_narrow() -> None:
    lines = WAIVERS.read_text().splitlines()
    for number, line in enumerate(lines):
        if line.startswith("lint_off"):
            above = lines[number - 1]
            assert above.startswith(("//", "lint_off")), f"{line}: no reason above it"
            assert "-match" in line, f"{line}: waives a whole rule"
