"""`lightloom pack`."""

from pathlib import Path
from typing import Annotated

import typer

from lightloom.rtl.config import PARAMETERS
from lightloom.shared.options import Json, Scene

WIDTH = PARAMETERS["width"]


def pack(
    scene: Scene,
    out: Annotated[Path, typer.Option("--out", metavar="IMAGE.bin", help="Where it goes.", show_default=False)],
    width: Annotated[
        int,
        typer.Option(
            "--width",
            metavar="|".join(map(str, WIDTH.values)),
            help="Most children of a node. Hardware of width 4 takes 4 only.",
        ),
    ] = WIDTH.default,
    json: Json = False,
) -> None:
    """Pack a scene's triangles for the hardware, as the memory image that it reads.

    The image holds the triangles in a wide tree of 64-byte blocks, described byte by byte in docs/memory_image.md. The
    same scene gives the same bytes everywhere. Node visits and triangle tests are those to be expected of a random line
    that meets the scene's box; `sah cost` is their weighted sum.

    \b
    Examples:
      lightloom pack cornell-box --out cornell-box.bin
      lightloom pack mesh.obj --width 4 --out mesh.bin --json
    """
    from lightloom.golden_model.host.errors import InputError
    from lightloom.golden_model.host.outputs import whole_file
    from lightloom.golden_model.scene.files.load import load_scene
    from lightloom.golden_model.tracing.bvh.build import build
    from lightloom.golden_model.tracing.wide_bvh.encode import widen
    from lightloom.golden_model.tracing.wide_bvh.memory_image import pack_image
    from lightloom.shared.console import Progress, print_json, print_table

    if width not in WIDTH.values:
        raise InputError(f"--width {width}: must be {WIDTH.allowed}")
    with Progress() as progress:
        with progress.stage("Scene"):
            triangles = load_scene(scene).triangles
        # Opened before the work, so that a place that cannot be written is found out before the work.
        with whole_file(out) as scratch, scratch.open("wb") as file:
            with progress.stage(f"Tree over {len(triangles):,} triangles"):
                tree = widen(build(triangles, leaf_size=1), width=width)
            file.write(image := pack_image({"bvh": tree.blocks}))
    visits, tests = tree.expected_visits
    counts = {name: int(tree.header[name]) for name in ("triangles", "nodes", "triangle_blocks", "levels")}
    summary = {
        "triangles": counts.pop("triangles"),
        "width": width,
        **counts,
        "bytes": len(image),
        "node_visits": visits,
        "triangle_tests": tests,
        "sah_cost": tree.sah_cost,
        "seconds": sum(progress.seconds.values()),
        "out": str(out),
    }
    if json:
        print_json(summary)
    else:
        print_table("Packed", [name.replace("_", " ") for name in summary], [list(summary.values())])
