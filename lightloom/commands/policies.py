"""`lightloom policies`."""

import json
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from lightloom.golden_model.driver.limits import require_affordable
from lightloom.golden_model.host.errors import InputError, warn
from lightloom.shared.inputs import (
    at_least,
    choose,
    image_size,
    require_exposure,
    require_samples,
    seed_value,
    whole_numbers,
)
from lightloom.shared.options import (
    Directions,
    Exposure,
    Folder,
    Json,
    LightSamples,
    Seed,
    Traversal,
    command,
)

if TYPE_CHECKING:
    from lightloom.golden_model.scene.scene import RenderDefaults
    from lightloom.policies.options import Comparison

FRAMES, SIZE, BUDGET = 48, (320, 214), 20_000
"""Where neither the options nor the scene say anything."""
SUITE_POLICIES = ("round-robin", "visibility", "influence")
"""What the suite compares, unless told: what a default has to beat, and the default."""


@dataclass(frozen=True, kw_only=True)
class PoliciesOptions:
    """The options, in the order of the help text."""

    scene: Annotated[
        str | None,
        typer.Argument(
            metavar="SCENE",
            help="`cornell-box`, or the path of an .obj, .ply, .glb, .gltf or .toml file; none with --suite.",
            show_default=False,
        ),
    ] = None
    suite: Annotated[
        bool,
        typer.Option("--suite", help="Instead of a scene all layouts of the suite, at two budgets each."),
    ] = False
    layouts: Annotated[
        str | None, typer.Option("--layouts", metavar="A,B", help="Of the suite only these, by name.")
    ] = None
    seeds: Annotated[int, typer.Option("--seeds", metavar="N", help="Of the suite so many seeds, from 0 on.")] = 3
    jobs: Annotated[int, typer.Option("--jobs", metavar="N", help="Cases of the suite at a time.")] = 2
    bars: Annotated[
        bool, typer.Option("--bars", help="Of the suite say what its figures have to be, and whether they are.")
    ] = False
    before: Annotated[
        Path | None,
        typer.Option(
            "--before", metavar="FILE", help="suite.json of an earlier build, against whose round-robin bars are held."
        ),
    ] = None
    names: Annotated[
        str | None,
        typer.Option("--policies", metavar="A,B", help="Policies by name, each compared with the first; else all."),
    ] = None
    frames: Annotated[
        int | None, typer.Option("--frames", metavar="N", help="Frames to render; else as the scene says, or 48.")
    ] = None
    budget: Annotated[
        int | None,
        typer.Option(
            "--budget",
            metavar="RAYS",
            help="Rays that a frame may spend on the lightmaps; else as the scene says, or 20000.",
        ),
    ] = None
    size: Annotated[
        str | None,
        typer.Option("--size", metavar="WxH", help="Width and height of a frame in pixels; else as the scene says."),
    ] = None
    out: Folder = Path("build/policies")
    seed: Seed = 0
    backend: Traversal = "auto"
    directions: Directions = 16
    light_samples: LightSamples = 4
    reference_rays: Annotated[
        int, typer.Option("--reference-rays", metavar="N", help="Rays a texel of the reference (a power of two).")
    ] = 512
    reference_every: Annotated[
        int, typer.Option("--reference-every", metavar="K", help="Compare every K-th frame.")
    ] = 2
    true: Annotated[
        bool,
        typer.Option(
            "--true", help="Also compare the picture at rest with a path-traced one, which reads no map; takes minutes."
        ),
    ] = False
    true_samples: Annotated[
        int, typer.Option("--true-samples", metavar="N", help="Paths a pixel of that picture (even).")
    ] = 512
    key_frames: Annotated[
        str | None,
        typer.Option("--key-frames", metavar="K,K", help="Frames to show as pictures; else four of those compared."),
    ] = None
    exposure: Exposure = None
    json: Json = False

    def policies(self, known: Iterable[str]) -> tuple[str, ...]:
        """The names that are given, else all that are known."""
        return tuple(self.names.split(",") if self.names is not None else known)


