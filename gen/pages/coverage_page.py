"""The page of `lightloom coverage`: one HTML file without scripts or links to elsewhere."""

from collections.abc import Mapping, Sequence
from itertools import groupby
from operator import itemgetter
from typing import Any

from lightloom.gen.pages.pages import environment


def coverage_page(report: Mapping[str, Any]) -> str:
    """The page for a report (as in coverage.json)."""
    rows = report["rows"]
    pages = environment()
    pages.filters.update(percent=percent)
    return pages.get_template("coverage.html").render(
        report=report,
        rows=rows,
        total=totals(rows),
        empty=sum(not row["count"] for row in report["bins"]),
        unexplained=[row for row in report["untaken"] if row["reason"] is None],
        explained=by_reason(report["untaken"]),
        units=[(unit, list(_grouped(bins, "group"))) for unit, bins in _grouped(report["bins"], "unit")],
    )


def totals(rows: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """The sum over the units of every figure."""
    return {name: sum(row[name] for row in rows) for name in rows[0] if isinstance(rows[0][name], int | float)}


def by_reason(untaken: Sequence[Mapping[str, Any]]) -> list[tuple[str, list[Mapping[str, Any]]]]:
    """Branches that cannot be taken, by the reason why."""
    found = [row for row in untaken if row["reason"] is not None]
    return list(_grouped(sorted(found, key=itemgetter("reason")), "reason"))


def _grouped(rows: Sequence[Mapping[str, Any]], key: str) -> Any:
    return ((name, list(part)) for name, part in groupby(rows, key=itemgetter(key)))


def percent(part: int, whole: int) -> str:
    """A share with one digit, never 100.0 % unless it is all; a dash of nothing."""
    if not whole:
        return "\N{EN DASH}"
    tenths = 1000 * part // whole
    return f"{tenths // 10}.{tenths % 10} %"
