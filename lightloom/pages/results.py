"""The pages docs/results.md and docs/traversal_figures.md, and the reports that they are made of, docs/results/*.json.

`python -m lightloom.pages.results build/results/*.json` takes these reports in, each in place of the one of its name,
and makes the pages of all. `lightloom.pages.measure` runs the commands that print them.
"""

import json
import math
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lightloom.bench import traversal_page
from lightloom.bench.traversal_page import KEYS, last_of
from lightloom.gen.pages.coverage_page import percent, totals
from lightloom.golden_model.contract.interfaces import PURE
from lightloom.pages.measure import parts
from lightloom.rtl.catalogue import CATALOGUE
from lightloom.rtl.config import PRESETS
from lightloom.shared.console import json_text
from lightloom.shared.provenance import commands_at

Row = dict[str, Any]
Report = dict[str, Any]
Cell = Callable[[Row], object]

UNIT = {"unit": "unit", "preset": "preset"}
RATE = {"latency": "latency", "initiation_interval": "interval"}
GATES = {**UNIT, **RATE, "gates": "gates", "logic_gates": "logic alone", "flip_flops": "flip-flops"}
GATES |= {"memories": "memories", "memory_bits": "their bits"}
MAPPED = {**UNIT, **RATE, "cells": "cells", "area_um2": "area, µm²", "flip_flop_area_um2": "of it flip-flops"}
MAPPED |= {"memories": "memories", "memory_bits": "their bits", "whole_area_um2": "area with them, µm²"}
MAPPED |= {"fmax_mhz": "MHz", "path_cells": "cells deep", "path_start": "from", "path_end": "to"}
CHECKS = {**UNIT, "library": "library", "seed": "seed", "vectors": "vectors", "mismatches": "mismatches"}
MACROS = {**UNIT, "memory": "memory", "depth": "words", "width": "bits", "macro": "macro", "macros": "macros"}
MACROS |= {"reads": "reads", "writes": "writes", "filled": "filled", "access_ns": "access, ns"}
MACROS |= {"memory_area_um2": "area, µm²"}
FPGA = {
    **UNIT,
    "device": "device",
    "speed_grade": "speed grade",
    "luts": "LUTs",
    "luts_available": "of",
    "flip_flops": "flip-flops",
}
FPGA |= {"wrapper_flip_flops": "the wrapper's", "multipliers": "multipliers", "block_rams": "block RAMs"}
FPGA |= {"fits": "fits", "fmax_mhz": "MHz"}
CYCLES = {"scene": "scene", "width": "width", "contexts": "contexts", "latency": "latency", "rays": "rays"}
CYCLES |= {"cycles_per_ray": "cycles a ray", "node_tests": "node tests"}
CYCLES |= {
    "golden_node_tests": "golden node tests",
    "triangle_tests": "triangle tests",
    "golden_triangle_tests": "golden triangle tests",
}
CYCLES |= {"ratio": "ratio", "mismatches": "mismatches"}

DOCS = Path(__file__).parents[2] / "docs"
PARTS = "results"
"""The folder of the reports, in that of the page."""
NO_PDK = Path("pdk")
"""The names of what is measured do not depend on where the libraries are."""

PREAMBLE = """\
# Results

Generated: every table is what the commands above it have printed with `--json` ([results/](results)), at the commit
above each command; of a unit that two of them measured, the later one's row is shown. How the figures come about is in
[synthesis.md](synthesis.md). All timing is after mapping and before layout: wires have no length, the clock is ideal.
"""

MISSING = """\
**Not measured** since reports are kept with their commits (`make results` does it): {names}.
"""

GATES_TEXT = """\
In two-input-gate equivalents: transistors of `abc -g cmos2` divided by four. **gates** counts everything, flip-flops
with their enables and resets too; **logic alone** leaves flip-flops out, as the published figures below do. Memories
with synchronous reads are counted as bits.
"""

