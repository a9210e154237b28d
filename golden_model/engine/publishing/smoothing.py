"""Smooths what is read of the maps, by as much as each texel is uncertain; what is maintained stays as it was sampled.

A texel's average of a few samples is noisy, and the noise of neighbours is independent. Two passes over the texels of
a chart, with neighbours one and two texels away, take from each neighbour a part of its difference:

    out = I_p + sum of w_pq (I_q - I_p)

Weights are large where the two differ by no more than their noise explains, and small at edges of light. Among texels
that are known equally well they are the same in both directions, so light goes from one to the other and none is made
or lost; of two that are not, the better known one is moved less. Normalised weights lose the light of outliers
(Dammertz et al. 2010, "Edge-avoiding à-trous wavelet transform", with the variance-guided stops of Schied et al. 2017,
SVGF, are the models of this).

Before that, what has no sample takes the mean of the fresh texels beside it, or else of those two away, by how well
each is known. What is stale (`sampling.confidence`) is brought into the range of theirs, as history is in temporal
antialiasing (Karis 2014, "High Quality Temporal Supersampling"): at an edge of light, where both sides are near, it
keeps what it was. So a change of light is shown where one texel in nine has found it, and nothing turns black that knew
something.

Everything is whole numbers, for hardware: noise and differences are logarithms in half octaves, a weight is read from a
table of seven entries, and the sums are exact; a pass rounds each to float32 and then to binary16.
"""

from dataclasses import dataclass

import numpy as np

from lightloom.golden_model.contract.formats import COUNT_BITS, ONE_SAMPLE
from lightloom.golden_model.engine.sampling.confidence import STALE
from lightloom.golden_model.numerics.floats import fixed64_to_float, float_divide, float_to_half, half_to_float
from lightloom.golden_model.numerics.logarithm import half_octaves
from lightloom.golden_model.numerics.vectors import dot
from lightloom.golden_model.tables.filters import VALUE_BITS, in_fixed, to_half
from lightloom.golden_model.tables.lightmap import VALID, Lightmaps, joined, steps_of

STEPS = (1, 2)
"""Distance of the neighbours in each pass."""
REACH = sum(STEPS) + 1 + max(STEPS)
"""Texels at most from one that decide on what it becomes.

The first pass looks at means of 3 x 3 around both ends, and each of these may be stale."""
WEIGHTS = (8, 8, 7, 6, 4, 2, 0)
"""Eighths, for a difference in half octaves above the noise: up to LEAST_DIFFERENCE, then one more each."""
LEAST_DIFFERENCE = -2
WEIGHT_BITS = 13
"""Of a weight after the point: eighths by sixteenths, and 6 for how much better a texel is known."""
MOST_LIGHT = 1 << 16 + VALUE_BITS
"""More than any binary16 number, as light is held."""
HOLE_MASS = -2
"""Of a texel without samples, whose value comes from around it: a quarter of a sample."""
HOLE_NOISE = 128
"""Its relative noise in 256ths."""
FRESH_MASS = 2
"""What counts most of a fresh texel where one without a sample looks for its light: four samples."""
KNOWN = 15 * ONE_SAMPLE
"""Of an average: from here on smoothing has little to gain, and edges of light as small as noise to lose."""
KNOWN_CARE = 2
"""Half octaves by which its noise counts less than it is."""
ALIKE = np.float32(0.95)
"""Cosine of the normals of texels that are smoothed together."""
_NEIGHBOURS = [(dy, dx) for dy in (-1, 0, 1) for dx in (-1, 0, 1) if dy or dx]
SHARES = [(1 if dy else 2) * (1 if dx else 2) for dy, dx in _NEIGHBOURS]
"""Sixteenths: 1 2 1, 2 4 2, 1 2 1 with the texel itself."""


