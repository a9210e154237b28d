"""`lightloom package`."""

from pathlib import Path
from typing import Annotated

import typer

from lightloom.rtl.config import PRESET_SUMMARIES, PRESETS
from lightloom.shared.inputs import choose
from lightloom.shared.options import Bus, Json


def package(
    units: Annotated[
        list[str] | None,
        typer.Argument(metavar="UNIT", help="Names of units; all of them if none is given."),
    ] = None,
    preset: Annotated[
        str, typer.Option("--preset", metavar="|".join(PRESETS), help="The hardware parameters; see above.")
    ] = "base",
    clock: Annotated[
        float | None,
        typer.Option(
            "--clock", metavar="NS", help="Period of the clock in the constraints.", show_default="the preset's"
        ),
    ] = None,
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="The folder that everything is written to.")] = Path(
        "build/package"
    ),
    prefix: Annotated[
        str, typer.Option("--prefix", metavar="NAME_", help="What the names of all modules begin with.")
    ] = "",
    bus: Bus = "",
    json: Json = False,
) -> None:
    from lightloom.hardware.package_inputs import package_units
    from lightloom.rtl.buses import BUSES
    from lightloom.rtl.catalogue import CATALOGUE
    from lightloom.shared.console import Progress, print_json, print_table

    choose(preset, PRESETS, "preset")
    bus = choose(bus, BUSES, "bus") if bus else ""
    names = [choose(name, CATALOGUE, "unit") for name in dict.fromkeys(units or CATALOGUE)]
    with Progress() as progress, progress.stage("Package", len(names)) as advance:
        described = package_units(names, preset, clock, out, advance, prefix, bus)
    if json:
        print_json({"out": str(out), **described})
        return
    columns = {"module": "module", "summary": "computes", "latency": "latency", "initiation_interval": "interval"}
    rows = [[row[key] for key in columns] for row in described["units"]]
    print_table(f"Package, preset {preset}", list(columns.values()), rows)
    print(f"{len(described['files']) + 2} files written to {out}; make -C {out} check")


package.__doc__ = "\n".join(
    [
        "Package units for a flow: Verilog, constraints, descriptions, testbenches, checksums.",
        "",
        "\b",
        "In DIR, whole or not at all:",
        "  README.md   Makefile (make check)   manifest.json   SHA256SUMS",
        "  rtl/UNIT.v  rtl/UNIT.json           Verilog-2001 and its manifest",
        "  lightloom.f   lightloom.core        file list, FuseSoC",
        "  sdc/  flow/librelane/  flow/openroad/   ipxact/",
        "  registers/  include/                with --bus: SystemRDL, C header, IP-XACT, page; C header of formats",
        "  testbench/                          self-checking, vectors of the golden model",
        "",
        "`make check` in DIR needs sha256sum and Icarus Verilog, no Python. The same options give the same bytes.",
        "",
        "\b",
        "Presets:",
        *(f"  {name:<6} {PRESET_SUMMARIES[name]}" for name in PRESETS),
        "",
        "\b",
        "Examples:",
        "  lightloom package --out package",
        "  lightloom package traversal --preset full --clock 4 --out package",
        "  lightloom package traversal --bus axi4-lite --out package",
    ]
)
