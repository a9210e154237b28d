"""`lightloom render`."""

from pathlib import Path
from typing import Annotated, Any

import typer

from lightloom.commands.options import Json, Scene, Seed, Threads, Traversal
from lightloom.golden_model.host.errors import InputError
from lightloom.shared.inputs import at_least, choose, image_size, seed_value


def render(
    scene: Scene,
    frames: Annotated[
        int | None, typer.Option("--frames", metavar="N", help="Frames to render; else the scene's own number, or 16.")
    ] = None,
    budget: Annotated[
        int | None,
        typer.Option(
            "--budget",
            metavar="RAYS",
            help="Rays a frame may spend on the lightmaps; else the scene's, or 200000.",
        ),
    ] = None,
    size: Annotated[
        str | None,
        typer.Option("--size", metavar="WxH", help="Width and height of a frame; else the scene's, or 512x512."),
    ] = None,
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="The folder that everything is written to.")] = Path(
        "build/render"
    ),
    seed: Seed = 0,
    backend: Traversal = "auto",
    threads: Threads = 1,
    policy: Annotated[
        str,
        typer.Option("--policy", metavar="NAME", help="What decides which texels are sampled; see below."),
    ] = "influence",
    directions: Annotated[
        int,
        typer.Option("--directions", metavar="N", help="Rays for indirect light in a texel update (a power of two)."),
    ] = 16,
    light_samples: Annotated[
        int, typer.Option("--light-samples", metavar="N", help="Shadow rays in a texel update, at most.")
    ] = 4,
    direct: Annotated[
        str,
        typer.Option(
            "--direct", metavar="maps|rays", help="Direct light from the lightmaps, or by shadow rays from every pixel."
        ),
    ] = "maps",
    surfaces: Annotated[
        str, typer.Option("--surfaces", metavar="MODE", help="How visible surfaces are determined; see below.")
    ] = "tile-deferred",
    versions: Annotated[
        int, typer.Option("--versions", metavar="N", help="Versions of the lightmaps in the flip chain, 1 to 8.")
    ] = 2,
    hold: Annotated[
        float | None,
        typer.Option(
            "--hold", metavar="FPS", help="Adapt the budget so that the modelled machine holds so many frames a second."
        ),
    ] = None,
    view: Annotated[
        list[str] | None,
        typer.Option("--view", metavar="NAME", help="Show this on the scene too, as a film (repeatable); see below."),
    ] = None,
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
    frame sees what they found. Objects, lights and camera follow the scene's paths. Same options, same bits.

    \b
    Policies, each with all that the one before has:
      round-robin   all texels in turn
      visibility    those that are seen, or will be
      variability   among them those whose light varies
      influence     and those whose light becomes different

    \b
    Visible surfaces:   tile-deferred, immediate, tiled-immediate (the same picture)
    Views:              priority, degree, variability, change, age, deviation

    \b
    In DIR, whole or not at all:
      frames/NNNN.png     film.webp     contact-sheet.png
      views/NAME.webp     what --view asks for, and views/NAME/NNNN.png
      lightmap/NNNN.png   the lightmaps after that frame (.exr: irradiance in half floats)
      timeline.svg        the stages of the last frames on the modelled machine
      render.json         counts and times, frame by frame

    \b
    Examples:
      lightloom render cornell-box
      lightloom render scenes/door.toml --view age --view change
      lightloom render cornell-box --frames 48 --budget 300000 --directions 64 --supersample 2
      lightloom render room.glb --size 960x540 --hold 60 --exr --out build/room
    """
    from lightloom.golden_model.frame.rasterizer import MODES
    from lightloom.golden_model.maintenance.publishing.flip_chain import LONGEST
    from lightloom.golden_model.maintenance.selection.policy import POLICIES
    from lightloom.golden_model.tracing.bvh.traversal import BACKENDS, backend_of
    from lightloom.render.policy_pictures import QUANTITIES

    choose(backend, BACKENDS, "backend")
    choose(policy, POLICIES, "policy")
    choose(surfaces, MODES, "mode of --surfaces")
    way: Any = choose(direct, ("maps", "rays"), "value of --direct")
    views = tuple(choose(name, [quantity.name for quantity in QUANTITIES], "view") for name in view or ())
    at_least(supersample, 1, "--supersample")
    if not 1 <= versions <= LONGEST:
        raise InputError(f"--versions {versions}: must be 1 to {LONGEST}")
    if hold is not None and not 0.01 <= hold <= 1e6:
        raise InputError(f"--hold {hold:g}: must be 0.01 to 1000000 frames a second")
    if exposure is not None and not 0 < exposure < float("inf"):
        raise InputError(f"--exposure {exposure:g}: must be greater than 0")

    from lightloom.golden_model.charts.curved import default_cache
    from lightloom.golden_model.charts.unwrap import unwrap
    from lightloom.golden_model.frame.frame_rays import FrameShading
    from lightloom.golden_model.frame.rasterizer import Rasterization
    from lightloom.golden_model.host.outputs import whole_folder
    from lightloom.golden_model.machine.budget_controller import BudgetPolicy
    from lightloom.golden_model.machine.cost_model import Machine
    from lightloom.golden_model.maintenance.sampling.settings import Sampling
    from lightloom.golden_model.renderer import Pipeline, Renderer
    from lightloom.golden_model.scene.files.load import load_scene
    from lightloom.golden_model.scene.scene import require_light
    from lightloom.golden_model.tracing.bvh.structure import Structure
    from lightloom.render.sequence import Pictures, contact_sheet, render_sequence
    from lightloom.shared.console import Progress, json_text, print_json, print_table
    from lightloom.shared.provenance import machine
    from lightloom.shared.provenance import versions as packages

    sampling = Sampling(directions=directions, light_samples=light_samples, direct=way)
    loaded = load_scene(scene)
    own = loaded.render
    count = at_least(frames if frames is not None else own.frames or 16, 1, "--frames")
    rays = budget if budget is not None else own.budget or 200_000
    width, height = image_size(size or "{}x{}".format(*(own.size or (512, 512))), supersample)
    require_light(loaded)  # before the charts, which may take a while
    sampling.require(rays, loaded)
    modelled = Machine(versions=max(versions, 2))
    held = None
    if hold is not None:
        target = max(round(modelled.clock_hz / hold), 1)
        held = BudgetPolicy(target=target, least=sampling.reserve(loaded.specular))
    with Progress() as progress, whole_folder(out) as folder:
        with progress.stage("Charts"):
            tracer = Structure(loaded, backend).trace
            lightmaps = unwrap(loaded, trace=tracer, cache=default_cache())
        with progress.stage("First light"):
            renderer = Renderer(
                loaded,
                width=width * supersample,
                height=height * supersample,
                budget=rays,
                seed=seed_value(seed),
                sampling=sampling,
                policy=POLICIES[policy],
                pipeline=Pipeline(
                    raster=Rasterization(mode=surfaces), shading=FrameShading(direct=way), versions=versions
                ),
                machine=modelled,
                hold=held,
                lightmaps=lightmaps,
                backend=backend,
                threads=threads,
            )
        with progress.stage("Frames", count) as advance:
            pictures = Pictures(supersample=supersample, exposure=exposure, exr=exr, views=views)
            figures = render_sequence(renderer, count, folder, pictures, advance)
            contact_sheet(folder).save(folder / "contact-sheet.png")
        figures |= {
            "backend": backend_of(backend),
            "seconds": dict(progress.seconds),
            "versions": packages(),
            "machine": machine(),
        }
        (folder / "render.json").write_text(json_text(figures))
    if json:
        print_json(figures)
        return
    lightmap = figures["lightmap"]
    print_table(
        f"{figures['scene']}, {count} frame{'s' if count > 1 else ''} of {width}x{height}",
        ["", "figure"],
        [
            ["triangles", figures["triangles"]],
            ["texels maintained", lightmap["valid"]],
            ["texel updates", lightmap["updates"]],
            ["rays a frame, at most", figures["budget"]],
            *([f"{kind} rays", number] for kind, number in figures["rays"].items() if number),
            ["rays before the first frame", figures["priming_rays"]],
            ["seconds", round(sum(progress.seconds.values()), 1)],
        ],
    )
    print(f"Written to {out}")
