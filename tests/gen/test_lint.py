"""Emitted Verilog is clean for Verilator and slang, up to reasoned waivers, and for Icarus as Verilog-2001."""

import re
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from lightloom.rtl.buses import module_name
from lightloom.rtl.catalogue import CATALOGUE
from lightloom.rtl.config import PRESETS
from lightloom.sim import toolchain
from lightloom.sim.emitted import emitted as emitted_text
from lightloom.sim.run_traversal_bench import SMALL
from tests import ROOT
from tests.needs import need_package
from tests.simulators import needs_icarus

WAIVERS = ROOT / "gen" / "lint.vlt"

SLANG_WAIVERS: dict[str, str] = {
    "unused-but-set-net": "Verilator looks for these, and gen/lint.vlt says which may stay",
    "arith-op-mismatch": "operands narrower than the result: Amaranth gives the result its width",
    "bitwise-op-mismatch": "the same of and, or, exclusive or",
    "sign-conversion": "Verilog extends signed operands by their sign; the result is a plain vector",
}
"""Warnings of slang that emitted Verilog may give, with the reason. All others of -Weverything are errors."""
SHIFT = re.compile(r" (<<<?|>>>?) ")
"""width-trunc is waived for an assigned shift alone: nobody reads its highest bits, and Yosys narrows the result."""

LINTED = [pytest.param(preset, marks=pytest.mark.long if preset == "full" else ()) for preset in PRESETS]
"""The largest preset takes longest to emit, and differs from the others in numbers alone."""


def files_of(folder: Path, unit: str) -> list[Path]:
    """The Verilog of an emitted unit."""
    return [path for path in (folder / f"{unit}.v", folder / f"{unit}_memories.v") if path.exists()]


def lint(*files: Path, top: str) -> str:
    verilator = toolchain.verilator()
    command = [verilator.binary, "--lint-only", "-Wall", "--top-module", top, *map(str, files)]
    done = subprocess.run(command, env=verilator.env, capture_output=True, text=True)
    return done.stderr


@pytest.mark.parametrize("preset", LINTED)
def test_verilator(emitted: Callable[[str], Path], preset: str) -> None:
    for unit in CATALOGUE:
        assert lint(WAIVERS, *files_of(emitted(preset), unit), top=unit) == "", unit


@pytest.mark.icarus
@needs_icarus
@pytest.mark.parametrize("preset", LINTED)
def test_icarus_as_verilog_2001(emitted: Callable[[str], Path], preset: str) -> None:
    for unit in CATALOGUE:
        command = [toolchain.icarus(), "-g2001", "-Wall", "-tnull", "-s", unit]
        command += map(str, files_of(emitted(preset), unit))
        done = subprocess.run(command, capture_output=True, text=True)
        assert (done.returncode, done.stdout, done.stderr) == (0, "", ""), unit


def slang(*sources: Path) -> list[str]:
    """What slang says about files, parsed, elaborated and analysed, that is not waived: message and line."""
    pyslang = need_package("pyslang", "slang is missing: pip install pyslang")
    driver = pyslang.driver.Driver()
    driver.addStandardArgs()
    options = ["-Weverything", *(f"-Wno-{name}" for name in SLANG_WAIVERS)]
    assert driver.parseCommandLine(" ".join(["slang", *options, *map(str, sources)]))
    assert driver.processOptions()
    assert driver.parseAllSources()
    compilation = driver.createCompilation()
    diagnostics = [*compilation.getAllDiagnostics(), *driver.runAnalysis(compilation).getDiagnostics()]
    engine = driver.diagEngine
    engine.clearClients()
    client = pyslang.TextDiagnosticClient()
    client.showColors(False)
    engine.addClient(client)
    for diagnostic in diagnostics:
        engine.issue(diagnostic)
    said = client.getString().splitlines()
    heard = [(line, said[k + 1]) for k, line in enumerate(said) if re.search(r": (warning|error): ", line)]
    return [
        f"{message}\n{line}"
        for message, line in heard
        if not (message.endswith("[-Wwidth-trunc]") and SHIFT.search(line))
    ]


@pytest.mark.parametrize("preset", LINTED)
def test_slang(emitted: Callable[[str], Path], preset: str) -> None:
    for unit in CATALOGUE:
        assert slang(*files_of(emitted(preset), unit)) == [], unit


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


def test_slang_hears_real_faults(tmp_path: Path) -> None:
    """A truncated sum, an output that is driven twice and a port that does not exist."""
    source = tmp_path / "faulty.v"
    source.write_text(
        "module part (input p, output q);\n  assign q = p;\nendmodule\n"
        "module faulty (input [7:0] a, input c, output [6:0] b, output d);\n"
        "  assign b = a + 8'd1;\n"
        "  assign d = c;\n"
        "  part part (.p(c), .q(d), .r(c));\n"
        "endmodule\n"
    )
    heard = "\n".join(slang(source))
    for what in ("width-trunc", "port-coercion", "'r'"):
        assert what in heard, heard


def test_every_waiver_has_a_reason_and_is_narrow() -> None:
    lines = WAIVERS.read_text().splitlines()
    for number, line in enumerate(lines):
        if line.startswith("lint_off"):
            above = lines[number - 1]
            assert above.startswith(("//", "lint_off")), f"{line}: no reason above it"
            assert "-match" in line, f"{line}: waives a whole rule"


# --- behind a bus -----------------------------------------------------------------------------------------------------


@pytest.fixture(
    params=[
        ("float_add", PRESETS["tiny"]),
        ("half_to_float", PRESETS["base"]),
        ("traversal", SMALL),
        pytest.param(("traversal", SMALL.but(units=2)), marks=pytest.mark.long),
    ],
    ids=["float_add", "half_to_float", "traversal", "array"],
)
def front(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    """The Verilog of a unit behind registers."""
    unit, config = request.param
    path = tmp_path / f"{module_name(unit, 'axi4-lite')}.v"
    path.write_text(emitted_text(unit, config, bus="axi4-lite"), encoding="utf-8")
    return path


def test_behind_a_bus(front: Path) -> None:
    assert lint(WAIVERS, front, top=front.stem) == ""
    unused = [warning for warning in slang(front) if "prot'" not in warning]  # gen/lint.vlt says why these may stay
    assert unused == []


@pytest.mark.icarus
@needs_icarus
def test_behind_a_bus_as_verilog_2001(front: Path) -> None:
    command = [toolchain.icarus(), "-g2001", "-Wall", "-tnull", "-s", front.stem, str(front)]
    done = subprocess.run(command, capture_output=True, text=True)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
