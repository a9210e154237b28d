"""Policies side by side: the same scene, seed and budget under each, against converged lightmaps of the same frames.

The measure is the mean relative error of a frame, E = sum |I - R| / sum R over the pixels that count and all channels
of the linear pictures I and R. R is the picture of that very frame read from converged maps (`golden_model.reference`),
so what E counts is what is wrong with the maps, and nothing else.

Light of emitters that reaches a pixel by no lightmap, seen directly, in a mirror or through glass, is the same in I and
R by construction. It is taken out of both, and where it is most of what R shows, the pixel does not count: a lamp in
view is many times as bright as what it lights, and would hide what is wrong everywhere else.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from gen.policies_page import policies_page
from gen.timeline import timeline
from golden_model.errors import InputError
from golden_model.images import exposure_for, tonemap, write_film, write_png
from golden_model.lightmap import VALID, Lightmaps, bilinear_taps
from golden_model.machine import FrameCounts, Machine
from golden_model.policy import POLICIES, Policy
from golden_model.reference import Reference
from golden_model.renderer import FrameResult, Renderer, Sampling
from golden_model.scene import Scene
from golden_model.schedule import Schedule, schedule
from lightloom.console import Progress, json_text
from lightloom.difference import relative_mse
from lightloom.machine import machine, versions
from lightloom.policy_parameters import changed_parameters, parameters
from lightloom.policy_pictures import (
    ERROR_FLOOR,
    ERROR_RANGE,
    QUANTITIES,
    UNKNOWN_AGE,
    ages,
    error_colours,
    error_legend,
    legend,
    relative_error,
    write_quantity,
)

BASELINE = "round-robin"
"""What the others are compared with, where it takes part; else the first one."""
KEY_FRAMES = 4
"""Frames that are shown as pictures, unless chosen."""
FILM_FRAMES = 60
"""Frames in the film at most: they are held in memory and in the page."""
FRAMES_PER_SECOND = 12.0
NOISE_RAYS = 4
"""The second reference, by which the first one's noise is estimated, has so many times fewer rays..."""
LEAST_RAYS = 8
"""... but no fewer than these."""
TIMELINE_FRAMES = 4
"""Frames of the drawing of the machine's time."""
LEAST_COUNTED = 0.5
"""Part of a frame's pixels that count, below which it is said."""
REFERENCE_SEED = 0x5EED
"""Keeps the reference's random numbers apart from the renders': added to the seed, modulo 2**32."""


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """What is compared, and how."""

    scene: str = "cornell-box"
    """As `load_scene` takes it."""
    policies: tuple[str, ...] = tuple(POLICIES)
    """Names in `POLICIES`, in the order of the page."""
    frames: int = 48
    width: int = 320
    height: int = 214
    budget: int = 20_000
    """Rays a frame."""
    directions: int = 16
    """Rays for indirect light in a texel update."""
    light_samples: int = 4
    """Shadow rays in a texel update."""
    reference_rays: int = 512
    """Rays for indirect light a texel of the reference."""
    reference_every: int = 2
    """Every so many frames are compared, from frame 0."""
    key_frames: tuple[int, ...] = ()
    """Frames shown as pictures, rising; none: `KEY_FRAMES` of the compared ones, evenly spread."""
    exposure: float | None = None
    """Factor from radiance to display; None: taken from the first frame's reference."""
    seed: int = 0
    backend: str = "auto"
    threads: int = 1

    def __post_init__(self) -> None:
        if not self.policies or len(set(self.policies)) < len(self.policies):
            raise InputError(f"--policies {','.join(self.policies)}: give one or more, each once")
        for name, value in (("frames", self.frames), ("reference-every", self.reference_every)):
            if value < 1:
                raise InputError(f"--{name} {value}: must be at least 1")
        if any(not 0 <= frame < self.frames for frame in self.key_frames):
            shown = ",".join(str(frame) for frame in self.key_frames)
            raise InputError(f"--key-frames {shown}: must be 0 to {self.frames - 1}")

    @property
    def sampling(self) -> Sampling:
        """What a texel update is made of, under all policies."""
        return Sampling(directions=self.directions, light_samples=self.light_samples)

    @property
    def shown(self) -> list[int]:
        """The frames shown as pictures, rising."""
        if self.key_frames:
            return sorted(set(self.key_frames))
        places = np.linspace(0, len(self._regular) - 1, min(KEY_FRAMES + 1, len(self._regular)))
        return sorted({self._regular[round(place)] for place in places[-KEY_FRAMES:]})

    @property
    def compared(self) -> list[int]:
        """The frames compared with the reference, rising; those shown are among them."""
        return sorted({*self._regular, *self.shown})

    @property
    def _regular(self) -> Sequence[int]:
        """Every K-th frame, without frame 0: what that one shows was there before any policy had its say."""
        return range(max(self.reference_every - 1, 1), self.frames, self.reference_every) or [self.frames - 1]

    @property
    def command(self) -> str:
        """The command line that does the same again."""
        options: dict[str, object] = {
            "policies": ",".join(self.policies),
            "frames": self.frames,
            "budget": self.budget,
            "size": f"{self.width}x{self.height}",
            "directions": self.directions,
            "light-samples": self.light_samples,
            "reference-rays": self.reference_rays,
            "reference-every": self.reference_every,
            "key-frames": ",".join(str(frame) for frame in self.shown),
            "seed": self.seed,
        }
        if self.exposure is not None:
            options["exposure"] = self.exposure
        return " ".join(["lightloom policies", self.scene, *(f"--{name} {value}" for name, value in options.items())])

    @property
    def baseline(self) -> str:
        return BASELINE if BASELINE in self.policies else self.policies[0]

    @property
    def full(self) -> str:
        """The policy whose maps are shown: the last."""
        return self.policies[-1]


