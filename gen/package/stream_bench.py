"""Testbench of a unit with results in order: Verilog that needs a simulator alone, with vectors of the golden model."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from lightloom.gen.package.files import render
from lightloom.golden_model.contract import bitpack
from lightloom.golden_model.models import model_results
from lightloom.rtl.config import Config

SEED = 2013


def stream_bench(unit: Mapping[str, Any], config: Config, operands: np.ndarray) -> dict[str, bytes]:
    """Testbench and vectors of a unit with results in order: file name to content.

    `unit` is its manifest, `operands` (N,) are of its input's dtype; a multiple of four of them is used.
    """
    name = unit["unit"]
    operands = operands[: len(operands) // 4 * 4]
    results = model_results(name, operands, config.flat())
    bench = render(
        "package_testbench.v",
        **shared(unit, operands, results),
        latency=unit["latency"],
        interval=unit["initiation_interval"],
    )
    module = unit["module"]
    return {f"{module}_tb.v": bench.encode(), f"{module}.hex": vectors(operands, results)}


def shared(unit: Mapping[str, Any], operands: np.ndarray, results: np.ndarray) -> dict[str, Any]:
    """What the template of any testbench needs."""
    return {
        "unit": unit["unit"],
        "module": unit["module"],
        "count": len(operands),
        "input_bits": bitpack.width(operands.dtype),
        "output_bits": bitpack.width(results.dtype),
        "tag_bits": unit["config"]["tag_width"],
        "seed": SEED,
    }


def vectors(operands: np.ndarray, results: np.ndarray) -> bytes:
    """A line of hexadecimal digits an operand: its result's bits above its own, for $readmemh."""
    shift = bitpack.width(operands.dtype)
    digits = -(-(shift + bitpack.width(results.dtype)) // 4)
    lines = [result << shift | operand for operand, result in zip(_whole(operands), _whole(results), strict=True)]
    return "".join(f"{line:0{digits}x}\n" for line in lines).encode()


def _whole(records: np.ndarray) -> list[int]:
    """Records (N,) to payloads."""
    return [int.from_bytes(row.tobytes(), "little") for row in bitpack.pack(records).astype("<u4")]
