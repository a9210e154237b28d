"""`lightloom policies`."""

from pathlib import Path
from typing import Annotated

import typer

from lightloom.commands.options import Json, Scene, Seed, Traversal
from lightloom.golden_model.host.errors import InputError, warn
from lightloom.shared.inputs import at_least, choose, image_size, seed_value, whole_numbers

FRAMES, SIZE, BUDGET = 48, (320, 214), 20_000
"""Where neither the options nor the scene say anything."""


def policies(
    scene: Scene,
    names: Annotated[
        str | None,
        typer.Option("--policies", metavar="A,B", help="Policies by name, each compared with the first; else all."),
    ] = None,
    frames: Annotated[
        int | None, typer.Option("--frames", metavar="N", help="Frames to render; else as the scene says, or 48.")
    ] = None,
    budget: Annotated[
        int | None,
        typer.Option(
            "--budget",
            metavar="RAYS",
            help="Rays that a frame may spend on the lightmaps; else as the scene says, or 20000.",
        ),
    ] = None,
    size: Annotated[
        str | None,
        typer.Option("--size", metavar="WxH", help="Width and height of a frame in pixels; else as the scene says."),
    ] = None,
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="The folder that everything is written to.")] = Path(
        "build/policies"
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
    reference_rays: Annotated[
        int, typer.Option("--reference-rays", metavar="N", help="Rays a texel of the reference (a power of two).")
    ] = 512,
    reference_every: Annotated[
        int, typer.Option("--reference-every", metavar="K", help="Compare every K-th frame.")
    ] = 2,
    key_frames: Annotated[
        str | None,
        typer.Option("--key-frames", metavar="K,K", help="Frames to show as pictures; else four of those compared."),
    ] = None,
    exposure: Annotated[
        float | None,
        typer.Option("--exposure", metavar="X", help="Factor from radiance to display; else from the first frame."),
    ] = None,
    json: Json = False,
) -> None:
    """Compare policies of texel selection on a scene, against converged lightmaps.

    The same scene is rendered under each policy with the same seed and the same rays a frame. Every K-th frame is
    compared with the picture that converged lightmaps of that very frame would give: E = sum |I - R| / sum R.
    Rendering the references takes most of the time; where nothing but the camera moves there is one for all frames.

    \b
    Policies, each with all that the one before has:
      round-robin   all texels in turn
      visibility    those that are seen, or will be
      variability   among them those whose light varies
      influence     and those whose light becomes different

    \b
    In DIR, whole or not at all:
      index.html      the page: errors, charts, pictures, parameters; it needs no other file
      policies.json   all figures, frame by frame
      film.webp       the first and the last policy, and their errors
      frames/NNNN/    pictures and errors of each policy     maps/NNNN/   what the last policy knows of the texels

    \b
    Examples:
      lightloom policies cornell-box
      lightloom policies scenes/bunny.toml --frames 24 --budget 40000 --size 480x320
      lightloom policies room.toml --policies round-robin,influence --key-frames 11,12,20 --out build/room
    """
    from lightloom.golden_model.maintenance.selection.policy import POLICIES
    from lightloom.golden_model.tracing.bvh.traversal import BACKENDS

    chosen = tuple(names.split(",")) if names is not None else tuple(POLICIES)
    for name in chosen:
        choose(name, POLICIES, "policy")
    choose(backend, BACKENDS, "backend")
    at_least(reference_every, 1, "--reference-every")
    if frames is not None:
        at_least(frames, 1, "--frames")
    wanted = image_size(size) if size is not None else None
    keys = whole_numbers(key_frames, "--key-frames") if key_frames is not None else ()
    if exposure is not None and not 0 < exposure < float("inf"):
        raise InputError(f"--exposure {exposure:g}: must be greater than 0")

    from lightloom.golden_model.charts.curved import default_cache
    from lightloom.golden_model.charts.unwrap import unwrap
    from lightloom.golden_model.host.outputs import whole_folder
    from lightloom.golden_model.scene.files.load import load_scene
    from lightloom.golden_model.scene.scene import require_light
    from lightloom.golden_model.tracing.bvh.structure import Structure
    from lightloom.policies.comparison import write_comparison
    from lightloom.policies.options import Comparison
    from lightloom.shared.console import Progress, print_json, print_table

    loaded = load_scene(scene)
    require_light(loaded)  # before the charts, which may take a while
    given = loaded.render
    width, height = wanted or given.size or SIZE
    options = Comparison(
        scene=scene,
        policies=chosen,
        frames=frames or given.frames or FRAMES,
        width=width,
        height=height,
        budget=budget if budget is not None else given.budget or BUDGET,
        directions=directions,
        light_samples=light_samples,
        reference_rays=reference_rays,
        reference_every=reference_every,
        key_frames=keys,
        exposure=exposure,
        seed=seed_value(seed),
        backend=backend,
    )
    options.sampling.require(options.budget, loaded)
    with Progress() as progress, whole_folder(out) as folder:
        with progress.stage("Charts"):
            lightmaps = unwrap(loaded, trace=Structure(loaded, backend).trace, cache=default_cache())
        report = write_comparison(loaded, lightmaps, options, folder, progress)
    if report["few_counted"] is not None:
        warn(report["few_counted"])
    if json:
        print_json(report)
        return
    rows = []
    for policy in report["policies"]:
        found = policy["summary"]
        rows.append(
            [
                policy["name"],
                *(_shown(found[name], 100) for name in ("error", "worst_error", "on_visible")),
                _shown(found["error_ratio"]),
                _shown(found["age"]),
                found["largest_spent"],
            ]
        )
    print_table(
        f"{report['scene']}, {options.frames} frame{'s' if options.frames > 1 else ''} of {width}x{height}, "
        f"{options.budget:,} rays a frame",
        ["policy", "mean error %", "worst %", "updates on texels read %", "ratio", "mean age", "rays, at most"],
        rows,
    )
    print(f"Written to {out / 'index.html'}")


def _shown(value: float | None, factor: float = 1) -> float | str:
    return "" if value is None else factor * value
