"""All layouts of the suite under policies, each at two budgets and from three seeds: what a default is chosen by.

Cases are computed side by side, and kept: what an interrupted run had done, the next one takes. Where the program or an
option has changed since, they are made anew.
"""

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

from lightloom.gen.pages.suite_page import markdown_table, suite_page
from lightloom.golden_model.host.outputs import whole_file
from lightloom.golden_model.stimuli.layouts.catalogue import LAYOUTS
from lightloom.policies.bars import bars, geometric_mean, rows_of
from lightloom.policies.case import Case, run_case
from lightloom.policies.options import Comparison
from lightloom.policies.report import TRUE
from lightloom.shared.console import Progress, json_text
from lightloom.shared.provenance import machine, versions

WORST = ("jump", "lag", "lag_turns", "darkened", "missed", "oldest", "greatest_share")
"""Figures of the last policy of which a row has the greatest of all seeds; None: no seed has it."""


def run_suite(
    chosen: list[Case], options: Comparison, folder: Path, jobs: int, advance: Callable[[float], None]
) -> list[dict[str, Any]]:
    """The figures of all cases, in their order, `jobs` at a time; `advance` is told of each that is done."""
    done: dict[str, dict[str, Any]] = {}
    # Not by a fork, which could copy a lock that another thread of this process holds.
    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
        waiting = {pool.submit(run_case, case, options, folder): case for case in chosen}
        try:
            for future in as_completed(waiting):
                done[waiting[future].name] = future.result()
                advance(1)
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise
    return [done[case.name] for case in chosen]


def write_suite(
    chosen: list[Case],
    options: Comparison,
    folder: Path,
    jobs: int,
    command: str,
    before: Mapping[str, Any] | None = None,
) -> dict[str, Any]:
    """Runs all cases, writes suite.json, suite.md and index.html into `folder`; returns what suite.json holds.

    `before` is what suite.json of an earlier build holds.
    """
    with Progress() as progress, progress.stage("Cases", len(chosen)) as advance:
        figures = run_suite(chosen, options, folder, jobs, advance)
    report = suite_report(figures, options.policies, command, before)
    texts = {
        "suite.json": json_text(report),
        "suite.md": "\n".join([*markdown_table(report["rows"]), ""]),
        "index.html": suite_page(report),
    }
    for name, text in texts.items():
        with whole_file(folder / name) as part:
            part.write_text(text, encoding="utf-8")
    return report


# --- what they say together -------------------------------------------------------------------------------------------


def suite_report(
    figures: list[dict[str, Any]], policies: Sequence[str], command: str, before: Mapping[str, Any] | None = None
) -> dict[str, Any]:
    """What suite.json holds, of the figures of cases."""
    rows = table(figures)
    report = {
        "command": command,
        "policies": list(policies),
        "means": geometric_means(rows),
        "rows": rows,
        "cases": figures,
        "versions": versions(),
        "machine": machine(),
    }
    return report | {"bars": rows_of(bars(report, before))}


def table(figures: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """A row a layout and budget, of its seeds' means, the worst first: by the last policy's error against the better of
    the others'."""
    groups: dict[tuple[str, str], list[dict[str, Any]]] = {}
    for case in figures:
        groups.setdefault((case["layout"], case["budget"]), []).append(case)
    rows = [_row(layout, budget, group) for (layout, budget), group in groups.items()]
    return sorted(rows, key=lambda row: -row["against_best"])


def _row(layout: str, budget: str, group: list[dict[str, Any]]) -> dict[str, Any]:
    names = list(group[0]["policies"])
    errors = {name: np.array([case["policies"][name]["error"] for case in group]) for name in names}
    full, others = errors[names[-1]], [errors[name] for name in names[:-1]] or [errors[names[-1]]]
    best = min(others, key=lambda each: each.mean())
    last = [case["policies"][names[-1]] for case in group]

    def every(name: str) -> list[Any]:
        # What was measured by an earlier build may lack what came later.
        return [each[name] for each in last if each.get(name) is not None]

    return {
        "layout": layout,
        "about": LAYOUTS[layout].about,
        "budget": budget,
        "errors": {name: float(each.mean()) for name, each in errors.items()},
        "against_best": float(full.mean() / best.mean()),
        "worst_run": float((full / np.minimum.reduce(others)).max()),
        "energy": float(np.mean(every("energy"))),
        "flip": float(np.mean(every("flip"))),
        **{name: float(np.mean(every(name))) if every(name) else None for name in TRUE},
        **{name: max(every(name), default=None) for name in WORST},
        "never_shown": sum(every("never_shown")),
        "least_share": min(every("least_share"), default=None),
        "pages": [case["page"] for case in group],
    }


def geometric_means(rows: list[dict[str, Any]]) -> dict[str, float]:
    """Of each policy its error against the first one's, over layouts and budgets."""
    first = next(iter(rows[0]["errors"]))
    ratios = {name: [row["errors"][name] / row["errors"][first] for row in rows] for name in rows[0]["errors"]}
    return {name: geometric_mean(each) for name, each in ratios.items()}
