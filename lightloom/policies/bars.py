"""What the suite's figures have to be: each bar with its figure, its limit, and whether it is met.

A bar is met by the figure itself, never by what it is rounded to; what is shown is rounded to the worse side. What was
not measured is not met, nor is what is only known to be more than its figure. Of the last policy of a report.
"""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from lightloom.golden_model.stimuli.layouts.catalogue import BUDGETS, LAYOUTS, SEEDS

WHOLE = len(LAYOUTS) * len(BUDGETS) * len(SEEDS)
"""Cases of the suite."""
FIRST, SEEN = "round-robin", "visibility"
"""The policies that the last one is held against."""
DIGITS = 4
"""Of a figure as shown, after the point."""

Case = Mapping[str, Any]


@dataclass(frozen=True)
class Bar:
    """A figure and its limit."""

    name: str
    figure: float | None
    """None: not measured."""
    limit: float
    least: bool = False
    """Whether the figure has to be at least the limit; else at most."""
    where: str = ""
    """Where the figure is, if it is the worst of many."""
    beyond: bool = False
    """Whether the true figure is known to be worse than `figure`, but not by how much."""

    @property
    def met(self) -> bool:
        if self.figure is None or self.beyond:
            return False
        # NaN is not met.
        return self.figure >= self.limit if self.least else self.figure <= self.limit

    @property
    def shown(self) -> str:
        """The figure, rounded to the worse side."""
        if self.figure is None or not math.isfinite(self.figure):
            return "not measured"
        rounded = (math.floor if self.least else math.ceil)(self.figure * 10**DIGITS) / 10**DIGITS
        return f"{'> ' if self.beyond else ''}{rounded:g}"

    @property
    def wanted(self) -> str:
        return f"{'>=' if self.least else '<='} {self.limit:g}"


def bars(report: Mapping[str, Any], before: Mapping[str, Any] | None = None) -> list[Bar]:
    """The bars of a suite's report; `before` is that of an earlier build, whose round-robin it is held against."""
    cases, last = report["cases"], report["policies"][-1]
    return [
        Bar("cases measured", len(cases), WHOLE, least=True),
        *_errors(cases, last),
        Bar(
            "geometric mean of E over layouts and budgets, to that of an earlier build's round-robin",
            None if before is None else against_before(cases, before["cases"], last),
            0.55,
        ),
        _lag(cases, last),
        _worst("darkened pixels of any frame", 0, cases, lambda case: case["policies"][last]["darkened"]),
        _worst("pixels that jump in any still frame", 0.01, cases, lambda case: case["policies"][last]["jump"]),
        _worst(
            "texels that a frame's pixels read and visibility missed",
            0.005,
            cases,
            lambda case: case["policies"][last].get("missed"),
        ),
        _worst("rays spent over budget, most", 1, cases, lambda case: case["policies"][last]["greatest_share"]),
        _worst(
            "rays spent over budget, least", 0.95, cases, lambda case: case["policies"][last]["least_share"], least=True
        ),
        *_true(cases, last),
    ]


def rows_of(bars: Iterable[Bar]) -> list[dict[str, Any]]:
    """For JSON and pages."""
    return [asdict(bar) | {"met": bar.met, "shown": bar.shown, "wanted": bar.wanted} for bar in bars]


def _errors(cases: Sequence[Case], last: str) -> list[Bar]:
    """E against the better of `visibility` and round-robin of the same build, and against round-robin."""
    others = [name for name in (FIRST, SEEN) if all(name in case["policies"] for case in cases)]
    if others != [FIRST, SEEN]:
        single, layout, mean = None, None, None
        worst_single = worst_layout = ""
    else:
        better = [
            case["policies"][last]["error"] / min(case["policies"][name]["error"] for name in others) for case in cases
        ]
        single = max(better)
        worst_single = _name(cases[int(np.argmax(better))])
        errors = {name: means(cases, name) for name in (*others, last)}
        ratios = {key: errors[last][key] / min(errors[name][key] for name in others) for key in errors[last]}
        worst = max(ratios, key=lambda key: ratios[key])
        layout, worst_layout = ratios[worst], "-".join(worst)
        mean = geometric_mean([errors[last][key] / errors[FIRST][key] for key in errors[last]])
    return [
        Bar("E of a layout and budget, to the better of visibility and round-robin", layout, 1.03, where=worst_layout),
        Bar("the same of a single run", single, 1.08, where=worst_single),
        Bar("geometric mean of E over layouts and budgets, to that of round-robin", mean, 0.8),
    ]


def _lag(cases: Sequence[Case], last: str) -> Bar:
    """The longest lag; one that was never shown comes before all others."""
    found = [case for case in cases if case["policies"][last]["lag_turns"] is not None]
    if not found:
        return Bar("lag, in turns", None, 8)
    worst = max(
        found, key=lambda case: (case["policies"][last]["never_shown"] > 0, case["policies"][last]["lag_turns"])
    )
    figures = worst["policies"][last]
    return Bar("lag, in turns", figures["lag_turns"], 8, where=_name(worst), beyond=figures["never_shown"] > 0)


def _true(cases: Sequence[Case], last: str) -> list[Bar]:
    """E true and its energy, where they were measured."""
    measured = [case for case in cases if case["policies"][last].get("true_error") is not None]
    if not measured:
        return []
    return [
        _worst("E true", 0.04, measured, lambda case: case["policies"][last]["true_error"]),
        _worst("energy true, off by", 0.02, measured, lambda case: abs(case["policies"][last]["true_energy"] - 1)),
    ]


def _worst(
    name: str, limit: float, cases: Sequence[Case], figure: Callable[[Case], float | None], least: bool = False
) -> Bar:
    """The bar of the worst case among those that have the figure."""
    found = [(value, _name(case)) for case in cases if (value := figure(case)) is not None]
    if not found:
        return Bar(name, None, limit, least)
    value, where = (min if least else max)(found)
    return Bar(name, value, limit, least, where)


def _name(case: Case) -> str:
    return f"{case['layout']}-{case['budget']}-{case['seed']}"


def means(cases: Iterable[Case], policy: str) -> dict[tuple[str, str], float]:
    """E of each layout and budget under a policy, the mean of its seeds."""
    found: dict[tuple[str, str], list[float]] = {}
    for case in cases:
        found.setdefault((case["layout"], case["budget"]), []).append(case["policies"][policy]["error"])
    return {key: float(np.mean(errors)) for key, errors in found.items()}


def against_before(cases: Sequence[Case], before: Sequence[Case], last: str) -> float | None:
    """Geometric mean over layouts and budgets of E to round-robin's E of an earlier build, over runs that both have."""
    common = {_name(case) for case in cases} & {_name(case) for case in before}
    now = means((case for case in cases if _name(case) in common), last)
    then = means((case for case in before if _name(case) in common), FIRST)
    return geometric_mean([now[key] / then[key] for key in now]) if now else None


def geometric_mean(ratios: Sequence[float]) -> float:
    """Of positive numbers, at least one."""
    return float(np.exp(np.log(ratios).mean()))
