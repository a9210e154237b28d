"""What a texel's samples tell about themselves: how far they lie apart across frames, and within one ([0058], [0073]).

Both figures are relative to the light that is there, in 1/256ths, and stop at 4095 (sixteen times as much). They are of
the luminance (r + 2 g + b) / 4, whose weights need no multiplier: what matters is that a change of any channel shows.
"""

from collections.abc import Sequence

import numpy as np

from lightloom.golden_model.numerics.floats import float_add, float_divide, float_multiply, float_sqrt, float_to_fixed
from lightloom.golden_model.numerics.vectors import dot

RELATIVE_BITS = 8
"""Bits after the point of `deviation` and `spread`."""
LARGEST = 4095
"""Where `deviation` and `spread` stop: 12 bits."""
MEMORY_BITS = 3
"""The running mean of the deviation forgets with weight 2**-MEMORY_BITS."""
LUMINANCE_BITS = 24
"""Width of a contribution's luminance as `luminance_sums` adds it up, so that a float32 multiplier squares it."""
_WEIGHTS = np.array([0.25, 0.5, 0.25], dtype=np.float32)


def luminance(rgb: np.ndarray) -> np.ndarray:
    """(N, 3) float32 to (N,): ((r / 4) + (g / 2)) + (b / 4), two roundings."""
    return dot(rgb, _WEIGHTS)


def relative_deviation(old: np.ndarray, sample: np.ndarray) -> np.ndarray:
    """|sample - old| over old, in luminance: (N, 3) and (N, 3) float32 to (N,) int64, 0 to LARGEST in 1/256ths.

    Where nothing was (old is 0) any light is LARGEST, and none is 0.
    """
    before, after = luminance(old), luminance(sample)
    distance = np.abs(float_add(after, before, subtract=True))
    fixed = float_to_fixed(float_divide(distance, before), RELATIVE_BITS).astype(np.int64)
    return np.clip(fixed, 0, LARGEST)


def running_deviation(deviation: np.ndarray, latest: np.ndarray, count: np.ndarray) -> np.ndarray:
    """The running mean after one more deviation: (N,) integers 0 to LARGEST, (N,) int64.

    `count` (N,), 1 to 255, is the number of samples in the average that the sample was compared with. The weight of the
    latest is 2**-s: s = 0 for the first deviation (count 1), 1 up to the third, 2 up to the seventh, then MEMORY_BITS.
    The step is rounded away from zero, so that the mean never stops short of where it is going: an integer mean that
    rounds to nearest would stay up to four 256ths off, and never return to 0 when the light has come to rest.
    """
    shift = np.zeros(len(deviation), dtype=np.int64)
    for threshold in (2, 4, 8):
        shift += count >= threshold
    difference = latest - deviation
    magnitude = (np.abs(difference) + (1 << shift) - 1) >> shift
    return deviation + np.where(difference < 0, -magnitude, magnitude)


def relative_spread(groups: Sequence[tuple[np.ndarray, np.ndarray, np.ndarray | int]]) -> np.ndarray:
    """Standard error of an update's sample over the sample: (M,) int64, 0 to LARGEST in 1/256ths.

    The sample is the sum of the contributions of several groups of rays (those over the hemisphere, those to lights).
    `groups` holds for each the sums of luminance and of its square, (M,) int64 as from `accumulate.luminance_sums`,
    and the number n of its rays, 1 or more ((M,) or one for all), those that brought nothing included. Were the rays
    independent, n / (n - 1) * (squares - sum**2 / n) would estimate the variance of a group's sum without bias; as they
    are stratified this is an upper estimate. A group of one ray says nothing and counts as 0, so does a dark sample.
    """
    texels = len(groups[0][0])
    variance, total = np.zeros(texels, dtype=np.float32), np.zeros(texels, dtype=np.int64)
    for sums, squares, rays in groups:
        count = np.broadcast_to(np.asarray(rays), texels)
        n = count.astype(np.float32)
        summed = sums.astype(np.float32)
        about_mean = float_add(
            squares.astype(np.float32), float_divide(float_multiply(summed, summed), n), subtract=True
        )
        factor = np.where(count > 1, float_divide(n, (count - 1).astype(np.float32)), np.float32(0))
        variance = float_add(variance, float_multiply(np.maximum(about_mean, np.float32(0)), factor))
        total += sums
    relative = float_divide(float_sqrt(variance), total.astype(np.float32))
    return np.clip(float_to_fixed(relative, RELATIVE_BITS).astype(np.int64), 0, LARGEST)
