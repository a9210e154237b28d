"""Renders a sequence of frames into a folder: frames, film, the lightmaps as they fill, and the figures of it all."""

from collections import Counter
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from lightloom.gen.pages.timeline import timeline
from lightloom.golden_model.contract import bitpack
from lightloom.golden_model.contract.formats import PUBLISHED_TEXEL, TEXEL_STATE
from lightloom.golden_model.host.errors import warn
from lightloom.golden_model.machine.cost_model import FrameCounts
from lightloom.golden_model.machine.schedule import Schedule, schedule
from lightloom.golden_model.pictures.images import atlas, exposure_for, tonemap, write_exr, write_film, write_png
from lightloom.golden_model.pictures.texel_views import preview
from lightloom.golden_model.renderer import FrameResult, Renderer
from lightloom.golden_model.scene.scene import Scene
from lightloom.golden_model.tables.lightmap import VALID, Lightmaps
from lightloom.render.policy_pictures import QUANTITIES

ENLARGED = 3
"""Pixels a texel has in pictures of lightmaps."""
UNSAMPLED = (38, 38, 42, 255)
"""Texels without a sample of their own, as shown."""
FRAMES_PER_SECOND = 12.0
TIMELINE_FRAMES = 5
"""Frames of the timeline, the last ones: those before are on their way up to speed."""
LONGEST_FILM = 600
"""Frames that go into the film: they are all held in memory."""
PI = 3.1415927


@dataclass(frozen=True, kw_only=True)
class Pictures:
    """What to write of each frame."""

    supersample: int = 1
    """A pixel of a PNG is the mean of so many rendered ones a side."""
    exposure: float | None = None
    """Factor from radiance to display; None: taken from the first frame, for all of them."""
    exr: bool = False
    """Write the rendered radiance of each frame as EXR too."""
    views: tuple[str, ...] = ()
    """Names of `VIEWS` to show on the surfaces of the scene too, each as a film of its own."""


VIEWS = {quantity.name: quantity for quantity in QUANTITIES}
"""What is known of the texels and can be shown on the scene ([0046])."""


def looped(scene: Scene, frames: int) -> Scene:
    """The scene with its camera path, if it has one, stretched or shortened to last `frames` frames."""
    if not scene.camera_path:
        return scene
    last = scene.camera_path[-1].frame
    keys = {round(key.frame * frames / last): key for key in scene.camera_path}
    return replace(scene, camera_path=tuple(replace(key, frame=frame) for frame, key in sorted(keys.items())))


def shown_lightmaps(frames: int) -> list[int]:
    """The frames after which the lightmaps are written: 0, 1, 3, 7, 15, … and the last."""
    return sorted({*(k for k in (2**n - 1 for n in range(24)) if k < frames), frames - 1})


def render_sequence(
    renderer: Renderer,
    frames: int,
    folder: Path,
    pictures: Pictures,
    advance: Callable[[float], None],
) -> dict[str, Any]:
    """Renders the next `frames` frames (>= 1) into `folder` and returns the figures, ready for JSON.

    Writes frames/NNNN.png (and .exr), film.webp, lightmap/NNNN.png and .exr (the version after frame NNNN),
    views/NAME.webp and views/NAME/NNNN.png, and timeline.svg: the stages of the last frames on the renderer's machine.
    """
    rows: list[dict[str, Any]] = []
    display: list[np.ndarray] = []
    views: dict[str, list[np.ndarray]] = {name: [] for name in pictures.views}
    counts: list[FrameCounts] = []
    seconds: Counter[str] = Counter()
    exposure = pictures.exposure
    keep = set(shown_lightmaps(frames))
    for _ in range(frames):
        result = renderer.frame()
        if exposure is None:
            exposure = exposure_for(result.image)
        name = f"{result.frame:04}"
        image = tonemap(result.image, exposure, pictures.supersample)
        if len(display) < LONGEST_FILM:
            display.append(image)
        write_png(folder / "frames" / f"{name}.png", image)
        if pictures.exr:
            write_exr(folder / "frames" / f"{name}.exr", result.image)
        if result.frame in keep:
            write_lightmaps(folder / "lightmap" / name, renderer, exposure)
        for view, film in views.items():
            shown = _view(renderer, result, view, pictures.supersample)
            write_png(folder / "views" / view / f"{name}.png", shown)
            if len(film) < LONGEST_FILM:
                film.append(shown)
        seconds.update(result.seconds)
        counts.append(result.counts)
        rows.append(_figures(result, renderer))
        advance(1)
    write_film(folder / "film.webp", display, FRAMES_PER_SECOND)
    for view, film in views.items():
        write_film(folder / "views" / f"{view}.webp", film, FRAMES_PER_SECOND)
    plan = schedule(renderer.machine, counts)
    (folder / "timeline.svg").write_text(timeline(plan, *_last_frames(plan)), encoding="utf-8")
    assert exposure is not None
    _warn_of_clipped(renderer, rows)
    report = _report(renderer, pictures, exposure, rows, plan)
    return report | {"lightmap_frames": sorted(keep), "frame_seconds": dict(seconds)}


def _report(
    renderer: Renderer, pictures: Pictures, exposure: float, rows: list[dict[str, Any]], plan: Schedule
) -> dict[str, Any]:
    """What was rendered, with which options, and what came out."""
    return {
        "scene": renderer.scene.name,
        "triangles": len(renderer.scene.triangles),
        "width": renderer.width // pictures.supersample,
        "height": renderer.height // pictures.supersample,
        "supersample": pictures.supersample,
        "exposure": exposure,
        "budget": max(row["budget"] for row in rows),
        "seed": renderer.seed,
        "sampling": asdict(renderer.sampling),
        "policy": asdict(renderer.policy),
        "pipeline": asdict(renderer.pipeline),
        "rays_an_update": renderer.sampling.reserve(renderer.scene.specular),
        "priming_rays": renderer.priming_rays,
        "rays": dict(sum((Counter(row["rays"]) for row in rows), Counter())),
        "frame_rays": dict(sum((Counter(row["frame_rays"]) for row in rows), Counter())),
        "machine_time": _machine_time(plan),
        "frames": rows,
        "lightmap": lightmap_figures(renderer.lightmaps, renderer.state),
    }