@command
def policies(options: PoliciesOptions) -> None:
    """Compare policies of texel selection on a scene, against converged lightmaps.

    The same scene is rendered under each policy with the same seed and the same rays a frame. Every K-th frame is
    compared with the picture that converged lightmaps of that very frame would give: E = sum |I - R| / sum R.
    Rendering the references takes most of the time; where nothing but the camera moves there is one for all frames.

    \b
    Policies; the last two have all of visibility:
      round-robin   all texels in turn
      visibility    those that are seen, or will be
      variability   among them those whose light varies
      influence     and those whose light becomes different

    A policy's mechanisms are switched behind its name: influence-drift is without one, visibility+notice with one. They
    are prediction, doubts, rim, lod, variability, dilation, guard, rings, notice, influence, shadows, heavy, lower,
    track, drift, sweep and probe.

    \b
    In DIR, whole or not at all:
      index.html      the page: errors, charts, pictures, parameters; it needs no other file
      policies.json   all figures, frame by frame
      film.webp       the first and the last policy, and their errors
      frames/NNNN/    pictures and errors of each policy     maps/NNNN/   what the last policy knows of the texels

    With --true the frames go on until nothing has changed for 60 of them, and the last is compared with a path-traced
    picture: E true, over blocks of 8x8 pixels. That picture is kept, for what has it in common.

    With --suite, DIR has a table of all layouts, the worst first (index.html, suite.json, suite.md), and what is above
    for each case in a folder of cases/. What an interrupted run had done is kept there, and taken by the next one.

    \b
    Examples:
      lightloom policies cornell-box
      lightloom policies scenes/bunny.toml --frames 24 --budget 40000 --size 480x320
      lightloom policies --suite --bars --out build/suite
      lightloom policies room.toml --policies visibility,influence-heavy,influence
      lightloom policies room.toml --true --true-samples 2048
      lightloom policies room.toml --policies round-robin,influence --key-frames 11,12,20 --out build/room
    """
    _check(options)
    if options.suite:
        return _suite(options)

    from lightloom.golden_model.charts.curved import default_cache
    from lightloom.golden_model.charts.unwrap import unwrap
    from lightloom.golden_model.host.outputs import whole_folder
    from lightloom.golden_model.scene.files.load import load_scene
    from lightloom.golden_model.scene.scene import require_light
    from lightloom.golden_model.structures.structure import Structure
    from lightloom.policies.comparison import write_comparison
    from lightloom.shared.console import Progress, print_json

    scene = load_scene(_scene_of(options))
    require_light(scene)  # before the charts, which may take a while
    comparison = _comparison(options, scene.render)
    require_affordable(comparison.sampling, comparison.budget, scene)
    with Progress() as progress, whole_folder(options.out) as folder:
        with progress.stage("Charts"):
            lightmaps = unwrap(scene, trace=Structure(scene, options.backend).trace, cache=default_cache())
        report = write_comparison(scene, lightmaps, comparison, folder, progress)
    if report["few_counted"] is not None:
        warn(report["few_counted"])
    if options.json:
        print_json(report)
    else:
        _print_table(report, comparison)
        print(f"Written to {options.out / 'index.html'}")


def _scene_of(options: PoliciesOptions) -> str:
    if options.scene is None:
        raise InputError("SCENE is missing; give one, such as cornell-box, or --suite")
    return options.scene


SUITE_ONLY = {"layouts": None, "seeds": 3, "jobs": 2, "bars": False, "before": None}
SCENE_ONLY = ("scene", "budget", "exposure")
"""Options that make no sense without the suite, with their defaults; and with it."""


def _suite(options: PoliciesOptions) -> None:
    """All layouts, side by side."""
    from lightloom.golden_model.scene.scene import RenderDefaults
    from lightloom.golden_model.stimuli.layouts.catalogue import LAYOUTS, SEEDS
    from lightloom.golden_model.stimuli.layouts.description import FRAMES as SUITE_FRAMES
    from lightloom.golden_model.stimuli.layouts.description import SIZE as SUITE_SIZE
    from lightloom.policies.case import cases
    from lightloom.policies.suite import write_suite
    from lightloom.shared.console import print_json

    if not 1 <= options.seeds <= len(SEEDS):
        raise InputError(f"--seeds {options.seeds}: must be 1 to {len(SEEDS)}")
    names = [choose(name, LAYOUTS, "layout") for name in (options.layouts or ",".join(LAYOUTS)).split(",")]
    own = RenderDefaults(frames=SUITE_FRAMES, size=(SUITE_SIZE[0], SUITE_SIZE[1]))
    comparison = _comparison(replace(options, scene="", names=options.names or ",".join(SUITE_POLICIES)), own)
    compared = "" if options.names is None else f" --policies {options.names}"
    command = f"lightloom policies --suite --layouts {','.join(names)} --seeds {options.seeds}{compared}"
    before = None if options.before is None else _suite_file(options.before)
    report = write_suite(cases(names, SEEDS[: options.seeds]), comparison, options.out, options.jobs, command, before)
    if options.json:
        print_json(report)
    else:
        _print_suite(report)
        if options.bars:
            _print_bars(report)
        print(f"Written to {options.out / 'index.html'}")