class Smoother:
    """The neighbours of all texels, and what smoothing makes of them. Made once a scene; tables of the hardware."""

    def __init__(self, lightmaps: Lightmaps):
        """Of lightmaps at rest: neighbours are valid texels that are joined, whose normals are `ALIKE`.

        Aslant they are joined by way of one of the two texels between.
        """
        number = np.arange(len(lightmaps.texels))
        _, width = steps_of(lightmaps)
        valid, normal = lightmaps.texels["state"] == VALID, lightmaps.texels["normal"]
        right, down = joined(lightmaps)

        def along(texel: np.ndarray, dy: int, dx: int) -> np.ndarray:
            """The texel beside each of (N,) in a row or a column, -1 where they are not joined."""
            step = width[np.maximum(texel, 0)] if dy else 1
            other = np.where(texel >= 0, texel + (dy + dx) * step, -1)
            first = np.minimum(texel, other)
            reached = (first >= 0) & (down if dy else right)[np.maximum(first, 0)]
            return np.where(reached & valid[np.clip(other, 0, len(valid) - 1)], other, -1)

        def beside(dy: int, dx: int) -> np.ndarray:
            ways = [((dy, 0), (0, dx)), ((0, dx), (dy, 0))] if dy and dx else [((dy, dx),)]
            ends = []
            for way in ways:
                end = np.where(valid, number, -1)
                for step in way:
                    end = along(end, *step)
                ends.append(end)
            other = np.where(ends[0] >= 0, ends[0], ends[-1])
            alike = dot(normal, normal[np.maximum(other, 0)]) > ALIKE
            return np.where((other >= 0) & alike, other, number)

        one = np.stack([beside(dy, dx) for dy, dx in _NEIGHBOURS], axis=1)
        two = np.stack([one[one[:, k], k] for k in range(len(_NEIGHBOURS))], axis=1)
        # The texel between belongs to both: nothing goes over what stands there.
        reached = (one != number[:, None]) & (two != one)
        self.beside = {1: one, 2: np.where(reached, two, number[:, None])}
        """By distance, the neighbours of each texel, (N, 8) int64: itself where there is none."""

    def around(self, texel: np.ndarray, step: int) -> np.ndarray:
        """Texels (M,) and their neighbours at a distance, each once."""
        return np.unique(np.concatenate([texel, self.beside[step][texel].reshape(-1)]))

    def smoothed(self, value: np.ndarray, state: np.ndarray, texel: np.ndarray) -> np.ndarray:
        """What texels (M,) show: (M, 3) float32 that binary16 holds.

        `value` is what all show without it, (N, 3) float32 that binary16 holds, `state` their TEXEL_STATE (N,). Only
        texels up to `REACH` away are looked at.
        """
        first = self.around(texel, STEPS[1])
        near = self.around(first, STEPS[0])
        field = self._field(value, state, self.around(near, 1))
        means = field.luminance.copy(), field.noise.copy()
        for what, mean in zip((field.luminance, field.noise), means, strict=True):
            mean[near] = self._mean(what, near)
        light, noise = self._pass(field, *means, first, STEPS[0])
        field.light[first], field.noise[first] = light, noise
        field.luminance[first] = _luminance(light)
        light, _ = self._pass(field, field.luminance, field.noise, texel, STEPS[1])
        return (light.astype(np.float64) * 2.0**-VALUE_BITS).astype(np.float32)

    def _field(self, value: np.ndarray, state: np.ndarray, texel: np.ndarray) -> "_Field":
        """What the passes look at, at texels (M,); elsewhere there is nothing of meaning."""
        count = len(value)
        field = _Field(np.zeros((count, 3), dtype=np.int64), *(np.zeros(count, dtype=np.int64) for _ in range(3)))
        light = self._refreshed(value, state, texel)
        field.light[texel], field.luminance[texel] = light, _luminance(light)
        field.mass[texel], field.noise[texel] = mass_of(state[texel]), noise_of(state[texel], light)
        return field

    def _refreshed(self, value: np.ndarray, state: np.ndarray, texel: np.ndarray) -> np.ndarray:
        """Light (M, 3) int64 in 2**-24 of texels (M,): that of `value`, or what is around where that is out of date."""
        out = in_fixed(value[texel])
        waiting = np.flatnonzero(state["count"][texel] < STALE)
        for step in STEPS:
            here, beside = texel[waiting], self.beside[step][texel[waiting]]
            fresh = (beside != here[:, None]) & (state["count"][beside] >= ONE_SAMPLE)
            found, known = fresh.any(axis=1), state["count"][here] > 0
            light = in_fixed(value[beside])
            bound, blank = found & known, found & ~known
            out[waiting[bound]] = _within(out[waiting[bound]], light[bound], fresh[bound])
            mass = np.minimum(mass_of(state[beside[blank]]), FRESH_MASS)
            weight = np.where(fresh[blank], np.array(SHARES) << np.maximum(mass, 0), 0)
            out[waiting[blank]] = _mean_of(light[blank], weight)
            waiting = waiting[~found]
        return out

    def _mean(self, what: np.ndarray, texel: np.ndarray) -> np.ndarray:
        """The weighted mean of each 3 x 3 of a quantity (N,), rounded down, at texels (M,)."""
        total = 4 * what[texel]
        for k, share in enumerate(SHARES):
            total += share * what[self.beside[1][texel, k]]
        return total >> 4

    def _pass(
        self, field: "_Field", level: np.ndarray, noise: np.ndarray, texel: np.ndarray, step: int
    ) -> tuple[np.ndarray, np.ndarray]:
        """Light (M, 3) and noise (M,) of texels (M,) after a pass; luminance and noise (N,) decide on the weights."""
        light, mass = field.light, field.mass
        total, taken = light[texel] << WEIGHT_BITS, np.zeros(len(texel), dtype=np.int64)
        for k, share in enumerate(SHARES):
            beside = self.beside[step][texel, k]
            over = half_octaves(np.abs(level[texel] - level[beside])) - np.maximum(noise[texel], noise[beside])
            eighths = np.array(WEIGHTS)[np.clip(over - LEAST_DIFFERENCE, 0, len(WEIGHTS) - 1)]
            weight = (eighths * share << WEIGHT_BITS - 7) >> np.maximum(mass[texel] - mass[beside], 0)
            weight[beside == texel] = 0
            total += weight[:, None] * (light[beside] - light[texel])
            taken += weight
        # Three quarters from around leave 0.38 of the noise: 2.8 half octaves less.
        return _in_half(total), field.noise[texel] - ((15 * taken + (1 << 14)) >> 15)


