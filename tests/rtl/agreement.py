"""Unit against model, in all bits, through the bulk harness."""

import functools

import numpy as np

from lightloom.golden_model.contract import bitpack
from lightloom.golden_model.models import model_results
from lightloom.rtl.catalogue import stream_unit
from lightloom.rtl.config import PRESETS
from lightloom.sim.bulk import BulkUnit

SHOWN = 5
SLACK = 500
"""Cycles of a run beyond its operations and the latency: reset, and the harness's own start and end."""


def fields_in_hex(record: np.ndarray) -> str:
    """The fields of a record (1,) as raw bits, ready to be pasted into a test."""
    parts = []
    for name, index, _, offset, width in bitpack.fields(record.dtype):
        whole = sum(int(word) << (32 * k) for k, word in enumerate(bitpack.pack(record)[0]))
        label = name + "".join(f"[{k}]" for k in index)
        parts.append(f"{label}={whole >> offset & (1 << width) - 1:#x}")
    return " ".join(parts)


@functools.cache
def bulk_unit(unit: str, preset: str) -> BulkUnit:
    """The Verilated unit, built once a test run."""
    return BulkUnit(unit, PRESETS[preset])


def assert_agrees(unit: str, preset: str, operands: np.ndarray, origin: str) -> np.ndarray:
    """Runs operands (N,) through unit and model; returns the results. `origin` says how to make the operands again.

    The unit's latency and initiation interval must be the stated ones.
    """
    assert len(operands)
    bulk = bulk_unit(unit, preset)
    expected, got = model_results(unit, operands, PRESETS[preset].flat()), bulk.run(operands)
    wrong = np.flatnonzero(~bitpack.equal(expected, got))
    lines = [f"{unit} ({preset}, {origin}): {len(wrong)} of {len(operands)} results differ"]
    for k in wrong[:SHOWN]:
        one = slice(k, k + 1)
        lines += [f"vector {k}: {fields_in_hex(operands[one])}"]
        lines += [f"  model {fields_in_hex(expected[one])}", f"  unit  {fields_in_hex(got[one])}"]
    assert not len(wrong), "\n".join(lines)
    stated = stream_unit(unit, PRESETS[preset])
    assert bulk.latency == stated.latency
    assert bulk.cycles <= len(operands) * stated.initiation_interval + bulk.latency + SLACK, "not at full rate"
    return got
