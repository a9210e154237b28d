"""Memories in synthesis: those with a synchronous read stay out of the mapping, as macros would.

Yosys's JSON of a design is edited here: each such memory becomes an instance of an empty module, for which a liberty
file with an access time and a set-up time is written. What a macro lacks stays logic: where a read port shows what is
written in the same cycle, a comparison and a register for the word are put around it.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

Json = dict[str, Any]
Bit = int | str


@dataclass(frozen=True)
class Memory:
    """One memory that was kept out: its place in the design and its shape."""

    module: str
    name: str
    depth: int
    width: int
    reads: int
    writes: int
    masked: bool = False
    """Bits of a word are written on their own, so that a write enable has a bit for each of them."""

    @property
    def bits(self) -> int:
        return self.depth * self.width

    @property
    def macro(self) -> str:
        """The name of the empty module."""
        return f"ram_{self.depth}x{self.width}_{self.reads}r{self.writes}w{'_masked' if self.masked else ''}"

    @property
    def address_width(self) -> int:
        return max(1, (self.depth - 1).bit_length())

    def ports(self) -> Iterator[tuple[str, str, int]]:
        """Name, direction and width of every port."""
        yield "clk", "input", 1
        for kind, count in (("r", self.reads), ("w", self.writes)):
            for port in range(count):
                yield f"{kind}{port}_en", "input", self.width if kind == "w" and self.masked else 1
                yield f"{kind}{port}_addr", "input", self.address_width
                yield f"{kind}{port}_data", "output" if kind == "r" else "input", self.width


def _number(parameter: str | int) -> int:
    return parameter if isinstance(parameter, int) else int(parameter, 2)


def _slice(bits: list[Bit], port: int, width: int) -> list[Bit]:
    return bits[port * width : (port + 1) * width]


class _Wires:
    """Numbers for new wires of a module, and cells between them."""

    def __init__(self, module: Json):
        self.cells: Json = module["cells"]
        self.names: Json = module["netnames"]
        used = [bit for net in module["netnames"].values() for bit in net["bits"] if isinstance(bit, int)]
        for cell in self.cells.values():
            used += [bit for bits in cell["connections"].values() for bit in bits if isinstance(bit, int)]
        self.free = max(used, default=1) + 1

    def new(self, width: int) -> list[Bit]:
        start, self.free = self.free, self.free + width
        return list(range(start, self.free))

    def cell(self, name: str, kind: str, parameters: dict[str, int], **connections: list[Bit]) -> None:
        self.cells[name] = {
            "type": kind,
            "parameters": {key: f"{value:032b}" for key, value in parameters.items()},
            "attributes": {},
            "port_directions": {port: "output" if port in "YQ" else "input" for port in connections},
            "connections": connections,
        }


def _fits(cell: Json, bits: int) -> bool:
    """Whether the memory has synchronous reads without a reset only, one clock, and at least so many bits."""
    parameters = {name: cell["parameters"][name] for name in cell["parameters"]}
    ports = _number(parameters["RD_PORTS"])
    clocked = _number(parameters["RD_CLK_ENABLE"]) == (1 << ports) - 1
    resets = [bit for name in ("RD_ARST", "RD_SRST") for bit in cell["connections"][name]]
    plain = not _number(parameters["RD_WIDE_CONTINUATION"]) and not _number(parameters["WR_WIDE_CONTINUATION"])
    size = _number(parameters["SIZE"]) * _number(parameters["WIDTH"])
    return clocked and plain and set(resets) <= {"0", "x"} and size >= bits and ports > 0


def cut_out(design: Json, bits: int) -> list[Memory]:
    """Replaces memories of at least `bits` bits in Yosys's JSON, in place; returns those of each module."""
    memories = []
    for module_name, module in list(design["modules"].items()):
        found = [name for name, cell in module["cells"].items() if cell["type"] == "$mem_v2" and _fits(cell, bits)]
        wires = _Wires(module) if found else None
        for name in found:
            assert wires is not None
            memories.append(_replace(module_name, name, module["cells"].pop(name), wires))
    for memory in {memory.macro: memory for memory in memories}.values():
        design["modules"][memory.macro] = {
            "attributes": {"blackbox": f"{1:032b}"},
            "ports": {name: {"direction": way, "bits": []} for name, way, _ in memory.ports()},
            "cells": {},
            "netnames": {},
        }
        _number_ports(design["modules"][memory.macro], memory)
    return memories


def _number_ports(module: Json, memory: Memory) -> None:
    free = 2
    for name, _, width in memory.ports():
        module["ports"][name]["bits"] = list(range(free, free + width))
        free += width