def straight_light(renderer: Renderer, result: FrameResult) -> np.ndarray:
    """What the last frame, which `result` is, shows where all lightmaps are black: (H, W, 3) float32.

    Light of emitters alone, straight or by mirrors and glass.
    """
    return renderer.picture(result, np.zeros_like(result.lightmap))


def counted_pixels(straight: np.ndarray, reference: np.ndarray) -> np.ndarray:
    """The pixels of a frame that measures count: (H, W) bool, from its straight light and its reference (H, W, 3).

    Those of which no more than half of the reference is straight light.
    """
    own, whole = (picture.sum(axis=-1, dtype=np.float64) for picture in (straight, reference))
    return np.asarray(np.isfinite(own) & (2 * own <= whole))


def error(image: np.ndarray, reference: np.ndarray) -> float | None:
    """E = sum |I - R| / sum R over the values of (..., 3) that are finite in both; None for a black reference."""
    finite = np.isfinite(image) & np.isfinite(reference)
    shown, wanted = image[finite].astype(np.float64), reference[finite].astype(np.float64)
    total = float(wanted.sum())
    return float(np.abs(shown - wanted).sum()) / total if total > 0 else None


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


def visible_texels(lightmaps: Lightmaps, gbuffer: np.ndarray) -> np.ndarray:
    """The valid texels of the finest level that pixels of a GBUFFER (H, W) read, (V,) int64, rising."""
    seen = gbuffer[(gbuffer["object"] >= 0) & gbuffer["front"]]
    texel, weight = bilinear_taps(lightmaps, seen["object"], seen["lightmap"])
    shown = lightmaps.fill[texel[weight > 0]].astype(np.int64)
    return np.unique(shown[shown >= 0])


