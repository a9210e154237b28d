"""Trees of buffers on nets that drive very many cells, as a layout flow would put them there.

ABC buffers what it maps, but leaves nets of thousands of cells alone, such as the enable of all registers of a unit.
"""

import re
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from lightloom.gen.flow.libraries import CELL, PIN, Library
from lightloom.golden_model.host.errors import InputError

LIMIT = 16
"""Cells that a buffer drives."""
LARGE = 2 * LIMIT
"""Nets with more cells than that get a tree; ABC's sizing is right for smaller ones."""
HUGE = 16 * LIMIT
"""Before gates are mapped: nets with more cells than that get a tree, so that ABC looks at all the others."""
ROOT = 4
"""Buffers that the cell at the root of a tree drives: it may be a small one."""

Bit = int | str
Load = tuple[list[Bit], int]
"""A list of bits and a place in it: an input of a cell."""


@dataclass(frozen=True)
class Buffer:
    """A cell whose output is its one input; capacitances in the library's unit."""

    cell: str
    area: float
    input: str
    output: str
    load: float
    """Capacitance of the input."""
    drive: float
    """Greatest capacitance at the output."""


def buffers(library: Library) -> list[Buffer]:
    """All buffers, the smallest first. Raises InputError where there is none."""
    found = sorted(_buffers(library), key=lambda buffer: (buffer.area, buffer.cell))
    if not found:
        raise InputError(f"{library.name}: no cell is a buffer; give the liberty file that has them")
    return found


def _buffers(library: Library) -> Iterator[Buffer]:
    for path in library.files:
        for text in re.split(CELL, path.read_text(errors="replace"))[1:]:
            function = re.search(r"\bfunction\s*:\s*\"\s*\(?\s*(\w+)\s*\)?\s*\"", text)
            pins = dict(zip(PIN.findall(text), re.split(PIN, text)[2::2], strict=True))
            if not function or len(pins) != 2 or function.group(1) not in pins or "dont_use : true" in text:
                continue
            (output,) = (pin for pin in pins if pin != function.group(1))
            area = _number("area", text)
            load, drive = _number("capacitance", pins[function.group(1)]), _number("max_capacitance", pins[output])
            yield Buffer(text.partition(")")[0].strip().strip('"'), area, function.group(1), output, load, drive)


def _number(name: str, text: str) -> float:
    found = re.search(rf"\b{name}\s*:\s*\"?([\d.]+)", text)
    return float(found.group(1)) if found else 0.0


def strong_enough(found: list[Buffer]) -> Buffer:
    """The smallest buffer that may drive ten times LIMIT of its own inputs (delay cells may not), else the last."""
    strong = [buffer for buffer in found if buffer.drive >= 10 * LIMIT * buffer.load]
    return strong[0] if strong else found[-1]


def spread(design: dict[str, Any], name: str, found: list[Buffer], size: int = LARGE) -> int:
    """Puts trees on the nets of a module that drive more than `size` cells, in place; returns how many buffers.

    `design` is Yosys's JSON; every cell's module is in it, or one of Yosys's own.
    """
    module, buffer = design["modules"][name], strong_enough(found)
    cells = module["cells"]
    loads: dict[Bit, list[Load]] = defaultdict(list)
    for cell in cells.values():
        for pin, bits in cell["connections"].items():
            if cell["port_directions"][pin] == "input":
                for place, bit in enumerate(bits):
                    loads[bit].append((bits, place))
    used = [bit for net in module["netnames"].values() for bit in net["bits"]]
    used += [bit for cell in cells.values() for bits in cell["connections"].values() for bit in bits]
    free = 1 + max((bit for bit in used if isinstance(bit, int)), default=1)
    clocks = {bit for port, one in module["ports"].items() if port == "clk" for bit in one["bits"]}
    added = 0
    for driver in sorted(bit for bit in loads if isinstance(bit, int) and bit not in clocks):
        ends = loads[driver]
        if len(ends) <= size:
            continue
        while len(ends) > ROOT:
            parents: list[Load] = []
            for start in range(0, len(ends), LIMIT):
                for bits, place in ends[start : start + LIMIT]:
                    bits[place] = free
                inputs: list[Bit] = [driver]
                cells[f"fanout{size}_{added}"] = {
                    "type": buffer.cell,
                    "parameters": {},
                    "attributes": {},
                    "port_directions": {buffer.input: "input", buffer.output: "output"},
                    "connections": {buffer.input: inputs, buffer.output: [free]},
                }
                parents.append((inputs, 0))
                free, added = free + 1, added + 1
            ends = parents
    return added
