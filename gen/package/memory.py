"""The memory of a testbench: what it holds, what of it a unit's port reaches, and what is tied off."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from amaranth import Shape
from amaranth.lib.wiring import Out

from lightloom.gen.verilog import AXI
from lightloom.gen.watched import Port, axi_of
from lightloom.rtl.memory.axi import Axi


@dataclass(frozen=True, kw_only=True, eq=False)
class Case:
    """What a unit with a memory is asked, what its model answers, and what the memory holds meanwhile."""

    operands: np.ndarray
    """Of the unit's input dtype, (N,)."""
    results: np.ndarray
    """Of its output dtype, (N,)."""
    image: bytes
    base: int
    """Byte address in the image of what the unit works on."""

    @property
    def memory_bits(self) -> int:
        """The memory has 2**memory_bits bytes, at least."""
        return max(len(self.image) - 1, 1 << 12).bit_length()


def memory_port(unit: Mapping[str, Any]) -> dict[str, Any]:
    """What the template of a memory needs, from the manifest of a unit that has a memory port.

    `wires` are the signals of that port, by AXI's names, with their widths; `unused` those that the memory has besides:
    its inputs with their widths, its outputs with 0.
    """
    ports = {port["name"]: Port(port["direction"], port["width"]) for port in unit["ports"]}
    one = axi_of(ports).ports[0]
    widths = {"address_width": one.address_width, "data_width": one.data_width, "id_width": one.id_width}
    wires, unused = {}, {}
    for part in Axi(**widths).ports:
        for name, member in part.members.items():
            if f"{AXI}_{name}" in ports:
                wires[name] = ports[f"{AXI}_{name}"].width
            else:
                unused[name] = Shape.cast(member.shape).width if member.flow == Out else 0
    return widths | {"wires": wires, "unused": unused}