def compare(
    scene: Scene, lightmaps: Lightmaps, options: Comparison, folder: Path, progress: Progress
) -> dict[str, Any]:
    """Renders all frames under all policies, writes the pictures into `folder` and returns the report, ready for JSON.

    Frame by frame: each policy's, then the reference's, once for all. What is held is the state of the renderers and
    the film. In `folder`: film.webp, timeline.svg, and for each key frame NNNN frames/NNNN/reference.png, POLICY.png
    and POLICY-error.png, and of the last policy maps/NNNN/QUANTITY.png and QUANTITY-maps.png.
    """
    with progress.stage("First light", len(options.policies)) as advance:
        renderers = {}
        for name in options.policies:
            renderers[name] = _renderer(scene, lightmaps, options, POLICIES[name])
            advance(1)
    judge = _Judge(scene, lightmaps, options, folder)
    rows: dict[str, list[dict[str, Any]]] = {name: [] for name in options.policies}
    counts: dict[str, list[FrameCounts]] = {name: [] for name in options.policies}
    compared = set(options.compared)
    with progress.stage("Frames and references", options.frames * len(renderers) + len(compared)) as advance:
        for number in range(options.frames):
            results = {}
            for name, renderer in renderers.items():
                results[name] = renderer.frame()
                advance(1)
            figures: dict[str, dict[str, Any]] = {}
            if number in compared:
                figures = judge.look(results, renderers)
                advance(1)
            visible = visible_texels(lightmaps, results[options.full].gbuffer)
            for name, result in results.items():
                rows[name].append(_row(result, renderers[name].state, visible) | figures.get(name, {}))
                counts[name].append(result.counts)
    with progress.stage("Film and timelines"):
        judge.write_film()
        # Frames follow each other as fast as they are done, so that their times tell what they cost.
        free = Machine(refresh_cycles=0, versions=renderers[options.full].pipeline.versions)
        plans = {name: schedule(free, each) for name, each in counts.items()}
        first = options.shown[0]
        last = min(first + TIMELINE_FRAMES, options.frames) - 1
        times = plans[options.full].frames
        drawn = timeline(plans[options.full], times[first].begin, times[last].shown)
        (folder / "timeline.svg").write_text(drawn, encoding="utf-8")
    return _report(scene, lightmaps, options, renderers, rows, plans) | {
        "timeline_frames": [first, last],
        "exposure": judge.exposure,
        "reference": {
            "rays": options.reference_rays,
            "every": options.reference_every,
            "frames": options.compared,
            "noise": judge.noise,
        },
    }


def _renderer(scene: Scene, lightmaps: Lightmaps, options: Comparison, policy: Policy) -> Renderer:
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
    )


