"""The page docs/arithmetic.md: what maintenance costs in operations and bytes.

python -m lightloom.pages.arithmetic measure > docs/arithmetic.json     # what a frame of a large scene has: minutes
python -m lightloom.pages.arithmetic > docs/arithmetic.md               # a second
"""

import json
import re
import sys
from collections.abc import Iterator, Mapping
from dataclasses import asdict
from textwrap import fill
from typing import Any

from lightloom.bench.counting import Operation
from lightloom.bench.operations import Work, work
from lightloom.bench.settled import Case, Frame, report
from lightloom.golden_model.contract.formats import PIXEL, PUBLISHED_TEXEL, TEXEL, TEXEL_STATE, field_width
from lightloom.golden_model.engine.sampling.settings import Sampling
from lightloom.golden_model.renderer import Pipeline
from lightloom.hardware.integer_gates import gates as gates_of_integers
from lightloom.pages.results import DOCS, PARTS, table

WIDTH = 120
NO_BREAK = "\0"
COMMAND = "python -m lightloom.pages.arithmetic"
UNITS = {
    "multiply": ("float_multiply",),
    "add": ("float_add",),
    "a*b - c*d": ("float_difference_of_products",),
    "divide": ("float_divide",),
    "root": ("float_sqrt",),
    "compare, min, max": ("float_compare", "float_minmax"),
    "convert": (
        *("float_to_half", "half_to_float", "float_to_fixed", "float_to_fixed_down"),
        *("fixed_to_float", "fixed64_to_float"),
    ),
}
"""Columns of the table, and the number units that each counts; the last column is of whole numbers."""
FLOPS = [each for name, names in UNITS.items() if name not in ("compare, min, max", "convert") for each in names]
Tally = Mapping[Operation, float]

HEAD = """\
# What maintenance computes

<!-- Made by `{command} > docs/arithmetic.md`; a test holds it to the model. -->
"""
PREAMBLE = """\
Operations and bytes of a frame's selection, of its rays without their tracing, and of publishing, at a million texels
and 25,000 updates. [frozen.md](frozen.md) tells what each step does.

**Operations** are counted in the model's own functions, which run on arrays that count
(`lightloom/bench/counting.py`, `lightloom/bench/operations.py`).

**Gates** weigh them: an operation counts as many as the unit has that does one a cycle (preset `base`,
[results.md](results.md#gates)). So what they add up to is area times cycles, whatever the machine. Whole numbers
count by the widths that the values of the run need, at rates that are fitted to operations synthesised in the same
way (`python -m lightloom.hardware.integer_gates`): of 40 bits {rates} gates. A factor of few bits with zeros below
them, as a weight of smoothing is, makes a product with these bits and a shift. Choices between two values, logic of
single bits, tables, addresses and counters do not count.
"""
RAYS = """\
A ray has {flops:.0f} float operations, without those of its update. Reads of the maps are whole numbers, and so are
hashes: 4 of their rounds a ray are for the keys of paths, which mirrors and glass alone need. Products of levels are
with coverages, which are 0 or 1 in the first.
"""
FRAME = """\
A settled frame of `{scene}` with {width} by {height} pixels and texels of {texel:g} (`{command} measure`: the
selection of {frames} frames without their rays, means of the last {measured}): {valid:,} valid texels of {texels:,}
in {regions:,} regions; {updates:,} updates, {together} of a region together, rewrite {rewritten:,} regions
({share:.2f} an update; {others}) and {coarser:,} texels above them. All texels are known, nothing is filled and no
influence is felt. Regions that cannot be on the screen leave out {left_out:.0%} of the texels of both views
([culling](selection.md#culling)); what else is not on the screen and facing is found texel by texel.
"""
VERDICT = """\
**Publishing with smoothing is {ratio:.2f} times the rays**, and as much as them at {even:.2f} regions an update.
{passes:.0%} of a region's are the two passes: eight neighbours in each, of which each takes three differences, three
products with 3 bits, and three sums. The first pass is also done for the two texels around the region. Who keeps it
for the regions beside it, as a frame that rewrites most of a map can, saves {once:.0%} of publishing.
"""
BYTES = """\
**Publishing moves {ratio:.2f} times the bytes of the rays** without those of the tree, {whole:.2f} times with them:
at {tree} bytes a ray (the bunny, texel by texel: [traversal](traversal_figures.md)) another {more:.0f} million a
frame. A region reads its own texels and those {halo} around. Who goes over the regions in their order and keeps a row
of them reads each texel once at most: {most:.1f} million bytes. The copy to the version after falls away where
versions share what has not changed.
"""
STATE = """\
What is kept of a texel from frame to frame, TEXEL_STATE: **{now} bits, {bytes} bytes** of 32 that it may have
({names}). Two bits more with a variability map, the last frame's bin. Beside it there are the published texels,
{level} bytes and a third more for their levels in each of {versions} versions, and two bytes that a frame makes for
itself: what was seen of the texel, and its class. A cell of the fills, one for each 16 texels of a map that is not
all sampled, has three sums of 44 bits and a count.
"""


