"""Runs the bench of a unit behind AXI4-Lite."""

import json
from pathlib import Path

import numpy as np

from lightloom.gen.manifest import manifest
from lightloom.golden_model.contract import bitpack
from lightloom.rtl.config import PRESETS, Config
from lightloom.sim.emitted import emitted
from lightloom.sim.runner import run_cocotb

BUS = "axi4-lite"


def run_register_bench(
    unit: str,
    simulator: str,
    folder: Path,
    *,
    operands: np.ndarray,
    seed: int,
    config: Config = PRESETS["tiny"],
    verilog: str | None = None,
) -> int:
    """Runs it for a unit whose results depend on its operands alone; returns how many tests passed.

    `operands` (N,) are of its input's dtype: half of them go through registers, half through the streams. `verilog`
    replaces the emitted text. Raises BenchError where a test fails.
    """
    described = manifest(unit, config, bus=BUS)
    module = described["module"]
    np.save(folder / "operands.npy", bitpack.pack(operands))
    run = {
        "unit": unit,
        "seed": seed,
        "operands": str(folder / "operands.npy"),
        "tag_width": config.streams.tag_width,
        "config": config.flat(),
        "registers": described["registers"],
    }
    return run_cocotb(
        module,
        {f"{module}.v": emitted(unit, config, bus=BUS) if verilog is None else verilog},
        simulator,
        module="lightloom.verif.benches.test_registers",
        public_ports=[port["name"] for port in described["ports"]],
        extra_env={"LIGHTLOOM_BENCH": json.dumps(run)},
        seed=seed,
        folder=folder,
    )
