# amaranth: UnusedElaboratable=no
"""The smallest unit: declared, emitted as Verilog, simulated on Verilator, and compared with its model in all bits.

    python minimal_unit.py [FOLDER]    # writes byte_sum.v into it

The Verilog has clock, reset and two valid/ready streams with a tag; the pipeline stops as a whole when nobody takes
its results.
"""

import sys
from pathlib import Path
from typing import Any

import numpy as np
from amaranth import Module, Mux, Value

from lightloom.gen.verilog import convert
from lightloom.golden_model.contract.interfaces import Unit
from lightloom.rtl.fabric.float_format import FloatFormat
from lightloom.rtl.fabric.pipeline import Step, StepCore, StreamUnit
from lightloom.sim.bulk import BulkUnit

BYTE_SUM = Unit(
    name="byte_sum",
    summary="a + b, at most 255",
    input=np.dtype([("a", "u1"), ("b", "u1")]),
    output=np.dtype([("z", "u1")]),
)


def byte_sum(operands: np.ndarray) -> np.ndarray:
    """The model: operands (N,) to results (N,)."""
    out = np.zeros(len(operands), BYTE_SUM.output)
    out["z"] = np.minimum(operands["a"].astype(int) + operands["b"], 255)
    return out


def add(m: Module, f: FloatFormat, *, a: Value, b: Value) -> dict[str, Any]:
    return {"total": a + b}


def saturate(m: Module, f: FloatFormat, *, total: Value) -> dict[str, Any]:
    return {"z": Mux(total[8], 0xFF, total[:8])}


class ByteSum(StepCore):
    """The hardware: two steps, a register after either, as far as `depth` allows."""

    declared = BYTE_SUM

    @classmethod
    def steps(cls, format: FloatFormat) -> list[tuple[Step, int]]:
        return [(add, 8), (saturate, 2)]


def main(folder: Path) -> None:
    verilog = convert(StreamUnit(ByteSum(depth=2), tag_width=8), BYTE_SUM.name)
    (folder / "byte_sum.v").write_text(verilog)
    operands = np.zeros(65536, BYTE_SUM.input)
    operands["a"], operands["b"] = np.divmod(np.arange(65536), 256)
    results = BulkUnit(BYTE_SUM, verilog=verilog).run(operands, stall_seed=1)
    assert (results == byte_sum(operands)).all()
    print(f"byte_sum.v: {len(verilog.splitlines())} lines; all {len(operands):,} sums are the model's, with stalls")


if __name__ == "__main__":
    main(Path(*sys.argv[1:2]))
