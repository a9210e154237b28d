"""Replays recorded operands through a Verilated unit and compares every result with the golden model, in all bits."""

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field
from types import MappingProxyType
from typing import Any, Protocol

import numpy as np

from lightloom.golden_model.contract import bitpack
from lightloom.golden_model.contract.interfaces import PURE
from lightloom.golden_model.models import model_results

CHUNK = 1 << 18
LISTED = 20
"""Mismatches that are listed; all of them are counted."""


class Simulated(Protocol):
    """What `sim.bulk.BulkUnit` offers."""

    throughput: float
    cycles: int

    def run(self, operands: np.ndarray) -> np.ndarray: ...


@dataclass(kw_only=True)
class Replay:
    """The outcome."""

    unit: str
    replayed: int
    mismatches: int = 0
    differing_bits: dict[str, int] = field(default_factory=dict)
    """For each result field, how many operations differ in it."""
    hits: int = 0
    cycles: int = 0
    vectors_per_second: float = 0.0
    """Of the simulation, on one core, without packing and files."""
    examples: list[dict[str, Any]] = field(default_factory=list)
    """The first mismatches: number, operands and both results in hex, field by field."""

    def as_dict(self) -> dict[str, Any]:
        return asdict(self)


def replay(
    unit: str,
    operands: np.ndarray,
    simulated: Simulated,
    advance: Callable[[float], None],
    config: Mapping[str, int] = MappingProxyType({}),
) -> Replay:
    """Runs operands (N,) of the unit's input dtype through the simulation and through the unit's model.

    `config` is the simulated hardware's, by flat names.
    """
    description = PURE[unit]
    names = description.output.names or ()
    outcome = Replay(unit=unit, replayed=len(operands), differing_bits=dict.fromkeys(names, 0))
    seconds = 0.0
    for start in range(0, len(operands), CHUNK):
        chunk = operands[start : start + CHUNK]
        got, want = simulated.run(chunk), model_results(unit, chunk, config)
        outcome.cycles += simulated.cycles
        seconds += len(chunk) / simulated.throughput if simulated.throughput else 0.0
        if "hit" in names:
            outcome.hits += int(want["hit"].sum())
        wrong = np.flatnonzero(~bitpack.equal(got, want))
        outcome.mismatches += len(wrong)
        if len(wrong):
            for name in names:
                outcome.differing_bits[name] += int(np.sum(_raw(got[name]) != _raw(want[name])))
        for at in wrong[: LISTED - len(outcome.examples)]:
            outcome.examples.append(
                {
                    "number": int(start + at),
                    "operands": in_hex(chunk[at]),
                    "golden_model": in_hex(want[at]),
                    "verilog": in_hex(got[at]),
                }
            )
        advance(len(chunk))
    outcome.vectors_per_second = len(operands) / seconds if seconds else 0.0
    return outcome


def _raw(values: np.ndarray) -> np.ndarray:
    """The bits, so that equal NaNs are equal and zeros of different sign are not."""
    return np.ascontiguousarray(values).view(f"u{values.dtype.itemsize}")


def in_hex(record: np.void) -> dict[str, str]:
    """A record's fields in hex, a vector's elements separated by spaces."""
    fields = {}
    for name in record.dtype.names or ():
        raw = _raw(np.atleast_1d(record[name]))
        fields[name] = " ".join(f"{int(value):0{2 * raw.dtype.itemsize}X}" for value in raw)
    return fields
