"""The registers of a unit for software and other tools: SystemRDL, and what PeakRDL's exporters make of it."""

import tempfile
from collections.abc import Mapping
from importlib import import_module
from pathlib import Path
from typing import Any

from lightloom.gen.package.files import render
from lightloom.golden_model.host.errors import InputError

PROPERTIES = {
    "rw": "sw = rw; hw = r;",
    "ro": "sw = r; hw = w;",
    "w1c": "sw = rw; hw = r; onwrite = woclr; hwset;",
    "w1p": "sw = w; hw = r; singlepulse;",
}
"""SystemRDL of what may be done with a field."""


def system_rdl(unit: Mapping[str, Any]) -> str:
    """SystemRDL 2.0 of a unit with registers, from its manifest."""
    return render("package_registers.rdl", **unit, properties=PROPERTIES)


def register_files(unit: Mapping[str, Any], version: str) -> dict[str, bytes]:
    """The files of a unit's registers, by their names, those of the page with its folder; {} for a unit without any.

    Raises InputError where PeakRDL is missing.
    """
    if "registers" not in unit:
        return {}
    module, text = unit["module"], system_rdl(unit)
    html, c_header, ipxact = (_exporter(name).exporter for name in ("html", "cheader", "ipxact"))
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        (folder / f"{module}.rdl").write_text(text, encoding="utf-8")
        compiler = import_module("systemrdl").RDLCompiler()
        compiler.compile_file(str(folder / f"{module}.rdl"))
        top = compiler.elaborate().top
        # It puts the time of day into the addresses of files, so that browsers read them again; here nothing may.
        html.HTMLExporter(user_context={"build_ts": 0}).export(top, str(folder / f"{module}_html"))
        standard = import_module("peakrdl_cheader.c_standards").CStandard.gnu11
        c_header.CHeaderExporter().export(top, path=str(folder / f"{module}.h"), std=standard)
        ipxact.IPXACTExporter(vendor="lightloom", library="registers", version=version).export(
            top, str(folder / f"{module}.xml")
        )
        paths = sorted(path for path in folder.rglob("*") if path.is_file())
        return {str(path.relative_to(folder)): path.read_bytes() for path in paths}


def _exporter(name: str) -> Any:
    """A package of PeakRDL."""
    try:
        import_module(f"peakrdl_{name}.exporter")
        return import_module(f"peakrdl_{name}")
    except ImportError as error:
        raise InputError(f"peakrdl-{name}: not found; install it with: pip install 'lightloom[registers]'") from error