def _replace(module: str, name: str, cell: Json, wires: _Wires) -> Memory:
    """Puts an instance of the empty module, and what is needed around it, in the place of a memory."""
    parameters, old = cell["parameters"], cell["connections"]
    width, address_bits = _number(parameters["WIDTH"]), _number(parameters["ABITS"])
    reads, writes = _number(parameters["RD_PORTS"]), _number(parameters["WR_PORTS"])
    enables = [_slice(old["WR_EN"], port, width) for port in range(writes)]
    masked = any(len(set(bits)) > 1 for bits in enables)
    memory = Memory(module, name.lstrip("\\"), _number(parameters["SIZE"]), width, reads, writes, masked)
    clock = old["RD_CLK"][:1]
    connections: dict[str, list[Bit]] = {"clk": clock}
    for port in range(writes):
        connections[f"w{port}_en"] = enables[port] if masked else enables[port][:1]
        connections[f"w{port}_addr"] = _slice(old["WR_ADDR"], port, address_bits)[: memory.address_width]
        connections[f"w{port}_data"] = _slice(old["WR_DATA"], port, width)
    transparent = _number(parameters["RD_TRANSPARENCY_MASK"])
    for port in range(reads):
        enable = _slice(old["RD_EN"], port, 1)
        address = _slice(old["RD_ADDR"], port, address_bits)[: memory.address_width]
        result = _slice(old["RD_DATA"], port, width)
        for write in reversed(range(writes)):
            if transparent >> (port * writes + write) & 1:
                result = _bypass(
                    wires, f"{name}.bypass{port}_{write}", clock, enable, address, write, connections, result
                )
        connections[f"r{port}_en"], connections[f"r{port}_addr"], connections[f"r{port}_data"] = enable, address, result
    # Addresses of fewer bits than the depth asks for cannot occur; unused ones are left to the tool.
    for port_name, _, port_width in memory.ports():
        connections[port_name] += ["0"] * (port_width - len(connections[port_name]))
    wires.cells[name] = {
        "type": memory.macro,
        "parameters": {},
        "attributes": {"keep": f"{1:032b}"},
        "port_directions": {port: way for port, way, _ in memory.ports()},
        "connections": connections,
    }
    return memory


def _bypass(
    wires: _Wires,
    name: str,
    clock: list[Bit],
    enable: list[Bit],
    address: list[Bit],
    write: int,
    connections: dict[str, list[Bit]],
    result: list[Bit],
) -> list[Bit]:
    """Logic that gives `result` what is written in the cycle of the read; returns where the macro's word goes in."""
    width = len(result)
    same, written, hold, word, macro = (wires.new(count) for count in (1, width, width, width, width))
    size = {"A_WIDTH": len(address), "B_WIDTH": len(address), "Y_WIDTH": 1, "A_SIGNED": 0, "B_SIGNED": 0}
    wires.cell(f"${name}_eq", "$eq", size, A=address, B=connections[f"w{write}_addr"], Y=same)
    size = {"A_WIDTH": width, "B_WIDTH": width, "Y_WIDTH": width, "A_SIGNED": 0, "B_SIGNED": 0}
    enables = connections[f"w{write}_en"]
    enables = enables if len(enables) == width else enables * width
    wires.cell(f"${name}_and", "$and", size, A=enables, B=same * width, Y=written)
    flip_flop = {"WIDTH": width, "CLK_POLARITY": 1, "EN_POLARITY": 1}
    for part, data, kept in (("hold", written, hold), ("word", connections[f"w{write}_data"], word)):
        wires.cell(f"${name}_{part}", "$dffe", flip_flop, CLK=clock, EN=enable, D=data, Q=kept)
    for part, bits in (("hold", hold), ("word", word)):
        wires.names[f"{name}_{part}"] = {"hide_name": 0, "bits": bits, "attributes": {}}
    wires.cell(f"${name}_mux", "$bwmux", {"WIDTH": width}, A=macro, B=word, S=hold, Y=result)
    return macro


def liberty(memories: Iterable[Memory], access: float, setup: float) -> str:
    """A liberty file of the empty modules: times in ns from the clock to the word, and before the clock."""
    macros = sorted({memory.macro: memory for memory in memories}.values(), key=lambda memory: memory.macro)
    widths = sorted({width for memory in macros for _, _, width in memory.ports() if width > 1})
    lines = [
        "library (memories) {",
        '  delay_model : table_lookup; time_unit : "1ns"; voltage_unit : "1V"; current_unit : "1mA";',
        '  pulling_resistance_unit : "1kohm"; leakage_power_unit : "1nW"; capacitive_load_unit (1, pf);',
        "  nom_process : 1; nom_voltage : 1; nom_temperature : 25; default_max_transition : 1000;",
        "  input_threshold_pct_rise : 50; input_threshold_pct_fall : 50;",
        "  output_threshold_pct_rise : 50; output_threshold_pct_fall : 50;",
        "  slew_lower_threshold_pct_rise : 20; slew_lower_threshold_pct_fall : 20;",
        "  slew_upper_threshold_pct_rise : 80; slew_upper_threshold_pct_fall : 80;",
    ]
    for width in widths:
        lines.append(
            f"  type (bus{width}) {{ base_type : array; data_type : bit; bit_width : {width}; bit_from : {width - 1}; "
            "bit_to : 0; downto : true; }"
        )
    for memory in macros:
        lines.append(f"  cell ({memory.macro}) {{ area : 0; interface_timing : true;")
        for name, way, width in memory.ports():
            lines += _pin(name, way, width, access, setup)
        lines.append("  }")
    return "\n".join([*lines, "}", ""])


def _pin(name: str, way: str, width: int, access: float, setup: float) -> Iterator[str]:
    group, shape = ("pin", "") if width == 1 else ("bus", f"bus_type : bus{width}; ")
    # In this order: OpenSTA makes the pins of a bus when it reads their type.
    yield f"    {group} ({name}) {{ {shape}direction : {way};"
    if name == "clk":
        yield "      clock : true; capacitance : 0.001;"
    elif way == "input":
        constraint = " ".join(f'{edge}_constraint (scalar) {{ values ("{setup:.6f}"); }}' for edge in ("rise", "fall"))
        yield '      capacitance : 0.001; timing () { related_pin : "clk"; timing_type : setup_rising;'
        yield f"      {constraint} }}"
    else:
        tables = " ".join(f'cell_{edge} (scalar) {{ values ("{access:.6f}"); }}' for edge in ("rise", "fall"))
        tables += " " + " ".join(f'{edge}_transition (scalar) {{ values ("0.02"); }}' for edge in ("rise", "fall"))
        yield f'      timing () {{ related_pin : "clk"; timing_type : rising_edge; {tables} }}'
    yield "    }"