PUBLISHED: list[tuple[str, str, str]] = [
    ("ray-triangle test, Appl. Sci. 12:9599 (MPRTA)", "337", "one triangle; logic alone"),
    ("ray-box test, Appl. Sci. 12:9599 (MPRTA)", "186", "two boxes; logic alone"),
    ("float32 fused multiply-add, multiplier and adder, the same", "14.4, 10.8, 6.2", "logic alone"),
]
"""What, thousands of gates, and what it covers."""

PUBLISHED_TEXT = """\
### Beside what others have published

{ours}

{published}

RayFlex (Purdue) tests four boxes or one triangle a cycle and the ray-tracing unit of Vortex one of each; neither states
an area in gates. Vortex reports 80,313 LUTs, 59,674 flip-flops and 146 DSPs for its unit with four contexts on an Alveo
U55C.
"""


PUBLISHED_RAYS: list[tuple[str, str, str]] = [
    ("PowerVR GR6500", "0.5", "40 node tests a cycle at 600 MHz"),
    ("IMG CXT RT3, one ray-acceleration cluster", "0.43", "5.3 box tests a cycle at 1 GHz"),
]
"""What, rays a cycle, and of what."""

AREA_TEXT = """\
**area** is that of the cells: without the memories with synchronous reads, whose number and bits stand beside it.
"""

WITHOUT_MACROS = "Measured without memory macros (ASAP7 has none), so there is no area with them.\n"

MACROS_TEXT = """\
**area with them** adds the memories in the library's macros, which have one port: a copy for each read port, of each
copy a macro for its read and one for each of its writes, since all are in one cycle; words and depth are rounded up to
whole macros, and **filled** is the part that is used. It is a count of area, not a design: what makes such a memory
of macros of one port is left out. A memory that is smaller in flip-flops stays in them, at twice the mean area of
the unit's a bit. The macros' access times, in their typical corner, are not in the clock, for which a word is there
after half a period: {access}
"""

RAYS_TEXT = """\
Diffuse rays in random order, nearest hit, on one unit of preset `base`: a node test of up to eight boxes and a triangle
test a cycle. **latency** is that of the memory in cycles. Beside the unit's tests stand the golden model's, which
visits strictly nearest first; **ratio** is cycles over those that the busier of the two tests needs for these. All rays
are compared with the golden model in all bits. More, and what is counted, in
[traversal_figures.md](traversal_figures.md).
"""

RAYS_OF_OTHERS = """\
### Beside what others have published

{published}

Both are peak rates of closed products, without scene or rays. RayFlex does four boxes or one triangle a cycle and has
no traversal; Vortex does one of each and publishes no rate of rays.
"""


def table(columns: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """A Markdown table."""
    lines = ["| " + " | ".join(columns) + " |", "|" + "---|" * len(columns)]
    return "\n".join([*lines, *("| " + " | ".join(_cell(value) for value in row) + " |" for row in rows)])


def _cell(value: object) -> str:
    if value is None or value == "":
        return "-"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, int):
        return f"{value:,}"
    if isinstance(value, float):
        return f"{value:,.0f}" if abs(value) >= 1000 else f"{value:.4g}"
    if isinstance(value, Mapping):
        return ", ".join(f"{name} {one}" for name, one in value.items()) or "-"
    return str(value).replace("|", "\\|")


def _rows(rows: Sequence[Row], columns: dict[str, str]) -> str:
    return table(list(columns.values()), [[row.get(key) for key in columns] for row in rows])


def _kind(report: Report) -> str:
    """The command's name."""
    return report["command"].split()[1]


def _made_by(reports: Sequence[Report]) -> str:
    """The commands, each under the commit that it measured, and the versions of the tools, above a table."""
    block = commands_at((report["command"], report.get("versions", {})) for report in reports)
    versions = {name: version for report in reports for name, version in report.get("versions", {}).items()}
    tools = ", ".join(f"{name} {version}" for name, version in versions.items() if name != "commit")
    return "\n".join([block, *([f"\n{tools}"] if tools else [])]) + "\n"


def _sorted(reports: Sequence[Report], name: str) -> list[Row]:
    """The rows of several reports, of each measurement the last one."""
    found = {
        tuple(row.get(key) for key in ("unit", "preset", "memory", "library", "device", "speed_grade")): row
        for report in reports
        for row in report.get(name, [])
    }
    return list(found.values())


