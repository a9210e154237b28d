"""The variability map: where light varies, in bins of one or two bits ([0058], [0072], [0073], FIG. 13 and 14).

Three kinds of variation are binned by thresholds: across frames (`deviation` of the texel's state), within a frame (its
`spread`), and within the map (contrast to the neighbours). The highest bin counts. The map is then widened, so that it
errs towards more sampling, widened more where it has changed, and falls off in rings, so that sampling goes outward
from high variability ([0075]). Widening does not cross the border of a chart. All thresholds rise and fall together
with the noise of the maps, so that a stated share of the texels is high.
"""

import numpy as np

from lightloom.golden_model.engine.publishing.regions import regions_of
from lightloom.golden_model.engine.selection.neighbourhoods import Windows
from lightloom.golden_model.engine.selection.policy import SHARE, Policy
from lightloom.golden_model.numerics.floats import float_minmax, flush, quiet
from lightloom.golden_model.numerics.sample_spread import luminance
from lightloom.golden_model.tables.lightmap import Lightmaps

HIGH = 3
"""The highest bin; also what one bit stands for when it is set."""

ONE = 16
"""The scale at which the policy's thresholds count as they are."""
LEAST, MOST = ONE // 4, ONE * 16
"""Bounds of the scale."""


@quiet
def contrast_bins(
    values: np.ndarray, windows: Windows, thresholds: tuple[int, ...], region: np.ndarray | None = None
) -> np.ndarray:
    """How many of the thresholds, in 1/256, the contrast of irradiance (N, 3) to its neighbours exceeds: (N,) uint8.

    The contrast of two texels is the difference of their luminances over the larger one: no division is needed. Of
    the four neighbours the one with the highest counts; of a `region` (N,) its own texels alone.
    """
    bright = luminance(values)
    bins = np.zeros(len(bright), dtype=np.uint8)
    for pair in windows.pairs:
        if region is not None:
            inside = region[pair[0]] == region[pair[1]]
            pair = pair[0][inside], pair[1][inside]
        one, two = (bright[texel] for texel in pair)
        gap = flush(np.abs(flush(one - two)) * np.float32(256))
        larger = float_minmax(one, two, True)
        found = np.zeros(len(gap), dtype=np.uint8)
        for threshold in thresholds:
            found += gap > flush(larger * np.float32(threshold))
        for texel in pair:
            bins[texel] = np.maximum(bins[texel], found)
    return bins


class Variability:
    """The variability map of N texels, frame by frame; keeps the last frame's bins."""

    def __init__(self, lightmaps: Lightmaps, windows: Windows, policy: Policy):
        """The maps at rest."""
        self.windows, self.policy = windows, policy
        self.last = np.zeros(len(lightmaps.texels), dtype=np.uint8)
        """Bins of the last frame before they were widened, (N,) uint8."""
        self.scale = ONE
        """Factor of all thresholds, in 1/ONE, LEAST to MOST: a register."""
        regions = regions_of(lightmaps)
        self._region = regions.of_texel if policy.by_region else None
        self.by_region = regions.by_region()
        """The texels as they lie in memory, (N,) int64."""
        begins = np.diff(regions.of_texel[self.by_region], prepend=-1) != 0
        self._first, self._of_texel = np.flatnonzero(begins), np.cumsum(begins) - 1

    def measure(self, state: np.ndarray, values: np.ndarray | None, valid: np.ndarray) -> np.ndarray:
        """TEXEL_STATE (N,), irradiance shown (N, 3) float32 and `valid` (N,) to bins (N,) uint8, before widening.

        Without `values` contrast does not count. A single bit is 0 or HIGH.
        """
        policy = self.policy
        bins = np.zeros(len(state), dtype=np.uint8)

        def used(thresholds: tuple[int, int, int]) -> tuple[int, ...]:
            scaled = tuple(threshold * self.scale // ONE for threshold in thresholds)
            return scaled if policy.variability_bits == 2 else scaled[1:2]

        for wanted, name, thresholds in (
            (policy.across_frames, "deviation", policy.deviation_bins),
            (policy.within_frame, "spread", policy.spread_bins),
        ):
            if wanted:
                found = np.zeros(len(state), dtype=np.uint8)
                for threshold in used(thresholds):
                    found += state[name] >= threshold
                bins = np.maximum(bins, found)
        if policy.within_map and values is not None:
            bins = np.maximum(bins, contrast_bins(values, self.windows, used(policy.contrast_bins), self._region))
        if policy.variability_bits == 1:
            bins *= np.uint8(HIGH)
        bins[~valid] = 0
        return self._regional(bins, valid) if policy.by_region else bins

    def _regional(self, bins: np.ndarray, valid: np.ndarray) -> np.ndarray:
        """The highest bin of each region at all its texels."""
        highest = np.maximum.reduceat(bins[self.by_region], self._first)
        out = np.empty_like(bins)
        out[self.by_region] = highest[self._of_texel]
        out[~valid] = 0
        return out

    def widened(self, bins: np.ndarray) -> np.ndarray:
        """Bins (N,) of this frame to the map that selection reads, (N,) uint8; `last` becomes `bins`.

        Every bin reaches `dilation` texels further; where it differs from the last frame's by `guard_change` or more,
        the higher of the two reaches `guard` more; from there it falls by one a texel over `rings` texels.
        """
        policy, windows = self.policy, self.windows
        higher, lower = np.maximum(bins, self.last), np.minimum(bins, self.last)
        restless = np.where(higher - lower >= policy.guard_change, higher, np.uint8(0))
        self.last = bins
        out = windows.largest(bins, policy.dilation)
        out = np.maximum(out, windows.largest(restless, policy.dilation + policy.guard if policy.guard else 0))
        for _ in range(policy.rings):
            around = windows.largest(out)
            out = np.maximum(out, np.where(around > 0, around - np.uint8(1), np.uint8(0)))
        return out

    def adapt(self, high: int, known: int) -> None:
        """Moves the scale by an eighth towards `variability_share` of `known` texels in the highest bin, now `high`.

        Up above the share, down below half of it; two counters and one comparison a frame ([0072]: thresholds by the
        statistics of the values).
        """
        step = max(self.scale // 8, 1)
        if high * SHARE > known * self.policy.variability_share:
            self.scale = min(self.scale + step, MOST)
        elif 2 * high * SHARE < known * self.policy.variability_share:
            self.scale = max(self.scale - step, LEAST)

    def look(self, state: np.ndarray, values: np.ndarray | None, valid: np.ndarray) -> np.ndarray:
        """`measure` and `widened`, then `adapt`; all zero where the policy has no variability map."""
        if self.policy.variability_bits == 0:
            return np.zeros(len(state), dtype=np.uint8)
        out = self.widened(self.measure(state, values, valid))
        if self.policy.variability_share:
            known = valid & (state["count"] > 0)
            self.adapt(int(np.count_nonzero(known & (out == HIGH))), int(np.count_nonzero(known)))
        return out
