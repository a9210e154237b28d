"""What Verilator has counted of a design: which branches were taken, which bits have changed.

Emitted Verilog has few `if`s and many `?:`. Verilator counts both arms of either, and those of `case`: these are the
branches. Toggles are the two edges of each bit of each named signal (Yosys's own, `_123_`, are left out), and blocks
are bodies of `always`. A module that is used several times is counted once, for all places together.
"""

import re
import tomllib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path

EXCLUSIONS = Path(__file__).with_name("coverage_exclusions.toml")

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


# --- branches that cannot be taken ------------------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class Exclusion:
    """Branches that cannot be taken, and why."""

    branches: Sequence[tuple[str, str]]
    """A regular expression that has to be found in the line of Verilog, and a pattern of the arm."""
    reason: str
    unit: str = "*"
    module: str = "*"

    def covers(self, unit: str, point: Point, line: str) -> bool:
        if not (fnmatchcase(unit, self.unit) and fnmatchcase(point.module, self.module)):
            return False
        return any(re.search(source, line) and fnmatchcase(point.what, arm) for source, arm in self.branches)


def exclusions(path: Path = EXCLUSIONS) -> list[Exclusion]:
    """Those of a file."""
    return [Exclusion(**each) for each in tomllib.loads(path.read_text(encoding="utf-8")).get("exclusion", [])]


@dataclass(frozen=True, kw_only=True)
class Untaken:
    """A branch that was not taken."""

    point: Point
    source: str
    """The line."""
    reason: str | None
    """Why it cannot be; None: that is not known."""


def untaken(
    unit: str, counts: Mapping[Point, int], verilog: str, excluded: Sequence[Exclusion]
) -> tuple[list[Untaken], list[str]]:
    """Branches that were not taken, in the order of the text; and exclusions that were."""
    lines = verilog.splitlines()
    missed, wrong = [], []
    for point, count in sorted(counts.items()):
        if point.kind != "branch":
            continue
        line = lines[point.line - 1].strip()
        reasons = [each.reason for each in excluded if each.covers(unit, point, line)]
        if not count:
            missed.append(Untaken(point=point, source=line, reason=reasons[0] if reasons else None))
        elif reasons:
            wrong.append(f"{point.file}:{point.line}: {point.what} of `{line}` was taken, yet excluded: {reasons[0]}")
    return missed, wrong
