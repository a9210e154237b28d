"""`lightloom layout`."""

from pathlib import Path
from typing import Annotated

import typer

from lightloom.rtl.config import PRESETS
from lightloom.shared.inputs import choose
from lightloom.shared.options import Json, Seed


def layout(
    unit: Annotated[str, typer.Argument(metavar="UNIT", help="A unit of up to about 2,000 cells.", show_default=False)],
    pdk_root: Annotated[
        Path, typer.Option("--pdk-root", metavar="DIR", help="Where IHP SG13G2 is.", show_default=False)
    ],
    preset: Annotated[str, typer.Option("--preset", metavar="|".join(PRESETS), help="Hardware parameters.")] = "tiny",
    seed: Seed = 1,
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="The folder that everything is written to.")] = Path(
        "build/layout"
    ),
    json: Json = False,
) -> None:
    """Place and route a small unit with IHP SG13G2 cells: a demonstration, nothing that is signed off.

    Needs Debian's qflow (graywolf, qrouter) and the PDK's liberty, LEF and GDS files of standard cells. The cells' own
    geometry is merged in; then which pins the metal connects is extracted and compared with the netlist.

    \b
    In DIR, whole or not at all:
      UNIT.gds   UNIT_routed.def   UNIT_mapped.v   UNIT.png   UNIT-detail.png   layout.json

    \b
    Examples:
      lightloom layout fixed_to_float --pdk-root pdks/ihp-sg13g2 --out build/fixed
    """
    from lightloom.hardware.place_and_route import lay_out
    from lightloom.rtl.catalogue import CATALOGUE
    from lightloom.shared.console import Progress, print_json, print_table

    choose(unit, CATALOGUE, "unit")
    choose(preset, PRESETS, "preset")
    with Progress() as progress, progress.stage(f"{unit} {preset}", 4) as advance:
        report = lay_out(unit, preset, pdk_root, out, seed, lambda step: advance(1))
    if json:
        print_json(report)
        return
    row = report["rows"][0]
    wire = row.pop("wire")
    rows = [[key.replace("_", " "), value] for key, value in row.items()]
    rows += [[f"wire on {metal}, um", length] for metal, length in wire.items()]
    print_table(f"Layout of {unit}, preset {preset}", ["what", "value"], rows)
    print(f"Written to {out}")
