"""`lightloom emit`."""

from pathlib import Path
from typing import Annotated

import typer

from lightloom.rtl.config import PRESET_SUMMARIES, PRESETS
from lightloom.shared.inputs import choose
from lightloom.shared.options import Bus, Json


def emit(
    units: Annotated[
        list[str] | None,
        typer.Argument(metavar="UNIT", help="Names of units; all of them if none is given. --list shows them."),
    ] = None,
    preset: Annotated[
        str, typer.Option("--preset", metavar="|".join(PRESETS), help="The hardware parameters; see above.")
    ] = "base",
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="The folder that the files are written to.")] = Path(
        "build/verilog"
    ),
    list_units: Annotated[bool, typer.Option("--list", help="Print the table of units and write nothing.")] = False,
    prefix: Annotated[
        str, typer.Option("--prefix", metavar="NAME_", help="What the names of all modules begin with.")
    ] = "",
    bus: Bus = "",
    json: Json = False,
) -> None:
    from lightloom.hardware.describe import emit_units, unit_row
    from lightloom.rtl.buses import BUSES
    from lightloom.rtl.catalogue import CATALOGUE
    from lightloom.shared.console import Progress, print_json, print_table

    choose(preset, PRESETS, "preset")
    bus = choose(bus, BUSES, "bus") if bus else ""
    names = [choose(name, CATALOGUE, "unit") for name in dict.fromkeys(units or CATALOGUE)]
    if list_units:
        rows = [unit_row(name, preset) for name in names]
    else:
        with Progress() as progress, progress.stage("Verilog", len(names)) as advance:
            rows = emit_units(names, preset, out, advance, prefix, bus)
    if json:
        print_json({"preset": preset, "out": None if list_units else str(out), "units": rows})
        return
    columns = ["unit", "computes", "latency", "interval", "bits in", "bits out"]
    print_table(f"Units, preset {preset}", columns, [list(row.values()) for row in rows])
    if not list_units:
        print(f"Written to {out}")


emit.__doc__ = "\n".join(
    [
        "Write the Verilog of units, with a manifest of each.",
        "",
        "Verilog-2001, one file a unit, and one of its memories; beside it a manifest (JSON) of ports,",
        "memories, latency, initiation interval, configuration and versions. The same units and preset",
        "give the same bytes.",
        "",
        "\b",
        "Presets:",
        *(f"  {name:<6} {PRESET_SUMMARIES[name]}" for name in PRESETS),
        "",
        "\b",
        "Examples:",
        "  lightloom emit",
        "  lightloom emit ray_triangle ray_setup --preset full --out verilog",
        "  lightloom emit traversal --preset tiny --prefix tiny_ --out build/tiny",
        "  lightloom emit traversal --bus axi4-lite",
        "  lightloom emit --list",
    ]
)
