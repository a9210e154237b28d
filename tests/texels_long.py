"""The long run of the units that see to texels: their Verilog against the model, in all bits, on millions of seeded
operands each, and on every call that the films of scenes/ make. Prints the table; ends with 1 where anything differs.

    python -m tests.texels_long --json build/texels.json
"""

import json
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated
from unittest import mock

import numpy as np
import typer
from rich.console import Console
from rich.table import Table

from lightloom.golden_model.charts.curved import default_cache
from lightloom.golden_model.charts.unwrap import unwrap
from lightloom.golden_model.contract import bitpack
from lightloom.golden_model.contract.interfaces import PURE
from lightloom.golden_model.engine.sampling import running_average
from lightloom.golden_model.engine.selection import screen_test
from lightloom.golden_model.host.outputs import whole_file
from lightloom.golden_model.models import model_results
from lightloom.golden_model.renderer import Renderer
from lightloom.golden_model.scene.files.load import load_scene
from lightloom.golden_model.structures.structure import Structure
from lightloom.rtl.config import PRESETS
from lightloom.sim.bulk import BulkUnit
from lightloom.verif.vectors.unit_vectors import unit_vectors
from tests import ROOT
from tests.rtl.agreement import fields_in_hex

CALLERS = {"texel_project": screen_test, "texel_match": screen_test, "texel_blend": running_average}
"""The units, and the module that calls the model of each for all films."""
FILMS = ("moving-viewpoint", "introduced-object", "light-switch", "door", "spheres", "bunny-turntable", "outdoor")
CHUNK = 250_000
"""Seeded operands a seed; chunk k has seed + k."""
SIZE = 160, 107
"""Of the films' pictures: what is called does not depend on it."""


@dataclass
class Row:
    """What was compared of one unit on one source of operands, and how many results differed."""

    unit: str
    source: str
    operands: int = 0
    mismatches: int = 0
    first: str = ""
    """The first operand whose results differ, in hex."""
    seconds: float = 0.0

    def take(self, bulk: BulkUnit, operands: np.ndarray, expected: np.ndarray) -> None:
        """Runs operands (N,) through the unit."""
        started = time.perf_counter()
        wrong = np.flatnonzero(~bitpack.equal(bulk.run(operands), expected)) if len(operands) else np.zeros(0, int)
        if len(wrong) and not self.first:
            self.first = fields_in_hex(operands[wrong[0] : wrong[0] + 1])
        self.operands += len(operands)
        self.mismatches += len(wrong)
        self.seconds += time.perf_counter() - started


def seeded(bulk: BulkUnit, count: int, seed: int) -> Row:
    """`count` seeded operands, in whole chunks."""
    name = bulk.unit.name
    row = Row(name, f"seeds {seed} to {seed + -(-count // CHUNK) - 1}")
    for k in range(-(-count // CHUNK)):
        operands = unit_vectors(name, CHUNK, seed + k)
        row.take(bulk, operands, model_results(name, operands))
    return row


def film(name: str, bulks: dict[str, BulkUnit], frames: int | None) -> list[Row]:
    """All calls of a film's frames (all frames that the scene asks for, if None), each replayed as it is made."""
    scene = load_scene(str(ROOT / "scenes" / f"{name}.toml"))
    rows = {unit: Row(unit, name) for unit in bulks}

    def replayed(unit: str, model: Callable[[np.ndarray], np.ndarray]) -> Callable[[np.ndarray], np.ndarray]:
        def call(operands: np.ndarray) -> np.ndarray:
            expected = model(operands)
            rows[unit].take(bulks[unit], operands, expected)
            return expected

        return call

    with ExitStack() as stack:
        for unit in bulks:
            module = CALLERS[unit]
            stack.enter_context(mock.patch.object(module, unit, replayed(unit, getattr(module, unit))))
        maps = unwrap(scene, trace=Structure(scene).trace, cache=default_cache())
        budget = scene.render.budget
        assert budget is not None, f"{name} says no budget"
        # NumPy's passes call the models; their compiled twins do not.
        renderer = Renderer(scene, width=SIZE[0], height=SIZE[1], budget=budget, lightmaps=maps, backend="numpy")
        for _ in range(frames or scene.render.frames or 1):
            renderer.frame()
    return list(rows.values())


def runs(units: list[str], preset: str, count: int, seed: int, films: list[str], frames: int | None) -> Iterator[Row]:
    """Rows in the order of the table."""
    bulks = {unit: BulkUnit(unit, PRESETS[preset]) for unit in units}
    if count:
        for bulk in bulks.values():
            yield seeded(bulk, count, seed)
    for name in films:
        yield from film(name, bulks, frames)


def table(rows: list[Row], preset: str) -> Table:
    out = Table(title=f"Units of texels, preset {preset}: Verilog against the model")
    for column in ("unit", "operands from", "operands", "mismatches", "seconds"):
        out.add_column(column, justify="left" if column in ("unit", "operands from") else "right")
    for row in rows:
        out.add_row(row.unit, row.source, f"{row.operands:,}", f"{row.mismatches:,}", f"{row.seconds:.0f}")
    return out


def main(
    units: Annotated[list[str] | None, typer.Argument(help="Units; all three if none is given.")] = None,
    preset: Annotated[str, typer.Option(help="Preset of the hardware.")] = "base",
    count: Annotated[int, typer.Option(help="Seeded operands a unit.")] = 2_000_000,
    seed: Annotated[int, typer.Option(help="Of the first of them.")] = 1,
    films: Annotated[str, typer.Option(metavar="A,B", help="Films of scenes/.")] = ",".join(FILMS),
    frames: Annotated[int | None, typer.Option(help="Frames of each film; else all.")] = None,
    json_file: Annotated[Path | None, typer.Option("--json", help="The rows, as JSON.")] = None,
) -> None:
    """Units of texels: Verilog against the model, on seeded operands and on all calls of the films."""
    rows = list(runs(units or list(CALLERS), preset, count, seed, [each for each in films.split(",") if each], frames))
    Console().print(table(rows, preset))
    for row in rows:
        if row.first:
            print(f"{row.unit}, {row.source}: {row.first}")
    if json_file is not None:
        with whole_file(json_file) as part:
            part.write_text(json.dumps([asdict(row) for row in rows], indent=1) + "\n")
    empty = [row for row in rows if not row.operands]
    sys.exit(1 if empty or any(row.mismatches for row in rows) else 0)


assert set(CALLERS) <= set(PURE)

if __name__ == "__main__":
    typer.run(main)
