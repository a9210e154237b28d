"""Makes the versions of the lightmaps that shaders read ([0084], [0085]): binary16, filled, with coarser levels.

A region of 8 x 8 texels is rewritten once in a frame, when the last of the updates that it shows has been blended; its
levels follow, then the levels above the regions. Without smoothing (`smoothing`), what is left alone has the bits that
publishing everything would give.
"""

from dataclasses import dataclass

import numpy as np

from lightloom.golden_model.contract.formats import PUBLISHED_TEXEL, TEXEL_STATE
from lightloom.golden_model.engine.publishing.filling import Filler, in_half
from lightloom.golden_model.engine.publishing.mipmaps import renew_levels
from lightloom.golden_model.engine.publishing.regions import regions_of
from lightloom.golden_model.engine.publishing.smoothing import Smoother
from lightloom.golden_model.numerics.floats import LARGEST_HALF, float_minmax, float_to_half, quiet
from lightloom.golden_model.tables.lightmap import Lightmaps, filled, part_of


@dataclass(frozen=True, kw_only=True)
class Difference:
    """What one frame's updates change in the published maps."""

    region: np.ndarray
    """Regions rewritten, (R,) int64, in the order in which they are complete."""
    ready: np.ndarray
    """Updates of the frame that have been blended when a region is complete, (R,) int64, ascending, at least 1."""
    texel: np.ndarray
    """Texels of the published maps that are written, all levels, (K,) int64, each once."""
    rgba: np.ndarray
    """Their new values, (K, 4) binary16."""


class Publisher:
    """Publishes the maps of one scene, all of them or what a frame has changed.

    Beside the tables of `Regions` it keeps a bit a texel (sampled or not) and a counter a map (valid texels that are
    not sampled).
    """

    def __init__(self, lightmaps: Lightmaps, smoother: Smoother | None = None):
        """With a `smoother` of the same lightmaps what is published is smoothed; the state never is."""
        self.lightmaps, self.smoother = lightmaps, smoother
        self.filler = Filler(lightmaps)
        self._plain = np.zeros((len(lightmaps.texels), 3), dtype=np.float32)  # what texels show without it
        self.regions = regions_of(lightmaps)
        self._note_samples(np.zeros(len(lightmaps.texels), dtype=np.bool_))

    def everything(self, state: np.ndarray) -> np.ndarray:
        """TEXEL_STATE (N,) to PUBLISHED_TEXEL (texels of all levels,)."""
        regions = self.regions
        self._note_samples(state["count"] > 0)
        published = np.zeros(regions.levels.total, dtype=PUBLISHED_TEXEL)
        self._plain = publish(self.lightmaps, state, self.filler)["rgba"][:, :3].astype(np.float32)
        published["rgba"][: len(state)] = self._values(state, np.arange(len(state)))
        renew_levels(regions, published["rgba"], np.arange(regions.count))
        return published

    def difference(self, before: np.ndarray, state: np.ndarray, texel: np.ndarray) -> Difference:
        """What turns the version `before` into the one that shows `state`.

        Without a smoother that is `everything(state)`, bit for bit. With one it is so in the regions that are written:
        those that show a texel named here. A region nearby keeps what it shows, though smoothing would find it changed
        a little, until a texel of its own changes.

        `before` is PUBLISHED_TEXEL (texels of all levels,) as this publisher made it last. `texel` (M,) names every
        texel whose state has changed since, in the order of the updates; naming others too only costs time.

        While a map has valid texels without a sample, all regions that show one are rewritten whenever the map is
        touched: their values depend on all samples around them (`filling`).
        """
        assert state.dtype == TEXEL_STATE
        place, region = self.regions.showing(texel)
        ready = np.zeros(self.regions.count, dtype=np.int64)
        np.maximum.at(ready, region, place + 1)
        unknown = self._count_samples(state, texel)
        ready[self._showing_unknown(unknown)] = len(texel)
        written = np.flatnonzero(ready)
        rgba = before["rgba"].copy()
        level0 = self.regions.texels(written)
        self._renew(state, texel, unknown)
        rgba[level0] = self._values(state, level0)
        changed = np.concatenate([level0, renew_levels(self.regions, rgba, written)])
        order = written[np.argsort(ready[written], kind="stable")]
        return Difference(region=order, ready=ready[order], texel=changed, rgba=rgba[changed])

    def _note_samples(self, sampled: np.ndarray) -> None:
        """Sets the bits and counters from whether each texel has a sample, (N,) bool."""
        regions = self.regions
        self._sampled = sampled
        maps = regions.object[regions.of_texel[regions.covered & ~sampled]]
        self._unknown = np.bincount(maps, minlength=len(self.lightmaps.width))

    def _count_samples(self, state: np.ndarray, texel: np.ndarray) -> np.ndarray:
        """Brings the bits and counters up to date; returns the maps that changed and have unsampled texels, (K,)."""
        texel = np.unique(texel[self.regions.covered[texel]])
        maps = self.regions.object[self.regions.of_texel[texel]]
        sampled = state["count"][texel] > 0
        np.add.at(self._unknown, maps, self._sampled[texel].astype(np.int64) - sampled)
        self._sampled[texel] = sampled
        touched = np.unique(maps)
        return touched[self._unknown[touched] > 0]

    def _showing_unknown(self, maps: np.ndarray) -> np.ndarray:
        """Regions of `maps` (K,) that show a texel without a sample."""
        found = [np.zeros(0, dtype=np.int64)]
        for part in self._parts(maps):
            fill = self.lightmaps.fill[part]
            found.append(self.regions.of_texel[part][(fill >= 0) & ~self._sampled[np.maximum(fill, 0)]])
        return np.unique(np.concatenate(found))

    def _renew(self, state: np.ndarray, texel: np.ndarray, unknown: np.ndarray) -> None:
        """Brings up to date what texels show without smoothing: those named (M,), and all of the maps `unknown`."""
        self._plain[texel] = in_half(state["irradiance"][texel])
        for number, part in zip(unknown.tolist(), self._parts(unknown), strict=True):
            whole = self.filler.fill(number, state["irradiance"][part], self._sampled[part], state["number"][part] > 0)
            self._plain[part] = in_half(whole)

    def _values(self, state: np.ndarray, texel: np.ndarray) -> np.ndarray:
        """Published values of texels of level 0 (M,): (M, 4) binary16."""
        fill = self.lightmaps.fill[texel]
        shown = np.zeros(len(state), dtype=np.bool_)
        shown[fill] = True  # where -1 the last one too, which is not read
        source = np.flatnonzero(shown)
        place = np.empty(len(state), dtype=np.int32)
        place[source] = np.arange(len(source))
        value = self._plain[source] if self.smoother is None else self.smoother.smoothed(self._plain, state, source)
        rgba = _packed(value, state["count"][source] > 0)[place[fill]]
        return np.where((fill >= 0)[:, None], rgba, np.float16(0))

    def _parts(self, maps: np.ndarray) -> list[slice]:
        """Texels of level 0 of each of `maps`."""
        return [part_of(self.lightmaps, number) for number in maps.tolist()]