class _Judge:
    """Compares frames with the reference of the same frame, and writes the pictures of it."""

    def __init__(self, scene: Scene, lightmaps: Lightmaps, options: Comparison, folder: Path):
        self.scene, self.lightmaps, self.options, self.folder = scene, lightmaps, options, folder
        self.reference = self._reference(options.reference_rays, 0)
        self.exposure = options.exposure
        self.noise: float | None = None
        """The reference's own E, estimated at the first frame."""
        compared = options.compared
        places = np.linspace(0, len(compared) - 1, min(len(compared), FILM_FRAMES))
        self._film_frames = {compared[round(place)] for place in places}
        self._film: list[np.ndarray] = []

    def _reference(self, rays: int, number: int) -> Reference:
        options = self.options
        return Reference(
            self.scene,
            self.lightmaps,
            rays=rays,
            seed=(options.seed + REFERENCE_SEED + number) % 2**32,
            backend=options.backend,
            threads=options.threads,
        )

    def look(self, results: Mapping[str, FrameResult], renderers: Mapping[str, Renderer]) -> dict[str, dict[str, Any]]:
        """Compares one frame under each policy; writes its pictures if it is a key frame. Figures by policy."""
        first = self.options.policies[0]
        renderer, result = renderers[first], results[first]
        wanted = renderer.picture(result, self.reference.published(result.frame, self._looked_at(result)))
        if self.exposure is None:
            self.exposure = exposure_for(wanted)
        straight = straight_light(renderer, result)
        counted = counted_pixels(straight, wanted)
        mapped = wanted[counted] - straight[counted]
        if self.noise is None:
            self.noise = self._noise(renderer, result, straight, mapped, counted)
        figures: dict[str, dict[str, Any]] = {
            name: {
                "error": error(shown.image[counted] - straight[counted], mapped),
                "relative_mse": relative_mse(shown.image[counted] - straight[counted], mapped),
                "counted": float(counted.mean()),
            }
            for name, shown in results.items()
        }
        if result.frame in self._film_frames:
            self._film.append(self._film_frame(results, wanted, counted))
        if result.frame in self.options.shown:
            for name, value in self._write(results, wanted, counted).items():
                figures[name]["flip"] = value
            full = self.options.full
            for quantity in QUANTITIES:
                place = self.folder / "maps" / f"{result.frame:04}"
                write_quantity(place, quantity, self.lightmaps, results[full], renderers[full].state)
        return figures

    def _noise(
        self,
        renderer: Renderer,
        result: FrameResult,
        straight: np.ndarray,
        mapped: np.ndarray,
        counted: np.ndarray,
    ) -> float | None:
        """The reference's own E, from one of fewer rays and other random numbers, which differs by the noise of both.

        Taken to fall with the root of the number of rays; it falls faster, so this is rather too much.
        """
        rays = self.options.reference_rays
        fewer = max(rays // NOISE_RAYS, LEAST_RAYS)
        other = self._reference(fewer, 1).published(result.frame, self._looked_at(result))
        between = error(renderer.picture(result, other)[counted] - straight[counted], mapped)
        return None if between is None else between / float(np.sqrt(1 + rays / fewer))

    def _looked_at(self, result: FrameResult) -> np.ndarray | None:
        """The texels that the picture of a frame reads; None: any, where mirrors and glass show what is not seen."""
        return None if self.scene.specular else visible_texels(self.lightmaps, result.gbuffer)

    def _write(
        self, results: Mapping[str, FrameResult], wanted: np.ndarray, counted: np.ndarray
    ) -> dict[str, float | None]:
        """Writes a key frame's pictures; mean FLIP of each policy's."""
        reference = self._display(wanted)
        found = {}
        for name, result in results.items():
            place = self.folder / "frames" / f"{result.frame:04}"
            shown = self._display(result.image)
            write_png(place / "reference.png", reference)
            write_png(place / f"{name}.png", shown)
            write_png(place / f"{name}-error.png", error_colours(relative_error(result.image, wanted, counted)))
            found[name] = flip(shown, reference, counted)
        return found

    def _film_frame(self, results: Mapping[str, FrameResult], wanted: np.ndarray, counted: np.ndarray) -> np.ndarray:
        """The baseline and the full policy side by side, and below each its errors."""
        pair = [results[name].image for name in (self.options.baseline, self.options.full)]
        top = np.concatenate([self._display(image) for image in pair], axis=1)
        bottom = np.concatenate([error_colours(relative_error(image, wanted, counted)) for image in pair], axis=1)
        return np.concatenate([top, bottom], axis=0)

    def write_film(self) -> None:
        """The film of all frames looked at, as long as the sequence."""
        write_film(self.folder / "film.webp", self._film, FRAMES_PER_SECOND * len(self._film) / self.options.frames)

    def _display(self, image: np.ndarray) -> np.ndarray:
        assert self.exposure is not None
        return tonemap(image, self.exposure)


def flip(shown: np.ndarray, wanted: np.ndarray, counted: np.ndarray) -> float | None:
    """Mean LDR-FLIP between 8-bit sRGB pictures (H, W, 3), 0 to 1, over pixels (H, W) bool; None if there are none."""
    import flip_evaluator

    test, reference = (picture.astype(np.float32) / 255 for picture in (shown, wanted))
    differences, _, _ = flip_evaluator.evaluate(reference, test, "LDR", applyMagma=False)
    return float(np.mean(differences[counted], dtype=np.float64)) if counted.any() else None


def _row(result: FrameResult, state: np.ndarray, visible: np.ndarray) -> dict[str, Any]:
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
        "unknown": float(1 - len(known) / len(age)) if len(age) else 0.0,
        "age": float(known.mean()) if len(known) else None,
        "oldest": int(known.max()) if len(known) else None,
        "seconds": sum(result.seconds.values()),
    }


