"""An estimate of the memories in macros of a library: how many of which, and their area.

A word is cut into macros side by side, a depth into macros one above the other; each read port has a copy of its own.
Of the macros that are given, the one that needs least area is taken, for each memory.
"""

import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from gen.memories import Memory
from golden_model.errors import InputError


@dataclass(frozen=True)
class Macro:
    """A memory macro, as its liberty file describes it."""

    name: str
    depth: int
    width: int
    area: float


@dataclass(frozen=True)
class Tiling:
    """A memory in macros of one kind."""

    memory: Memory
    macro: Macro
    count: int

    @property
    def area(self) -> float:
        return self.count * self.macro.area

    @property
    def filled(self) -> float:
        """Part of the macros' bits that the memory uses, with its copies."""
        return self.memory.bits * self.memory.reads / (self.count * self.macro.depth * self.macro.width)


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
                macros.append(Macro(name, 1 << int(address), int(width), area))
        if not macros or not re.search(r"^\s*memory\s*\(", text, re.MULTILINE):
            raise InputError(f"--macros {path}: describes no memory; give liberty files of memory macros")
    return macros


def tile(memory: Memory, macros: Sequence[Macro]) -> Tiling:
    """The tiling of least area."""

    def with_macro(macro: Macro) -> Tiling:
        tiles = math.ceil(memory.width / macro.width) * math.ceil(memory.depth / macro.depth)
        return Tiling(memory, macro, tiles * memory.reads)

    return min((with_macro(macro) for macro in macros), key=lambda tiling: (tiling.area, tiling.macro.name))
