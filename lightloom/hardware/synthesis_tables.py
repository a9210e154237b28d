"""What `lightloom synth` shows and writes."""

import shutil
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from lightloom.gen.flow import timing, tools
from lightloom.golden_model.host.outputs import whole_folder
from lightloom.hardware.synthesis import Measured
from lightloom.shared.console import json_text, print_table

UNIT = {"unit": "unit", "preset": "preset"}
MADE_OF = {"flip_flops": "flip-flops", "memory_bits": "memory bits"}
GATES = {**UNIT, "gates": "gates", "logic_gates": "logic alone", **MADE_OF}
MAPPED = {
    **UNIT,
    **MADE_OF,
    "cells": "cells",
    "area_um2": "area µm²",
    "whole_area_um2": "with memories µm²",
    "fmax_mhz": "MHz",
    "slack_ns": "slack ns",
    "path_cells": "deep",
    "path_start": "from",
    "path_end": "to",
}
MODULES = ("unit", "preset", "module", "instances", "gates_each", "gates")
MACROS = ("unit", "preset", "memory", "depth", "width", "reads", "macro", "macros", "filled", "memory_area_um2")
CHECKS = ("unit", "preset", "library", "seed", "vectors", "mismatches", "first")

SINGLE_PORT = (
    "Macros: the least area that holds the words; for each read port a copy, and of that a macro for the read and one "
    "for each write, as macros of one port need. What is smaller in flip-flops stays in them."
)


def print_tables(report: dict[str, Any], modules: bool, with_library: bool) -> None:
    """Presets of a unit stand below each other."""
    rows = report["rows"]
    title = f"Synthesis, {rows[0]['library']}" if with_library else "Synthesis, two-input-gate equivalents"
    if with_library and rows[0]["clock_ns"] is not None:
        title += f", {rows[0]['clock_ns']:g} ns asked for, before layout"
    columns = MAPPED if with_library else GATES
    print_table(title, list(columns.values()), [[row[key] for key in columns] for row in rows])
    if modules:
        _print("Area by module, in gates, each synthesised on its own", report["modules"], MODULES)
    if rows[0]["macros"] is not None:
        _print("Memories in macros, an estimate", report["memories"], MACROS)
        print(SINGLE_PORT)
    if report["checks"]:
        _print("Netlists against the golden model", report["checks"], CHECKS)
    if with_library and tools.path_of(timing.PROGRAM) is None:
        print("OpenSTA is not installed (Debian: apt install opensta): no timing", file=sys.stderr)


def _print(title: str, rows: Sequence[dict[str, Any]], columns: Sequence[str]) -> None:
    names = [name.replace("_um2", " µm²").replace("_", " ") for name in columns]
    print_table(title, names, [[row[name] for name in columns] for row in rows])


def write(out: Path, measured: Sequence[Measured], report: dict[str, Any]) -> None:
    """Netlists and timing reports, named <unit>.<preset>.v and .timing.txt, and synthesis.json."""
    with whole_folder(out) as folder:
        (folder / "synthesis.json").write_text(json_text(report), encoding="utf-8")
        for one in measured:
            for name, suffix in (("mapped.v", ".v"), (timing.REPORT, ".timing.txt"), ("memories.lib", ".memories.lib")):
                if (one.folder / name).exists():
                    shutil.copy(one.folder / name, folder / f"{one.unit}.{one.preset}{suffix}")