def _said(text: str, **values: Any) -> str:
    """Paragraphs with their values, in lines of the house's width."""
    whole = re.sub("`[^`]*`", lambda code: code[0].replace(" ", NO_BREAK), text.format(**values))
    parts = [fill(part, WIDTH, break_on_hyphens=False, break_long_words=False) for part in whole.split("\n\n")]
    return "\n\n".join(parts).replace(NO_BREAK, " ") + "\n"


def _width(dtype: Any, *names: str) -> int:
    """Bits of some fields of a format."""
    total = 0
    for name in names or dtype.names:
        base, shape = dtype[name].base, dtype[name].shape
        total += field_width(dtype[name] if not shape else base) * (shape[0] if shape else 1)
    return total


TREE_BYTES = 90
"""A ray's from the surface of the bunny, texel by texel: docs/traversal_figures.md."""
HALO = 4
"""Texels around a region that are read: `REACH` less what means of stale ones look at."""
SMOOTHED = (_width(TEXEL_STATE, "irradiance", "count", "spread", "deviation") + 4) / 8
"""Of a texel that smoothing looks at; four bits are whether it is joined to those to its right and below, and alike."""


def base_gates(report: Mapping[str, Any]) -> dict[str, float]:
    """Gates of the units of preset base that take operands every cycle, of what `lightloom synth` has measured."""
    rows = (row for row in report["rows"] if row["preset"] == "base" and row["initiation_interval"] == 1)
    return {row["unit"]: row["gates"] for row in rows}


def weighed(tally: Tally, units: Mapping[str, float]) -> float:
    """Gates of operations."""
    return sum(
        times * (units[operation[0]] if operation[0] in units else gates_of_integers(operation))
        for operation, times in tally.items()
    )


def times_of(frame: Frame, rays: float) -> dict[str, float]:
    """How many of each a frame has."""
    return {
        "texel": frame.valid,
        "region of all": frame.regions,
        "region and view": 2 * frame.regions,
        "texel looked at": frame.looked_at,
        "texel and view": frame.tested,
        "texel on the screen and view": frame.on_screen + frame.on_predicted,
        "ray": rays * frame.updates,
        "update": frame.updates,
        "region": frame.rewritten,
        "texel of a coarser level": 21 * frame.rewritten + frame.coarser,
        "texel of a map not all sampled": 0,
        "texel and record": 0,
        "texel reached": 0,
    }


def page() -> str:
    """The whole page, of what was measured and of what is counted now."""
    measured = json.loads((DOCS / "arithmetic.json").read_text(encoding="utf-8"))
    units = base_gates(json.loads((DOCS / PARTS / "gates.json").read_text(encoding="utf-8")))
    found, frame, case = work(), Frame(**measured["frame"]), Case(**measured["case"])
    parts = [HEAD.format(command=COMMAND), _said(PREAMBLE, rates=_rates()), *_each(found, units)]
    others = ", ".join(f"{share:.2f} with {count} together" for count, share in measured["regions an update"].items())
    parts += [*_frame(found, units, frame, case, others), *_bytes(found.rays, frame), "## State\n", _state()]
    return "\n".join(parts)


def _rates() -> str:
    said: dict[str, Operation] = {
        "a sum": ("sum", 40),
        "a comparison": ("compare", 40),
        "a logarithm": ("logarithm", 40),
        "a product with 3 bits": ("product", 3, 40),
        "a shift by up to 15": ("shift", 40, 4),
    }
    return ", ".join(f"{name} {gates_of_integers(each):,.0f}" for name, each in said.items())


def _each(found: Work, units: Mapping[str, float]) -> Iterator[str]:
    """What is done for each texel, ray and region."""
    yield "## Of each\n"
    rows = []
    for stage, steps in found.stages.items():
        for step in steps:
            columns = [sum(step.tally.get((unit,), 0) for unit in names) for names in UNITS.values()]
            whole = sum(times for operation, times in step.tally.items() if operation[0] not in units)
            figures = [_short(each) for each in (*columns, whole)]
            gates = _short(weighed(step.tally, units) / 1000)
            rows.append([stage, step.name, f"`{step.function}`", step.of, *figures, gates])
    head = ["", "step", "said by, below `engine/`", "of each", *UNITS, "whole numbers", "thousand gates"]
    yield table(head, rows) + "\n"
    flops = sum(found.stages["rays"][0].tally.get((unit,), 0) for unit in FLOPS)
    yield _said(RAYS, flops=flops)


def _short(value: float) -> str:
    return "" if not value else f"{value:,.0f}" if value >= 99.5 else f"{value:.3g}"