def apply(difference: Difference, published: np.ndarray) -> None:
    """Writes a difference into PUBLISHED_TEXEL (texels of all levels,)."""
    published["rgba"][difference.texel] = difference.rgba


def publish(lightmaps: Lightmaps, state: np.ndarray, filler: Filler | None = None) -> np.ndarray:
    """Level 0 alone: TEXEL_STATE (N,) to PUBLISHED_TEXEL (N,), irradiance in binary16, LARGEST_HALF at most.

    Texels that have not been sampled yet take a value from the sampled ones around them (`filling`), weight 0. Empty
    and buried texels repeat the texel that `fill` names, so that a bilinear read at a chart's border sees no black.
    """
    assert state.dtype == TEXEL_STATE
    sampled = state["count"] > 0
    value = state["irradiance"].copy()
    filler = Filler(lightmaps) if filler is None else filler
    for number in range(len(lightmaps.width)):
        part = part_of(lightmaps, number)
        if not sampled[lightmaps.fill[part][lightmaps.fill[part] >= 0]].all():
            value[part] = filler.fill(number, value[part], sampled[part], state["number"][part] > 0)
    out = np.zeros(len(state), dtype=PUBLISHED_TEXEL)
    out["rgba"] = filled(lightmaps, _packed(value, sampled))
    return out


@quiet
def _packed(value: np.ndarray, sampled: np.ndarray) -> np.ndarray:
    """Irradiance (M, 3) float32 and a weight (M,) bool to binary16 (M, 4)."""
    kept = float_minmax(value, LARGEST_HALF)
    return float_to_half(np.concatenate([kept, sampled[:, None].astype(np.float32)], axis=1))