def _report(
    scene: Scene,
    lightmaps: Lightmaps,
    options: Comparison,
    renderers: Mapping[str, Renderer],
    rows: Mapping[str, list[dict[str, Any]]],
    plans: Mapping[str, Schedule],
) -> dict[str, Any]:
    summaries = {name: summary(frames, options.budget) for name, frames in rows.items()}
    base = summaries[options.baseline]
    for figures in summaries.values():
        for measure in MEASURES:
            mine, other = figures[measure], base[measure]
            figures[f"{measure}_ratio"] = mine / other if mine is not None and other else None
    before = None
    policies = []
    for name in options.policies:
        policy = POLICIES[name]
        policies.append(
            {
                "name": name,
                "about": ABOUT.get(name, ""),
                "before": before,
                "changes": changed_parameters(policy, POLICIES[before] if before else None),
                "summary": summaries[name]
                | {"first_rays": renderers[name].priming_rays, "machine_seconds": machine_seconds(plans[name])},
                "frames": rows[name],
            }
        )
        before = name
    return {
        "scene": scene.name,
        "triangles": len(scene.triangles),
        "objects": len(scene.object_names),
        "dynamic": scene.dynamic,
        "texels": len(lightmaps.texels),
        "valid": int((lightmaps.texels["state"] == VALID).sum()),
        "baseline": options.baseline,
        "full": options.full,
        "options": asdict(options),
        "command": options.command,
        "key_frames": options.shown,
        "few_counted": few_counted(rows[options.full]),
        "rays_an_update": options.sampling.reserve(scene.specular),
        "policies": policies,
        "parameters": parameters(POLICIES[options.full]),
        "error_scale": {"range": ERROR_RANGE, "floor": ERROR_FLOOR, "colours": error_legend()},
        "quantities": [
            {
                "name": quantity.name,
                "title": quantity.title,
                "about": quantity.about,
                "low": quantity.low,
                "high": quantity.high,
                "unit": quantity.unit,
                "open": quantity.open,
                "labels": list(quantity.labels),
                "colours": legend(quantity),
            }
            for quantity in QUANTITIES
        ],
    }


def machine_seconds(plan: Schedule) -> float:
    """Mean time from one frame to the next on the machine; of a single frame, its whole time."""
    cycles = plan.intervals() or (plan.duration,)
    return plan.machine.seconds(sum(cycles)) / len(cycles)


DECIDING = ("visibility", "footprints")
"""Kinds of rays by which a policy makes up its mind."""

MEASURES = ("error", "relative_mse", "flip")
"""What is compared with the baseline's."""

ABOUT = {
    "round-robin": "All texels in turn, whether anyone sees them or not.",
    "visibility": "Texels that the frame or a coming one reads, before those that nobody sees.",
    "variability": "Among those, the ones whose light varies: from update to update, within one, from texel to texel.",
    "influence": "And the ones whose light becomes different: around what moves or is switched, and where sampling "
    "notices a change.",
}
"""What each policy adds to the one before."""


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
        "texels": mean("texels"),
        "on_visible": mean("on_visible"),
        "unknown": mean("unknown"),
        "age": mean("age"),
        "oldest": most("oldest"),
        "deciding": sum(rays[kind] for kind in DECIDING) / len(frames),
        "rays": {kind: rays[kind] / len(frames) for kind in frames[0]["rays"]},
        "largest_spent": largest,
        "within_budget": largest <= budget,
        "seconds": sum(frame["seconds"] for frame in frames),
    }


def write_comparison(
    scene: Scene, lightmaps: Lightmaps, options: Comparison, folder: Path, progress: Progress
) -> dict[str, Any]:
    """What `compare` writes, policies.json and index.html, into `folder`; returns what policies.json holds."""
    report = compare(scene, lightmaps, options, folder, progress)
    report |= {"versions": versions(), "machine": machine(), "seconds": dict(progress.seconds)}
    with progress.stage("Page"):
        page = policies_page(report, folder)
    (folder / "policies.json").write_text(json_text(report))
    (folder / "index.html").write_text(page, encoding="utf-8")
    return report
