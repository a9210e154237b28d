"""Waves for a viewer: what Verilator needs to write FST, and a save file that shows a unit's ports by their fields."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import vcd.gtkw

from lightloom.golden_model.host.errors import InputError
from lightloom.sim import toolchain

LIBRARIES = {"lz4.h": "liblz4-dev", "zlib.h": "zlib1g-dev"}
"""Headers that Verilator's writer of FST is compiled with, and the Debian packages that have them."""
LINKED = ("-llz4", "-lz")
GROUPS = {
    "clock": ("clk", "rst"),
    "control": ("control", "strobe"),
    "status": ("status",),
    "memory": ("memory",),
    "counters": ("counter",),
}
"""Groups of ports in a save file, and the roles of ports that are in each; streams have groups of their own."""
ZOOM = -15.0
"""A viewer's first look is at some twenty cycles: 2^15 ps across a tenth of a window."""
FORMATS = {"float32": "real", "int32": "signed", "int16": "signed"}
"""How a viewer shows fields that are no plain numbers."""


def require_libraries() -> None:
    """Raises InputError where a header is missing that waves of Verilator need."""
    for header, package in LIBRARIES.items():
        if not toolchain.has_header(header):
            raise InputError(f"waves: {header} not found; install it (Debian: apt install {package}), or use --icarus")


def save_file(path: Path, waves: Path, unit: Mapping[str, Any], scope: str) -> None:
    """Writes GTKWave's save file for the ports of a unit, whose manifest is given and whose ports lie in `scope`.

    Each stream is a group: its handshake, its payload, the payload's fields one by one. The others are grouped by role.
    """
    ports = unit["ports"]
    with path.open("w", encoding="utf-8") as file:
        save = vcd.gtkw.GTKWSave(file)
        save.dumpfile(waves.name, abspath=False)
        save.treeopen(f"{scope}.")
        save.zoom_markers(ZOOM)
        for name, roles in GROUPS.items():
            _group(save, name, scope, [port for port in ports if port["role"] in roles], name in ("memory", "counters"))
            if name == "clock":
                streams = [port for port in ports if port["role"] == "stream"]
                for stream in dict.fromkeys(port["name"].partition("__")[0] for port in streams):
                    _stream(save, stream, scope, [port for port in streams if port["name"].startswith(f"{stream}__")])


def _group(save: vcd.gtkw.GTKWSave, name: str, scope: str, ports: Sequence[Mapping[str, Any]], closed: bool) -> None:
    if ports:
        with save.group(name, closed=closed):
            for port in ports:
                save.trace(_full(scope, port), alias=port["name"], datafmt="dec" if name == "counters" else "hex")


def _stream(save: vcd.gtkw.GTKWSave, name: str, scope: str, ports: Sequence[Mapping[str, Any]]) -> None:
    with save.group(f"stream {name}"):
        for port in sorted(ports, key=lambda port: "fields" in port):
            save.trace(_full(scope, port), alias=port["name"])
            for field in port.get("fields", ()):
                _slice(save, _full(scope, port), port["width"], field)


def _slice(save: vcd.gtkw.GTKWSave, signal: str, width: int, field: Mapping[str, Any]) -> None:
    """Some bits of a signal of `width` bits under a name of their own.

    GTKWave writes a bit as its place from the left, and the whole signal. `GTKWSave` has no call for that.
    """
    name = field["name"] + "".join(f"[{index}]" for index in field["index"])
    left = width - field["offset"] - field["width"]
    bits = (f"({place}){signal}" for place in range(left, left + field["width"]))
    save.trace(" ".join([f"#{{{name}}}", *bits]), datafmt=FORMATS.get(field["type"], "hex"))


def _full(scope: str, port: Mapping[str, Any]) -> str:
    return f"{scope}.{port['name']}" + (f"[{port['width'] - 1}:0]" if port["width"] > 1 else "")
