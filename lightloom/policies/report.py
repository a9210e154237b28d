"""The figures of a comparison of policies: a row a frame, a summary a policy, and the whole report, ready for JSON."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from lightloom.golden_model.contract.formats import LIKELY
from lightloom.golden_model.engine.selection.policy import policy_of
from lightloom.golden_model.machine.schedule import Schedule
from lightloom.golden_model.renderer import FrameResult, Renderer
from lightloom.golden_model.scene.scene import Scene
from lightloom.golden_model.tables.lightmap import VALID, Lightmaps
from lightloom.policies.options import Comparison
from lightloom.policies.parameters import changed_parameters, parameters
from lightloom.policies.steps import Lag, longest
from lightloom.render.policy_pictures import (
    ERROR_FLOOR,
    ERROR_RANGE,
    QUANTITIES,
    UNKNOWN_AGE,
    Quantity,
    ages,
    error_legend,
    legend,
)

LEAST_COUNTED = 0.5
"""Part of a frame's pixels that count, below which it is said."""
LEAST_UPDATES = 20
"""Of fewer a frame the budget's remainder is a large part."""
DECIDING = ("visibility", "footprints")
"""Kinds of rays by which a policy makes up its mind."""

MEASURES = ("error", "relative_mse", "flip")
"""What is compared with the baseline's."""
TRUE = ("true_error", "true_energy", "true_noise")
"""What a summary has of E true; None without --true."""

ABOUT = {
    "round-robin": "All texels in turn, whether anyone sees them or not.",
    "visibility": "Texels that the frame or a coming one reads, before those that nobody sees.",
    "variability": "Among those, the ones whose light varies: from update to update, within one, from texel to texel.",
    "influence": "Of those that are seen, the ones whose light becomes different: around what moves or is switched, "
    "and where sampling notices a change.",
}
"""What each policy prefers."""


def frame_row(result: FrameResult, state: np.ndarray, visible: np.ndarray) -> dict[str, Any]:
    """Figures of one frame that need no reference."""
    done = result.maintenance
    seen = np.zeros(len(state), dtype=bool)
    seen[visible] = True
    age = ages(state, result.frame)[visible]
    known = age[age != UNKNOWN_AGE]
    return {
        "frame": result.frame,
        "texels": len(done.texels),
        "rays": dict(done.rays),
        "spent": sum(done.rays.values()),
        "visible": len(visible),
        "on_visible": float(seen[done.texels].mean()) if len(done.texels) else 0.0,
        "missed": float((done.plan.degree[visible] < LIKELY).mean()) if len(visible) else 0.0,
        "unknown": float(1 - len(known) / len(age)) if len(age) else 0.0,
        "age": float(known.mean()) if len(known) else None,
        "oldest": int(known.max()) if len(known) else None,
        "seconds": sum(result.seconds.values()),
    }


def comparison_report(
    scene: Scene,
    lightmaps: Lightmaps,
    options: Comparison,
    renderers: Mapping[str, Renderer],
    rows: Mapping[str, list[dict[str, Any]]],
    plans: Mapping[str, Schedule],
    lags: Sequence[Lag],
    true: Mapping[str, Mapping[str, Any]],
) -> dict[str, Any]:
    valid = int((lightmaps.texels["state"] == VALID).sum())
    rays_an_update = options.sampling.reserve(scene.specular)
    summaries = {}
    for name, frames in rows.items():
        late = [lag.of(name, frames_a_turn(frames[lag.step.first]["visible"], options)) for lag in lags]
        summaries[name] = (
            summary(frames, options.budget)
            | longest([lag for lag in late if lag is not None])
            | budget_shares(frames, options.budget, rays_an_update, valid)
            | dict(true.get(name) or dict.fromkeys(TRUE))
        )
    base = summaries[options.baseline]
    for figures in summaries.values():
        for measure in MEASURES:
            mine, other = figures[measure], base[measure]
            figures[f"{measure}_ratio"] = mine / other if mine is not None and other else None
    return {
        "scene": scene.name,
        "triangles": len(scene.triangles),
        "objects": len(scene.object_names),
        "dynamic": scene.dynamic,
        "texels": len(lightmaps.texels),
        "valid": valid,
        "baseline": options.baseline,
        "full": options.full,
        "options": asdict(options),
        "command": options.command,
        "key_frames": options.shown,
        "few_counted": few_counted(rows[options.full]),
        "rays_an_update": rays_an_update,
        "policies": [
            {
                "name": name,
                "about": ABOUT.get(name, ""),
                "before": before,
                "changes": changed_parameters(policy_of(name), policy_of(before) if before else None),
                "summary": summaries[name]
                | {"first_rays": renderers[name].priming_rays, "machine_seconds": machine_seconds(plans[name])},
                "frames": rows[name],
            }
            for before, name in zip((None, *options.policies), options.policies, strict=False)
        ],
        "parameters": parameters(policy_of(options.full)),
        "error_scale": {"range": ERROR_RANGE, "floor": ERROR_FLOOR, "colours": error_legend()},
        "quantities": [_described(quantity) for quantity in QUANTITIES],
    }


