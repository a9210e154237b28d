"""`lightloom trace`."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from lightloom.shared.inputs import choose
from lightloom.shared.options import Json, Scene, npz

if TYPE_CHECKING:
    import numpy as np

TRACERS = ("golden", "rtl")
HITS = ("primitive", "t", "u", "v")
RAYS = {"origin": 3, "direction": 3, "t_min": 0, "t_max": 0}


def trace(
    scene: Scene,
    rays: Annotated[
        Path, npz("--rays", "RAYS", "The rays: origin (N,3), direction (N,3), t_min (N), t_max (N), float32.")
    ],
    out: Annotated[
        Path, npz("--out", "HITS", "Where the hits go: primitive (N) int32, -1 a miss; t, u, v (N) float32.")
    ],
    any_hit: Annotated[
        bool,
        typer.Option("--any-hit", help="Only whether there is a hit: primitive is 0 or -1, the rest 0."),
    ] = False,
    tracer: Annotated[
        str,
        typer.Option(
            "--tracer",
            "--backend",
            metavar="golden|rtl",
            help="What answers: the golden model or the Verilog. `--backend` is its older name.",
        ),
    ] = "golden",
    json: Json = False,
) -> None:
    """Trace rays through a scene.

    A ray covers origin + t * direction with t_min < t <= t_max. The nearest hit wins; of equal ones the lower triangle
    index. The hit point is (1-u-v) v0 + u v1 + v v2.

    \b
    Tracers, the same bits from both:
      golden  the golden model's BVH traversal
      rtl     the Verilated traversal unit with a tree in its memory

    \b
    Examples:
      lightloom trace cornell-box --rays rays.npz --out hits.npz
      lightloom trace mesh.obj --rays rays.npz --tracer rtl --out rtl.npz
      lightloom compare hits.npz rtl.npz
    """
    choose(tracer, TRACERS, "tracer")

    from lightloom.golden_model.host.outputs import whole_file
    from lightloom.golden_model.scene.files.load import load_scene
    from lightloom.hardware.tracers import golden_tracer, rtl_tracer
    from lightloom.shared.console import Progress, print_json, print_table
    from lightloom.shared.inputs import save_arrays

    batch = _rays(rays)
    stage = f"{len(batch):,} rays"
    with Progress() as progress:
        with progress.stage("Scene"):
            triangles = load_scene(scene).triangles
        with progress.stage("Simulators" if tracer == "rtl" else "Tree"):
            traced = (rtl_tracer if tracer == "rtl" else golden_tracer)(triangles)
        # Opened before the work, so that a place that cannot be written is found out before the work.
        with whole_file(out) as scratch, scratch.open("wb") as file:
            with progress.stage(stage, len(batch)) as advance:
                hits = traced(batch, any_hit=any_hit, advance=advance)
            save_arrays(file, {name: hits[name] for name in HITS})
    seconds = progress.seconds[stage]
    summary = {
        "rays": len(batch),
        "hits": int((hits["primitive"] >= 0).sum()),
        "triangles": len(triangles),
        "seconds": seconds,
        "rays_per_second": len(batch) / seconds,
        "backend": tracer,
        "out": str(out),
    }
    if json:
        print_json(summary)
    else:
        print_table("Traced", [name.replace("_", " ") for name in summary], [list(summary.values())])


def _rays(path: Path) -> "np.ndarray":
    """RAY (N,) of a file. Raises InputError where it holds no such thing."""
    import numpy as np

    from lightloom.golden_model.contract.formats import RAY
    from lightloom.shared.inputs import read_arrays

    arrays = read_arrays(path, RAYS, "--rays")
    batch = np.zeros(len(arrays["t_min"]), dtype=RAY)
    for name, values in arrays.items():
        batch[name] = values
    return batch
