"""`lightloom fpga`."""

from pathlib import Path
from typing import Annotated

import typer

from lightloom.rtl.config import PRESETS
from lightloom.shared.inputs import choose
from lightloom.shared.options import Json, Seed

COLUMNS = {
    "unit": "unit",
    "preset": "preset",
    "device": "device",
    "speed_grade": "speed grade",
    "luts": "LUTs",
    "flip_flops": "flip-flops",
    "multipliers": "multipliers",
    "block_rams": "block RAMs",
    "wrapper_flip_flops": "of the wrapper",
    "fits": "fits",
    "fmax_mhz": "MHz",
}


def fpga(
    units: Annotated[list[str], typer.Argument(metavar="UNIT", help="Names of units.", show_default=False)],
    device: Annotated[str, typer.Option("--device", metavar="25k|85k", help="An ECP5 of so many LUTs.")] = "85k",
    speed: Annotated[str, typer.Option("--speed", metavar="6|7|8", help="Its speed grade.")] = "6",
    preset: Annotated[str, typer.Option("--preset", metavar="|".join(PRESETS), help="Hardware parameters.")] = "tiny",
    seed: Seed = 1,
    out: Annotated[
        Path | None, typer.Option("--out", metavar="DIR", help="Write bitstreams and figures there.")
    ] = None,
    json: Json = False,
) -> None:
    """Place and route units on a Lattice ECP5 with Yosys and nextpnr: what they use, their clock, a bitstream.

    Units have more ports than a device has pins: a wrapper shifts them in and out through five pins. Its flip-flops,
    one a port bit, are among those used. The clock is that of the slowest path after routing.

    \b
    Examples:
      lightloom fpga ray_setup --device 25k
      lightloom fpga traversal --speed 8 --out build/fpga
    """
    import shutil

    from lightloom.gen.flow import tools
    from lightloom.gen.flow.fpga import BITSTREAM, DEVICES, SPEEDS
    from lightloom.golden_model.host.outputs import whole_folder
    from lightloom.hardware.fpga import TOOLS, place
    from lightloom.rtl.catalogue import CATALOGUE
    from lightloom.shared.console import Progress, json_text, print_json, print_table
    from lightloom.shared.provenance import COMMIT

    choose(device, DEVICES, "device")
    grades = {str(grade): grade for grade in SPEEDS}
    choose(speed, grades, "speed grade")
    choose(preset, PRESETS, "preset")
    names = [choose(name, CATALOGUE, "unit") for name in dict.fromkeys(units)]
    placed = []
    with Progress() as progress:
        for name in names:
            with progress.stage(f"{name} {preset} {device}-{speed}"):
                placed.append(place(name, preset, device, grades[speed], seed))
    chosen = f"--device {device} --speed {speed} --preset {preset} --seed {seed}"
    report = {
        "command": f"lightloom fpga {' '.join(names)} {chosen}",
        "versions": {**COMMIT, **{name: tools.version(name) for name in TOOLS}},
        "rows": [one.row() for one in placed],
    }
    if out is not None:
        with whole_folder(out) as folder:
            (folder / "fpga.json").write_text(json_text(report), encoding="utf-8")
            for one in placed:
                if one.placed.fits:
                    shutil.copy(one.folder / BITSTREAM, folder / f"{one.unit}.{preset}.{device}.bit")
    if json:
        print_json(report)
    else:
        rows = [one.row() for one in placed]
        print_table(f"ECP5, {device}", list(COLUMNS.values()), [[row[key] for key in COLUMNS] for row in rows])
        if out is not None:
            print(f"Written to {out}")
