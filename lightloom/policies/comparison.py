"""Policies side by side: the same scene, seed and budget under each, against converged lightmaps of the same frames."""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from lightloom.gen.pages.policies_page import policies_page
from lightloom.gen.pages.timeline import timeline
from lightloom.golden_model.engine.selection.policy import Policy, policy_of
from lightloom.golden_model.machine.cost_model import FrameCounts, Machine
from lightloom.golden_model.machine.schedule import Schedule, schedule
from lightloom.golden_model.renderer import FrameResult, Renderer
from lightloom.golden_model.scene.pose import scene_at
from lightloom.golden_model.scene.scene import Scene
from lightloom.golden_model.tables.lightmap import Lightmaps
from lightloom.policies.judge import Judge, straight_light, visible_texels
from lightloom.policies.options import Comparison
from lightloom.policies.report import comparison_report, frame_row
from lightloom.policies.steps import Lag, steps
from lightloom.policies.still import jump, still_frames, still_from
from lightloom.policies.true_error import resting_frame, true_figures, true_pictures
from lightloom.shared.console import Progress, json_text
from lightloom.shared.provenance import machine, versions

TIMELINE_FRAMES = 4
"""Frames of the drawing of the machine's time."""


def compare(
    scene: Scene,
    lightmaps: Lightmaps,
    options: Comparison,
    folder: Path,
    progress: Progress,
    references: Path | None = None,
) -> dict[str, Any]:
    """Renders all frames under all policies, writes the pictures into `folder` and returns the report, ready for JSON.

    Frame by frame: each policy's, then the reference's, once for all. What is held is the state of the renderers and
    the film. Converged maps are kept in the folder `references`, if it is given. In `folder`: film.webp, timeline.svg,
    and for each key frame NNNN frames/NNNN/reference.png, POLICY.png and POLICY-error.png, and of the last policy
    maps/NNNN/QUANTITY.png and QUANTITY-maps.png.
    """
    rest = resting_frame(scene, options.frames) if options.true_samples else None
    with progress.stage("First light", len(options.policies)) as advance:
        renderers: dict[str, Renderer] = {}
        for name in options.policies:
            renderers[name] = _renderer(scene, lightmaps, options, policy_of(name), renderers.values())
            advance(1)
    judge = Judge(scene, lightmaps, options, folder, references)
    rows: dict[str, list[dict[str, Any]]] = {name: [] for name in options.policies}
    counts: dict[str, list[FrameCounts]] = {name: [] for name in options.policies}
    still, changes = still_frames(scene, options.frames), steps(scene, options.frames)
    lags = [Lag(step) for step in changes if step.followed]
    looked = {*options.compared, *still_from(still), *(frame for step in changes for frame in step.edges)}
    before: dict[str, np.ndarray] = {}
    with progress.stage("Frames and references", options.frames * len(renderers) + len(looked)) as advance:
        for number in range(options.frames):
            results = {}
            for name, renderer in renderers.items():
                results[name] = renderer.frame()
                advance(1)
            figures: dict[str, dict[str, Any]] = {}
            if number in looked:
                figures = judge.look(results, renderers, before)
                advance(1)
            for lag in lags:
                lag.look(number, {name: result.image for name, result in results.items()}, judge.seen)
            visible = visible_texels(lightmaps, results[options.full].gbuffer)
            for name, result in results.items():
                row = frame_row(result, renderers[name].state, visible) | figures.get(name, {})
                if number in still and judge.seen is not None and judge.exposure is not None:
                    row["jump"] = jump(before[name], result.image, judge.seen.whole, judge.exposure)
                rows[name].append(row)
                before[name] = result.image
                counts[name].append(result.counts)
    true = {} if rest is None else _true(scene, results, renderers, rest, options, progress)
    with progress.stage("Film and timelines"):
        judge.write_film()
        plans = _plans(renderers[options.full], counts)
        drawn = _write_timeline(plans[options.full], options, folder)
    return comparison_report(scene, lightmaps, options, renderers, rows, plans, lags, true) | {
        "timeline_frames": drawn,
        "exposure": judge.exposure,
        "reference": _reference(options, judge, rest),
    }


def _reference(options: Comparison, judge: Judge, rest: int | None) -> dict[str, Any]:
    """What the frames were held against."""
    return {
        "rays": options.reference_rays,
        "every": options.reference_every,
        "frames": options.compared,
        "noise": judge.noise,
        "true_samples": options.true_samples,
        "true_frame": rest,
    }


def _plans(full: Renderer, counts: Mapping[str, list[FrameCounts]]) -> dict[str, Schedule]:
    """The time of every policy's frames, on a machine like that of the renderer `full`.

    Frames follow each other as fast as they are done, so that their times tell what they cost.
    """
    free = Machine(refresh_cycles=0, versions=full.pipeline.versions, early_selection=full.machine.early_selection)
    return {name: schedule(free, each) for name, each in counts.items()}


def _write_timeline(plan: Schedule, options: Comparison, folder: Path) -> list[int]:
    """Writes timeline.svg, of the first key frame and those after it; the first and the last frame in it."""
    first = options.shown[0]
    last = min(first + TIMELINE_FRAMES, options.frames) - 1
    drawn = timeline(plan, plan.frames[first].begin, plan.frames[last].shown)
    (folder / "timeline.svg").write_text(drawn, encoding="utf-8")
    return [first, last]


def _true(
    scene: Scene,
    results: Mapping[str, FrameResult],
    renderers: Mapping[str, Renderer],
    rest: int,
    options: Comparison,
    progress: Progress,
) -> dict[str, dict[str, Any]]:
    """E true of each policy at frame `rest`; up to there they go on from the frames that gave `results`."""
    last, found = dict(results), {}
    with progress.stage("Coming to rest", rest + 1 - options.frames) as advance:
        for _ in range(options.frames, rest + 1):
            last = {name: renderer.frame() for name, renderer in renderers.items()}
            advance(1)
    with progress.stage("Path-traced picture") as advance:
        gbuffer = last[options.full].gbuffer
        pictures = true_pictures(scene_at(scene, rest), gbuffer, options.true_samples, options.backend, advance)
    for name, result in last.items():
        found[name] = true_figures(result.image, straight_light(renderers[name], result), pictures)
    return found


def _renderer(
    scene: Scene, lightmaps: Lightmaps, options: Comparison, policy: Policy, others: Iterable[Renderer]
) -> Renderer:
    """One that begins with what one of the others has found, where that is what it would find itself."""
    return Renderer(
        scene,
        width=options.width,
        height=options.height,
        budget=options.budget,
        seed=options.seed,
        sampling=options.sampling,
        policy=policy,
        lightmaps=lightmaps,
        backend=options.backend,
        threads=options.threads,
        like=next((other for other in others if other.policy.together == policy.together), None),
    )


def write_comparison(
    scene: Scene,
    lightmaps: Lightmaps,
    options: Comparison,
    folder: Path,
    progress: Progress,
    references: Path | None = None,
) -> dict[str, Any]:
    """What `compare` writes, policies.json and index.html, into `folder`; returns what policies.json holds."""
    report = compare(scene, lightmaps, options, folder, progress, references)
    report |= {"versions": versions(), "machine": machine(), "seconds": dict(progress.seconds)}
    with progress.stage("Page"):
        page = policies_page(report, folder)
    (folder / "policies.json").write_text(json_text(report))
    (folder / "index.html").write_text(page, encoding="utf-8")
    return report
