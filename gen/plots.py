"""Small charts as inline SVG. Colours come from the page's style sheet, by class; every mark has a title to hover."""

from collections.abc import Callable, Mapping, Sequence
from html import escape

WIDTH, HEIGHT = 720, 220
LEFT, RIGHT, TOP, BOTTOM = 64, 8, 14, 26


def stacked_bars(
    labels: Sequence[object], series: Mapping[str, Sequence[float]], limit: float | None = None, limit_name: str = ""
) -> str:
    """One bar a label, the series stacked in it, and a line at `limit`. Class `s0`, `s1`, … for each series."""
    totals = [sum(values) for values in zip(*series.values(), strict=True)]
    ticks = nice_ticks(max([*totals, limit or 0]))
    top = ticks[-1] or 1
    plot_width, plot_height = WIDTH - LEFT - RIGHT, HEIGHT - TOP - BOTTOM

    def y(value: float) -> float:
        return TOP + plot_height * (1 - value / top)

    parts = [_axis(ticks, y)]
    step = plot_width / max(len(labels), 1)
    every = -(-len(labels) // 16)
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
        line, right = f"{y(limit):.1f}", WIDTH - RIGHT
        parts.append(f'<line class="limit" x1="{LEFT}" x2="{right}" y1="{line}" y2="{line}"/>')
        label_y = f"{y(limit) - 5:.1f}"
        parts.append(f'<text class="limit" x="{right}" y="{label_y}" text-anchor="end">{escape(limit_name)}</text>')
    return _svg(parts)


def nice_ticks(largest: float, count: int = 4) -> list[float]:
    """Round values from 0 to at least `largest`, about `count` steps: 1, 2, 2.5 or 5 times a power of ten apart."""
    if largest <= 0:
        return [0.0, 1.0]
    power = 10.0 ** len(str(int(largest / count))) / 10
    step = next(power * factor for factor in (1, 2, 2.5, 5, 10, 20) if power * factor * count >= largest)
    return [step * k for k in range(int(-(-largest // step)) + 1)]


def short(value: float) -> str:
    """1500000 as 1.5 M, 300000 as 300 k."""
    for size, letter in ((1e9, " G"), (1e6, " M"), (1e3, " k")):
        if value >= size:
            return f"{value / size:.3g}{letter}"
    return f"{value:.3g}"


def _axis(ticks: Sequence[float], y: Callable[[float], float]) -> str:
    lines = []
    for tick in ticks:
        lines.append(f'<line class="grid" x1="{LEFT}" x2="{WIDTH - RIGHT}" y1="{y(tick):.1f}" y2="{y(tick):.1f}"/>')
        lines.append(f'<text x="{LEFT - 8}" y="{y(tick) + 4:.1f}" text-anchor="end">{short(tick)}</text>')
    return "".join(lines)


def _svg(parts: Sequence[str]) -> str:
    return f'<svg viewBox="0 0 {WIDTH} {HEIGHT}" role="img">{"".join(parts)}</svg>'
