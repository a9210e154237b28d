"""Bars of the suite: what is met, what is not, and that nothing is rounded in favour."""

from typing import Any

import pytest

from lightloom.golden_model.stimuli.layouts.catalogue import BUDGETS, LAYOUTS, SEEDS
from lightloom.policies.bars import Bar, against_before, bars


def report(**changes: Any) -> dict[str, Any]:
    """A report in which all bars are met, but for what is changed in the figures of the last case's last policy."""
    good: dict[str, Any] = {"error": 0.1, "darkened": 0.0, "jump": 0.01, "greatest_share": 1.0, "least_share": 0.95}
    good |= {"lag_turns": 8.0, "missed": 0.005, "never_shown": 0, "true_error": None, "true_energy": None}
    cases: list[dict[str, Any]] = [
        {
            "layout": layout,
            "budget": budget,
            "seed": seed,
            "policies": {
                "round-robin": good | {"error": 0.2},
                "visibility": good | {"error": 0.125},
                "influence": dict(good),
            },
        }
        for layout in LAYOUTS
        for budget in BUDGETS
        for seed in SEEDS
    ]
    cases[-1]["policies"]["influence"] |= changes
    return {"policies": list(cases[0]["policies"]), "cases": cases}


LAST = list(LAYOUTS)[-1] + "-plenty-2"


def named(report: dict[str, Any], words: str, before: dict[str, Any] | None = None) -> Bar:
    (found,) = (bar for bar in bars(report, before) if words in bar.name)
    return found


def test_all_bars_are_met() -> None:
    met = {bar.name: bar.met for bar in bars(report(), report())}
    assert len(met) == 11
    assert all(met.values()), met
    unmet = [bar for bar in bars(report()) if not bar.met]
    assert [bar.shown for bar in unmet] == ["not measured"], "an earlier build is not known"


@pytest.mark.parametrize(
    ("changes", "words", "shown"),
    [
        ({"error": 0.125 * 1.0800001}, "single run", "1.0801"),
        ({"darkened": 1e-9}, "darkened", "0.0001"),
        ({"jump": 0.01000001}, "jump", "0.0101"),
        ({"missed": 0.00500001}, "missed", "0.0051"),
        ({"greatest_share": 1.0000001}, "budget, most", "1.0001"),
        ({"least_share": 0.9499999}, "budget, least", "0.9499"),
        ({"lag_turns": 8.00001}, "lag", "8.0001"),
        ({"lag_turns": 2.0, "never_shown": 1}, "lag", "> 2"),
    ],
)
def test_a_hair_is_enough_to_miss(changes: dict[str, Any], words: str, shown: str) -> None:
    bar = named(report(**changes), words)
    assert not bar.met
    assert (bar.shown, bar.where) == (shown, LAST)
    assert [other.met for other in bars(report(**changes), report())].count(False) == 1


def test_errors_of_layouts_are_means_of_seeds() -> None:
    made = report(error=0.4)
    bar = named(made, "E of a layout")
    assert bar.figure == pytest.approx((0.1 + 0.1 + 0.4) / 3 / 0.125)
    assert bar.where == LAST.removesuffix("-2")
    assert named(made, "single run").figure == pytest.approx(0.4 / 0.125)
    rows = len(LAYOUTS) * len(BUDGETS)
    assert named(made, "to that of round-robin").figure == pytest.approx(0.5 * 2 ** (1 / rows))


def test_an_earlier_build_is_compared_by_the_runs_that_both_have() -> None:
    before = report()
    before["cases"] = before["cases"][:6]
    for case in before["cases"]:
        case["policies"]["round-robin"]["error"] = 0.4
    assert named(report(error=7), "earlier", before).figure == pytest.approx(0.25)
    assert against_before(report()["cases"], [], "influence") is None


def test_what_is_missing_is_not_met() -> None:
    made = report()
    made["cases"] = made["cases"][1:]
    assert not named(made, "cases measured").met
    for case in made["cases"]:
        del case["policies"]["visibility"]
    assert [bar.shown for bar in bars(made)].count("not measured") == 4
    assert not Bar("nan", float("nan"), 1).met


def test_true_errors_are_bars_where_they_were_measured() -> None:
    found = bars(report(true_error=0.0400001, true_energy=0.9799999))
    assert [(bar.met, bar.shown) for bar in found[-2:]] == [(False, "0.0401"), (False, "0.0201")]
    assert all(bar.met for bar in bars(report(true_error=0.04, true_energy=1.0199))[-2:])
