"""The compiled twin of `Smoother.smoothed`, in all bits. Needs numba; NumPy's passes remain the definition.

It goes over the texels that matter alone, and holds what it knows of them in their order: those asked for come first,
then the ones around them that the first pass changes, then those that its means look at, then those of which these are
made. So what a step needs is a beginning of that order.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from lightloom.golden_model.contract.formats import COUNT_BITS, ONE_SAMPLE
from lightloom.golden_model.engine.publishing.smoothing import (
    FRESH_MASS,
    HOLE_MASS,
    HOLE_NOISE,
    KNOWN,
    KNOWN_CARE,
    LEAST_DIFFERENCE,
    MOST_LIGHT,
    SHARES,
    WEIGHT_BITS,
    WEIGHTS,
    Smoother,
)
from lightloom.golden_model.engine.sampling.confidence import STALE
from lightloom.golden_model.tables.filters import VALUE_BITS
from lightloom.golden_model.tables.lightmap import Lightmaps
from lightloom.golden_model.tracing.compiled import cached, compiled

_EIGHTHS = np.array(WEIGHTS)
_SIXTEENTHS = np.array(SHARES)
_FRACTION = (1 << 52) - 1
_ROOT = (181 - 128) << 45
"""181 / 128 in the fraction of a float64."""


class CompiledSmoother(Smoother):
    """A `Smoother` that gives the same bits, some ten times as fast on one thread."""

    def __init__(self, lightmaps: Lightmaps, run: Callable[[Callable[[slice], None], int], None]):
        """`run` has a work done on all slices of a number of texels."""
        super().__init__(lightmaps)
        self._run = run

    def smoothed(self, value: np.ndarray, state: np.ndarray, texel: np.ndarray) -> np.ndarray:
        """As `Smoother.smoothed`."""
        out = np.empty((len(texel), 3), dtype=np.float32)
        known = [state[field] for field in ("count", "spread", "deviation")]
        self._run(
            lambda part: smooth(value, *known, self.beside[1], self.beside[2], texel[part], out[part]), len(texel)
        )
        return out


@compiled
def half_octaves(number: Any) -> Any:
    """As `numerics.logarithm.half_octaves`, of one number: read off its bits as a float64."""
    pattern = np.float64(max(number, 1)).view(np.int64)
    return 2 * ((pattern >> 52) - 1023) + (1 if pattern & _FRACTION >= _ROOT else 0)


@compiled
def in_half(value: Any) -> Any:
    """Light in 2**-24 that float32 holds, not negative, rounded to binary16, in 2**-24 again."""
    octave: Any = (np.float64(value).view(np.int64) >> 52) - 1023
    coarse: Any = max(octave - 10, 0)  # subnormals have the unit of 2**-24
    return np.int64(np.rint(value * np.int64((1023 - coarse) << 52).view(np.float64))) << coarse


@compiled
def luminance(light: Any) -> Any:
    """As `smoothing.luminance`, of light (3,)."""
    return (light[0] + 2 * light[1] + light[2]) >> 2


@compiled
def mass_of(count: Any) -> Any:
    """As `smoothing.mass_of`, of one texel."""
    if count == 0:
        return HOLE_MASS
    return (half_octaves(min(count, 16 * ONE_SAMPLE)) >> 1) - COUNT_BITS


@compiled
def noise_of(count: Any, spread: Any, deviation: Any, level: Any) -> Any:
    """As `smoothing.noise_of`, of one texel whose luminance is `level`."""
    relative, less = HOLE_NOISE, 0
    if count > 0:
        relative = spread * 5 >> 3
        if count >= 5 * ONE_SAMPLE:
            relative = deviation * 5 >> 2
        elif count >= 2 * ONE_SAMPLE:
            relative = max(relative, deviation * 5 >> 2)
        less = (half_octaves(min(count, 63 * ONE_SAMPLE)) - 2 * COUNT_BITS) >> 1
    if count >= KNOWN:
        less += KNOWN_CARE
    return half_octaves(relative) - 16 + half_octaves(level) - less


@compiled
def grown(which: Any, place: Any, first: Any, beside: Any) -> Any:
    """Puts what lies beside the `first` texels of `which` behind them, each once; returns how many there are then."""
    total = first
    for index in range(first):
        for k in range(beside.shape[1]):
            other = beside[which[index], k]
            if place[other] < 0:
                place[other] = total
                which[total] = other
                total += 1
    return total


@compiled
def refreshed(here: Any, value: Any, counts: Any, one: Any, two: Any, out: Any) -> None:
    """As `Smoother._refreshed`, of one texel: light (3,) in 2**-24."""
    for channel in range(3):
        out[channel] = int(float(value[here, channel]) * 2.0**VALUE_BITS)
    own = np.int64(counts[here])
    if own >= STALE:
        return
    for step in range(2):
        beside = one if step == 0 else two
        whole = np.int64(0)
        total, low, high = np.zeros(3, np.int64), np.full(3, MOST_LIGHT, np.int64), np.zeros(3, np.int64)
        for k in range(len(_SIXTEENTHS)):
            other = beside[here, k]
            count = np.int64(counts[other])
            if other == here or count < ONE_SAMPLE:
                continue
            weight = _SIXTEENTHS[k] << max(min(mass_of(count), FRESH_MASS), 0)
            whole += weight
            for channel in range(3):
                light = int(float(value[other, channel]) * 2.0**VALUE_BITS)
                total[channel] += weight * light
                low[channel], high[channel] = min(low[channel], light), max(high[channel], light)
        if whole > 0:
            for channel in range(3):
                if own > 0:
                    out[channel] = min(max(out[channel], low[channel]), high[channel])
                else:
                    mean = np.float32(total[channel]) * np.float32(2.0**-VALUE_BITS) / np.float32(whole)
                    out[channel] = in_half(float(mean) * 2.0**VALUE_BITS)
            return


@compiled
def mean_of(what: Any, here: Any, beside: Any, place: Any, texel: Any) -> Any:
    """As `Smoother._mean`, of the texel at `here`."""
    total = 4 * what[here]
    for k in range(len(_SIXTEENTHS)):
        total += _SIXTEENTHS[k] * what[place[beside[texel, k]]]
    return total >> 4


@compiled
def rounded(light: Any, total: Any) -> Any:
    """Light and what is added to it, rounded."""
    return in_half(float(np.float32((light << WEIGHT_BITS) + total)) * 2.0**-WEIGHT_BITS)


@compiled
def moved(
    here: Any, texel: Any, beside: Any, place: Any, light: Any, mass: Any, level: Any, noise: Any, out: Any
) -> Any:
    """As `Smoother._pass`, of the texel at `here`: its light (3,) after it into `out`; returns the weights' sum."""
    red, green, blue = light[here]
    more_red, more_green, more_blue, taken = 0, 0, 0, 0
    for k in range(len(_SIXTEENTHS)):
        other = beside[texel, k]
        if other == texel:
            continue
        there = place[other]
        over = half_octaves(abs(level[here] - level[there])) - max(noise[here], noise[there]) - LEAST_DIFFERENCE
        eighths = _EIGHTHS[min(max(over, 0), len(_EIGHTHS) - 1)]
        weight = (eighths * _SIXTEENTHS[k] << WEIGHT_BITS - 7) >> max(mass[here] - mass[there], 0)
        taken += weight
        more_red += weight * (light[there, 0] - red)
        more_green += weight * (light[there, 1] - green)
        more_blue += weight * (light[there, 2] - blue)
    out[0], out[1], out[2] = rounded(red, more_red), rounded(green, more_green), rounded(blue, more_blue)
    return taken


