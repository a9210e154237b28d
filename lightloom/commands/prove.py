"""`lightloom prove`."""

from pathlib import Path
from typing import Annotated, Any

import typer

from lightloom.shared.inputs import at_least, choose
from lightloom.shared.options import Json


def prove(
    names: Annotated[
        list[str] | None,
        typer.Argument(metavar="UNIT|PROPERTY", help="Units, or single properties as UNIT/NAME; all if none is given."),
    ] = None,
    quick: Annotated[bool, typer.Option("--quick", help="Only the subset that `make test` takes.")] = False,
    solver: Annotated[
        str, typer.Option("--solver", metavar="yices|z3|both", help="z3 is the cross-check, and slower.")
    ] = "yices",
    mutations: Annotated[
        bool,
        typer.Option("--mutations", help="Instead: seeded faults in the RTL, and what catches each of them."),
    ] = False,
    only_list: Annotated[
        bool, typer.Option("--list", help="Print the properties, or the faults, and prove nothing.")
    ] = False,
    jobs: Annotated[int, typer.Option("--jobs", metavar="N", help="Properties at a time.")] = 2,
    out: Annotated[
        Path, typer.Option("--out", metavar="DIR", help="The folder for the counterexamples of what fails.")
    ] = Path("build/proofs"),
    json: Json = False,
) -> None:
    """Prove properties of the RTL with SymbiYosys, or say how long no counterexample exists.

    Exit code 1 if a property fails: the table says which part of it, and where the waves of the counterexample are.
    With --mutations, NAMEs are those of faults, and exit code 1 says that one was not caught.

    \b
    Examples:
      lightloom prove
      lightloom prove float_add queue/depth3 --solver both
      lightloom prove --quick --json
      lightloom prove --mutations
      lightloom prove --mutations --list
    """
    from lightloom.gen.formal.catalogue import PROPERTIES
    from lightloom.gen.formal.solve import PROGRAMS
    from lightloom.hardware import proofs

    at_least(jobs, 1, "--jobs")
    choose(solver, (*PROGRAMS, "both"), "solver")
    solvers = list(PROGRAMS) if solver == "both" else [solver]
    if mutations:
        faults = proofs.chosen_faults(names or [])
        table = proofs.listed_faults(faults) if only_list else proofs.mutation_table(faults, jobs)
    else:
        units = dict.fromkeys(one.unit for one in PROPERTIES.values())
        wanted = {choose(name, (*units, *PROPERTIES), "unit or property") for name in names or ()}
        chosen = [
            one
            for one in PROPERTIES.values()
            if (not wanted or wanted & {one.unit, one.key}) and (one.quick or not quick)
        ]
        table = proofs.listed(chosen) if only_list else proofs.proof_table(chosen, solvers, jobs, out)
    _show(table, json)
    if not table.good:
        raise typer.Exit(1)


def _show(table: Any, json: bool) -> None:
    from lightloom.shared.console import print_json, print_table

    if json:
        print_json({"command": table.command, "versions": table.versions, "rows": table.rows})
        return
    print_table(table.title, table.columns, [[row[name] for name in table.columns] for row in table.rows])
    for line in table.after:
        print(line)
