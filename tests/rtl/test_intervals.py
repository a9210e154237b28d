# amaranth: UnusedElaboratable=no
# (cores are also made only to ask for their latency)
"""Graphs at intervals of which no unit is: every bit of every result, at full rate and with both sides stalling."""

import re

import pytest

from lightloom.gen.verilog import convert
from lightloom.golden_model.contract.bitpack import equal
from lightloom.golden_model.models import model_results
from lightloom.rtl.config import PRESETS
from lightloom.rtl.engine.texel_blend import TexelBlend
from lightloom.rtl.engine.texel_match import TexelMatch
from lightloom.rtl.engine.texel_project import TexelProject
from lightloom.rtl.fabric.dataflow import DataflowCore
from lightloom.rtl.fabric.pipeline import StreamUnit
from lightloom.rtl.intersection.box_setup import BoxSetup
from lightloom.rtl.intersection.node_test import NodeTest
from lightloom.rtl.intersection.ray_setup import RaySetup
from lightloom.rtl.intersection.ray_time import RayTime
from lightloom.rtl.intersection.ray_triangle import RayTriangle
from lightloom.sim.bulk import BulkUnit
from lightloom.verif.vectors.unit_vectors import unit_vectors
from tests import ROOT
from tests.rtl.agreement import SLACK

SEED = 2016
COUNT = 10_000
QUICK = [(RayTriangle, 8), (BoxSetup, 3), (TexelProject, 16), (TexelMatch, 4), (TexelBlend, 16)]
LONG = [
    *((RayTriangle, interval) for interval in (3, 4, 16, 32)),
    *((core, interval) for core in (RaySetup, RayTime, NodeTest) for interval in (2, 5)),
    (BoxSetup, 32),
    *((TexelProject, interval) for interval in (1, 2, 4, 32)),
    *((TexelMatch, interval) for interval in (1, 16, 32)),
    *((TexelBlend, interval) for interval in (1, 4, 32)),
]


def check(make: type[DataflowCore], interval: int, preset: str) -> None:
    config = PRESETS[preset]
    core = make(config, interval=interval)
    unit, name = StreamUnit(core, config.streams.tag_width), core.unit.name
    bulk = BulkUnit(name, config, verilog=convert(unit, name), optimised=False)
    operands = unit_vectors(name, COUNT, SEED)
    expected = model_results(name, operands, config.flat())
    assert equal(bulk.run(operands), expected).all(), f"unit_vectors({name!r}, {COUNT}, {SEED})"
    assert bulk.latency == unit.latency
    assert bulk.cycles <= COUNT * unit.initiation_interval + unit.latency + SLACK, "not at full rate"
    assert equal(bulk.run(operands, stall_seed=SEED), expected).all(), f"stalled, {name!r}, {COUNT}, {SEED}"


@pytest.mark.parametrize(("make", "interval"), QUICK)
def test_agrees_with_the_model(make: type[DataflowCore], interval: int) -> None:
    check(make, interval, "base")


@pytest.mark.long
@pytest.mark.parametrize(("make", "interval"), LONG)
def test_agrees_with_the_model_at_others(make: type[DataflowCore], interval: int) -> None:
    check(make, interval, "base")


@pytest.mark.long
@pytest.mark.parametrize("preset", ["tiny", "full"])
@pytest.mark.parametrize("interval", [4, 8, 16])
def test_ray_triangle_of_the_other_presets(interval: int, preset: str) -> None:
    check(RayTriangle, interval, preset)


def test_the_page_is_of_this_hardware() -> None:
    """Latencies; and at an interval of 8 the unit has at most 35 % of the gates."""
    page = (ROOT / "docs" / "interval_figures.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| (\w+) \| (\d+) \| (\d+) \| ([\d,]+) \|", page, re.MULTILINE)
    gates = {(preset, int(interval)): int(count.replace(",", "")) for preset, interval, _, count in rows}
    assert {preset for preset, _ in gates} == set(PRESETS)
    for preset, interval, latency, _ in rows:
        assert RayTriangle(PRESETS[preset], interval=int(interval)).latency == int(latency)
    for preset in PRESETS:
        assert gates[preset, 8] <= 0.35 * gates[preset, 1]
