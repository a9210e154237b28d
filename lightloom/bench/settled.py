"""How many texels, updates and regions a settled frame of a large scene has: its selection alone, frame after frame.

No texel is sampled: what selection chooses counts as updated and known a little better. So a frame takes seconds.
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from lightloom.golden_model.charts.unwrap import unwrap
from lightloom.golden_model.contract.formats import COUNT_MAX, FRAMES, ONE_SAMPLE, TEXEL_STATE
from lightloom.golden_model.driver.predicted_view import predicted_view
from lightloom.golden_model.driver.report import Reporter
from lightloom.golden_model.engine.kernels import Kernels
from lightloom.golden_model.engine.publishing.regions import Regions, regions_of
from lightloom.golden_model.engine.sampling.settings import Sampling
from lightloom.golden_model.engine.selection.culling import region_boxes
from lightloom.golden_model.engine.selection.policy import Policy
from lightloom.golden_model.engine.selection.screen_test import to_project
from lightloom.golden_model.engine.selection.selector import FrameContext, Report, Selector
from lightloom.golden_model.engine.selection.texel_project import texel_project
from lightloom.golden_model.frame.rasterizer import rasterize
from lightloom.golden_model.scene.files.load import load_scene
from lightloom.golden_model.scene.scene import Scene
from lightloom.golden_model.structures.structure import Structure
from lightloom.golden_model.tables.lightmap import SIDE_LEVELS, VALID, Lightmaps
from lightloom.golden_model.tables.pinhole import View, look_at

SEED = 6
OTHERS = (1, 16)
"""Texels of a region that may follow each other, beside the default."""


@dataclass(frozen=True, kw_only=True)
class Case:
    """A scene whose camera moves, and what a frame of it may spend."""

    scene: str = "scenes/moving-viewpoint.toml"
    texel: float = 0.02
    """Side of a texel in the scene's unit."""
    width: int = 1920
    height: int = 1080
    updates: int = 25_000
    together: int = Policy().together
    frames: int = 60
    """That are selected; of the last ones …"""
    measured: int = 12
    """… the means are taken."""


@dataclass(frozen=True, kw_only=True)
class Frame:
    """Means of the frames measured."""

    texels: int
    """Of all maps; then those that are valid, and all regions."""
    valid: int
    regions: int
    tested: int
    """Texels of the regions that are not left out in the last frame, of both views; then of either."""
    looked_at: int
    on_screen: int
    """Texels that face the eye and are on the screen, in the last frame; then the same of the predicted view."""
    on_predicted: int
    updates: int
    rewritten: int
    """Regions that show an update."""
    coarser: int
    """Texels above the regions that are renewed with them."""


def measure(case: Case, backend: str = "auto") -> Frame:
    """Selects the texels of so many frames; about a second a frame and million texels with numba."""
    scene = load_scene(case.scene)
    maps = unwrap(scene, case.texel, trace=Structure(scene, backend).trace)
    policy = replace(Policy(), together=case.together)
    selector, regions = Selector(maps, policy, Kernels(backend).screen_test), regions_of(maps)
    rng, valid = np.random.default_rng(SEED), maps.texels["state"] == VALID
    state = np.zeros(len(valid), dtype=TEXEL_STATE)
    state["count"][valid] = ONE_SAMPLE * rng.integers(4, 20, int(valid.sum()))
    state["frame"] = -rng.integers(0, 64, len(valid)) % FRAMES
    unchanged = Reporter(scene, policy).report(scene, scene, None, 0)
    trace, reserve = Structure(scene, backend).trace, Sampling().reserve(False)
    figures: list[tuple[int, int, int]] = []
    views: list[View] = []
    for frame in range(case.frames):
        views, context = _seen(scene, maps, state, case, frame, policy, unchanged)
        plan = selector.plan(replace(context, trace=trace), case.updates * reserve, reserve)
        state["count"][plan.texel] = np.minimum(state["count"][plan.texel] + ONE_SAMPLE, COUNT_MAX)
        state["frame"][plan.texel] = frame % FRAMES
        written = np.unique(regions.showing(plan.texel)[1])
        figures.append((len(plan.texel), len(written), _above(regions, written)))
    updates, rewritten, coarser = np.rint(np.mean(figures[-case.measured :], axis=0)).astype(int).tolist()
    kept = _kept(maps, valid, views, scene, policy)
    on_screen = [_on_screen(maps, valid, view, scene, policy) for view in views]
    return Frame(
        texels=len(valid),
        valid=int(valid.sum()),
        regions=regions.count,
        tested=int(kept.sum()),
        looked_at=int(kept.any(axis=0).sum()),
        on_screen=on_screen[0],
        on_predicted=on_screen[1] if len(on_screen) > 1 else 0,
        updates=updates,
        rewritten=rewritten,
        coarser=coarser,
    )


def report(case: Case, others: Sequence[int] = OTHERS) -> dict[str, Any]:
    """A case and what was measured, ready for JSON; and regions an update with so many texels `together`."""
    frames = {together: measure(replace(case, together=together)) for together in (case.together, *others)}
    first = frames.pop(case.together)
    shares = {str(together): round(frame.rewritten / frame.updates, 3) for together, frame in frames.items()}
    return {"case": asdict(case), "frame": asdict(first), "regions an update": shares}


def _seen(
    scene: Scene, maps: Lightmaps, state: np.ndarray, case: Case, frame: int, policy: Policy, unchanged: Report
) -> tuple[list[View], FrameContext]:
    """The view of a frame, the predicted one if there is one, and what selection looks at."""

    def drawn(view: View) -> np.ndarray:
        return rasterize(view, scene.triangles, scene.normals, scene.object_id, maps.uv)

    camera = scene.camera_at(frame)
    view = look_at(camera.position, camera.target, camera.up, camera.fov_y_tan, case.width, case.height)
    coming = predicted_view(scene, frame, case.width, case.height, policy)
    context = FrameContext(
        frame=frame,
        report=unchanged,
        lightmaps=maps,
        state=state,
        view=view,
        gbuffer=drawn(view),
        predicted=None if coming is None else (coming, drawn(coming)),
    )
    return [view, *([] if coming is None else [coming])], context


def _above(regions: Regions, written: np.ndarray) -> int:
    """Texels of the levels above regions (K,) that are renewed with them."""
    total, levels = 0, regions.levels
    for level in range(SIDE_LEVELS + 1, levels.width.shape[1]):
        there = written[level <= levels.count[regions.object[written]]]
        up = level - SIDE_LEVELS
        place = np.stack([regions.object[there], regions.row[there] >> up, regions.column[there] >> up])
        total += np.unique(place, axis=1).shape[1]
    return total


def _kept(maps: Lightmaps, valid: np.ndarray, views: list[View], scene: Scene, policy: Policy) -> np.ndarray:
    """The valid texels of regions that are not left out, (views, N) bool."""
    regions = region_boxes(maps).posed(scene.rotation, scene.translation)
    seen = np.stack([regions.on_screen(view, scene.texel_size, policy) for view in views])
    return seen[:, regions.of_texel] & valid


def _on_screen(maps: Lightmaps, valid: np.ndarray, view: View, scene: Scene, policy: Policy) -> int:
    where = maps.texels["position"][valid], maps.texels["normal"][valid]
    return int(texel_project(to_project(*where, view, scene.texel_size, policy))["visible"].sum())
