"""`lightloom coverage`."""

from pathlib import Path
from typing import Annotated

import typer

from lightloom.shared.inputs import choose
from lightloom.shared.options import Json


def coverage(
    units: Annotated[
        list[str] | None, typer.Argument(metavar="UNIT", help="Names of units; all of them if none is given.")
    ] = None,
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="The folder that the page is written to.")] = Path(
        "build/coverage"
    ),
    json: Json = False,
) -> None:
    """Measure what the benches reach: branches and bits of the Verilog, and kinds of operands, results and stalls.

    Runs each unit's cocotb bench on a simulator that counts, and a bulk run of its corner cases and 200,000 random
    operands. A branch that is not taken has to be explained in sim/coverage_exclusions.toml. The exit code is 1 where
    less than 95 % of the branches are taken, one is neither taken nor explained, or one that is explained is taken.
    All units take about ten minutes on an idle machine; simulators are kept for the next time.

    \b
    In DIR, whole or not at all:
      index.html      the page; it needs no other file
      coverage.json   its numbers
      UNIT.v          the Verilog that the page gives lines of

    \b
    Examples:
      lightloom coverage float_add --out build/coverage
      lightloom coverage --json > coverage.json
    """
    from lightloom.gen.pages.coverage_page import coverage_page
    from lightloom.golden_model.host.outputs import whole_folder
    from lightloom.hardware.coverage import faults, measure, report_of
    from lightloom.rtl.catalogue import CATALOGUE
    from lightloom.shared.console import Progress, json_text, print_json, print_table

    names = [choose(name, CATALOGUE, "unit") for name in dict.fromkeys(units or CATALOGUE)]
    with Progress() as progress, whole_folder(out) as folder:
        measured = []
        for name in names:
            with progress.stage(name):
                measured.append(measure(name, folder))
        report = report_of(measured, " ".join(["lightloom coverage", *(units or [])]))
        (folder / "coverage.json").write_text(json_text(report), encoding="utf-8")
        (folder / "index.html").write_text(coverage_page(report), encoding="utf-8")
    if json:
        print_json(report)
    else:
        columns = ["unit", "configuration", "tests", "branches", "of", "explained", "toggles", "of", "bins", "of"]
        shown = ["unit", "configuration", "tests", "branches_taken", "branches", "branches_explained"]
        shown += ["toggles_seen", "toggles", "bins_filled", "bins"]
        print_table("Coverage", columns, [[row[name] for name in shown] for row in report["rows"]])
        print(f"Written to {out / 'index.html'}")
    wrong = faults(report)
    for line in wrong:
        typer.echo(line, err=True)
    if wrong:
        raise typer.Exit(1)
