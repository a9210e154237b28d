"""The cocotb bench of units behind AXI4-Lite, on both simulators, and Verilog with something wrong in it."""

from pathlib import Path

import pytest

from lightloom.rtl.config import PRESETS
from lightloom.sim.emitted import emitted
from lightloom.sim.run_register_bench import run_register_bench
from lightloom.sim.runner import BenchError
from lightloom.verif.vectors.unit_vectors import unit_vectors
from tests.simulators import SIMULATORS

SEED = 411
COUNT = 60


def bench(unit: str, simulator: str, folder: Path, verilog: str | None = None) -> int:
    operands = unit_vectors(unit, COUNT, SEED)[:COUNT]
    return run_register_bench(unit, simulator, folder, operands=operands, seed=SEED, verilog=verilog)


@pytest.mark.parametrize("simulator", SIMULATORS)
@pytest.mark.parametrize("unit", ["float_add", "half_to_float"])
def test_bench(unit: str, simulator: str, tmp_path: Path) -> None:
    assert bench(unit, simulator, tmp_path) == 8


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("write_strobes <= s_axi__wstrb;", "write_strobes <= 4'hf;"),
        ("assign irq = ", "assign irq = 1'b0 & "),
    ],
    ids=["strobes", "interrupt"],
)
def test_a_fault_is_heard(tmp_path: Path, old: str, new: str) -> None:
    text = emitted("half_to_float", PRESETS["tiny"], bus="axi4-lite")
    assert old in text
    with pytest.raises(BenchError, match="4 of 8 tests failed"):
        bench("half_to_float", "verilator", tmp_path, text.replace(old, new))
