"""The long run of the number units: every unit's Verilog against the NumPy model and SoftFloat, the model against exact
arithmetic, millions of vectors each. Prints the table; ends with 1 where anything differs.

    python -m tests.operators_long --json build/operators.json
"""

import json
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass, field
from functools import partial
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.console import Console
from rich.progress import track
from rich.table import Table

from lightloom.golden_model.contract import bitpack
from lightloom.golden_model.contract.interfaces import OPERATORS
from lightloom.golden_model.host.outputs import whole_file
from lightloom.golden_model.models import model_results
from lightloom.rtl.config import PRESETS
from lightloom.sim.bulk import BulkUnit
from tests.exact import exact_results
from tests.softfloat import softfloat_results
from tests.vectors import corner_vectors, differences, random_vectors

CHUNK = 1 << 20
"""Random vectors a seed; chunk k has seed + k."""


@dataclass
class Row:
    """What was compared for one unit, and how many results differed."""

    unit: str
    corners: int = 0
    random: int = 0
    exact: int = 0
    """Vectors of the comparison with exact arithmetic."""
    model_softfloat: int = 0
    model_exact: int = 0
    rtl_model: int = 0
    """Summed over all presets, as `rtl_softfloat`."""
    rtl_softfloat: int = 0
    megavectors: dict[str, float] = field(default_factory=dict)
    """Million vectors a second of the Verilated unit on one core, by preset."""
    seconds: float = 0.0
    first: list[str] = field(default_factory=list)
    """The first differing vectors, in hex, and how to make them again."""

    @property
    def mismatches(self) -> int:
        return self.model_softfloat + self.model_exact + self.rtl_model + self.rtl_softfloat


def chunks(name: str, random: int, seed: int) -> Iterator[tuple[str, np.ndarray]]:
    """(how to make them again, operands): the corners first, then the random ones."""
    yield f"corner_vectors({name!r})", corner_vectors(name)
    for index, start in enumerate(range(0, random, CHUNK)):
        count = min(CHUNK, random - start)
        yield f"random_vectors({name!r}, {count}, {seed + index})", random_vectors(name, count, seed + index)


def measure(name: str, *, random: int, exact: int, presets: list[str], seed: int) -> Row:
    """Runs one unit over its corners and `random` vectors, `exact` of either kind through exact arithmetic too."""
    started = time.perf_counter()
    row = Row(name)
    units = {preset: BulkUnit(name, PRESETS[preset]) for preset in presets}

    def compare(source: str, operands: np.ndarray, **results: np.ndarray) -> int:
        report = differences(operands, source, results)
        if report and len(row.first) < 5:
            row.first.append(f"{name}: {report}")
        expected, found = results.values()
        return int((~bitpack.equal(expected, found)).sum())

    seconds = dict.fromkeys(presets, 0.0)
    for index, (source, operands) in enumerate(chunks(name, random, seed)):
        if index:
            row.random += len(operands)
        else:
            row.corners = len(operands)
        expected, oracle = model_results(name, operands), softfloat_results(name, operands)
        row.model_softfloat += compare(source, operands, SoftFloat=oracle, model=expected)
        for preset, unit in units.items():
            got = unit.run(operands)
            seconds[preset] += len(operands) / unit.throughput
            row.rtl_model += compare(f"{source}, {preset}", operands, model=expected, RTL=got)
            row.rtl_softfloat += compare(f"{source}, {preset}", operands, SoftFloat=oracle, RTL=got)
        if index < 2:
            picked = np.random.default_rng(seed).choice(len(operands), min(exact, len(operands)), replace=False)
            some = operands[picked]
            results = {"exact": exact_results(name, some), "model": expected[picked]}
            row.exact += len(some)
            row.model_exact += compare(f"default_rng({seed}).choice of {source}", some, **results)
    total = row.corners + row.random
    row.megavectors = {preset: round(total / seconds[preset] / 1e6, 2) for preset in presets}
    row.seconds = round(time.perf_counter() - started, 1)
    return row


def table(rows: list[Row], presets: list[str]) -> Table:
    out = Table(title=f"Number units; Verilog of preset {', '.join(presets)}; columns with ≠ count differing results")
    out.add_column("unit")
    heads = ["corners", "random", "exact", "model≠SoftFloat", "model≠exact", "RTL≠model", "RTL≠SoftFloat", "Mvectors/s"]
    for head in heads:
        out.add_column(head, justify="right")
    for row in rows:
        counts = [row.corners, row.random, row.exact, row.model_softfloat, row.model_exact]
        cells = [f"{count:,}" for count in (*counts, row.rtl_model, row.rtl_softfloat)]
        out.add_row(row.unit, *cells, f"{next(iter(row.megavectors.values())):.1f}")
    return out


def main(
    random: Annotated[int, typer.Option(min=1, help="Random vectors a unit and preset.")] = 4 << 20,
    exact: Annotated[
        int, typer.Option(min=1, help="Corners, and as many random vectors, in exact arithmetic.")
    ] = 100_000,
    preset: Annotated[list[str] | None, typer.Option(help="Presets; all unless given.")] = None,
    seed: Annotated[int, typer.Option(help="Seed of the first million random vectors.")] = 1,
    workers: Annotated[int, typer.Option(min=1, help="Units at a time.")] = 2,
    json_file: Annotated[Path | None, typer.Option("--json", help="Write the table here, too.")] = None,
) -> None:
    """Number units: Verilog against NumPy model and SoftFloat, model against exact arithmetic."""
    presets = preset or list(PRESETS)
    if unknown := set(presets) - set(PRESETS):
        raise typer.BadParameter(f"{', '.join(sorted(unknown))}: no such preset; known are {', '.join(PRESETS)}")
    work = partial(measure, random=random, exact=exact, presets=presets, seed=seed)
    with ProcessPoolExecutor(workers) as pool:
        done = pool.map(work, OPERATORS)
        rows = list(track(done, "number units", total=len(OPERATORS), console=Console(stderr=True)))
    Console(width=None if sys.stdout.isatty() else 160).print(table(rows, presets))
    mismatches = sum(row.mismatches for row in rows)
    if json_file is not None:
        report = {"seed": seed, "presets": presets, "mismatches": mismatches, "units": [asdict(row) for row in rows]}
        with whole_file(json_file) as part:
            part.write_text(json.dumps(report, indent=2) + "\n")
    for line in (line for row in rows for line in row.first):
        print(line)
    print(f"{mismatches} mismatches over {sum(row.corners + row.random for row in rows):,} vectors a preset")
    raise typer.Exit(1 if mismatches else 0)


if __name__ == "__main__":
    typer.run(main)
