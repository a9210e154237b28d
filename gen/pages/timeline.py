"""A schedule drawn over time, as in FIG. 3 to 5: one SVG that stands alone or in a page, in light and in dark."""

from collections.abc import Sequence
from html import escape

from lightloom.gen.pages.plots import nice_ticks
from lightloom.golden_model.machine.schedule import DISPLAY, WHOLE, Event, Schedule

ROWS: tuple[tuple[str, tuple[str, ...]], ...] = (
    ("display", (DISPLAY,)),
    ("input, geometry", ("input", "geometry")),
    ("acceleration structure", ("structure",)),
    ("visible surfaces", ("visible surfaces",)),
    ("fragment shading", ("fragment shading",)),
    ("frame shader", ("frame shader",)),
    ("rays of the frame", ("fragment rays", "frame rays")),
    ("ray shading", ("ray shading",)),
    ("blending, output", ("blending", "output")),
    ("lightmap rays", ("lightmap rays",)),
    ("lightmap shading", ("lightmap shading",)),
    ("selection, update", ("selection", "lightmap update")),
)
"""Label and stages of each row, downwards."""

FIRST_MAINTENANCE = 9
"""The row above which the line between picture and maintenance runs."""

WIDTH, LEFT, RIGHT, TOP = 1080, 160, 16, 34
ROW, BAR, GAP = 34, 24, 14
COLOURS = 4
"""Frames are told apart by colour; every fourth has the same."""

STYLE = """
.timeline{--paper:#fcfcfa;--ink:#1c1d20;--soft:#62656c;--line:#dfdfda;--c0:#d9822b;--c1:#4a6fa5;--c2:#5a9367;--c3:#8b6bb1}
@media (prefers-color-scheme:dark){.timeline{--paper:#131416;--ink:#e9e8e4;--soft:#9b9ea6;--line:#303238;--c0:#c9752a;
--c1:#5b82bd;--c2:#5a9a6b;--c3:#977bc0}}
.timeline .paper{fill:var(--paper)}
.timeline text{font:11px ui-sans-serif,system-ui,-apple-system,"Segoe UI",Arial,sans-serif;fill:var(--soft)}
.timeline text.row{fill:var(--ink);font-size:12px}
.timeline text.number{fill:#fff;font-weight:600;pointer-events:none}
.timeline .line{stroke:var(--line)}
.timeline .refresh{stroke:var(--soft);stroke-dasharray:2 4}
.timeline .version{stroke:var(--ink);stroke-width:1.2;fill:none;opacity:.55}
.timeline .version:hover{opacity:1;stroke-width:2.5}
.timeline .room{fill:var(--line);opacity:.45}
.timeline .c0{fill:var(--c0)}.timeline .c1{fill:var(--c1)}.timeline .c2{fill:var(--c2)}.timeline .c3{fill:var(--c3)}
.timeline rect.c0:hover,.timeline rect.c1:hover,.timeline rect.c2:hover,.timeline rect.c3:hover{filter:brightness(1.25)}
"""


def timeline(plan: Schedule, begin: int = 0, end: int | None = None) -> str:
    """The part of a schedule between two cycles (to its end unless given) as SVG.

    A bar is a stage of a frame, in the frame's colour, its height the part of the unit that it has: lightmap rays grow
    where the rasterizer works, and fill their row where the frames have no rays. Curves lead from the end of an update
    of the lightmaps to the shading that reads the version which it completes.
    """
    end = max((event.end for event in plan.events), default=1) if end is None else end
    if not begin < end:
        raise ValueError(f"from cycle {begin} to {end}: nothing to draw")
    height = TOP + ROW * len(ROWS) + GAP + 8
    parts = [f'<rect class="paper" width="{WIDTH}" height="{height}"/>', *_axis(plan, begin, end, height)]

    def x(cycle: int) -> float:
        return LEFT + (WIDTH - LEFT - RIGHT) * (min(max(cycle, begin), end) - begin) / (end - begin)

    for row, (label, stages) in enumerate(ROWS):
        y = _y(row)
        parts.append(f'<text class="row" x="{LEFT - 10}" y="{y + BAR / 2 + 4:.1f}" text-anchor="end">{label}</text>')
        parts.append(f'<rect class="room" x="{LEFT}" y="{y:.1f}" width="{WIDTH - LEFT - RIGHT}" height="{BAR}"/>')
        shown = [e for e in plan.events if e.stage in stages and e.begin < end and e.end > begin]
        parts += [_bar(plan, event, y, x(event.begin), x(event.end)) for event in shown]
        parts += _numbers(shown, y, [(x(event.begin), x(event.end)) for event in shown])
    for time in plan.frames:
        if time.version_complete > begin and time.read_from < end:
            parts.append(_version(plan, time.frame, x(time.version_complete), x(time.read_from)))
    return (
        f'<svg class="timeline" xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {height}" role="img">'
        f"<title>Frames on the machine, over time</title><style>{STYLE}</style>{''.join(parts)}</svg>"
    )


