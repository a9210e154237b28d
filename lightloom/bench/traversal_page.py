"""The page docs/traversal_figures.md, made from what `lightloom bench traversal --json` has measured, once or in parts.

`lightloom.pages.results` writes it beside docs/results.md, of the reports of this command.
"""

from collections.abc import Callable, Iterator, Sequence
from typing import Any

from lightloom.shared.provenance import commands_at

Cell = Callable[[dict[str, Any]], object]


def _rounded(name: str, digits: int = 2) -> Cell:
    return lambda row: float(f"{row[name]:.{digits}f}")


def _parts(unit: str) -> Cell:
    """Busy, starved and stalled, in percent of the cycles."""
    return lambda row: " / ".join(f"{100 * row[f'{unit}_{state}']:.0f}" for state in ("busy", "starved", "stalled"))


def _percent(name: str, digits: int = 0) -> Cell:
    return lambda row: f"{100 * row[name]:.{digits}f} %"


def _plain(name: str) -> Cell:
    return lambda row: "" if row[name] is None else row[name]


def _thousands(name: str) -> Cell:
    return lambda row: round(row[name] / 1000)


CYCLES: dict[str, Cell] = {
    "rays": _plain("rays"),
    "cycles a ray": _rounded("cycles_per_ray"),
    "node tests": _rounded("node_tests"),
    "golden node tests": _rounded("golden_node_tests"),
    "triangle tests": _rounded("triangle_tests"),
    "golden triangle tests": _rounded("golden_triangle_tests"),
    "leaf visits": _rounded("leaf_visits"),
    "ratio": _rounded("ratio"),
    "mismatches": _plain("mismatches"),
    "kHz": _thousands("cycles_per_second"),
}
WORK: dict[str, Cell] = {
    "node test %": _parts("node"),
    "triangle test %": _parts("triangle"),
    "node cache": _percent("node_hits"),
    "triangle cache": _percent("triangle_hits"),
    "bytes a ray": lambda row: round(row["bytes_per_ray"]),
}
SWEPT: dict[str, Cell] = {name: _plain(name) for name in ("scene", "width", "contexts", "latency")}
UNITS: dict[str, Cell] = {name: _plain(name) for name in ("scene", "order", "units")}
RATE: dict[str, Cell] = {"rays a cycle": lambda row: float(f"{1 / row['cycles_per_ray']:.3f}")}
TABLES: list[tuple[str, str, dict[str, Cell]]] = [
    ("speed", "One unit: diffuse rays, nearest hit", SWEPT | CYCLES),
    ("speed", "One unit: where the cycles go", SWEPT | WORK),
    ("units", "Units at one memory port, latency 100", UNITS | RATE | CYCLES),
    ("units", "Units at one memory port: where the cycles go", UNITS | WORK),
    (
        "identity",
        "Against the golden model: all families of rays, nearest hit and any hit",
        {
            **{name: _plain(name) for name in ("scene", "width", "condition", "rays", "mismatches")},
            "wrong counters": _plain("count_mismatches"),
            "cycles a ray": _rounded("cycles_per_ray"),
            "node tests": _rounded("node_tests"),
            "revisits": _rounded("revisits", 4),
        },
    ),
    (
        "boxes",
        "The box test against exact arithmetic",
        {
            **{name: _plain(name) for name in ("family", "pairs")},
            "false rejects": _plain("false_rejects"),
            "entered": _percent("entered", 1),
            "accepted": _percent("accepted", 1),
            "false accepts": _percent("false_accepts", 3),
        },
    ),
]
"""Rows, title and columns of each table."""

KEYS = {
    "speed": ("scene", "width", "contexts", "latency"),
    "units": ("scene", "order", "units"),
    "identity": ("scene", "width", "condition"),
    "boxes": ("family",),
}
"""Of each kind of row what says which measurement it is."""


def last_of(rows: Sequence[dict[str, Any]], keys: Sequence[str]) -> list[dict[str, Any]]:
    """The rows, of each measurement the last one, in the order of the first ones."""
    return list({tuple(row[key] for key in keys): row for row in rows}.values())


def tables(measured: dict[str, Any]) -> Iterator[tuple[str, list[str], list[list[object]]]]:
    """Title, columns and cells of every table of `traversal.measure` that has rows."""
    for name, title, columns in TABLES:
        if measured[name]:
            yield title, list(columns), [[cell(row) for cell in columns.values()] for row in measured[name]]


PREAMBLE = """\
# The traversal unit in figures

Made by these commands, in the project's folder, at the commits above them:

{commands}

What they print with `--json` is in [results/](results).

The Verilated [traversal unit](traversal_unit.md), preset `base` but for what a table or the command names, with
[the memory of the simulations](axi_memory.md) behind it (512 bits, a beat a cycle). Every run is compared with the
golden model in all bits; "mismatches" counts rays.

Cycles are from the first ray that enters a cold unit to the last result. Beside the tests that the unit makes stand
those of the golden model, which visits children strictly one after the other, nearest first: what the algorithm asks
for. The unit makes more where a ray runs ahead of its own hits. **ratio** is cycles over those that the busier of the
node test and the triangle test needs for the golden ones, with several units those of all: 1 is the ideal. The
percentages of the two tests are cycles that were busy, starved of work, and stalled. A cache's figure is the part of
requests whose block was there; requests for blocks on their way are neither. Bytes are those that came from memory;
kHz, simulated cycles a millisecond of processor time.
"""


def page(reports: Sequence[dict[str, Any]]) -> str:
    """The page; `reports` are the JSON of the commands. What several of them have measured is the last one's."""
    measured = [report["traversal"] for report in reports]
    commands = [(report["traversal"]["command"], report.get("versions", {})) for report in reports]
    together = {name: last_of([row for part in measured for row in part[name]], keys) for name, keys in KEYS.items()}
    processors = dict.fromkeys(report["machine"]["processor"] for report in reports)
    parts = [
        PREAMBLE.format(commands=commands_at(commands)),
        f"Simulated on {', '.join(processors)}.",
    ]
    for title, columns, rows in tables(together):
        lines = ["| " + " | ".join(columns) + " |", "|" + "---|" * len(columns)]
        lines += ["| " + " | ".join(_cell(cell) for cell in row) + " |" for row in rows]
        parts += [f"\n## {title}\n", "\n".join(lines)]
    return "\n".join(parts) + "\n"


def _cell(value: object) -> str:
    return f"{value:,}" if isinstance(value, int) else str(value)
