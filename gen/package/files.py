"""The files of a package that describe a unit to a flow, each from a template or as JSON."""

import json
import re
from collections.abc import Mapping
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from lightloom.gen.pages.pages import TEMPLATES

DENSITY = 55
"""Percent of the core that LibreLane fills with cells."""


def render(template: str, **context: Any) -> str:
    """A template of this folder, filled in. Only XML and HTML are escaped."""
    environment = Environment(
        loader=FileSystemLoader(TEMPLATES),
        autoescape=template.endswith((".xml", ".html")),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.filters["quoted"] = lambda text: text.replace('"', '\\"')  # of SystemRDL
    return environment.get_template(template).render(context)


def verilog_files(unit: Mapping[str, Any]) -> list[str]:
    """The Verilog of a unit, from its manifest: its own file, and that of its memories."""
    return [unit["file"], *([unit["memories"]["file"]] if unit["memories"] else [])]


def constraints(unit: Mapping[str, Any], clock: float, unit_name: str = "ns") -> str:
    """SDC of a unit, from its manifest, with a clock of `clock` ns."""
    return render("package.sdc", **unit, period=f"{clock:g}", unit_name=unit_name)


def ipxact(unit: Mapping[str, Any], version: str) -> str:
    """IEEE 1685-2014 component of a unit."""
    widths = {port["name"]: port["width"] for port in unit["ports"]}
    axi, registers = (
        [(name.removeprefix(prefix).upper(), name) for name in widths if name.startswith(prefix)]
        for prefix in ("m_axi_", "s_axi_")
    )
    return render(
        "package_ipxact.xml",
        **unit,
        version=version,
        axi=axi,
        register_port=registers,
        axi_width=widths.get("m_axi_rdata"),
        address_range=1 << widths.get("m_axi_araddr", 0),
    )


def librelane(unit: Mapping[str, Any], clock: float) -> str:
    """Configuration of a unit, from its manifest, for LibreLane; paths are relative to its own folder."""
    module = unit["module"]
    return to_json(
        {
            "meta": {"version": 2},
            "DESIGN_NAME": module,
            "VERILOG_FILES": [f"dir::../../../rtl/{file}" for file in verilog_files(unit)],
            "CLOCK_PORT": "clk",
            "CLOCK_PERIOD": clock,
            "PNR_SDC_FILE": f"dir::../../../sdc/{module}.sdc",
            "SIGNOFF_SDC_FILE": f"dir::../../../sdc/{module}.sdc",
            "FP_CORE_UTIL": DENSITY,
        }
    )


def to_json(content: Mapping[str, Any]) -> str:
    """JSON as a file; lists of plain values on one line."""
    text = json.dumps(content, indent=2)
    return re.sub(r"\[\s+([^\[\]{}]*?)\s+\]", lambda m: "[" + re.sub(r",\s+", ", ", m[1]) + "]", text) + "\n"
