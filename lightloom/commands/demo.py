"""`lightloom demo`."""

from pathlib import Path
from typing import Annotated, Any

import typer

from lightloom.demo import DemoOptions
from lightloom.shared.inputs import at_least, image_size, seed_value
from lightloom.shared.options import Json, Size

_DEFAULT = DemoOptions()


def demo(
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="The folder that everything is written to.")] = Path(
        "build/demo"
    ),
    frames: Annotated[int, typer.Option("--frames", metavar="N", help="Frames of the film.")] = _DEFAULT.frames,
    size: Size = f"{_DEFAULT.width}x{_DEFAULT.height}",
    budget: Annotated[int, typer.Option("--budget", metavar="RAYS", help="Rays a frame at most.")] = _DEFAULT.budget,
    replay_limit: Annotated[
        int,
        typer.Option(
            "--replay-limit", metavar="N", help="Tests replayed at most; of more, a seeded sample of this size."
        ),
    ] = _DEFAULT.replay_limit,
    seed: Annotated[int, typer.Option("--seed", metavar="N", help="Seed of the render and of the sample.")] = (
        _DEFAULT.seed
    ),
    json: Json = False,
) -> None:
    """Render, emit, replay: the main job, from a scene to a picture to proven Verilog.

    Renders the Cornell box with a moving camera, its lightmaps maintained by ray tracing under a budget of rays a
    frame; emits the Verilog of every unit; sends the ray-triangle tests that the render made through the Verilated
    ray_triangle unit and compares every result with the golden model in all bits.

    \b
    In DIR, whole or not at all:
      report.html         everything to look at, in one file
      report.json         the same figures (replayed, mismatches, ...)
      frames/NNNN.png     film.webp     contact-sheet.png
      lightmap/NNNN.png   the lightmaps after that frame (.exr: irradiance in half floats)
      verilog/            Verilog and manifest of every unit

    Ends with exit code 1 if a single bit differs.

    \b
    Examples:
      lightloom demo
      lightloom demo --frames 8 --size 240x240 --out build/quick
    """
    from lightloom.demo import demo as run
    from lightloom.shared.console import Progress, print_json

    width, height = image_size(size, _DEFAULT.supersample)
    options = DemoOptions(
        frames=at_least(frames, 1, "--frames"),
        width=width,
        height=height,
        budget=budget,
        replay_limit=at_least(replay_limit, 1, "--replay-limit"),
        seed=seed_value(seed),
    )
    with Progress() as progress:
        report = run(options, out, progress)
    if json:
        print_json(report)
    else:
        _print_table(report)
        print(f"Open {out / 'report.html'}")
    if report["mismatches"]:
        raise typer.Exit(1)


def _print_table(report: dict[str, Any]) -> None:
    """What is in report.json, in short, and tests that differ."""
    from lightloom.shared.console import print_table

    rendered, replayed = report["render"], report["replay"]
    print_table(
        "Lightloom demo",
        ["", "figure"],
        [
            ["frames", len(rendered["frames"])],
            ["texels maintained", rendered["lightmap"]["valid"]],
            ["texel updates", rendered["lightmap"]["updates"]],
            ["rays a frame, at most", rendered["budget"]],
            *([f"{kind} rays", count] for kind, count in rendered["rays"].items()),
            ["rays before the first frame", rendered["priming_rays"]],
            ["ray-triangle tests", report["tests"]],
            ["tests replayed through the Verilog", report["replayed"]],
            ["mismatches", report["mismatches"]],
            ["tests a second, simulated", round(replayed["vectors_per_second"])],
            ["units emitted", len(report["units"])],
            ["seconds", round(sum(report["seconds"].values()), 1)],
        ],
    )
    for example in replayed["examples"]:
        print(f"mismatch in test {example['number']}")
        for side in ("operands", "golden_model", "verilog"):
            print(f"  {side:<12} " + "  ".join(f"{name} {bits}" for name, bits in example[side].items()))