def gates(reports: Sequence[Report]) -> Iterator[str]:
    """Gate equivalents, and those of others beside them."""
    rows = _sorted(reports, "rows")
    yield "## Gates\n"
    yield _made_by(reports)
    yield GATES_TEXT
    yield _rows(rows, GATES) + "\n"
    what = {"node_test": "{} boxes", "ray_triangle": "one triangle", "ray_triangle_half": "half a triangle"}
    ours = [
        (
            f"{row['unit']}, {row['preset']}",
            row["logic_gates"] / 1000,
            row["gates"] / 1000,
            what[row["unit"]].format(PRESETS[row["preset"]].tree.width) + " a cycle",
        )
        for row in rows
        if row["unit"] in what
    ]
    yield PUBLISHED_TEXT.format(
        ours=table(["here", "logic alone, thousands", "gates, thousands", "does"], ours),
        published=table(["published", "thousands of gates", "does a cycle"], PUBLISHED),
    )


def mapped(reports: Sequence[Report]) -> Iterator[str]:
    """One table a library and clock."""
    for library in dict.fromkeys(report["rows"][0]["library"] for report in reports):
        ours = [report for report in reports if report["rows"][0]["library"] == library]
        rows = _sorted(ours, "rows")
        yield f"## {library}\n"
        yield _made_by(ours)
        clocks = sorted({row["clock_ns"] for row in rows if row["clock_ns"]})
        if clocks:
            asked = ", ".join(f"{clock:g}" for clock in clocks)
            yield f"Clock period asked for, which the access time of memories is half of: {asked} ns.\n"
        memories = [row for row in _sorted(ours, "memories") if row["macro"]]
        if any(row["unit"] not in PURE for row in rows):
            yield AREA_TEXT
            yield (_macros_text(memories, clocks) if memories else WITHOUT_MACROS)
        yield _rows(rows, MAPPED) + "\n"
        if memories:
            yield "### Memories in macros\n"
            yield _rows(memories, MACROS) + "\n"
    checks = _sorted(reports, "checks")
    if checks:
        yield "## Netlists against the golden model\n"
        yield _made_by([report for report in reports if report["checks"]])
        yield _rows(checks, CHECKS) + "\n"


def _macros_text(memories: Sequence[Row], clocks: Sequence[float]) -> str:
    times = [row["access_ns"] for row in memories if row["access_ns"] is not None]
    if not times:
        return MACROS_TEXT.format(access="the files give none.")
    half = min(clocks) / 2 if clocks else math.inf
    late = "which is later." if max(times) > half else "which is earlier."
    return MACROS_TEXT.format(access=f"{min(times):.3g} to {max(times):.3g} ns against {half:g} ns, {late}")


def _traced(reports: Sequence[Report]) -> list[Row]:
    """The rows of the reports of cycles, of each measurement the last one."""
    return last_of([row for report in reports for row in report["rows"]], KEYS["speed"])


def cycles(reports: Sequence[Report]) -> Iterator[str]:
    """Cycles a ray, and the peaks of others beside them."""
    yield "## Cycles a ray\n"
    yield _made_by(reports)
    yield RAYS_TEXT
    yield _rows(_traced(reports), CYCLES) + "\n"
    yield RAYS_OF_OTHERS.format(published=table(["published", "rays a cycle", "with"], PUBLISHED_RAYS))


def _in_short(title: str, summary: Callable[[Sequence[Row]], str]) -> Callable[[Sequence[Report]], Iterator[str]]:
    """A section with a column for every key, and above it what the rows come to."""

    def section(reports: Sequence[Report]) -> Iterator[str]:
        rows = [row for report in reports for row in report["rows"]]
        yield f"## {title}\n"
        yield _made_by(reports)
        yield summary(rows) + "\n"
        yield _rows(rows, {key: key.replace("_", " ") for row in rows for key in row}) + "\n"

    return section


