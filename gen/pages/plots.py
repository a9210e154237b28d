"""Small charts as inline SVG. Colours come from the page's style sheet, by class; every mark has a title to hover."""

import math
from collections.abc import Callable, Mapping, Sequence
from html import escape

WIDTH, HEIGHT = 720, 220
LEFT, RIGHT, TOP, BOTTOM = 64, 8, 14, 26
NAMES = 92
"""Room for the names at the ends of lines."""
LABEL = 40
"""Room for a number below the axis."""
LETTER = 13
"""Names are so far apart at least."""


def stacked_bars(
    labels: Sequence[object],
    series: Mapping[str, Sequence[float]],
    limit: float | None = None,
    limit_name: str = "",
    *,
    width: int = WIDTH,
) -> str:
    """One bar a label, the series stacked in it, and a line at `limit`. Class `s0`, `s1`, … for each series.

    `width` is that of the drawing, whose letters have the same size at any.
    """
    totals = [sum(values) for values in zip(*series.values(), strict=True)]
    ticks = nice_ticks(max([*totals, limit or 0]))
    top = ticks[-1] or 1
    plot_width, plot_height = width - LEFT - RIGHT, HEIGHT - TOP - BOTTOM

    def y(value: float) -> float:
        return TOP + plot_height * (1 - value / top)

    parts = [_axis(ticks, y, width - RIGHT)]
    step = plot_width / max(len(labels), 1)
    every = -(-len(labels) * LABEL // (width - LEFT - RIGHT)) or 1
    for k, label in enumerate(labels):
        x, base = LEFT + k * step, 0.0
        for index, (name, values) in enumerate(series.items()):
            value = values[k]
            title = escape(f"frame {label}, {name}: {value:,.0f}")
            parts.append(
                f'<rect class="s{index}" x="{x + 0.12 * step:.1f}" y="{y(base + value):.1f}" width="{0.76 * step:.1f}" '
                f'height="{max(y(base) - y(base + value), 0):.1f}"><title>{title}</title></rect>'
            )
            base += value
        if k % every == 0:
            parts.append(
                f'<text x="{x + step / 2:.1f}" y="{HEIGHT - 8}" text-anchor="middle">{escape(str(label))}</text>'
            )
    if limit is not None:
        line, right = f"{y(limit):.1f}", width - RIGHT
        parts.append(f'<line class="limit" x1="{LEFT}" x2="{right}" y1="{line}" y2="{line}"/>')
        label_y = f"{y(limit) - 5:.1f}"
        parts.append(f'<text class="limit" x="{right}" y="{label_y}" text-anchor="end">{escape(limit_name)}</text>')
    return _svg(parts, width)


def line_chart(
    labels: Sequence[float],
    series: Mapping[str, Sequence[float | None]],
    *,
    number: Callable[[float], str] | None = None,
    marks: Sequence[float] = (),
    width: int = WIDTH,
) -> str:
    """One line a series over rising `labels` (frames), its name at its end; None is a gap.

    Class `c0`, `c1`, ... for each series. `number` writes values, `marks` are labels that get a vertical line, `width`
    is that of the drawing, whose letters have the same size at any.
    """
    number = number or short
    values = [value for line in series.values() for value in line if value is not None]
    ticks = nice_ticks(max(values, default=0))
    right = width - NAMES
    first, last = labels[0], labels[-1]

    def x(label: float) -> float:
        return LEFT + (right - LEFT) * ((label - first) / (last - first) if last > first else 0.5)

    def y(value: float) -> float:
        return TOP + (HEIGHT - TOP - BOTTOM) * (1 - value / ticks[-1])

    parts = [_axis(ticks, y, right, number)]
    parts += [
        f'<line class="mark" x1="{x(mark):.1f}" x2="{x(mark):.1f}" y1="{TOP}" y2="{HEIGHT - BOTTOM}"/>'
        for mark in marks
    ]
    for tick in _frame_ticks(first, last):
        parts.append(f'<text x="{x(tick):.1f}" y="{HEIGHT - 8}" text-anchor="middle">{tick}</text>')
    ends: dict[int, float] = {}
    for index, (name, line) in enumerate(series.items()):
        points = [(label, value) for label, value in zip(labels, line, strict=True) if value is not None]
        for run in _runs(labels, line):
            path = " ".join(f"{x(label):.1f},{y(value):.1f}" for label, value in run)
            parts.append(f'<polyline class="c{index}" points="{path}"/>')
        for label, value in points:
            title = f"<title>{escape(f'{name}, frame {label:g}: {number(value)}')}</title>"
            parts.append(f'<circle class="c{index}" cx="{x(label):.1f}" cy="{y(value):.1f}" r="5">{title}</circle>')
        if points:
            ends[index] = y(points[-1][1])
    for index, height in _apart(ends).items():
        name = escape(list(series)[index])
        parts.append(f'<text class="label c{index}" x="{right + 8}" y="{height + 4:.1f}">{name}</text>')
    return _svg(parts, width)


def nice_ticks(largest: float, count: int = 4) -> list[float]:
    """Round values from 0 to at least `largest`, about `count` steps: 1, 2, 2.5 or 5 times a power of ten apart."""
    if largest <= 0:
        return [0.0, 1.0]
    power = 10.0 ** math.floor(math.log10(largest / count))
    step = next(power * factor for factor in (1, 2, 2.5, 5, 10, 20) if power * factor * count >= largest)
    return [step * k for k in range(int(-(-largest // step)) + 1)]


def short(value: float) -> str:
    """1500000 as 1.5 M, 300000 as 300 k."""
    for size, letter in ((1e9, " G"), (1e6, " M"), (1e3, " k")):
        if value >= size:
            return f"{value / size:.3g}{letter}"
    return f"{value:.3g}"


def _runs(labels: Sequence[float], line: Sequence[float | None]) -> list[list[tuple[float, float]]]:
    """The stretches of a line between its gaps."""
    runs: list[list[tuple[float, float]]] = [[]]
    for label, value in zip(labels, line, strict=True):
        if value is not None:
            runs[-1].append((label, value))
        elif runs[-1]:
            runs.append([])
    return [run for run in runs if run]


def _frame_ticks(first: float, last: float, most: int = 12) -> list[int]:
    """Whole numbers from `first` to `last`, at most `most`: 1, 2 or 5 times a power of ten apart."""
    power = 10 ** max(math.floor(math.log10((last - first) / most)), 0) if last > first else 1
    step = next(power * factor for factor in (1, 2, 5, 10, 20) if power * factor * most > last - first)
    return [step * k for k in range(math.ceil(first / step), math.floor(last / step) + 1)]


def _apart(places: Mapping[int, float]) -> dict[int, float]:
    """The places of names (from the top) moved apart as little as a pass down and one up need, inside the drawing."""
    order = sorted(places, key=lambda index: (places[index], index))
    moved: dict[int, float] = {}
    floor = float(TOP)
    for index in order:
        moved[index] = max(places[index], floor)
        floor = moved[index] + LETTER
    ceiling = float(HEIGHT - BOTTOM)
    for index in reversed(order):
        moved[index] = min(moved[index], ceiling)
        ceiling = moved[index] - LETTER
    return moved


def _axis(
    ticks: Sequence[float],
    y: Callable[[float], float],
    right: float,
    number: Callable[[float], str] = short,
) -> str:
    lines = []
    for tick in ticks:
        lines.append(f'<line class="grid" x1="{LEFT}" x2="{right}" y1="{y(tick):.1f}" y2="{y(tick):.1f}"/>')
        lines.append(f'<text x="{LEFT - 8}" y="{y(tick) + 4:.1f}" text-anchor="end">{number(tick)}</text>')
    return "".join(lines)


def _svg(parts: Sequence[str], width: int) -> str:
    return f'<svg viewBox="0 0 {width} {HEIGHT}" role="img">{"".join(parts)}</svg>'
