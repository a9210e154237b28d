"""What a texel's samples tell about themselves: how far they lie apart across frames, and within one ([0058], [0073]).

Both figures are relative to the light that is there, in 1/256ths, and stop at 4095 (sixteen times as much). They are of
the luminance (r + 2 g + b) / 4, whose weights need no multiplier: what matters is that a change of any channel shows.
"""

from collections.abc import Sequence

import numpy as np

from lightloom.golden_model.contract.formats import RELATIVE_BITS, RELATIVE_MAX
from lightloom.golden_model.numerics.floats import (
    fixed64_to_float,
    float_add,
    float_divide,
    float_minmax,
    float_multiply,
    float_sqrt,
    float_to_fixed,
)
from lightloom.golden_model.numerics.vectors import dot

MEMORY_BITS = 3
"""Running means of deviations and departures forget with weight 2**-MEMORY_BITS."""
SETTLED = 1 << MEMORY_BITS
"""From so many samples on running means have their full memory."""
LUMINANCE_BITS = 24
"""Width of a contribution's luminance as `luminance_sums` adds it up, so that a float32 multiplier squares it."""
_WEIGHTS = np.array([0.25, 0.5, 0.25], dtype=np.float32)


def luminance(rgb: np.ndarray) -> np.ndarray:
    """(N, 3) float32 to (N,): ((r / 4) + (g / 2)) + (b / 4), two roundings."""
    return dot(rgb, _WEIGHTS)


def relative_departure(old: np.ndarray, sample: np.ndarray) -> np.ndarray:
    """(sample - old) over old, in luminance: (N, 3) and (N, 3) float32 to (N,) int64, in 1/256ths up to RELATIVE_MAX.

    Where nothing was (old is 0) any light is RELATIVE_MAX, and none is 0.
    """
    before, after = luminance(old), luminance(sample)
    distance = np.abs(float_add(after, before, subtract=True))
    fixed = float_to_fixed(float_divide(distance, before), RELATIVE_BITS).astype(np.int64)
    magnitude = np.clip(fixed, 0, RELATIVE_MAX)
    return np.where(after < before, -magnitude, magnitude)


def running_mean(mean: np.ndarray, latest: np.ndarray, count: np.ndarray) -> np.ndarray:
    """The running mean of deviations, or of departures, after one more: (N,) integers up to RELATIVE_MAX, (N,) int64.

    `count` (N,), 1 to 255, is the number of samples in the average that the sample was compared with. The weight of the
    latest is 2**-s: s = 0 for the first one (count 1), 1 up to the third, 2 up to the seventh, then MEMORY_BITS.
    The step is rounded away from zero, so that the mean never stops short of where it is going: an integer mean that
    rounds to nearest would stay up to four 256ths off, and never return to 0 when the light has come to rest.
    """
    shift = _weight_bits(count)
    difference = latest - mean
    magnitude = (np.abs(difference) + (1 << shift) - 1) >> shift
    return mean + np.where(difference < 0, -magnitude, magnitude)


def running_bias(bias: np.ndarray, latest: np.ndarray, count: np.ndarray, heavy: np.ndarray) -> np.ndarray:
    """The running mean of departures from the average as it has become by the sample: (N,) int64, as `running_mean`.

    The average takes a part of the latest departure itself, so later samples will depart by less: by 1/2 where it was
    worth one sample or the new one weighs more (`heavy`), by 1/4 up to three samples, 1/8 up to seven; of more it is
    little. Without that the bias of a change would be remembered for longer than there is one.
    """
    mean = running_mean(bias, latest, count)
    taken = np.abs(mean) >> np.where(heavy > 0, 1, _weight_bits(count) + 1)
    taken[(count >= SETTLED) & (heavy == 0)] = 0
    return mean - np.where(mean < 0, -taken, taken)


def _weight_bits(count: np.ndarray) -> np.ndarray:
    """s of the weights 2**-s by the number of samples so far, (N,) int64."""
    shift = np.zeros(len(count), dtype=np.int64)
    for threshold in (2, 4, SETTLED):
        shift += count >= threshold
    return shift


def relative_spread(groups: Sequence[tuple[np.ndarray, np.ndarray, np.ndarray | int]]) -> np.ndarray:
    """Standard error of an update's sample over the sample: (M,) int64, 0 to RELATIVE_MAX in 1/256ths.

    The sample is the sum of the contributions of several groups of rays (those over the hemisphere, those to lights).
    `groups` holds for each the sums of luminance and of its square, (M,) integers as from `accumulate.luminance_sums`,
    and the number n of its rays, (M,) or one for all, those that brought nothing included. Were the rays independent,
    n / (n - 1) * (squares - sum**2 / n) would estimate the variance of a group's sum without bias; as they are
    stratified this is an upper estimate. A group of one ray, or of none, says nothing and counts as 0, so does a dark
    sample.
    """
    dark = np.zeros(len(groups[0][0]), dtype=np.float32)
    variance, total = dark, dark.astype(np.int64)
    for sums, squares, rays in groups:
        count = np.asarray(rays, dtype=np.int64)
        n, others = fixed64_to_float(count), fixed64_to_float(count - 1)
        summed = fixed64_to_float(sums)
        mean_of_squares = float_divide(float_multiply(summed, summed), n)
        about_mean = float_add(fixed64_to_float(squares), mean_of_squares, subtract=True)
        factor = np.where(count > 1, float_divide(n, others), np.float32(0))
        variance = float_add(variance, float_multiply(float_minmax(about_mean, dark, True), factor))
        total = total + sums.astype(np.int64)
    relative = float_divide(float_sqrt(variance), fixed64_to_float(total))
    return np.clip(float_to_fixed(relative, RELATIVE_BITS).astype(np.int64), 0, RELATIVE_MAX)