def _suite_file(path: Path) -> dict[str, Any]:
    """What a suite.json holds."""
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(f"--before {path}: cannot be read ({error}); give the suite.json of a suite") from error
    if not isinstance(found, dict) or not {"cases", "policies"} <= set(found):
        raise InputError(f"--before {path}: no cases in it; give the suite.json of a suite")
    if "round-robin" not in found["policies"]:
        raise InputError(f"--before {path}: round-robin takes no part; give a suite in which it does")
    return found


def _print_bars(report: dict[str, Any]) -> None:
    from lightloom.shared.console import print_table

    rows = [[bar["name"], bar["shown"], bar["wanted"], bar["met"], bar["where"]] for bar in report["bars"]]
    print_table("Bars", ["bar", "figure", "limit", "met", "where"], rows)


def _print_suite(report: dict[str, Any]) -> None:
    from lightloom.shared.console import print_table

    names = report["policies"]
    rows = [
        [
            row["layout"],
            row["budget"],
            *(100 * row["errors"][name] for name in names),
            row["against_best"],
            row["worst_run"],
        ]
        for row in report["rows"]
    ]
    columns = ["layout", "budget", *(f"{name} %" for name in names), "to the better", "worst run"]
    print_table("Mean errors, the worst first", columns, rows)
    print("Geometric means: " + ", ".join(f"{name} {mean:.3f}" for name, mean in report["means"].items()))


def _check(options: PoliciesOptions) -> None:
    """Raises InputError for what can be seen to be wrong without the scene."""
    from lightloom.golden_model.engine.selection.policy import POLICIES, policy_of
    from lightloom.golden_model.tracing.bvh.traversal import BACKENDS

    for name in options.policies(POLICIES):
        policy_of(name)
    if options.suite:
        for name in SCENE_ONLY:
            if getattr(options, name) is not None:
                raise InputError(f"--suite: has scenes and budgets of its own; leave {name} out")
    elif changed := [name for name, usual in SUITE_ONLY.items() if getattr(options, name) != usual]:
        raise InputError(f"--{changed[0]}: is for --suite")
    at_least(options.jobs, 1, "--jobs")
    choose(options.backend, BACKENDS, "backend")
    at_least(options.reference_every, 1, "--reference-every")
    at_least(options.true_samples, 2, "--true-samples")
    if options.frames is not None:
        at_least(options.frames, 1, "--frames")
    if options.size is not None:
        image_size(options.size)
    if options.key_frames is not None:
        whole_numbers(options.key_frames, "--key-frames")
    require_exposure(options.exposure)
    require_samples(options.directions, options.light_samples)
    seed_value(options.seed)


def _comparison(options: PoliciesOptions, own: "RenderDefaults") -> "Comparison":
    """What is compared: what the options say, else the scene, else the constants above."""
    from lightloom.golden_model.engine.selection.policy import POLICIES
    from lightloom.policies.options import Comparison

    width, height = image_size(options.size) if options.size is not None else own.size or SIZE
    return Comparison(
        scene=_scene_of(options),
        policies=options.policies(POLICIES),
        frames=options.frames or own.frames or FRAMES,
        width=width,
        height=height,
        budget=options.budget if options.budget is not None else own.budget or BUDGET,
        directions=options.directions,
        light_samples=options.light_samples,
        reference_rays=options.reference_rays,
        reference_every=options.reference_every,
        true_samples=options.true_samples if options.true else 0,
        key_frames=whole_numbers(options.key_frames, "--key-frames") if options.key_frames is not None else (),
        exposure=options.exposure,
        seed=options.seed,
        backend=options.backend,
    )


def _print_table(report: dict[str, Any], comparison: "Comparison") -> None:
    """A policy a row."""
    from lightloom.shared.console import print_table

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
                *(
                    [_shown(found[name], 100) for name in ("true_error", "true_noise")]
                    if comparison.true_samples
                    else []
                ),
            ]
        )
    print_table(
        f"{report['scene']}, {comparison.frames} frame{'s' if comparison.frames > 1 else ''} of "
        f"{comparison.width}x{comparison.height}, {comparison.budget:,} rays a frame",
        ["policy", "mean error %", "worst %", "updates on texels read %", "ratio", "mean age", "rays, at most"]
        + (["E true %", "its noise %"] if comparison.true_samples else []),
        rows,
    )


def _shown(value: float | None, factor: float = 1) -> float | str:
    return "" if value is None else factor * value