def _proved(rows: Sequence[Row]) -> str:
    proved = sum(row["status"] == "proved" for row in rows)
    bounded = sum(row["method"].startswith("bounded") for row in rows)
    return (
        f"**{proved} of {len(rows)} proved**, {bounded} of them within a bound: there is no counterexample of as many "
        "cycles as the depth says. **reached**: what had to be possible, and in which cycle it first was."
    )


def _caught(rows: Sequence[Row]) -> str:
    caught = sum(bool(row["caught by"]) for row in rows)
    reasons = sum(bool(row["equivalent"]) for row in rows)
    return f"**{caught} of {len(rows)} caught**; {reasons} cannot be seen from outside, for the reason beside them."


def _covered(rows: Sequence[Row]) -> str:
    total = totals(rows)
    share = percent(total["branches_taken"], total["branches"])
    return (
        "**{branches_taken:,} of {branches:,} branches taken** ({share}); {branches_explained} cannot be, for reasons "
        "in `sim/coverage_exclusions.toml`. {toggles_seen:,} of {toggles:,} edges seen; {bins_filled:,} of {bins:,} "
        "bins filled."
    ).format(share=share, **total)


def ecp5(reports: Sequence[Report]) -> Iterator[str]:
    """What fits on an FPGA, and how fast it is."""
    yield "## ECP5\n"
    yield _made_by(reports)
    yield _rows(_sorted(reports, "rows"), FPGA) + "\n"


SECTIONS: dict[str, Callable[[Sequence[Report]], Iterator[str]]] = {
    "gates": gates,
    "synth": mapped,
    "fpga": ecp5,
    "bench": cycles,
    "prove": _in_short("Proofs", _proved),
    "mutations": _in_short("Mutations", _caught),
    "coverage": _in_short("Coverage", _covered),
}
"""In the order of the page; each takes the reports of one kind."""


def page(reports: Sequence[Report], missing: Sequence[str] = ()) -> str:
    """The page; `reports` are the JSON of the commands, in any order, `missing` names of parts that are not there."""
    kinds: dict[str, list[Report]] = {kind: [] for kind in SECTIONS}
    for report in map(_unwrapped, reports):
        kind = _kind(report)
        if kind == "synth" and report["rows"][0]["library"] is None:
            kind = "gates"
        elif kind == "prove" and "--mutations" in report["command"]:
            kind = "mutations"
        kinds[kind].append(report)
    sections = [
        PREAMBLE,
        *([MISSING.format(names=", ".join(missing))] if missing else []),
        *bars(_sorted([*kinds["gates"], *kinds["synth"], *kinds["fpga"]], "rows"), _traced(kinds["bench"])),
    ]
    for kind, section in SECTIONS.items():
        if kinds[kind]:
            sections += section(kinds[kind])
    return "\n".join(sections).rstrip() + "\n"


def _unwrapped(report: Report) -> Report:
    """A report with its rows at the top: that of `lightloom bench traversal` has them one level down."""
    if "traversal" not in report:
        return report
    measured = report["traversal"]
    return {"command": measured["command"], "versions": report.get("versions", {}), "rows": measured["speed"]}


@dataclass(frozen=True, kw_only=True)
class Bar:
    """What was asked for of the units of one preset, or of one of them."""

    what: str
    preset: str
    least_mhz: float | None = None
    most_gates: int | None = None
    library: str | None = None
    device: str | None = None
    unit: str | None = None

    def concerns(self, row: Row) -> bool:
        """Whether the bar is about the row of a measurement."""
        same = row.get("library") == self.library and row.get("device") == self.device
        return same and row["preset"] == self.preset and self.unit in (None, row["unit"])

    def figure(self, row: Row) -> float | None:
        return row["gates"] if self.least_mhz is None else row["fmax_mhz"]

    def met(self, row: Row) -> bool:
        figure = self.figure(row)
        if figure is None:
            return False
        return figure <= (self.most_gates or 0) if self.least_mhz is None else figure >= self.least_mhz


