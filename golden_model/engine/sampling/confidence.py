"""What averages are worth: less where light is expected to change, or seems to have changed ([0077], claim 14)."""

import numpy as np

from lightloom.golden_model.contract.formats import COUNT_BITS, ONE_SAMPLE, RELATIVE_BITS, WHOLE_CHANGE
from lightloom.golden_model.numerics.logarithm import half_octaves

STALE = ONE_SAMPLE // 4
"""What is worth less than this is stale: it is not shown where something fresh is near."""
LEAST_NOISE, MOST_NOISE = 1 << RELATIVE_BITS - 5, 1 << RELATIVE_BITS - 1
"""Bounds of a sample's noise, in 256ths."""
_UNIT_BITS = 2 * WHOLE_CHANGE + COUNT_BITS
"""No power of two below is less than 2**-_UNIT_BITS, so that all are whole in that unit."""


def lower(state: np.ndarray, expected: np.ndarray) -> np.ndarray:
    """Lowers what averages are worth where their light is about to change, `expected` (N,) as of `reach.texel_changes`.

    Of `state` TEXEL_STATE (N,), in place. An average of n samples of relative noise s has a variance of s * s / n; an
    expected change by the part x of the light adds x * x to it, as the process noise of a Kalman filter does, and
    leaves n / (1 + n * x * x / (s * s)). Rounded to nearest, and never to nothing unless x is all of it. s is what the
    rays of the last sample said (`spread`), 1/32 to 1/2. Everything is a whole number: 1 / (s * s) is a power of two.

    Returns the texels (M,) int64 that were worth STALE or more and are no longer.
    """
    texel = np.flatnonzero((expected > 0) & (state["count"] > 0))
    count, change = state["count"][texel].astype(np.int64), expected[texel].astype(np.int64)
    noise = np.clip(state["spread"][texel].astype(np.int64) * 5 >> 3, LEAST_NOISE, MOST_NOISE)
    # In 16ths of a sample the average is left with count / (1 + count * 2**power), or a 16th where that is less.
    power = 2 * (change - WHOLE_CHANGE) + 2 * RELATIVE_BITS - half_octaves(noise) - COUNT_BITS
    ratio = (1 << _UNIT_BITS) + (count << (power + _UNIT_BITS))
    left = np.maximum(((count << _UNIT_BITS + 1) + ratio) // (2 * ratio), 1)
    state["count"][texel] = np.where(change == WHOLE_CHANGE, 0, left)
    return texel[(count >= STALE) & (state["count"][texel] < STALE)]


def limit(state: np.ndarray, most: np.ndarray) -> None:
    """Nothing of TEXEL_STATE (N,) is worth more samples than `most` (N,) uint16 says in 16ths; in place."""
    np.minimum(state["count"], most, out=state["count"])
