"""Functional bins: what goes into which."""

import json
from pathlib import Path

import numpy as np
import pytest

from lightloom.golden_model.contract import bitpack
from lightloom.golden_model.contract.formats import FLOAT
from lightloom.golden_model.contract.interfaces import PURE
from lightloom.golden_model.models import model_results
from lightloom.verif.bins import coverage
from lightloom.verif.bins.coverage import Groups, StreamCycles, cases, note, noted, together
from lightloom.verif.bins.number_bins import rounding, signed
from lightloom.verif.bins.unit_bins import BINS, any_bins, unit_bins
from lightloom.verif.vectors.any_vectors import any_vectors
from lightloom.verif.vectors.unit_vectors import VECTORS, unit_vectors


def filled(bins: dict[str, int]) -> set[str]:
    return {name for name, count in bins.items() if count}


def test_bins_and_vectors_are_those_of_units() -> None:
    assert set(BINS) <= set(PURE)
    assert set(VECTORS) <= set(BINS)


@pytest.mark.parametrize("unit", PURE)
def test_a_unit_without_vectors_of_its_own_gets_some(unit: str) -> None:
    dtype = PURE[unit].input
    operands = any_vectors(dtype, 3000, 7)
    assert operands.dtype == dtype
    assert operands.tobytes() == any_vectors(dtype, 3000, 7).tobytes() != any_vectors(dtype, 3000, 8).tobytes()
    assert bitpack.equal(bitpack.unpack(bitpack.pack(operands), dtype), operands).all()
    groups = any_bins(operands, operands)
    assert set(groups) == {*(f"operand {name}" for name in dtype.names or ()), "results that vary"}
    assert all(count for bins in groups.values() for count in bins.values()), groups


def test_bins_that_follow_from_the_formats_find_what_is_missing() -> None:
    operands = unit_vectors("float_to_fixed", 100, 1)
    operands["a"] = 1
    operands["fraction"] = 3
    groups = any_bins(operands, operands)
    assert filled(groups["operand a"]) == {"+normal"}
    assert groups["results that vary"] == {"a": 0, "fraction": 0}


def test_stream_states() -> None:
    cycles = StreamCycles()
    for offered, accepted, valid, ready in [(0, 0, 0, 0), (1, 0, 0, 1), (1, 1, 1, 0), (1, 1, 1, 1)]:
        cycles.add(bool(offered), bool(accepted), bool(valid), bool(ready))
    groups = cycles.groups()
    assert filled(groups["input and output"]) == {"idle, idle", "held, idle", "moves, held", "moves, moves"}
    assert filled(groups["input"]) == {"idle, then held", "held, then moves", "moves, then moves", "held for one cycle"}
    assert filled(groups["output"]) == {"idle, then idle", "idle, then held", "held, then moves", "held for one cycle"}
    assert len(groups["input"]) == 8 + 2


def test_how_a_result_was_rounded() -> None:
    one, ulp = np.float32(1), 2.0**-23
    for excess, tail, name in [
        (0, 0, "exact"),
        (ulp / 4, 0, "cut off"),
        (ulp / 2, 0, "tie cut off"),
        (ulp / 2, -(2.0**-80), "cut off"),
        (-ulp / 8, 0, "raised"),
        (-ulp / 4, 0, "tie raised"),  # below a power of two numbers lie twice as close
    ]:
        assert filled(rounding(np.array([one]), np.array([excess]), np.array([tail]))) == {name}
        assert filled(rounding(np.array([-one]), np.array([-excess]), np.array([-tail]))) == {name}


@pytest.mark.parametrize(
    ("a", "b", "group", "name"),
    [
        (1.0, -1.0, "cancellation", "all bits"),
        (1.5, -1.0, "cancellation", "one bit"),
        (1.5, 1.0, "carry", "carry"),
        (2.0**-126, -(2.0**-126) * 1.5, "ends of the range", "flushed"),
        (2.0**127, 2.0**127, "ends of the range", "beyond"),
        (np.inf, -np.inf, "two infinities", "+, -"),
        (0.0, -0.0, "two zeros", "+, -"),
    ],
)
def test_bins_of_a_sum(a: float, b: float, group: str, name: str) -> None:
    operands = np.array([(a, b, False)], dtype=PURE["float_add"].input)
    assert name in filled(unit_bins("float_add", operands, model_results("float_add", operands))[group])


def test_classes_have_signs() -> None:
    values = np.array([0.0, -0.0, 1e-40, -1.0, np.inf, np.nan], dtype=FLOAT["z"])
    assert filled(signed(values)) == {"+zero", "-zero", "+subnormal", "-normal", "+infinite", "NaN"}


def unwanted() -> Groups:
    raise AssertionError("nobody wants them")


def test_groups_are_noted_and_added_up(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "bins.jsonl"
    note(unwanted)
    monkeypatch.setenv(coverage.BINS, str(path))
    for value in (1, 0):
        bins = cases(one_thing=np.array([value, 1]), other=np.array([0]))
        note({"group": bins}.copy)
    assert json.loads(path.read_text().splitlines()[0]) == {"group": {"one thing": 2, "other": 0}}
    assert noted(path) == {"group": {"one thing": 3, "other": 0}}
    assert together([{"a": {"b": 1}}, {"c": {"d": 2}}]) == {"a": {"b": 1}, "c": {"d": 2}}
