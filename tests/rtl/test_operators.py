"""The number units' Verilog against the golden model and SoftFloat in all bits, and what their depth promises."""

import dataclasses
import gc
import warnings
from typing import Any

import numpy as np
import pytest
from amaranth.hdl import Fragment, UnusedElaboratable

from lightloom.gen.verilog import verilog_of
from lightloom.golden_model.contract.formats import field_width
from lightloom.golden_model.contract.interfaces import OPERATORS
from lightloom.golden_model.models import model_results
from lightloom.rtl.catalogue import stream_unit
from lightloom.rtl.config import PRESETS, Config
from lightloom.rtl.fabric.float_format import FLOAT32
from lightloom.rtl.fabric.pipeline import StepCore, StreamUnit
from lightloom.sim.bulk import BulkUnit
from tests import ROOT
from tests.softfloat import softfloat_results
from tests.vectors import corner_vectors, differences, random_vectors

DOCUMENTATION = ROOT / "docs" / "operators.md"
SEED = 20250102
RANDOM = 200_000
DEPTHS = [field.name for field in dataclasses.fields(Config) if field.name.endswith("_depth")]


def combinational() -> Config:
    """Depth 0 everywhere: what the deepest logic computes."""
    depths: dict[str, Any] = dict.fromkeys(DEPTHS, 0)
    return PRESETS["tiny"].but(**depths)


def core_of(name: str) -> type[StepCore]:
    (core,) = (core for core in StepCore.__subclasses__() if core.declared.name == name)
    return core


def latency(name: str, config: Config) -> int:
    unit = stream_unit(name, config)
    Fragment.get(unit, None)  # Amaranth warns of components that are never elaborated
    return unit.latency


def check(name: str, config: Config) -> None:
    operands = np.concatenate([corner_vectors(name), random_vectors(name, RANDOM, SEED)])
    bulk = BulkUnit(name, config)
    results = {
        "model": model_results(name, operands),
        "SoftFloat": softfloat_results(name, operands),
        "RTL": bulk.run(operands),
    }
    report = differences(operands, f"corner_vectors + random_vectors({name!r}, {RANDOM}, {SEED})", results)
    assert not report, report
    assert bulk.latency == latency(name, config)


@pytest.mark.parametrize("preset", ["base", "tiny"])
@pytest.mark.parametrize("name", OPERATORS)
def test_verilog_agrees(name: str, preset: str) -> None:
    check(name, PRESETS[preset])


@pytest.mark.long
@pytest.mark.parametrize("name", OPERATORS)
def test_verilog_agrees_at_the_other_depths(name: str) -> None:
    check(name, PRESETS["full"])
    check(name, combinational())


@pytest.mark.parametrize("name", OPERATORS)
def test_every_depth_up_to_the_number_of_steps(name: str) -> None:
    core = core_of(name)
    steps = len(core.steps(FLOAT32))
    for depth in range(steps + 1):
        unit = StreamUnit(core(depth), tag_width=4)
        assert unit.latency == depth
        Fragment.get(unit, None)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UnusedElaboratable)  # of the refused ones
        for depth in (-1, steps + 1):
            with pytest.raises(ValueError, match=f"{name}: depth must be 0 to {steps}, not {depth}"):
                core(depth)
        gc.collect()


def test_a_difference_of_products_may_stand_in_for_a_product() -> None:
    """a*b - 0*0 is a*b in all bits, for zeros of either sign and for what underflows too: see FloatFlow.multiply."""
    operands = np.concatenate([corner_vectors("float_multiply"), random_vectors("float_multiply", RANDOM, SEED)])
    wider = np.zeros(len(operands), dtype=OPERATORS["float_difference_of_products"].input)
    for name in ("a", "b"):
        wider[name] = operands[name]
    results = {
        "product": model_results("float_multiply", operands),
        "difference": model_results("float_difference_of_products", wider),
    }
    report = differences(operands, f"corner_vectors + random_vectors('float_multiply', {RANDOM}, {SEED})", results)
    assert not report, report


def test_a_wrong_bit_is_found() -> None:
    """The comparison itself: Verilog that overlooks a bit must not pass."""
    good = verilog_of("float_compare", PRESETS["tiny"])
    broken = good.replace("| i_a[22:0]", "| i_a[22:1]")
    assert broken != good
    operands = corner_vectors("float_compare")
    results = {
        "model": model_results("float_compare", operands),
        "RTL": BulkUnit("float_compare", PRESETS["tiny"], verilog=broken).run(operands),
    }
    report = differences(operands, "corner_vectors('float_compare')", results)
    assert "differ; first, vector " in report
    assert "a=0x" in report


def test_documentation_states_the_ports_and_depths() -> None:
    table = {}
    for line in DOCUMENTATION.read_text().splitlines():
        cells = [cell.strip() for cell in line.split("|")[1:-1]]
        if len(cells) == 7 and cells[0].strip("`") in OPERATORS:
            table[cells[0].strip("`")] = cells[2:]
    stated = {}
    for name, unit in OPERATORS.items():
        parameter = table[name][2].strip("`")
        depths = [str(config.flat()[parameter]) for config in PRESETS.values()]
        assert depths == [str(latency(name, config)) for config in PRESETS.values()]
        ports = [
            ", ".join(f"`{field}` {field_width(dtype[field])}" for field in dtype.names or ())
            for dtype in (unit.input, unit.output)
        ]
        stated[name] = [*ports, f"`{parameter}`", f"0–{len(core_of(name).steps(FLOAT32))}", " / ".join(depths)]  # noqa: RUF001
    assert table == stated
