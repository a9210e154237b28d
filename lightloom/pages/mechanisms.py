"""The page docs/mechanisms.md and the figures beside it: what each mechanism of the default policy is good for.

`python -m lightloom.pages.mechanisms` prints the policies that a suite has to compare for it, and
`python -m lightloom.pages.mechanisms build/mechanisms/suite.json` writes both of its report.
"""

import json
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from lightloom.golden_model.engine.selection.policy import MECHANISMS, Policy, policy_of
from lightloom.pages.results import table
from lightloom.pages.suite import DOCS, write_page
from lightloom.policies.bars import WHOLE, geometric_mean, means
from lightloom.shared.provenance import commands_at

DEFAULT = "influence"
WITHIN_VARIABILITY = ("dilation", "guard", "rings")
"""These do nothing without a map of variability, so they are taken from a policy that has one."""

PREAMBLE = """\
# What each mechanism is good for

<!-- Made by `python -m lightloom.pages.mechanisms build/mechanisms/suite.json`. -->

The [suite](policies.md#the-suite) under the default policy and under policies that differ from it in one mechanism:
{count} of {whole} cases (layouts, budgets and seeds). `-` is without it, `+` with it; each is the name of a policy, for
`--policy` and `--policies`.

{commands}

E is the mean error against converged maps, here of the policy with the mechanism to that of the policy without it: the
geometric mean over layouts and budgets, and the layouts where it helps most and least. Below 1 it helps. "Lag" and
"jump" are the worst of all cases without it and with it: turns until a change is shown, part of the pixels that flicker
at rest.
"""


def pairs() -> list[tuple[str, str, str]]:
    """Of each mechanism its name, and the names of the policies without it and with it."""
    found = []
    for mechanism in MECHANISMS:
        if mechanism in WITHIN_VARIABILITY:
            with_it = f"{DEFAULT}+variability"
            found.append((mechanism, f"{with_it}-{mechanism}", with_it))
        elif policy_of(f"{DEFAULT}-{mechanism}") == Policy():
            found.append((mechanism, DEFAULT, f"{DEFAULT}+{mechanism}"))
        else:
            found.append((mechanism, f"{DEFAULT}-{mechanism}", DEFAULT))
    return found


def policies() -> list[str]:
    """All policies that the page needs, each once, the default last."""
    names = dict.fromkeys(name for _, *both in pairs() for name in both if name != DEFAULT)
    return [*names, DEFAULT]


def rows_of(cases: Sequence[Mapping[str, Any]]) -> list[tuple[str, ...]]:
    """The table: a row for each mechanism whose policies the cases have."""
    rows: list[tuple[str, ...]] = []
    for _, without, with_it in pairs():
        if not all({without, with_it} <= set(case["policies"]) for case in cases):
            continue
        ratios = {key: error / means(cases, without)[key] for key, error in means(cases, with_it).items()}
        best, worst = min(ratios, key=lambda key: ratios[key]), max(ratios, key=lambda key: ratios[key])
        rows.append(
            (
                f"`{with_it}` to `{without}`",
                "on" if with_it == DEFAULT else "off",
                f"{geometric_mean(list(ratios.values())):.3f}",
                f"{ratios[best]:.2f} ({' '.join(best)})",
                f"{ratios[worst]:.2f} ({' '.join(worst)})",
                _both(cases, without, with_it, "lag_turns", "{:.1f}"),
                _both(cases, without, with_it, "jump", "{:.2%}"),
            )
        )
    return rows


def _both(cases: Sequence[Mapping[str, Any]], without: str, with_it: str, figure: str, shown: str) -> str:
    """The worst of a figure of all cases, under both policies."""
    found = []
    for name in (without, with_it):
        values = [case["policies"][name][figure] for case in cases if case["policies"][name][figure] is not None]
        found.append(shown.format(max(values)) if values else "-")
    return ", ".join(found)


def page(report: Mapping[str, Any]) -> str:
    """The whole page, of what docs/mechanisms.json holds."""
    cases = report["cases"]
    head = ("E of", "by default", "mean", "best", "worst", "lag, turns", "jump")
    preamble = PREAMBLE.format(
        count=len(cases),
        whole=WHOLE,
        commands=commands_at([(report["command"], report["versions"])]),
    )
    return f"{preamble}\n{table(head, rows_of(cases))}\n"


def write(report: Mapping[str, Any], docs: Path = DOCS) -> None:
    """Writes mechanisms.json and mechanisms.md into a folder, of what a suite.json holds."""
    write_page("mechanisms", page, report, docs)


if __name__ == "__main__":
    if len(sys.argv) == 1:
        print(",".join(policies()))
    else:
        write(json.loads(Path(sys.argv[1]).read_text(encoding="utf-8")))
