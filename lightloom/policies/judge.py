"""How far frames are from a reference of the same frames: the measures, and pictures of the differences.

The measure is the mean relative error of a frame, E = sum |I - R| / sum R over the pixels that count and all channels
of the linear pictures I and R. R is the picture of that very frame read from converged maps
(`golden_model.oracle.converged_maps`), so what E counts is what is wrong with the maps, and nothing else.

Light of emitters that reaches a pixel by no lightmap, seen directly, in a mirror or through glass, is the same in I and
R by construction. It is taken out of both, and where it is most of what R shows, the pixel does not count: a lamp in
view is many times as bright as what it lights, and would hide what is wrong everywhere else.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from lightloom.golden_model.oracle.converged_maps import Reference
from lightloom.golden_model.pictures.images import exposure_for, tonemap, write_film, write_png
from lightloom.golden_model.renderer import FrameResult, Renderer
from lightloom.golden_model.scene.scene import Scene
from lightloom.golden_model.tables.lightmap import Lightmaps, bilinear_taps
from lightloom.policies.options import Comparison
from lightloom.policies.references import KeptReference
from lightloom.policies.steps import Seen
from lightloom.render.policy_pictures import QUANTITIES, error_colours, luminance, relative_error, write_quantity
from lightloom.shared.difference import finite_in_both, relative_mse

FILM_FRAMES = 60
"""Frames in the film at most: they are held in memory and in the page."""
FRAMES_PER_SECOND = 12.0
NOISE_RAYS = 4
"""The second reference, by which the first one's noise is estimated, has so many times fewer rays..."""
LEAST_RAYS = 8
"""... but no fewer than these."""
REFERENCE_SEED = 0x5EED
"""Keeps the reference's random numbers apart from the renders': added to the seed, modulo 2**32."""
DARK = 0.25
"""A pixel that shows less than this part both of what it showed before and of what it ought to is a flaw to the eye."""


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
    shown, wanted = (values.astype(np.float64) for values in finite_in_both(image, reference))
    total = float(wanted.sum())
    return float(np.abs(shown - wanted).sum()) / total if total > 0 else None


def energy(image: np.ndarray, reference: np.ndarray) -> float | None:
    """sum I / sum R over the values of (..., 3) that are finite in both; None for a black reference."""
    shown, wanted = finite_in_both(image, reference)
    total = float(wanted.sum(dtype=np.float64))
    return float(shown.sum(dtype=np.float64)) / total if total > 0 else None


def darkened(
    image: np.ndarray, before: np.ndarray, straight: np.ndarray, mapped: np.ndarray, counted: np.ndarray
) -> float:
    """The part of the pixels that count (H, W) that are darker than `DARK` of the frame before and of the reference.

    By luminance, strictly. Of the picture (H, W, 3) and of the reference without straight light: `straight` is to be
    taken out of `image`, and is out of `mapped`; the frame `before` is as it was shown. 0 where no pixel counts.
    """
    shown, earlier, wanted = (luminance(picture) for picture in (image - straight, before, mapped))
    dark = (shown < DARK * earlier) & (shown < DARK * wanted)
    return float(dark[counted].mean()) if counted.any() else 0.0


def visible_texels(lightmaps: Lightmaps, gbuffer: np.ndarray) -> np.ndarray:
    """The valid texels of the finest level that pixels of a GBUFFER (H, W) read, (V,) int64, rising."""
    seen = gbuffer[(gbuffer["object"] >= 0) & gbuffer["front"]]
    texel, weight = bilinear_taps(lightmaps, seen["object"], seen["lightmap"])
    shown = lightmaps.fill[texel[weight > 0]].astype(np.int64)
    return np.unique(shown[shown >= 0])