def _frame(found: Work, units: Mapping[str, float], frame: Frame, case: Case, others: str) -> Iterator[str]:
    """What a frame comes to."""
    yield "## Of a frame\n"
    share = frame.rewritten / frame.updates
    left_out = 1 - frame.tested / (2 * frame.valid)
    given = {**asdict(case), **asdict(frame), "share": share, "others": others, "left_out": left_out}
    yield _said(FRAME, command=COMMAND, **given)
    times, rows, sums = times_of(frame, found.rays), [], dict.fromkeys(found.stages, 0.0)
    for stage, steps in found.stages.items():
        for step in steps:
            if count := times[step.of]:
                gates = count * weighed(step.tally, units)
                sums[stage] += gates
                operations = count * sum(step.tally.values())
                rows.append([stage, step.name, f"{count:,.0f}", f"{operations / 1e6:,.1f}", f"{gates / 1e9:,.1f}"])
    rows += [[f"**{stage}**", "together", "", "", f"**{gates / 1e9:,.1f}**"] for stage, gates in sums.items()]
    yield table(["", "step", "times", "million operations", "10⁹ gates"], rows) + "\n"
    yield _verdict(found, units, frame, sums)


def _verdict(found: Work, units: Mapping[str, float], frame: Frame, sums: Mapping[str, float]) -> str:
    parts = {step.name: weighed(step.tally, units) for step in found.stages["publishing"] if step.of == "region"}
    region = sum(parts.values()) + 21 * weighed(found.stages["publishing"][-2].tally, units)
    passes = [name for name in parts if "pass" in name]
    once = sum(parts[name] * (1 - 64 / side**2) for name, side in zip(passes, (12, 8), strict=True))
    return _said(
        VERDICT,
        ratio=sums["publishing"] / sums["rays"],
        even=sums["rays"] / region / frame.updates,
        passes=sum(parts[name] for name in passes) / region,
        once=once / region,
    )


def _bytes(rays: float, frame: Frame) -> Iterator[str]:
    """What a frame reads and writes."""
    yield "## Bytes\n"
    times, rows, sums = times_of(frame, rays), [], dict.fromkeys(("selection", "rays", "publishing"), 0.0)
    for stage, what, of, size in _moved(rays):
        if count := times[of]:
            sums[stage] += count * size
            rows.append([stage, what, f"{count:,.0f}", f"{size:,.0f}", f"{count * size / 1e6:.1f}"])
    rows += [[f"**{stage}**", "together", "", "", f"**{size / 1e6:.1f}**"] for stage, size in sums.items()]
    yield table(["", "what", "times", "bytes", "million bytes"], rows) + "\n"
    tree = TREE_BYTES * times["ray"]
    yield _said(
        BYTES,
        ratio=sums["publishing"] / sums["rays"],
        whole=sums["publishing"] / (sums["rays"] + tree),
        tree=TREE_BYTES,
        more=tree / 1e6,
        halo=HALO,
        most=frame.regions * 64 * SMOOTHED / 1e6,
    )


def _moved(rays: float) -> Iterator[tuple[str, str, str, float]]:
    """(stage, what, of each, bytes)."""
    record, state = _width(TEXEL, "position", "normal") / 8, _width(TEXEL_STATE) / 8
    watched = _width(TEXEL_STATE, "frame", "count", "heavy", "noticed", "deviation", "bias") / 8
    yield "selection", "boxes around a region's points and normals", "region of all", 2 * record
    yield "selection", "position and normal of a texel, for both views", "texel looked at", record
    yield "selection", "four pixels", "texel on the screen and view", 4 * PIXEL.itemsize
    yield (
        *("selection", "what is found, written; state and what was found; the class written, and read twice"),
        *("texel", 1 + watched + 1 + 3),
    )
    nearest = Sampling().directions
    texture, colours, material = 3 * 2 * 4, 2 * 3 * 4, 4
    hit = texture + colours + material + 4 * PUBLISHED_TEXEL.itemsize
    yield (
        "rays",
        "lightmap coordinates, material, albedo, emission and four texels of a hit",
        "ray",
        hit * nearest / rays,
    )
    yield (
        "rays",
        "record; state read and written",
        "update",
        _width(TEXEL, "position", "normal", "tangent") / 8 + 2 * state,
    )
    side = 8 + 2 * HALO
    published = (64 + 21) * PUBLISHED_TEXEL.itemsize
    yield "publishing", f"{side} by {side} texels to smooth", "region", side * side * SMOOTHED
    yield "publishing", "three levels written, and copied to the version after", "region", 3 * published


def _state() -> str:
    """What changes of a texel."""
    now = _width(TEXEL_STATE)
    names = ", ".join(f"{name} {_width(TEXEL_STATE, name)}" for name in TEXEL_STATE.names or ())
    level, versions = PUBLISHED_TEXEL.itemsize, Pipeline().versions
    return _said(STATE, now=now, bytes=-(-now // 8), names=names, level=level, versions=versions)


def main(what: list[str]) -> None:
    """Writes what was measured, or the page."""
    sys.stdout.write(json.dumps(report(Case()), indent=1) + "\n" if what == ["measure"] else page())


if __name__ == "__main__":
    main(sys.argv[1:])