def _warn_of_clipped(renderer: Renderer, rows: list[dict[str, Any]]) -> None:
    """Says what was brighter than the formats hold."""
    if clipped := renderer.priming_clipped + sum(row["clipped"] for row in rows):
        warn(f"{clipped} samples and texels were brighter than the lightmaps hold, so the picture is too dark there")
    if clipped := sum(row["frame_rays"]["clipped"] for row in rows):
        warn(f"{clipped} rays of pixels brought more light than the formats hold, so the picture is too dark there")


def _view(renderer: Renderer, result: FrameResult, name: str, pixels: int) -> np.ndarray:
    """A quantity of the texels after the frame on the surfaces that it sees, 8-bit sRGB."""
    quantity = VIEWS[name]
    values = quantity.values(result, renderer.state)
    image = preview(renderer.lightmaps, result.gbuffer, values, quantity.low, quantity.high, quantity.palette)
    height, width = image.shape[0] // pixels, image.shape[1] // pixels
    squares = image[: height * pixels, : width * pixels].reshape(height, pixels, width, pixels, 3)
    return np.rint(squares.mean(axis=(1, 3))).astype(np.uint8)


def _last_frames(plan: Schedule) -> tuple[int, int]:
    """The time of the last frames of a schedule, in cycles."""
    first = plan.frames[-min(TIMELINE_FRAMES, len(plan.frames))]
    return first.begin, max(plan.duration, first.begin + 1)


def _machine_time(plan: Schedule) -> dict[str, Any]:
    """What the sequence would take on the machine."""
    seconds = plan.machine.seconds
    intervals = plan.intervals()
    return {
        "seconds": seconds(plan.duration),
        "longest_frame_seconds": seconds(max(intervals, default=plan.duration)),
        "longest_latency_seconds": seconds(max(frame.latency for frame in plan.frames)),
        "utilisation": plan.utilisation(),
    }


def _figures(result: FrameResult, renderer: Renderer) -> dict[str, Any]:
    sampled = renderer.state["count"][renderer.lightmaps.texels["state"] == VALID] > 0
    return {
        "frame": result.frame,
        "budget": result.budget,
        "texels": len(result.maintenance.texels),
        "rays": result.maintenance.rays,
        "clipped": result.maintenance.clipped,
        "frame_rays": asdict(result.frame_rays),
        "sampled": float(sampled.mean()) if len(sampled) else 1.0,
        "seconds": sum(result.seconds.values()),
    }


def lightmap_figures(lightmaps: Lightmaps, state: np.ndarray) -> dict[str, Any]:
    """Counts of maps and texels, and how often the valid texels have been updated."""
    assert state.dtype == TEXEL_STATE
    states = np.bincount(lightmaps.texels["state"], minlength=3)
    updates = state["number"][lightmaps.texels["state"] == VALID]  # at most 4095
    return {
        "maps": len(lightmaps.width),
        "charts": int(lightmaps.chart.max()) + 1,
        "texels": len(lightmaps.texels),
        "empty": int(states[0]),
        "valid": int(states[1]),
        "buried": int(states[2]),
        "sampled": int((updates > 0).sum()),
        "updates": int(updates.sum(dtype=np.int64)),
        "fewest_updates": int(updates.min(initial=0 if not len(updates) else 4095)),
        "most_updates": int(updates.max(initial=0)),
        "bytes": len(lightmaps.texels) * (bitpack.width(TEXEL_STATE) + bitpack.width(PUBLISHED_TEXEL)) // 8,
    }


def write_lightmaps(stem: Path, renderer: Renderer, exposure: float) -> None:
    """Writes all maps in one picture each: `stem`.exr, the published version, and `stem`.png, its sampled texels.

    Brightness in the PNG is that of a white surface under the irradiance, at the exposure of the frames.
    """
    maps = renderer.lightmaps
    rgba = renderer.published["rgba"][: len(maps.texels)].astype(np.float32)
    rgba[:, :3] = np.ldexp(rgba[:, :3], renderer.exponent)
    write_exr(stem.with_suffix(".exr"), atlas(maps, rgba))
    irradiance = np.where(maps.fill[:, None] >= 0, rgba[:, :3], 0)
    colour = tonemap(irradiance[:, None], 0.7 * exposure / PI)[:, 0]
    picture = np.concatenate([colour, np.full((len(colour), 1), 255, np.uint8)], axis=1)
    picture[rgba[:, 3] == 0] = UNSAMPLED
    picture[maps.chart < 0] = 0  # transparent
    enlarged = atlas(maps, picture).repeat(ENLARGED, axis=0).repeat(ENLARGED, axis=1)
    write_png(stem.with_suffix(".png"), enlarged)


def contact_sheet(folder: Path, columns: int = 6) -> Image.Image:
    """All frames of a folder that `render_sequence` wrote, or evenly chosen ones if there are many, on one page."""
    from lightloom.shared.pictures import sheet

    paths = sorted((folder / "frames").glob("*.png"))
    paths = [paths[round(k)] for k in np.linspace(0, len(paths) - 1, min(len(paths), 4 * columns))]
    frames = []
    for path in paths:
        with Image.open(path) as image:
            frames.append(image.convert("RGB"))
    return sheet(frames, [f"frame {int(path.stem)}" for path in paths], columns, cell=min(240, frames[0].width))