class Judge:
    """Compares frames with the reference of the same frame, and writes the pictures of it."""

    def __init__(
        self, scene: Scene, lightmaps: Lightmaps, options: Comparison, folder: Path, references: Path | None = None
    ):
        """Pictures go into `folder`; converged maps are kept in `references`, if that is given."""
        self.scene, self.lightmaps, self.options, self.folder = scene, lightmaps, options, folder
        self.references = references
        self.reference = self._reference(options.reference_rays, 0)
        self.exposure = options.exposure
        self.noise: float | None = None
        """The reference's own E, estimated at the first frame."""
        self.seen: Seen | None = None
        """What the frame looked at last should show."""
        compared = options.compared
        places = np.linspace(0, len(compared) - 1, min(len(compared), FILM_FRAMES))
        self._film_frames = {compared[round(place)] for place in places}
        self._film: list[np.ndarray] = []

    def _reference(self, rays: int, number: int) -> Reference | KeptReference:
        options = self.options
        made = Reference(
            self.scene,
            self.lightmaps,
            rays=rays,
            seed=(options.seed + REFERENCE_SEED + number) % 2**32,
            backend=options.backend,
            threads=options.threads,
        )
        return made if self.references is None else KeptReference(made, self.references)

    def look(
        self,
        results: Mapping[str, FrameResult],
        renderers: Mapping[str, Renderer],
        before: Mapping[str, np.ndarray],
    ) -> dict[str, dict[str, Any]]:
        """Compares one frame under each policy with its reference; figures by policy.

        `before` has the pictures of the frame before, none for frame 0. A frame that is not among those compared is
        one at which something changes at once: of it there is the part of darkened pixels alone. Pictures are written
        of key frames.
        """
        first = self.options.policies[0]
        renderer, result = renderers[first], results[first]
        wanted = renderer.picture(result, self.reference.published(result.frame, self._looked_at(result)))
        if self.exposure is None:
            self.exposure = exposure_for(wanted)
        straight = straight_light(renderer, result)
        self.seen = seen = Seen(mapped=wanted - straight, straight=straight, counted=counted_pixels(straight, wanted))
        figures: dict[str, dict[str, Any]] = {name: {} for name in results}
        for name, image in before.items():
            figures[name]["darkened"] = darkened(results[name].image, image, straight, seen.mapped, seen.counted)
        if result.frame in self.options.compared:
            if self.noise is None:
                self.noise = self._noise(renderer, result, seen)
            for name, shown in results.items():
                figures[name] |= self._measures(shown.image, seen)
            self._show(results, renderers, wanted, figures)
        return figures

    def _measures(self, image: np.ndarray, seen: Seen) -> dict[str, Any]:
        """The figures of one picture, (H, W, 3), that are means over pixels."""
        shown, mapped = (image - seen.straight)[seen.counted], seen.mapped[seen.counted]
        return {
            "error": error(shown, mapped),
            "energy": energy(shown, mapped),
            "relative_mse": relative_mse(shown, mapped),
            "counted": float(seen.counted.mean()),
        }

    def _show(
        self,
        results: Mapping[str, FrameResult],
        renderers: Mapping[str, Renderer],
        wanted: np.ndarray,
        figures: dict[str, dict[str, Any]],
    ) -> None:
        """Takes a compared frame into the film, and writes the pictures of a key frame; adds FLIP to its figures."""
        assert self.seen is not None
        frame, counted = results[self.options.full].frame, self.seen.counted
        if frame in self._film_frames:
            self._film.append(self._film_frame(results, wanted, counted))
        if frame in self.options.shown:
            for name, value in self._write(results, wanted, counted).items():
                figures[name]["flip"] = value
            full = self.options.full
            for quantity in QUANTITIES:
                place = self.folder / "maps" / f"{frame:04}"
                write_quantity(place, quantity, self.lightmaps, results[full], renderers[full].state)

    def _noise(self, renderer: Renderer, result: FrameResult, seen: Seen) -> float | None:
        """The reference's own E, from one of fewer rays and other random numbers, which differs by the noise of both.

        Taken to fall with the root of the number of rays; it falls faster, so this is rather too much.
        """
        rays = self.options.reference_rays
        fewer = max(rays // NOISE_RAYS, LEAST_RAYS)
        other = self._reference(fewer, 1).published(result.frame, self._looked_at(result))
        shown = renderer.picture(result, other) - seen.straight
        between = error(shown[seen.counted], seen.mapped[seen.counted])
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
