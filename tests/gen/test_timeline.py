"""The drawing of a schedule: every event a bar in its row, its height the share, well-formed and alone."""

import re
from xml.etree import ElementTree

import pytest

from lightloom.gen.pages.timeline import BAR, COLOURS, LEFT, RIGHT, ROWS, WIDTH, timeline
from lightloom.golden_model.machine.cost_model import STAGES, FrameCounts, Machine, RayCounts
from lightloom.golden_model.machine.schedule import DISPLAY, WHOLE, Schedule, schedule

ROW_OF = {stage: row for row, (_, stages) in enumerate(ROWS) for stage in stages}
SVG = "{http://www.w3.org/2000/svg}"
FRAME = FrameCounts(
    moved=1000,
    refitted=5000,
    triangles=2000,
    fragments_tested=400_000,
    fragments_shaded=200_000,
    frame_shader_pixels=200_000,
    pixels=200_000,
    fragment_rays=RayCounts(closest=20_000),
    frame_rays=RayCounts(any_hit=200_000),
    lightmap_rays=RayCounts(closest=160_000, any_hit=40_000),
    scanned=50_000,
    updates=10_000,
    published=30_000,
)


@pytest.fixture(scope="module")
def plan() -> Schedule:
    return schedule(Machine(frames_in_flight=3, versions=3, refresh_cycles=2_000_000), [FRAME] * 5)


def bars(svg: str) -> list[ElementTree.Element]:
    root = ElementTree.fromstring(svg)
    return [rect for rect in root.iter(f"{SVG}rect") if re.fullmatch(r"c\d", rect.get("class", ""))]


def _row(bar: ElementTree.Element) -> float:
    return float(bar.get("y", "")) + float(bar.get("height", ""))


def _title(bar: ElementTree.Element) -> str:
    title = bar.find(f"{SVG}title")
    assert title is not None
    return title.text or ""


def test_every_stage_has_a_row() -> None:
    drawn = [stage for _, stages in ROWS for stage in stages]
    assert sorted(drawn) == sorted([*STAGES, DISPLAY])


def test_every_event_is_a_bar_as_long_as_it_takes_and_as_high_as_its_share(plan: Schedule) -> None:
    found = bars(timeline(plan))
    end = max(event.end for event in plan.events)
    scale = (WIDTH - LEFT - RIGHT) / end
    by_place = sorted(plan.events, key=lambda event: (ROW_OF[event.stage], event.begin, event.frame))
    found.sort(key=lambda bar: (_row(bar), float(bar.get("x", "")), _title(bar)))
    for event, bar in zip(by_place, found, strict=True):
        assert bar.get("class") == f"c{event.frame % COLOURS}"
        assert float(bar.get("x", "")) == pytest.approx(LEFT + event.begin * scale, abs=0.01)
        width = (event.end - event.begin) * scale
        assert float(bar.get("width", "")) == pytest.approx(max(width, 0.6), abs=0.01)
        assert float(bar.get("height", "")) == pytest.approx(BAR * event.share / WHOLE, abs=0.01)
    titles = {_title(bar) for bar in found}
    assert len(titles) == len(plan.events)
    assert any(re.match(r"frame 3, lightmap rays: [\d.]+ to [\d.]+ ms, \d+% of the tracer", text) for text in titles)


def test_curves_lead_to_the_shading_that_reads_a_version(plan: Schedule) -> None:
    root = ElementTree.fromstring(timeline(plan))
    curves = list(root.iter(f"{SVG}path"))
    assert len(curves) == len(plan.frames) - 2  # versions 0 and 1 are there from the start
    for curve in curves:
        start, *_, x, _ = re.findall(r"[\d.]+", curve.get("d", ""))
        assert float(start) <= float(x)


def test_a_part_shows_what_is_in_it(plan: Schedule) -> None:
    begin, end = plan.frames[1].begin, plan.frames[2].shown
    inside = [event for event in plan.events if event.begin < end and event.end > begin]
    found = bars(timeline(plan, begin, end))
    assert len(found) == len(inside) < len(plan.events)
    assert all(LEFT <= float(bar.get("x", "")) <= WIDTH - RIGHT for bar in found)
    with pytest.raises(ValueError, match="nothing to draw"):
        timeline(plan, 5, 5)


def test_it_stands_alone_in_light_and_dark(plan: Schedule) -> None:
    svg = timeline(plan)
    assert svg.startswith('<svg class="timeline" xmlns="http://www.w3.org/2000/svg"')
    assert "prefers-color-scheme:dark" in svg
    used = set(re.findall(r'class="([^"]+)"', svg)) - {"timeline"}
    assert all(f".timeline .{name}" in svg or f".timeline text.{name}" in svg for name in used)
    assert svg == timeline(plan)
