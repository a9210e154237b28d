"""`lightloom render`."""

from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from golden_model.errors import InputError
from lightloom.commands.options import Json, Scene, Seed, Size, Traversal
from lightloom.inputs import at_least, choose, image_size, seed_value


def render(
    scene: Scene,
    frames: Annotated[int, typer.Option("--frames", metavar="N", help="Frames to render.")] = 16,
    budget: Annotated[
        int, typer.Option("--budget", metavar="RAYS", help="Rays that a frame may spend on the lightmaps.")
    ] = 200_000,
    size: Size = "512x512",
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="The folder that everything is written to.")] = Path(
        "build/render"
    ),
    seed: Seed = 0,
    backend: Traversal = "auto",
    directions: Annotated[
        int,
        typer.Option("--directions", metavar="N", help="Rays for indirect light in a texel update (a power of two)."),
    ] = 16,
    light_samples: Annotated[
        int, typer.Option("--light-samples", metavar="N", help="Shadow rays in a texel update, at most.")
    ] = 4,
    supersample: Annotated[
        int, typer.Option("--supersample", metavar="K", help="A PNG pixel is the mean of K x K rendered ones.")
    ] = 1,
    exposure: Annotated[
        float | None,
        typer.Option("--exposure", metavar="X", help="Factor from radiance to display; else from the first frame."),
    ] = None,
    exr: Annotated[bool, typer.Option("--exr", help="Write the radiance of each frame as EXR too.")] = False,
    json: Json = False,
) -> None:
    """Render frames of a scene whose lightmaps are maintained by ray tracing.

    Each frame is drawn from the lightmaps; beside it, texels are sampled anew by at most --budget rays, and the next
    frame sees what they found. The camera follows the scene's path, if it has one. Same options, same bits.

    \b
    In DIR, whole or not at all:
      frames/NNNN.png     film.webp     contact-sheet.png
      lightmap/NNNN.png   the lightmaps after that frame (.exr: irradiance in half floats)
      render.json         counts and times, frame by frame

    \b
    Examples:
      lightloom render cornell-box
      lightloom render cornell-box --frames 48 --budget 300000 --directions 64 --supersample 2
      lightloom render room.glb --size 960x540 --exr --out build/room
    """
    from golden_model.traversal import BACKENDS, backend_of, trace

    choose(backend, BACKENDS, "backend")
    at_least(frames, 1, "--frames")
    at_least(supersample, 1, "--supersample")
    width, height = image_size(size, supersample)
    if exposure is not None and not 0 < exposure < float("inf"):
        raise InputError(f"--exposure {exposure:g}: must be greater than 0")

    from golden_model.bvh import build
    from golden_model.charts import unwrap
    from golden_model.gather import Sampling
    from golden_model.mesh_charts import default_cache
    from golden_model.outputs import whole_folder
    from golden_model.renderer import Renderer
    from golden_model.scene import load_scene, require_light
    from lightloom.console import Progress, json_text, print_json, print_table
    from lightloom.machine import machine, versions
    from lightloom.sequence import Pictures, contact_sheet, render_sequence

    sampling = Sampling(directions=directions, light_samples=light_samples)
    loaded = load_scene(scene)
    require_light(loaded)  # before the charts, which may take a while
    sampling.require(budget, loaded)
    with Progress() as progress, whole_folder(out) as folder:
        with progress.stage("Charts"):
            tracer = partial(trace, build(loaded.triangles), backend=backend)
            lightmaps = unwrap(loaded, trace=tracer, cache=default_cache())
        with progress.stage("First light"):
            renderer = Renderer(
                loaded,
                width=width * supersample,
                height=height * supersample,
                budget=budget,
                seed=seed_value(seed),
                sampling=sampling,
                lightmaps=lightmaps,
                backend=backend,
            )
        with progress.stage("Frames", frames) as advance:
            pictures = Pictures(supersample=supersample, exposure=exposure, exr=exr)
            figures = render_sequence(renderer, frames, folder, pictures, advance)
            contact_sheet(folder).save(folder / "contact-sheet.png")
        figures |= {
            "backend": backend_of(backend),
            "seconds": dict(progress.seconds),
            "versions": versions(),
            "machine": machine(),
        }
        (folder / "render.json").write_text(json_text(figures))
    if json:
        print_json(figures)
        return
    lightmap = figures["lightmap"]
    print_table(
        f"{figures['scene']}, {frames} frame{'s' if frames > 1 else ''} of {width}x{height}",
        ["", "figure"],
        [
            ["triangles", figures["triangles"]],
            ["texels maintained", lightmap["valid"]],
            ["texel updates", lightmap["updates"]],
            ["rays a frame, at most", budget],
            *([f"{kind} rays", count] for kind, count in figures["rays"].items()),
            ["rays before the first frame", figures["priming_rays"]],
            ["seconds", round(sum(progress.seconds.values()), 1)],
        ],
    )
    print(f"Written to {out}")
