"""The cocotb bench of every unit: that of units with a stream in and a stream out, or one of its own."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from lightloom.rtl.config import PRESETS, Config
from lightloom.sim.run_traversal_bench import SMALL, run_traversal_bench
from lightloom.sim.runner import run_bench
from lightloom.verif.vectors.unit_vectors import unit_vectors

SEED = 2024
OPERANDS = 4000
"""Of each test of a bench of streams."""
RAYS = 3000
"""Of the traversal unit's bench with all sides stalled."""


@dataclass(frozen=True, kw_only=True)
class UnitBench:
    """How a unit is tried."""

    config: Config
    """The hardware that it is tried on as a rule,"""
    called: str
    """and what that is called."""
    run: Callable[[Path, Config, str | None, bool], int]
    """Runs it on Verilator, in a folder, with a configuration, Verilog instead of the unit's own, and whether coverage
    is counted; returns how many tests passed. Raises BenchError where one fails."""


def _streams(unit: str) -> UnitBench:
    """Of a unit whose results depend on its operands alone."""

    def run(folder: Path, config: Config, verilog: str | None, coverage: bool) -> int:
        operands = unit_vectors(unit, OPERANDS, SEED)
        return run_bench(
            *(unit, "verilator"),
            operands=operands,
            seed=SEED,
            config=config,
            folder=folder,
            coverage=coverage,
            verilog=verilog,
        )

    return UnitBench(config=PRESETS["base"], called="base", run=run)


def _traversal(folder: Path, config: Config, verilog: str | None, coverage: bool) -> int:
    return run_traversal_bench(folder, "verilator", config, rays=RAYS, verilog=verilog, coverage=coverage)


OWN = {"traversal": UnitBench(config=SMALL, called="small", run=_traversal)}
"""Benches of units that need more than operands."""


def bench_of(unit: str) -> UnitBench:
    """The bench of a unit of the catalogue."""
    return OWN[unit] if unit in OWN else _streams(unit)
