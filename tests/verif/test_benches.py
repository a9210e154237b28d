"""Every unit's cocotb bench on both simulators."""

from collections.abc import Mapping
from itertools import product
from pathlib import Path

import pytest

from lightloom.gen.verilog import convert, verilog_of
from lightloom.golden_model.contract.interfaces import OPERATORS, PURE
from lightloom.rtl.config import PRESETS
from lightloom.rtl.engine.texel_blend import TexelBlend
from lightloom.rtl.engine.texel_match import TexelMatch
from lightloom.rtl.engine.texel_project import TexelProject
from lightloom.rtl.fabric.dataflow import DataflowCore
from lightloom.rtl.fabric.pipeline import StreamUnit
from lightloom.rtl.intersection.ray_triangle import RayTriangle
from lightloom.sim.runner import BenchError, run_bench
from lightloom.verif.vectors.unit_vectors import unit_vectors
from tests.simulators import SIMULATORS, needs_icarus

SEED = 2013
# Of a number unit, and of a larger one, of which Icarus simulates a hundred cycles a second: it is there for what is
# undefined and for the order of events. That results are right, whatever the operands, is shown by the bulk harness
# with two hundred thousand; here streams stall, stop and begin again, which some hundreds of them do in every way.
COUNT = {"verilator": (1000, 1000), "icarus": (300, 100)}


SLOW_ON_ICARUS = {"ray_triangle", "ray_triangle_half", "texel_match", "texel_project", "texel_blend"}
"""Larger ones whose twin for every day is the same bench on Verilator; of ray_triangle, Icarus also takes the one that
shares its operators."""


def marks_of(unit: str, simulator: str) -> list[pytest.MarkDecorator]:
    if simulator == "verilator":
        return []
    return [pytest.mark.icarus, needs_icarus, *([pytest.mark.long] if unit in SLOW_ON_ICARUS else [])]


def bench(
    unit: str,
    simulator: str,
    folder: Path,
    preset: str = "base",
    verilog: str | None = None,
    timing: Mapping[str, int] | None = None,
) -> int:
    return run_bench(
        unit,
        simulator,
        operands=unit_vectors(unit, COUNT[simulator][unit not in OPERATORS], SEED),
        seed=SEED,
        config=PRESETS[preset],
        folder=folder,
        verilog=verilog,
        timing=timing,
    )


@pytest.mark.parametrize(
    ("unit", "simulator"),
    [
        pytest.param(unit, simulator, marks=marks_of(unit, simulator))
        for unit in PURE
        for simulator in ("verilator", "icarus")
    ],
)
def test_bench(unit: str, simulator: str, tmp_path: Path) -> None:
    assert bench(unit, simulator, tmp_path) == 8


@pytest.mark.parametrize("preset", ["tiny", pytest.param("full", marks=pytest.mark.long)])
def test_ray_triangle_bench_of_the_other_presets(preset: str, tmp_path: Path) -> None:
    assert bench("ray_triangle", "verilator", tmp_path, preset) == 8


AT_OTHER_INTERVALS = [
    (RayTriangle, 8),
    *(
        pytest.param(make, interval, marks=pytest.mark.long)
        for make, interval in [(RayTriangle, 3), *product((TexelProject, TexelMatch, TexelBlend), (1, 4, 16, 32))]
    ),
]


@pytest.mark.parametrize(("make", "interval"), AT_OTHER_INTERVALS)
@pytest.mark.parametrize("simulator", SIMULATORS)
def test_bench_at_other_intervals(simulator: str, make: type[DataflowCore], interval: int, tmp_path: Path) -> None:
    config = PRESETS["base"]
    core = make(config, interval=interval)
    unit, name = StreamUnit(core, config.streams.tag_width), core.unit.name
    timing = {"latency": unit.latency, "initiation_interval": interval}
    assert bench(name, simulator, tmp_path, verilog=convert(unit, name), timing=timing) == 8


@pytest.mark.parametrize(
    ("original", "mutant", "message"),
    [
        ("{ tag0, ", "{ tag0, ~", "operation 0: operands 0x"),
        ("{ tag0, ", "{ 8'h00, ", "operation 1: operands 0x"),
        ("else if (i__ready) o__valid", "else o__valid", "withdrawn"),
        ("if (i__ready) tag0", "tag0", "a waiting result changed"),
        ("_0_ | o__ready", "1'b1", "a waiting result changed"),
        ("if (rst) o__valid", "if (1'b0) o__valid", r"reset_in_flight +FAIL"),
    ],
    ids=["result", "tag", "withdrawn", "unstable", "lost", "not reset"],
)
def test_bench_catches_a_broken_unit(original: str, mutant: str, message: str, tmp_path: Path) -> None:
    good = verilog_of("float_compare", PRESETS["base"])
    assert good.count(original) == 1
    with pytest.raises(BenchError, match=message):
        bench("float_compare", "verilator", tmp_path, verilog=good.replace(original, mutant))
