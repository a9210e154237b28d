"""Frames laid out in time: dependencies of FIG. 5, shares, frames in flight, versions of the lightmaps."""

from collections import defaultdict
from dataclasses import fields, replace

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from lightloom.golden_model.machine.cost_model import MAINTENANCE, STAGES, FrameCounts, Machine, RayCounts, load, work
from lightloom.golden_model.machine.schedule import AFTER, DISPLAY, FOLLOWING, WHOLE, Schedule, schedule

FRAME = FrameCounts(
    moved=1000,
    refitted=1000,
    triangles=2000,
    fragments_tested=40_000,
    fragments_shaded=20_000,
    frame_shader_pixels=20_000,
    pixels=20_000,
    fragment_rays=RayCounts(closest=2_000),
    frame_rays=RayCounts(any_hit=20_000),
    lightmap_rays=RayCounts(closest=16_000, any_hit=4_000),
    scanned=5_000,
    updates=1_000,
    published=3_000,
)


def spans(plan: Schedule) -> dict[tuple[int, str], tuple[int, int]]:
    """(frame, stage) to (begin, end) of the time in which it occupies a unit."""
    found: dict[tuple[int, str], tuple[int, int]] = {}
    for event in plan.events:
        begin, end = found.get((event.frame, event.stage), (event.begin, event.end))
        found[event.frame, event.stage] = min(begin, event.begin), max(end, event.end)
    return found


SMALL = st.integers(0, 9000)
RAYS = st.builds(RayCounts, closest=SMALL, any_hit=SMALL)
COUNTS = st.builds(
    FrameCounts,
    **{item.name: RAYS if isinstance(item.default, RayCounts) else SMALL for item in fields(FrameCounts)},
)


@st.composite
def runs(draw: st.DrawFn) -> tuple[Machine, list[FrameCounts]]:
    machine = Machine(
        refresh_cycles=draw(st.sampled_from([0, 10_000, 100_000])),
        frames_in_flight=draw(st.integers(1, 8)),
        versions=draw(st.integers(1, 8)),
        overlap_shading=draw(st.integers(0, 1)),
        early_selection=draw(st.integers(0, 1)),
        raster_share=draw(st.integers(1, 255)),
        other_share=draw(st.integers(1, 255)),
        shader_share=draw(st.integers(1, 255)),
        input_cycles=draw(st.integers(0, 5000)),
    )
    return machine, draw(st.lists(COUNTS, min_size=1, max_size=6))


ONE_RAY_EACH = replace(FrameCounts(), fragment_rays=RayCounts(any_hit=1), frame_rays=RayCounts(any_hit=1))
"""Rays of two stages of a frame that come to the tracer in the same cycle."""


@settings(deadline=None, max_examples=40, derandomize=True)
@example((Machine(refresh_cycles=0, versions=1), [ONE_RAY_EACH] * 2))
@given(runs())
def test_every_schedule_keeps_the_rules(run: tuple[Machine, list[FrameCounts]]) -> None:
    machine, frames = run
    plan = schedule(machine, frames)
    assert plan == schedule(machine, frames)
    at = spans(plan)
    done: dict[tuple[int, str], int] = defaultdict(int)
    changes: dict[str, list[tuple[int, int]]] = defaultdict(list)
    for event in plan.events:
        assert 0 <= event.begin < event.end
        assert 1 <= event.share <= WHOLE
        if event.stage != DISPLAY:
            assert event.resource == STAGES[event.stage]
            done[event.frame, event.stage] += (event.end - event.begin) * event.share
            changes[event.resource] += [(event.begin, event.share), (event.end, -event.share)]
    for k, frame in enumerate(frames):
        for stage, cycles in work(machine, frame).items():
            # The last cycle of a piece may not be used in full.
            assert cycles * WHOLE <= done[k, stage] <= (cycles + 60) * WHOLE
    for resource, steps in changes.items():  # no unit is used more than whole
        used = 0
        for _, share in sorted(steps):
            used += share
            assert 0 <= used <= WHOLE, resource
    for k, time in enumerate(plan.frames):
        for stage, names in AFTER.items():
            for name in names:
                if (k, stage) in at and (k, name) in at:
                    assert at[k, stage][0] >= at[k, name][1], f"frame {k}: {stage} before the end of {name}"
        for stage, names in FOLLOWING.items():
            for name in names:
                if (k, stage) in at and (k, name) in at:
                    assert at[k, stage][0] >= at[k, name][0], f"frame {k}: {stage} before {name}"
        assert time.version_complete <= time.read_from <= time.read_until <= time.done <= time.shown
        if k + 1 < len(frames) and (k + 1, "selection") in at:
            assert at[k + 1, "selection"][0] >= time.read_until
        if k >= machine.frames_in_flight:
            assert time.begin >= plan.frames[k - machine.frames_in_flight].shown
        if machine.refresh_cycles:
            assert time.shown % machine.refresh_cycles == 0
    assert all(interval >= machine.refresh_cycles for interval in plan.intervals())