def _described(quantity: Quantity) -> dict[str, Any]:
    """What the page says of a quantity of texels."""
    names = ("name", "title", "about", "low", "high", "unit", "open")
    shown = {name: getattr(quantity, name) for name in names}
    return {**shown, "labels": list(quantity.labels), "colours": legend(quantity)}


def frames_a_turn(visible: int, options: Comparison) -> float:
    """Frames that it takes to update so many visible texels once each, if all rays of the budget went to them.

    An update without mirrors is taken, of which there are more: so lags are rather too many turns. At least one texel.
    """
    return max(visible, 1) * options.sampling.reserve(specular=False) / options.budget


def budget_shares(frames: Sequence[Mapping[str, Any]], budget: int, rays_an_update: int, valid: int) -> dict[str, Any]:
    """The least and the greatest part of the budget that a frame has spent, and whether the least counts.

    It counts (else it is None) where the budget pays for `LEAST_UPDATES` and for no more than all valid texels.
    """
    shares = [frame["spent"] / budget for frame in frames]
    counts = LEAST_UPDATES * rays_an_update <= budget <= valid * rays_an_update
    return {"least_share": min(shares) if counts else None, "greatest_share": max(shares)}


def machine_seconds(plan: Schedule) -> float:
    """Mean time from one frame to the next on the machine; of a single frame, its whole time."""
    cycles = plan.intervals() or (plan.duration,)
    return plan.machine.seconds(sum(cycles)) / len(cycles)


def few_counted(rows: Sequence[Mapping[str, Any]]) -> str | None:
    """One sentence on the compared frames, among `rows`, less than half of whose pixels count; None: no such frame."""
    few = {row["frame"]: 100 * row["counted"] for row in rows if row.get("counted", 1) < LEAST_COUNTED}
    if not few:
        return None
    frames = ("frames " if len(few) > 1 else "frame ") + ", ".join(str(frame) for frame in few)
    shares = " to ".join(dict.fromkeys(f"{share:.2g}" for share in (min(few.values()), max(few.values()))))
    return (
        f"{frames}: errors are those of {shares} % of the pixels; the others show an emitter, "
        "whose light is in no lightmap and is most of theirs, and do not count"
    )


def summary(frames: Sequence[Mapping[str, Any]], budget: int) -> dict[str, Any]:
    """Figures of a policy over all its frames: means over the frames that have them, and the extremes."""

    def mean(name: str) -> float | None:
        found = [frame[name] for frame in frames if frame.get(name) is not None]
        return float(np.mean(found)) if found else None

    def most(name: str) -> Any:
        return max((frame[name] for frame in frames if frame.get(name) is not None), default=None)

    rays = sum((Counter(frame["rays"]) for frame in frames), Counter())
    largest = most("spent")
    return {
        **{name: mean(name) for name in MEASURES},
        "worst_error": most("error"),
        "energy": mean("energy"),
        "jump": most("jump"),
        "darkened": most("darkened"),
        "missed": most("missed"),
        "texels": mean("texels"),
        "on_visible": mean("on_visible"),
        "unknown": mean("unknown"),
        "age": mean("age"),
        "oldest": most("oldest"),
        "deciding": sum(rays[kind] for kind in DECIDING) / len(frames),
        "rays": {kind: rays[kind] / len(frames) for kind in frames[0]["rays"]},
        "largest_spent": largest,
        "least_spent": min(frame["spent"] for frame in frames),
        "within_budget": largest <= budget,
        "seconds": sum(frame["seconds"] for frame in frames),
    }
