"""What Verilator has counted of a design: which branches were taken, which bits have changed.

Emitted Verilog has few `if`s and many `?:`. Verilator counts both arms of either, and those of `case`: these are the
branches. Toggles are the two edges of each bit of each named signal (Yosys's own, `_123_`, are left out), and blocks
are bodies of `always`. A module that is used several times is counted once, for all places together.
"""

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

ARMS = ("if", "else", "elsif", "case", "cond_then", "cond_else")
"""How Verilator calls the arms of a decision."""
RECORD = re.compile(r"C '([^']*)' (\d+)")


@dataclass(frozen=True, order=True)
class Point:
    """One thing that is counted."""

    file: str
    line: int
    column: int
    module: str
    kind: str
    """branch, toggle or block."""
    what: str
    """The arm, such as "else"; or the bit and its edge, such as "tag[3]:0->1"."""


def read_points(path: Path) -> dict[Point, int]:
    """The points of a file of Verilator's, each with how often it was hit."""
    counts: dict[Point, int] = {}
    for point, count in _records(path):
        counts[point] = counts.get(point, 0) + count
    return counts


def _records(path: Path) -> Iterator[tuple[Point, int]]:
    with path.open(encoding="utf-8") as file:
        for line in file:
            if not (found := RECORD.match(line)):
                continue
            # \1 before each key, \2 before its value: f file, l line, n column, page kind/module, o comment.
            field = dict(pair.split("\2", 1) for pair in found[1].split("\1")[1:])
            page, _, module = field["page"].partition("/")
            what = field["o"]
            kind = {"v_toggle": "toggle"}.get(page, "branch" if what in ARMS else "block")
            where = Path(field["f"]).name, int(field["l"]), int(field["n"])
            yield Point(*where, module, kind, what), int(found[2])


def share(counts: Iterable[int]) -> tuple[int, int]:
    """How many of them are not zero, and how many there are."""
    values = list(counts)
    return sum(value > 0 for value in values), len(values)