@dataclass(frozen=True)
class _Field:
    """Of all texels, where they are looked at."""

    light: np.ndarray  # (N, 3) int64, in 2**-24
    luminance: np.ndarray  # (N,) int64, of it
    mass: np.ndarray  # (N,) int64: `mass_of`
    noise: np.ndarray  # (N,) int64: `noise_of`


def _within(light: np.ndarray, beside: np.ndarray, fresh: np.ndarray) -> np.ndarray:
    """Light (K, 3) brought into the range of what is `fresh` (K, 8) of the light (K, 8, 3) `beside`, by channel."""
    low = np.where(fresh[..., None], beside, MOST_LIGHT).min(axis=1)
    high = np.where(fresh[..., None], beside, 0).max(axis=1)
    return np.clip(light, low, high)


def _mean_of(beside: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """The mean (K, 3) of light (K, 8, 3) by weights (K, 8), not all zero, as binary16 holds it."""
    total = (weight[..., None] * beside).sum(axis=1)
    mean = float_divide(fixed64_to_float(total, VALUE_BITS), fixed64_to_float(weight.sum(axis=1)[:, None]))
    return in_fixed(half_to_float(float_to_half(mean)))


def _in_half(total: np.ndarray) -> np.ndarray:
    """Sums of light times weights, rounded to float32 and then to binary16, as light in 2**-24 again: int64."""
    return in_fixed(to_half(total, WEIGHT_BITS))


def mass_of(state: np.ndarray) -> np.ndarray:
    """How well texels are known: the logarithm of the number of their samples, at most 4, (N,) int64."""
    count = state["count"].astype(np.int64)
    return np.where(count > 0, (half_octaves(np.minimum(count, 16 * ONE_SAMPLE)) >> 1) - COUNT_BITS, HOLE_MASS)


def noise_of(state: np.ndarray, light: np.ndarray) -> np.ndarray:
    """The logarithm of what smoothing may change of texels' luminance, in half octaves, (N,) int64.

    That is its standard error: of few samples what the last one says of itself, of more what samples have differed by
    from their average. Of averages from `KNOWN` on it is half of that.
    """
    count, spread = state["count"].astype(np.int64), state["spread"].astype(np.int64) * 5 >> 3
    deviation = state["deviation"].astype(np.int64) * 5 >> 2
    known = np.where(count >= 2 * ONE_SAMPLE, np.maximum(deviation, spread), spread)
    relative = np.where(count >= 5 * ONE_SAMPLE, deviation, known)
    relative = np.where(count > 0, relative, HOLE_NOISE)
    samples = half_octaves(np.minimum(count, 63 * ONE_SAMPLE)) - 2 * COUNT_BITS
    less = (np.where(count > 0, samples, 0) >> 1) + KNOWN_CARE * (count >= KNOWN)
    return half_octaves(relative) - 16 + half_octaves(_luminance(light)) - less


def _luminance(light: np.ndarray) -> np.ndarray:
    """(r + 2 g + b) / 4 of light (N, 3), rounded down, (N,) int64."""
    return (light[:, 0] + 2 * light[:, 1] + light[:, 2]) >> 2
