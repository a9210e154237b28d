"""docs/mechanisms.md: what each mechanism does to the error, over the suite."""

import json
from pathlib import Path
from typing import Any

from lightloom.golden_model.engine.selection.policy import MECHANISMS, Policy, policy_of
from lightloom.pages.mechanisms import DOCS, page, pairs, policies, rows_of, write


def figures(error: float, lag: float | None = None, jump: float | None = None) -> dict[str, Any]:
    return {"error": error, "lag_turns": lag, "jump": jump}


def test_each_pair_differs_in_its_mechanism_and_one_of_them_is_the_default() -> None:
    assert [mechanism for mechanism, *_ in pairs()] == list(MECHANISMS)
    for mechanism, without, with_it in pairs():
        assert policy_of(f"{without}+{mechanism}") == policy_of(with_it) != policy_of(without)
        inside = mechanism in ("dilation", "guard", "rings")
        assert inside or Policy() in (policy_of(without), policy_of(with_it))
    assert policies()[-1] == "influence"
    assert len(policies()) == len(set(policies()))


def test_the_help_names_all_of_them() -> None:
    text = " ".join((DOCS / "command-line.md").read_text(encoding="utf-8").split())
    assert ", ".join(list(MECHANISMS)[:-1]) + f" and {list(MECHANISMS)[-1]}." in text


def test_rows_are_means_over_layouts_and_budgets_of_the_means_of_seeds() -> None:
    errors = {("door", 0): (0.3, 0.1), ("door", 1): (0.5, 0.3), ("room", 0): (0.1, 0.2)}
    cases = [
        {
            "layout": layout,
            "budget": "scarce",
            "seed": seed,
            "policies": {"influence-drift": figures(off, 4.25), "influence": figures(on, 3.0, 0.015)},
        }
        for (layout, seed), (off, on) in errors.items()
    ]
    # Of door (0.1 + 0.3) / (0.3 + 0.5), of room 2.
    row = ("`influence` to `influence-drift`", "on", "1.000", "0.50 (door scarce)", "2.00 (room scarce)")
    assert rows_of(cases) == [(*row, "4.2, 3.0", "-, 1.50%")]


def test_the_page_says_what_the_figures_say(tmp_path: Path) -> None:
    report = json.loads((DOCS / "mechanisms.json").read_text(encoding="utf-8"))
    assert (DOCS / "mechanisms.md").read_text(encoding="utf-8") == page(report)
    assert report["policies"] == policies()
    assert not report["versions"]["commit"].endswith("-dirty")
    write(report | {"rows": [], "means": {}, "bars": []}, tmp_path)
    assert (tmp_path / "mechanisms.json").read_bytes() == (DOCS / "mechanisms.json").read_bytes()
