"""Runs the benches of units with everything counted: branches and toggles of the Verilog, bins of what was tried."""

import tempfile
import time
from pathlib import Path
from typing import Any

from golden_model import bitpack
from golden_model.units import OPERATORS, UNITS
from rtl.catalogue import CATALOGUE
from rtl.config import PRESETS
from sim.bulk import BulkUnit
from sim.coverage import exclusions, read_points, share, untaken
from sim.emitted import emitted
from sim.runner import run_bench
from verif.coverage import Groups, noted, together
from verif.number_bins import number_bins
from verif.ray_bins import ray_bins
from verif.traversal_bench import SMALL, run_traversal_bench
from verif.unit_vectors import many_vectors, unit_vectors

SEED = 2024
PRESET = "base"
OPERANDS = 8000
"""Of each test of a unit's bench."""
MANY = 200_000
"""Random ones of the bulk run that the bins are filled from."""
RAYS = 3000
"""Of the traversal unit's bench with all sides stalled."""
BAR = 0.95
"""Share of the branches that have to be taken or explained."""


def measure(unit: str, out: Path) -> dict[str, Any]:
    """Measures a unit and leaves its Verilog in `out`: a row of figures under "row", and "untaken", "bins", "wrong".

    Raises BenchError or BulkError where the unit is wrong, InputError where a tool is missing.
    """
    started = time.perf_counter()
    config = PRESETS[PRESET] if unit in UNITS else SMALL
    verilog = emitted(unit, config)
    (out / f"{unit}.v").write_text(verilog, encoding="utf-8")
    with tempfile.TemporaryDirectory(prefix="lightloom-") as scratch:
        folder = Path(scratch)
        if unit in UNITS:
            tests = run_bench(
                unit,
                "verilator",
                operands=unit_vectors(unit, OPERANDS, SEED),
                seed=SEED,
                config=config,
                module="verif.test_operators" if unit in OPERATORS else None,
                folder=folder,
                coverage=True,
                verilog=verilog,
            )
        else:
            tests = run_traversal_bench(folder, "verilator", config, rays=RAYS, verilog=verilog, coverage=True)
        counts = read_points(folder / "coverage.dat")
        bins = noted(folder / "bins.jsonl")
    if unit in UNITS:
        bins = together([_possible(unit, bins), _tried(unit, verilog)])
    missed, wrong = untaken(unit, counts, verilog, exclusions())
    row: dict[str, Any] = {"unit": unit, "preset": PRESET if unit in UNITS else "small", "tests": tests}
    for kind in ("branch", "toggle"):
        row[f"{kind}_hit"], row[f"{kind}_all"] = share(n for point, n in counts.items() if point.kind == kind)
    row["branch_explained"] = sum(each.reason is not None for each in missed)
    row["bins_hit"], row["bins_all"] = share(n for group in bins.values() for n in group.values())
    row["seconds"] = round(time.perf_counter() - started, 1)
    return {
        "row": row,
        "bins": bins,
        "wrong": wrong,
        "untaken": [
            {
                "unit": unit,
                "module": each.point.module,
                "line": each.point.line,
                "column": each.point.column,
                "arm": each.point.what,
                "source": each.source,
                "reason": each.reason,
            }
            for each in missed
        ],
    }


def _possible(unit: str, bins: Groups) -> Groups:
    """The streams' bins but for those that a pipeline without a queue does not have.

    It stops as a whole, so its input is held exactly while its output is, and nothing moves then.
    """
    if CATALOGUE[unit](PRESETS[PRESET]).initiation_interval != 1:  # type: ignore[attr-defined]
        return bins
    never = ("held, idle", "held, moves", "moves, held")
    both = {name: count for name, count in bins["input and output"].items() if name not in never}
    return bins | {"input and output": both}


def _tried(unit: str, verilog: str) -> Groups:
    """Bins of the operands of a bulk run, whose results are the model's."""
    operands = many_vectors(unit, MANY, SEED)
    expected = UNITS[unit].model(operands)
    results = BulkUnit(unit, PRESETS[PRESET], verilog=verilog).run(operands)
    if not bitpack.equal(results, expected).all():
        raise AssertionError(f"{unit}: results of many_vectors({unit!r}, {MANY}, {SEED}) are not the model's")
    return number_bins(unit, operands, results) if unit in OPERATORS else ray_bins(unit, operands, results)
