"""Sums what the rays of a texel bring, in fixed point: integer sums do not depend on the order in which rays return."""

import numpy as np

from lightloom.golden_model.numerics.floats import beyond_fixed, fixed64_to_float, float_to_fixed
from lightloom.golden_model.numerics.logarithm import half_octaves
from lightloom.golden_model.numerics.sample_spread import LUMINANCE_BITS, luminance

_LUMINANCE_SHIFT = 4
"""A contribution's luminance is added up in units of 4 of the accumulators' (and is the mean of four parts)."""


def beyond(contribution: np.ndarray, fraction: int) -> int:
    """How many contributions of rays (R, 3) float32 saturate, in any colour: light that gets lost."""
    return int(np.count_nonzero(beyond_fixed(contribution, fraction).any(axis=1)))


def accumulate(slot: np.ndarray, contribution: np.ndarray, slots: int, fraction: int) -> np.ndarray:
    """Contributions of rays (R, 3) float32 to accumulators `slot` (R,) of `slots`: their sums, (slots, 3) int64.

    Each contribution is rounded to `fraction` bits after the point, to nearest even, saturating at 32 bits (NaN is 0);
    the sums are exact. Hardware needs 32 + log2(rays a texel) bits.
    """
    total = np.zeros((slots, 3), dtype=np.int64)
    np.add.at(total, slot, float_to_fixed(contribution, fraction).astype(np.int64))
    return total


def luminance_sums(
    slot: np.ndarray, contribution: np.ndarray, slots: int, fraction: int
) -> tuple[np.ndarray, np.ndarray]:
    """Sums of the luminance of contributions and of its square, (slots,) int64 each; arguments as for `accumulate`.

    Of the rounded contributions: (r + 2 g + b) / 16, rounded down, saturating at 24 bits. The sums are exact; hardware
    needs 24 + log2(rays a texel) and 48 + log2(rays a texel) bits, 37 and 61 for 8192 rays.
    """
    fixed = float_to_fixed(contribution, fraction).astype(np.int64)
    value = (fixed[:, 0] + 2 * fixed[:, 1] + fixed[:, 2]) >> _LUMINANCE_SHIFT
    value = np.clip(value, 0, (1 << LUMINANCE_BITS) - 1)
    sums, squares = np.zeros(slots, dtype=np.int64), np.zeros(slots, dtype=np.int64)
    np.add.at(sums, slot, value)
    np.add.at(squares, slot, value * value)
    return sums, squares


def light_of(irradiance: np.ndarray, fraction: int) -> int:
    """Luminance of texels (M, 3) float32 together, in fixed point as contributions are; 32 + log2(M) bits."""
    return int(float_to_fixed(luminance(irradiance), fraction).sum(dtype=np.int64))


def brightness_of(irradiance: np.ndarray, fraction: int) -> int:
    """Luminance of texels (M, 3) float32 as a logarithm in half octaves, of all together."""
    return int(half_octaves(float_to_fixed(luminance(irradiance), fraction).astype(np.int64)).sum())


def irradiance(total: np.ndarray, fraction: np.ndarray | int) -> np.ndarray:
    """Accumulators (M, 3) int64 to float32, rounded once."""
    return np.asarray(fixed64_to_float(total, fraction))
