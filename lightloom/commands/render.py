"""`lightloom render`."""

from typing import Any

from lightloom.render.options import RenderOptions
from lightloom.shared.options import command


@command
def render(options: RenderOptions) -> None:
    """Render frames of a scene whose lightmaps are maintained by ray tracing.

    Each frame is drawn from the lightmaps; beside it, texels are sampled anew by at most --budget rays, and the next
    frame sees what they found. Objects, lights and camera follow the scene's paths. Same options, same bits.

    \b
    Policies; the last two have all of visibility:
      round-robin   all texels in turn
      visibility    those that are seen, or will be
      variability   among them those whose light varies
      influence     and those whose light becomes different
      influence-drift, visibility+notice ...   without or with a mechanism: see `lightloom policies --help`

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
    from lightloom.golden_model.host.outputs import whole_folder
    from lightloom.golden_model.tracing.bvh.traversal import backend_of
    from lightloom.render.plan import plan
    from lightloom.render.sequence import contact_sheet, render_sequence
    from lightloom.shared.console import Progress, json_text, print_json
    from lightloom.shared.provenance import machine, versions

    planned = plan(options)
    with Progress() as progress, whole_folder(options.out) as folder:
        with progress.stage("Charts"):
            lightmaps = planned.lightmaps()
        with progress.stage("First light"):
            renderer = planned.renderer(lightmaps)
        with progress.stage("Frames", planned.frames) as advance:
            figures = render_sequence(renderer, planned.frames, folder, planned.pictures, advance)
            contact_sheet(folder).save(folder / "contact-sheet.png")
        figures |= {
            "backend": backend_of(options.backend),
            "seconds": dict(progress.seconds),
            "versions": versions(),
            "machine": machine(),
        }
        (folder / "render.json").write_text(json_text(figures))
    if options.json:
        print_json(figures)
    else:
        _print_table(figures)
        print(f"Written to {options.out}")


def _print_table(figures: dict[str, Any]) -> None:
    """What is in render.json, in short."""
    from lightloom.shared.console import print_table

    lightmap, count = figures["lightmap"], len(figures["frames"])
    print_table(
        f"{figures['scene']}, {count} frame{'s' if count > 1 else ''} of {figures['width']}x{figures['height']}",
        ["", "figure"],
        [
            ["triangles", figures["triangles"]],
            ["texels maintained", lightmap["valid"]],
            ["texel updates", lightmap["updates"]],
            ["rays a frame, at most", figures["budget"]],
            *([f"{kind} rays", number] for kind, number in figures["rays"].items() if number),
            ["rays before the first frame", figures["priming_rays"]],
            ["seconds", round(sum(figures["seconds"].values()), 1)],
        ],
    )
