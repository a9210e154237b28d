"""Runs the benches of units with everything counted: branches and toggles of the Verilog, bins of what was tried."""

import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from lightloom.golden_model.contract import bitpack
from lightloom.golden_model.contract.interfaces import PURE
from lightloom.golden_model.models import model_results
from lightloom.hardware.benches import SEED, Run, bench_of
from lightloom.rtl.catalogue import stream_unit
from lightloom.rtl.config import Config
from lightloom.shared.provenance import machine, versions
from lightloom.sim.bulk import BulkUnit
from lightloom.sim.coverage import exclusions, read_points, share, untaken
from lightloom.sim.emitted import emitted
from lightloom.verif.bins.coverage import Groups, noted, together
from lightloom.verif.bins.unit_bins import unit_bins
from lightloom.verif.vectors.unit_vectors import many_vectors

MANY = 200_000
"""Random operands of the bulk run that the bins are filled from."""
BAR = 0.95
"""Share of the branches that have to be taken; the others have to be explained."""


def measure(unit: str, out: Path) -> dict[str, Any]:
    """Measures a unit and leaves its Verilog in `out`: "row" is its figures; "bins" and "untaken"
    are rows; "wrong" are lines.

    Raises BenchError or BulkError where the unit is wrong, InputError where a tool is missing.
    """
    started = time.perf_counter()
    bench, pure = bench_of(unit), unit in PURE
    verilog = emitted(unit, bench.config)
    (out / f"{unit}.v").write_text(verilog, encoding="utf-8")
    with tempfile.TemporaryDirectory(prefix="lightloom-") as scratch:
        folder = Path(scratch)
        tests = bench.run(Run(folder=folder, config=bench.config, verilog=verilog, coverage=True))
        points = read_points(folder / "coverage.dat")
        bins = noted(folder / "bins.jsonl")
    if pure:
        bins = together([_possible(unit, bench.config, bins), _tried(unit, bench.config, verilog)])
    counts = {point: count for point, count in points.items() if not is_core(unit, point.module)}
    cores = share(n for point, n in points.items() if point.kind == "branch" and is_core(unit, point.module))
    missed, wrong = untaken(unit, counts, verilog, exclusions())
    counted = {
        kind: share(count for point, count in counts.items() if point.kind == kind) for kind in ("branch", "toggle")
    }
    filled = share(count for group in bins.values() for count in group.values())
    return {
        "row": {
            "unit": unit,
            "configuration": bench.called,
            "tests": tests,
            "branches": counted["branch"][1],
            "branches_taken": counted["branch"][0],
            "core_branches": cores[1],
            "core_branches_taken": cores[0],
            "branches_explained": sum(each.reason is not None for each in missed),
            "toggles": counted["toggle"][1],
            "toggles_seen": counted["toggle"][0],
            "bins": filled[1],
            "bins_filled": filled[0],
            "seconds": time.perf_counter() - started,
        },
        "bins": [
            {"unit": unit, "group": group, "bin": name, "count": count}
            for group, named in bins.items()
            for name, count in named.items()
        ],
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
        "wrong": wrong,
    }


def is_core(unit: str, module: str) -> bool:
    """Whether a module of a unit's Verilog is the core of another unit, which is counted there."""
    return any(module.startswith(f"{unit}_{other}_") for other in PURE)


def report_of(measured: Sequence[dict[str, Any]], command: str) -> dict[str, Any]:
    """What `measure` has given for each unit, as one report: rows of units, of bins, and of branches not taken."""
    return {
        "command": command,
        "versions": versions(),
        "machine": machine(),
        "rows": [each["row"] for each in measured],
        **{name: [row for each in measured for row in each[name]] for name in ("bins", "untaken", "wrong")},
    }


def faults(report: dict[str, Any]) -> list[str]:
    """Why a report does not pass, a line each."""
    rows = report["rows"]
    taken, number, explained = (
        sum(row[name] for row in rows) for name in ("branches_taken", "branches", "branches_explained")
    )
    lines = [f"{each}; sim/coverage_exclusions.toml is wrong" for each in report["wrong"]]
    if taken < BAR * number:
        lines.append(f"{taken} of {number} branches are taken ({explained} cannot be), less than {BAR:.0%}")
    for each in report["untaken"]:
        if each["reason"] is None:
            where = "{unit}.v:{line}:{column}: {arm} of `{source}`".format_map(each)
            lines.append(f"{where} is not taken, and nothing says why")
    for each in report["bins"]:
        if not each["count"]:
            lines.append("{unit}: {group}: {bin}: never seen".format_map(each))
    return lines


def _possible(unit: str, config: Config, bins: Groups) -> Groups:
    """The streams' bins but for those that a pipeline without a queue does not have.

    It stops as a whole. One that takes an operation a cycle holds its input exactly while its output is held. One that
    takes an operation every other cycle moves neither side in two cycles in a row; and where its latency is even, a
    result is there in the cycles in which an operation is taken, where it is odd, in the others.
    """
    never: dict[str, tuple[str, ...]]
    described = stream_unit(unit, config)
    if described.initiation_interval == 1:
        never = {"input and output": ("held, idle", "held, moves", "moves, held")}
    else:
        never = {
            "input and output": ("moves, held", "moves, moves" if described.latency % 2 else "held, moves"),
            "input": ("moves, then moves",),
            "output": ("moves, then moves", "moves, then held"),
        }
    return {
        group: {name: count for name, count in named.items() if count or name not in never.get(group, ())}
        for group, named in bins.items()
    }


def _tried(unit: str, config: Config, verilog: str) -> Groups:
    """Bins of the operands of a bulk run, whose results are the model's."""
    operands = many_vectors(unit, MANY, SEED)
    expected = model_results(unit, operands, config.flat())
    results = BulkUnit(unit, config, verilog=verilog).run(operands)
    if not bitpack.equal(results, expected).all():
        raise AssertionError(f"{unit}: results of many_vectors({unit!r}, {MANY}, {SEED}) are not the model's")
    return unit_bins(unit, operands, results)
