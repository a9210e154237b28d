"""An estimate of the memories in macros of a library: how many of which, and their area.

A word is cut into macros side by side, a depth into macros one above the other; each read port has a copy of its own. A
copy is read and written in one cycle. Macros of one port do one of these, so that one is counted for the read and one
for each write port: about the size of a macro of two ports, where there are none. Of the macros that are given, the one
that needs least area is taken, for each memory; one that is smaller in flip-flops stays in them.
"""

import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from lightloom.gen.flow.memories import Memory
from lightloom.golden_model.host.errors import InputError


@dataclass(frozen=True)
class Macro:
    """A memory macro, as its liberty file describes it."""

    name: str
    depth: int
    width: int
    area: float
    access: float | None = None
    """The longest time from the clock to the word, in ns; None where the file gives none."""


REGISTER_FLIP_FLOPS = 2
"""A bit of a memory in flip-flops takes one, and about as much again for the multiplexers of its enable and a read."""


@dataclass(frozen=True)
class Tiling:
    """A memory in macros of one kind, or in flip-flops: `macro` is None then."""

    memory: Memory
    macro: Macro | None
    count: int
    area: float

    @property
    def filled(self) -> float | None:
        """Part of the macros' bits that the memory's words use."""
        if self.macro is None:
            return None
        bits = self.memory.bits * self.memory.reads * accesses(self.memory)
        return bits / (self.count * self.macro.depth * self.macro.width)


def accesses(memory: Memory) -> int:
    """Of a copy in a cycle: its read, and each write."""
    return 1 + memory.writes


def read_macros(paths: Iterable[Path]) -> list[Macro]:
    """The macros that liberty files describe. Raises InputError for a file without one."""
    macros = []
    for path in paths:
        try:
            text = path.read_text(errors="replace")
        except OSError as error:
            raise InputError(f"--macros {path}: cannot be read ({error.strerror})") from error
        for cell in re.split(r"^\s*cell\s*\(", text, flags=re.MULTILINE)[1:]:
            found = {
                key: re.search(rf"^\s*{key}\s*:\s*\"?([\d.]+)", cell, re.MULTILINE)
                for key in ("address_width", "word_width", "area")
            }
            if all(found.values()):
                name = cell.partition(")")[0].strip().strip('"')
                address, width, area = (float(match.group(1)) for match in found.values() if match)
                macros.append(Macro(name, 1 << int(address), int(width), area, _access(cell)))
        if not macros or not re.search(r"^\s*memory\s*\(", text, re.MULTILINE):
            raise InputError(f"--macros {path}: describes no memory; give liberty files of memory macros")
    return macros


def _access(cell: str) -> float | None:
    """The greatest delay of the tables of `cell_rise` and `cell_fall`."""
    tables = re.findall(r"cell_(?:rise|fall)\s*\([^)]*\)\s*\{.*?values\s*\((.*?)\)\s*;", cell, re.DOTALL)
    return max((float(number) for table in tables for number in re.findall(r"[\d.]+", table)), default=None)


def tile(memory: Memory, macros: Sequence[Macro], flip_flop: float = math.inf) -> Tiling:
    """The memory at the least area; `flip_flop` is the area of one, without which there are macros only."""

    def with_macro(macro: Macro) -> Tiling:
        tiles = math.ceil(memory.width / macro.width) * math.ceil(memory.depth / macro.depth)
        count = tiles * memory.reads * accesses(memory)
        return Tiling(memory, macro, count, count * macro.area)

    ways = [Tiling(memory, None, 0, REGISTER_FLIP_FLOPS * memory.bits * flip_flop), *map(with_macro, macros)]
    return min(ways, key=lambda tiling: (tiling.area, tiling.macro.name if tiling.macro else ""))
