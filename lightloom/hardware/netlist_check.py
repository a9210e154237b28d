"""Mapped netlists against the golden model: the gates that synthesis made compute what the unit is to compute."""

import shutil
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lightloom.gen.flow import libraries, netlist
from lightloom.golden_model.contract import bitpack
from lightloom.golden_model.contract.interfaces import PURE
from lightloom.golden_model.models import model_results
from lightloom.hardware.synthesis import Measured, Source
from lightloom.rtl.config import PRESETS
from lightloom.sim.bulk import BulkUnit
from lightloom.verif.vectors.unit_vectors import many_vectors


@dataclass(frozen=True)
class Check:
    """Vectors through a netlist, and how many results differ from the golden model in a bit."""

    vectors: int
    mismatches: int
    first: str
    """The first operands that differ, empty where none do."""


def check(measured: Measured, source: Source, count: int, seed: int) -> Check:
    """Sends random operands, and a number unit's corner cases, through the netlist of `measured`, with stalls."""
    unit = PURE[measured.unit]
    text = _text(measured, source)
    operands = many_vectors(unit.name, count, seed)
    config = PRESETS[measured.preset]
    results = BulkUnit(unit.name, config, verilog=text, optimised=False).run(operands, stall_seed=seed + 1)
    return compare(operands, results, model_results(unit.name, operands, config.flat()))


def compare(operands: np.ndarray, results: np.ndarray, expected: np.ndarray) -> Check:
    """Results (N,) against those of the model, bit by bit."""
    different = np.flatnonzero(~bitpack.equal(results, expected))
    if not len(different):
        return Check(len(operands), 0, "")
    at = different[0]
    return Check(len(operands), len(different), f"operands {operands[at]}: {results[at]}, not {expected[at]}")


def _text(measured: Measured, source: Source) -> str:
    with tempfile.TemporaryDirectory(prefix="lightloom-") as scratch:
        folder = Path(scratch)
        shutil.copy(measured.folder / "mapped.v", folder)
        library = libraries.unpack(source.name, source.files, source.period, folder)
        return netlist.simulated(folder, library, measured.unit)