def test_maintenance_gets_its_share_and_more_while_the_rasterizer_works() -> None:
    """Frames in flight overlap: frame rays of one are traced while surfaces of the next are found."""
    plan = schedule(Machine(refresh_cycles=0, frames_in_flight=3, versions=3, tracer_units=1), [FRAME] * 8)
    raster = [(e.begin, e.end) for e in plan.events if e.resource == "rasterizer"]
    shares: dict[bool, set[int]] = {True: set(), False: set()}
    for event in plan.events:
        if event.stage == "lightmap rays":
            while_rastering = any(begin < event.end and event.begin < end for begin, end in raster)
            shares[while_rastering].add(event.share)
    assert Machine().raster_share in shares[True]
    assert shares[False] == {Machine().other_share, WHOLE}
    assert Machine().other_share not in shares[True]


def test_maintenance_does_not_wait_for_visible_surfaces() -> None:
    """With early selection, [0052]: it looks at those of the frame before."""
    slow = Machine(raster_units=1, test_cycles=50, refresh_cycles=0, early_selection=1)
    at = spans(schedule(slow, [FRAME] * 2))
    assert at[0, "lightmap update"][1] < at[0, "visible surfaces"][1]
    assert at[0, "lightmap rays"][0] >= at[0, "structure"][1]
    assert at[1, "selection"][0] >= at[0, "visible surfaces"][1]


def test_selection_looks_at_what_its_own_frame_shows() -> None:
    slow = Machine(raster_units=1, test_cycles=50, refresh_cycles=0)
    at = spans(schedule(slow, [FRAME] * 3))
    assert all(at[k, "selection"][0] >= at[k, "visible surfaces"][1] for k in range(3))


def test_shading_waits_for_its_version() -> None:
    """Maintenance so slow that it decides: with two versions frame k + 1 waits for what frame k writes."""
    slow = Machine(closest_cycles=2000, refresh_cycles=0)
    plan = schedule(slow, [FRAME] * 5)
    for before, time in zip(plan.frames, plan.frames[1:], strict=False):
        assert time.version_complete == before.updated
        assert time.read_from >= before.updated
    # A longer chain lets frames be shown that much earlier at first, and changes nothing in the long run.
    longer = schedule(Machine(closest_cycles=2000, refresh_cycles=0, versions=4), [FRAME] * 5)
    assert longer.frames[2].done < plan.frames[2].done
    assert longer.frames[3].version_complete == longer.frames[0].updated


def test_more_frames_in_flight_bring_frames_closer_and_input_further() -> None:
    plans = [schedule(Machine(refresh_cycles=0, frames_in_flight=n, versions=2), [FRAME] * 30) for n in (1, 2, 3)]
    # Not the last frames: nothing is beside them.
    pace = [plan.frames[25].shown - plan.frames[5].shown for plan in plans]
    assert pace[0] > 1.1 * max(pace[1:])
    least = max(load(work(Machine(), FRAME)).values())
    assert all(19 * least <= cycles for cycles in pace)
    assert max(pace[1:]) < 20 * 1.1 * least  # the busiest unit hardly rests
    assert plans[2].frames[-1].latency > plans[0].frames[-1].latency
    busy = [max(plan.utilisation().values()) for plan in plans]
    assert busy[0] < busy[2] <= 1


def test_streamed_shading_starts_with_the_first_tile() -> None:
    strict, tiled = (spans(schedule(Machine(overlap_shading=n), [FRAME])) for n in (0, 1))
    assert strict[0, "fragment shading"][0] == strict[0, "visible surfaces"][1]
    assert tiled[0, "fragment shading"][0] == tiled[0, "visible surfaces"][0]


@pytest.mark.parametrize("versions", [1, 2, 3])
def test_work_of_frames_is_what_utilisation_says(versions: int) -> None:
    plan = schedule(Machine(versions=versions, refresh_cycles=0), [FRAME] * 4)
    for unit, part in plan.utilisation().items():
        assert part * plan.duration == pytest.approx(4 * load(work(Machine(), FRAME))[unit], abs=40)


def test_no_frames() -> None:
    assert schedule(Machine(), []) == Schedule(machine=Machine(), events=(), frames=(), duration=0)


def test_maintenance_stages_have_units() -> None:
    assert set(MAINTENANCE) < set(STAGES)