BARS = [
    Bar(what="every unit on ASAP7 RVT TT", preset="full", least_mhz=1000, library="asap7 typ"),
    Bar(what="every unit on IHP SG13G2 typ", preset="full", least_mhz=200, library="ihp-sg13g2 typ"),
    Bar(what="every unit on IHP SG13G2 slow", preset="base", least_mhz=125, library="ihp-sg13g2 slow"),
    Bar(what="the traversal unit on an ECP5-85k", preset="tiny", least_mhz=50, device="85k", unit="traversal"),
    Bar(what="eight boxes a cycle", preset="base", most_gates=190_000, unit="node_test"),
    Bar(what="a triangle a cycle", preset="base", most_gates=300_000, unit="ray_triangle"),
    Bar(what="a triangle in two cycles", preset="base", most_gates=180_000, unit="ray_triangle_half"),
]


MOST_CYCLES = 1.15
"""Cycles over those that the busier of the golden model's two tests would take, with a memory `LATENCY` cycles away."""
LATENCY = 100


def rate_bar(rows: Iterable[Row]) -> Iterator[tuple[object, ...]]:
    """The line of the cycles a ray of all scenes, of rows of `cycles`."""
    ratios = {row["scene"]: row["ratio"] for row in rows if row["latency"] == LATENCY and row["ratio"] is not None}
    if ratios:
        worst = max(ratios, key=lambda scene: ratios[scene])
        missing = ", ".join(f"{scene} {ratio:.2f}" for scene, ratio in ratios.items() if ratio > MOST_CYCLES)
        what = f"cycles a ray over those of the golden tests, latency {LATENCY}"
        figure = f"{ratios[worst]:.2f} ({worst})"
        met = "no" if missing else "yes"
        yield what, "base", f"at most {MOST_CYCLES:g}", len(ratios), figure, met, missing, ""


def bars(rows: Sequence[Row], traced: Iterable[Row] = ()) -> Iterator[str]:
    """What was asked for, the worst unit or scene, and those that miss it."""
    lines: list[tuple[object, ...]] = []
    for bar in BARS:
        found = [row for row in rows if bar.concerns(row)]
        if not found:
            continue
        # Of clocks the slowest, of areas the greatest; a unit without a figure is worse than all.
        sign = -1 if bar.least_mhz is None else 1
        worst = min(found, key=lambda row: sign * figure if (figure := bar.figure(row)) is not None else -math.inf)
        asked = f"at most {bar.most_gates:,} gates" if bar.least_mhz is None else f"at least {bar.least_mhz:g} MHz"
        missing = ", ".join(f"{row['unit']} {_cell(bar.figure(row))}" for row in found if not bar.met(row))
        figure = f"{_cell(bar.figure(worst))} ({worst['unit']})"
        left_out = [] if bar.unit else [unit for unit in CATALOGUE if unit not in {row["unit"] for row in found}]
        met = "no" if missing else "of these" if left_out else "yes"
        lines.append((bar.what, bar.preset, asked, len(found), figure, met, missing, ", ".join(left_out)))
    lines += rate_bar(traced)
    if lines:
        yield "## Against the bars\n"
        yield (
            table(["what", "preset", "bar", "measured", "worst", "met", "what misses it", "not measured"], lines) + "\n"
        )


def pages_of(docs: Path) -> dict[str, str]:
    """Names and texts of the pages of the reports that are kept in a folder of documents."""
    kept = sorted((docs / PARTS).glob("*.json"))
    reports = [json.loads(part.read_text(encoding="utf-8")) for part in kept]
    missing = [name for name in parts(NO_PDK) if name not in {part.stem for part in kept}]
    traced = [report for report in reports if "traversal" in report]
    return {"results.md": page(reports, missing), "traversal_figures.md": traversal_page.page(traced)}


def write(reports: Iterable[Path], docs: Path = DOCS) -> None:
    """Takes files of reports in, each instead of the one of its name, and writes the pages of all that are kept."""
    for report in reports:
        kept = json_text(json.loads(report.read_text(encoding="utf-8")))
        (docs / PARTS / report.name).write_text(kept, encoding="utf-8")
    for name, text in pages_of(docs).items():
        (docs / name).write_text(text, encoding="utf-8")


if __name__ == "__main__":
    write(map(Path, sys.argv[1:]))
