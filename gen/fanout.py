"""Buffers behind flip-flops and memories that drive many cells.

ABC buffers the nets between gates. What registers drive are inputs to it, as strong as can be, so that it leaves them
alone; any layout would not.
"""

import re
from collections import Counter, defaultdict
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from gen.libraries import Library
from golden_model.errors import InputError

LIMIT = 16
"""Cells that one output drives; the same as that of ABC's own buffers."""

PIN = re.compile(r"^\s*pin\s*\(\s*\"?(\w+)\"?\s*\)", re.MULTILINE)


@dataclass(frozen=True)
class Buffer:
    """A cell whose output is its input."""

    cell: str
    area: float
    input: str
    output: str


def buffer_of(library: Library, design: dict[str, Any], top: str) -> Buffer:
    """The buffer that ABC took most often in Yosys's JSON of the mapped design, else the largest one.

    By function alone, delay cells are buffers too; ABC has looked at their timing. Raises InputError where the library
    has none.
    """
    taken = Counter(cell["type"] for cell in design["modules"][top]["cells"].values())
    found = sorted(_buffers(library), key=lambda buffer: (taken[buffer.cell], buffer.area, buffer.cell))
    if not found:
        raise InputError(f"{library.name}: no cell is a buffer; give the liberty file that has them")
    return found[-1]


def _buffers(library: Library) -> Iterable[Buffer]:
    for path in library.files:
        for text in re.split(r"^\s*cell\s*\(", path.read_text(errors="replace"), flags=re.MULTILINE)[1:]:
            pins = PIN.findall(text)
            function = re.search(r"\bfunction\s*:\s*\"\s*\(?\s*(\w+)\s*\)?\s*\"", text, re.MULTILINE)
            area = re.search(r"^\s*area\s*:\s*([\d.]+)", text, re.MULTILINE)
            if len(pins) == 2 and function and function.group(1) in pins and area and "dont_use : true" not in text:
                name = text.partition(")")[0].strip().strip('"')
                (output,) = (pin for pin in pins if pin != function.group(1))
                yield Buffer(name, float(area.group(1)), function.group(1), output)


def buffered(design: dict[str, Any], top: str, buffer: Buffer) -> int:
    """Puts trees of buffers into Yosys's JSON of a mapped design, in place; returns how many buffers."""
    module = design["modules"][top]
    cells = module["cells"]
    sinks: dict[int, list[tuple[list[int | str], int]]] = defaultdict(list)
    driven = set()
    for cell in cells.values():
        # Only registers and memories tell the directions of their pins: the modules of all others are not read.
        directions = cell.get("port_directions", {})
        for pin, bits in cell["connections"].items():
            for place, bit in enumerate(bits):
                if directions.get(pin) == "output":
                    driven.add(bit)
                elif isinstance(bit, int):
                    sinks[bit].append((bits, place))
    used = [bit for net in module["netnames"].values() for bit in net["bits"]]
    used += [bit for cell in cells.values() for bits in cell["connections"].values() for bit in bits]
    free = 1 + max((bit for bit in used if isinstance(bit, int)), default=1)
    added = 0
    for bit in sorted(bit for bit in driven if isinstance(bit, int)):
        loads = sinks[bit]
        while len(loads) > LIMIT:
            parents = []
            for start in range(0, len(loads), LIMIT):
                connections: dict[str, list[int | str]] = {buffer.input: [bit], buffer.output: [free]}
                for bits, place in loads[start : start + LIMIT]:
                    bits[place] = free
                cells[f"fanout_{added}"] = {
                    "type": buffer.cell,
                    "parameters": {},
                    "attributes": {},
                    "connections": connections,
                }
                parents.append((connections[buffer.input], 0))
                free, added = free + 1, added + 1
            loads = parents
    return added
