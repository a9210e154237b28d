"""The page of `lightloom policies --suite`: a table, the worst first, and the films of the cases beside it."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from lightloom.gen.pages.pages import environment
from lightloom.gen.pages.policies_page import percent, times

Row = Mapping[str, Any]


@dataclass(frozen=True)
class Column:
    """A column of the table, after the layout, the budget and the errors."""

    name: str
    shown: Callable[[Row], str]
    about: str
    over: Callable[[Row], bool] = lambda row: False
    """Whether the figure of a row is one to look at."""


def share(value: float | None) -> str:
    """A part of a whole as a percentage with two decimals; empty where there is none."""
    return "" if value is None else f"{100 * value:.2f} %"


def lag(row: Row) -> str:
    """The longest lag of a row in frames and turns; a lower bound where a change was never shown."""
    if row["lag"] is None:
        return ""
    return f"{'> ' if row['never_shown'] else ''}{row['lag']} ({row['lag_turns']:.1f})"


def spent(row: Row) -> str:
    """The least and the greatest part of the budget spent; without the least where that does not count."""
    greatest = share(row["greatest_share"])
    return greatest if row["least_share"] is None else f"{100 * row['least_share']:.2f} to {greatest}"


def true_error(row: Row) -> str:
    """E true and the noise of what it is against."""
    return "" if row["true_error"] is None else f"{share(row['true_error'])} ± {share(row['true_noise'])}"


COLUMNS = (
    Column(
        "to the better",
        lambda row: f"{row['against_best']:.2f}",
        "E of the last policy over that of the better of the others, of the seeds' means",
        lambda row: bool(row["against_best"] > 1),
    ),
    Column(
        "worst run",
        lambda row: f"{row['worst_run']:.2f}",
        "the same ratio of the worst single seed",
        lambda row: bool(row["worst_run"] > 1),
    ),
    Column("energy", lambda row: f"{row['energy']:.3f}", "light in the pictures over light in the references"),
    Column("FLIP", lambda row: f"{row['flip']:.4f}", "mean difference to the eye, 0 to 1, of the key frames"),
    Column(
        "jump",
        lambda row: share(row["jump"]),
        "the largest part of the pixels that changes by more than 8 of 255 between frames in which nothing does, and "
        "not towards the reference",
    ),
    Column(
        "lag (turns)",
        lag,
        "frames after a step of a light or a cut until a tenth of the change is missing at most; a turn is what it "
        "takes to update each visible texel once; > where a change was not shown while it could be",
        lambda row: bool(row["never_shown"]),
    ),
    Column(
        "darkened",
        lambda row: share(row["darkened"]),
        "the largest part of the pixels below a quarter both of the frame before and of the reference",
        lambda row: bool(row["darkened"]),
    ),
    Column(
        "oldest",
        lambda row: "" if row["oldest"] is None else str(row["oldest"]),
        "frames since the last update of any texel that is read",
    ),
    Column(
        "E true",
        true_error,
        "the same as E, over blocks of 8 x 8 pixels, against a path-traced picture that reads no map, after 60 frames "
        "at rest, and the noise of that picture",
    ),
    Column(
        "energy true",
        lambda row: "" if row["true_energy"] is None else f"{row['true_energy']:.3f}",
        "light in that picture at rest over light in the path-traced one",
    ),
    Column(
        "rays spent",
        spent,
        "the least and the greatest part of the budget that a frame has spent",
        lambda row: bool(row["greatest_share"] > 1),
    ),
)
"""Of the last policy. JSON has what they are made of."""


def columns_of(rows: list[dict[str, Any]]) -> list[Column]:
    """The columns in which some row has a figure."""
    return [column for column in COLUMNS if any(column.shown(row) for row in rows)]


def markdown_table(rows: list[dict[str, Any]]) -> Iterator[str]:
    """The table as Markdown, line by line."""
    names = list(rows[0]["errors"])
    columns = ["layout", "budget", *(f"E {name}" for name in names), *(column.name for column in columns_of(rows))]
    yield f"| {' | '.join(columns)} |"
    yield f"|{'---|' * len(columns)}"
    for row in rows:
        errors = [share(row["errors"][name]) for name in names]
        shown = [column.shown(row) for column in columns_of(rows)]
        yield f"| {' | '.join([row['layout'], row['budget'], *errors, *shown])} |"


def suite_page(report: Mapping[str, Any]) -> str:
    """The page for a report (as in suite.json), to be put beside the folder of the cases."""
    rows, names = report["rows"], report["policies"]
    pages = environment()
    pages.filters.update(percent=percent, times=times, share=share)
    return pages.get_template("suite.html").render(
        **{name: report[name] for name in ("rows", "means", "bars", "versions", "command")},
        names=names,
        columns=columns_of(rows),
        baseline=names[0],
        full=names[-1],
        layouts=len({row["layout"] for row in rows}),
        budgets=len({row["budget"] for row in rows}),
        seeds=len(rows[0]["pages"]),
    )
