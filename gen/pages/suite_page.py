"""The page of `lightloom policies --suite`: a table, the worst first, and the films of the cases beside it."""

from collections.abc import Mapping
from typing import Any

from lightloom.gen.pages.pages import environment
from lightloom.gen.pages.policies_page import percent, times


def suite_page(report: Mapping[str, Any]) -> str:
    """The page for a report (as in suite.json), to be put beside the folder of the cases."""
    rows, names = report["rows"], report["policies"]
    pages = environment()
    pages.filters.update(percent=percent, times=times)
    return pages.get_template("suite.html").render(
        **{name: report[name] for name in ("rows", "means", "versions", "command")},
        names=names,
        baseline=names[0],
        full=names[-1],
        layouts=len({row["layout"] for row in rows}),
        budgets=len({row["budget"] for row in rows}),
        seeds=len(rows[0]["pages"]),
    )
