"""Costs of a frame on a machine: counts times cycles over units."""

import re
from collections.abc import Callable
from dataclasses import fields

import pytest

from lightloom.golden_model.host.errors import InputError
from lightloom.golden_model.host.parameters import parameters
from lightloom.golden_model.machine.budget_controller import BudgetPolicy
from lightloom.golden_model.machine.cost_model import RESOURCES, STAGES, FrameCounts, Machine, RayCounts, load, work
from tests import ROOT


def test_work_is_counts_times_cycles_over_units_rounded_up() -> None:
    machine = Machine(shader_cores=8, fragment_cycles=5, tracer_units=4, raster_units=2, setup_cycles=3)
    cycles = work(machine, FrameCounts(fragments_shaded=13, triangles=7, fragments_tested=9))
    assert cycles["fragment shading"] == 9  # 65 / 8
    assert cycles["visible surfaces"] == 7 * 3 + 5
    assert cycles["lightmap rays"] == 0


def test_rays_cost_their_tests_where_these_are_counted() -> None:
    machine = Machine(tracer_units=2, node_cycles=1, triangle_cycles=2, closest_cycles=13, any_hit_cycles=9)
    counted = RayCounts(closest=10, any_hit=5, nodes=400, triangles=100)
    assert work(machine, FrameCounts(lightmap_rays=counted))["lightmap rays"] == 200  # triangle tests run beside them
    counted = RayCounts(closest=10, any_hit=5, nodes=400, triangles=300)
    assert work(machine, FrameCounts(lightmap_rays=counted))["lightmap rays"] == 300
    plain = FrameCounts(frame_rays=RayCounts(closest=10, any_hit=5))
    assert work(machine, plain)["frame rays"] == (130 + 45 + 1) // 2


def test_load_adds_up_the_stages_of_a_unit() -> None:
    counts = FrameCounts(
        moved=10,
        refitted=10,
        triangles=10,
        fragments_tested=99,
        fragments_shaded=99,
        pixels=99,
        updates=10,
        published=99,
    )
    cycles = work(Machine(), counts)
    assert set(cycles) == set(STAGES)
    total = load(cycles)
    assert set(total) == set(RESOURCES)
    assert sum(total.values()) == sum(cycles.values())
    assert total["shader"] == cycles["fragment shading"] + cycles["blending"]


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: Machine(raster_share=0), "machine raster_share 0: must be 1 to 255"),
        (lambda: Machine(other_share=256), "machine other_share 256: must be 1 to 255"),
        (lambda: Machine(frames_in_flight=9), "machine frames_in_flight 9: must be 1 to 8"),
        (lambda: RayCounts(closest=-1), "rays closest -1: must be 0 to"),
        (lambda: FrameCounts(pixels=-1), "counts pixels -1: must be 0 or more"),
    ],
)
def test_what_is_out_of_range_is_named(make: Callable[[], object], said: str) -> None:
    with pytest.raises(InputError, match=said):
        make()


@pytest.mark.parametrize("options", [Machine, BudgetPolicy])
def test_the_page_has_every_parameter_with_its_default_range_and_meaning(options: type) -> None:
    page = (ROOT / "docs" / "machine.md").read_text(encoding="utf-8")
    rows = {
        row[0]: row[1:]
        for row in re.findall(r"^\| `(\w+)` \| ([^|]+) \| ([^|]+) to ([^|]+) \| ([^|]+) \|$", page, re.MULTILINE)
    }
    declared = parameters(options)
    assert list(declared) == [item.name for item in fields(options)]
    for each in declared.values():
        *numbers, meaning = rows[each.name]
        assert each.range is not None
        assert (*map(_number, numbers), meaning) == (each.default, *each.range, each.says), each.name


def _number(text: str) -> int:
    base, _, power = text.strip().partition("^")
    return int(base.replace(",", "")) ** int(power or 1)