def _y(row: int) -> float:
    return TOP + ROW * row + (GAP if row >= FIRST_MAINTENANCE else 0)


def _axis(plan: Schedule, begin: int, end: int, height: int) -> list[str]:
    """Times in milliseconds above the rows, display times as dashed lines through all of them."""
    parts = []
    plot = WIDTH - LEFT - RIGHT
    duration = plan.machine.seconds(end - begin) * 1000
    for tick in nice_ticks(duration * 1000, 8):  # in microseconds: whole numbers
        at = LEFT + plot * tick / 1000 / duration
        if at <= LEFT + plot + 0.5:
            parts.append(f'<line class="line" x1="{at:.1f}" x2="{at:.1f}" y1="{TOP - 8}" y2="{height - 8}"/>')
            parts.append(f'<text x="{at:.1f}" y="{TOP - 14}" text-anchor="middle">{tick / 1000:g} ms</text>')
    refresh = plan.machine.refresh_cycles
    if refresh and (end - begin) // refresh < 100:
        for cycle in range(-(-begin // refresh) * refresh, end + 1, refresh):
            at = LEFT + plot * (cycle - begin) / (end - begin)
            parts.append(f'<line class="refresh" x1="{at:.1f}" x2="{at:.1f}" y1="{TOP - 4}" y2="{height - 8}"/>')
    line = _y(FIRST_MAINTENANCE) - GAP / 2 - 5
    parts.append(f'<line class="line" x1="8" x2="{WIDTH - RIGHT}" y1="{line:.1f}" y2="{line:.1f}"/>')
    return parts


def _bar(plan: Schedule, event: Event, y: float, left: float, right: float) -> str:
    height = BAR * event.share / WHOLE
    first, last = (plan.machine.seconds(cycle) * 1000 for cycle in (event.begin, event.end))
    share = "" if event.share == WHOLE else f", {event.share / WHOLE:.0%} of the {event.resource}"
    title = escape(f"frame {event.frame}, {event.stage}: {first:.3f} to {last:.3f} ms{share}")
    return (
        f'<rect class="c{event.frame % COLOURS}" x="{left:.2f}" y="{y + BAR - height:.2f}" '
        f'width="{max(right - left, 0.6):.2f}" height="{height:.2f}"><title>{title}</title></rect>'
    )


def _numbers(events: Sequence[Event], y: float, edges: Sequence[tuple[float, float]]) -> list[str]:
    """The frame's number in its longest bar of a row, where there is room."""
    widest: dict[int, tuple[float, float, float]] = {}
    for event, (left, right) in zip(events, edges, strict=True):
        height = BAR * event.share / WHOLE
        room = 9 * len(str(event.frame)) + 4
        if height >= 12 and right - left > max(widest.get(event.frame, (room,))[0], room):
            widest[event.frame] = right - left, (left + right) / 2, y + BAR - height / 2 + 4
    return [
        f'<text class="number" x="{middle:.1f}" y="{base:.1f}" text-anchor="middle">{frame}</text>'
        for frame, (_, middle, base) in widest.items()
    ]


def _version(plan: Schedule, frame: int, left: float, right: float) -> str:
    names = [stages for _, stages in ROWS]
    above = _y(names.index(("fragment shading",))) + BAR
    below = _y(len(ROWS) - 1)
    time = plan.frames[frame]
    first, last = (plan.machine.seconds(cycle) * 1000 for cycle in (time.version_complete, time.read_from))
    title = f"version {frame} of the lightmaps: complete at {first:.3f} ms, read from {last:.3f} ms"
    bend = (below - above) / 3
    curve = (
        f"M{left:.1f} {below:.1f}C{left:.1f} {below - bend:.1f} {right:.1f} {above + bend:.1f} {right:.1f} {above:.1f}"
    )
    return f'<path class="version" d="{curve}"><title>{title}</title></path>'
