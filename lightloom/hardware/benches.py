"""The cocotb bench of every unit: that of units with a stream in and a stream out, or one of its own."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from lightloom.golden_model.contract.interfaces import OPERATORS
from lightloom.rtl.config import PRESETS, Config
from lightloom.sim.run_traversal_bench import SMALL, TAGS, run_traversal_bench
from lightloom.sim.runner import run_bench
from lightloom.verif.vectors.unit_vectors import unit_vectors

SEED = 2024
OPERANDS = 4000
"""Of each test of a bench of streams."""
RAYS = 3000
"""Of the traversal unit's bench with all sides stalled."""


@dataclass(frozen=True, kw_only=True)
class Run:
    """One run of a bench; what is not said here is that of `sim.runner.run_cocotb`."""

    folder: Path
    config: Config
    simulator: str = "verilator"
    seed: int = SEED
    verilog: str | None = None
    """Instead of the unit's own."""
    only: str | None = None
    waves: bool = False
    coverage: bool = False

    def sized(self, whole: int, few: int) -> int:
        """Icarus, ten to a hundred times slower, gets fewer operands; it is there for what is undefined."""
        return whole if self.simulator == "verilator" else few


@dataclass(frozen=True, kw_only=True)
class UnitBench:
    """How a unit is tried."""

    config: Config
    """The hardware that it is tried on as a rule,"""
    called: str
    """and what that is called."""
    top: str
    """The module that the simulation runs, and the scope in it that has the unit's ports."""
    run: Callable[[Run], int]
    """Runs it; returns how many tests passed. Raises BenchError where one fails."""
    fitted: Callable[[Config], Config] = lambda config: config
    """What a configuration has to have changed for the bench."""


def _streams(unit: str) -> UnitBench:
    """Of a unit whose results depend on its operands alone."""

    def run(how: Run) -> int:
        count = how.sized(OPERANDS, 300 if unit in OPERATORS else 100)
        return run_bench(
            unit,
            how.simulator,
            operands=unit_vectors(unit, count, how.seed),
            seed=how.seed,
            config=how.config,
            only=how.only,
            folder=how.folder,
            waves=how.waves,
            coverage=how.coverage,
            verilog=how.verilog,
        )

    return UnitBench(config=PRESETS["base"], called="base", top=unit, run=run)


def _traversal(how: Run) -> int:
    return run_traversal_bench(
        how.folder,
        how.simulator,
        how.config,
        rays=how.sized(RAYS, 400),
        few=how.sized(30, 10),
        seed=how.seed,
        verilog=how.verilog,
        only=how.only,
        waves=how.waves,
        coverage=how.coverage,
    )


OWN = {
    "traversal": UnitBench(
        config=SMALL,
        called="small",
        top="traversal_watched",
        run=_traversal,
        fitted=lambda config: config.but(tag_width=TAGS),
    )
}
"""Benches of units that need more than operands."""


def bench_of(unit: str) -> UnitBench:
    """The bench of a unit of the catalogue."""
    return OWN[unit] if unit in OWN else _streams(unit)