@cached
def smooth(
    sources: Any,  # left out by callers: `cached` says why
    value: Any,  # float32 (N, 3)
    counts: Any,  # uint16 (N,), as the next two of TEXEL_STATE
    spreads: Any,
    deviations: Any,
    one: Any,  # int64 (N, 8): what is beside each texel, at a distance of one and of two
    two: Any,
    texel: Any,  # int64 (M,), each once
    out: Any,  # float32 (M, 3)
) -> None:
    """Writes into `out` what texels show."""
    place = np.full(len(value), -1, np.int32)
    which = np.empty(len(value), np.int64)
    asked = len(texel)
    for index in range(asked):
        which[index], place[texel[index]] = texel[index], index
    first = grown(which, place, asked, two)
    near = grown(which, place, first, one)
    around = grown(which, place, near, one)

    light = np.empty((around, 3), np.int64)
    level, mass, noise = np.empty(around, np.int64), np.empty(around, np.int64), np.empty(around, np.int64)
    for here in range(around):
        at = which[here]
        refreshed(at, value, counts, one, two, light[here])
        level[here] = luminance(light[here])
        mass[here] = mass_of(np.int64(counts[at]))
        noise[here] = noise_of(np.int64(counts[at]), np.int64(spreads[at]), np.int64(deviations[at]), level[here])

    mean_level, mean_noise = np.empty(near, np.int64), np.empty(near, np.int64)
    for here in range(near):
        mean_level[here] = mean_of(level, here, one, place, which[here])
        mean_noise[here] = mean_of(noise, here, one, place, which[here])

    passed, passed_level, passed_noise = np.empty((first, 3), np.int64), np.empty(first, np.int64), noise[:first].copy()
    for here in range(first):
        taken = moved(here, which[here], one, place, light, mass, mean_level, mean_noise, passed[here])
        passed_level[here] = luminance(passed[here])
        passed_noise[here] -= (15 * taken + (1 << 14)) >> 15

    last = np.empty(3, np.int64)
    for here in range(asked):
        moved(here, which[here], two, place, passed, mass, passed_level, passed_noise, last)
        for channel in range(3):
            out[here, channel] = np.float32(float(last[channel]) * 2.0**-VALUE_BITS)
