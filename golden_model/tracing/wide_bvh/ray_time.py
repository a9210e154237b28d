"""A float32 distance t along a ray, as the integer distance of the box test, rounded down and up."""

import numpy as np

from lightloom.golden_model.contract.formats import RAY_TIMES, SCALE_BIAS, TIME_BITS
from lightloom.golden_model.numerics.floats import float_multiply, quiet

TIME_MAX = (1 << TIME_BITS) - 1
BELOW = 4
"""How far `low` lies below the rounded product, whose float32 rounding is half a unit at the greatest distance."""
ABOVE = 5
"""How far `high` lies above: one more, because the product is rounded down to an integer."""
SIGNIFICAND = 24
"""Bits of a float32's significand."""


@quiet
def ray_time(times: np.ndarray) -> np.ndarray:
    """RAY_TIME (N,) to RAY_TIMES (N,).

    The product t * rate (float32) in units of 2**-(scale - SCALE_BIAS), so that `low` <= distance <= `high`; both
    saturate at the ends of their range, which stand for everything beyond. Where the product is infinite or a NaN, they
    are the whole range.
    """
    product = float_multiply(times["t"], times["rate"])
    low, high = both_ways(floor_scaled(product, times["scale"].astype(np.int64) - SCALE_BIAS, TIME_BITS - 1), TIME_BITS)
    unknown = ~np.isfinite(product)
    out = np.zeros(len(times), dtype=RAY_TIMES)
    out["low"], out["high"] = np.where(unknown, 0, low), np.where(unknown, TIME_MAX, high)
    return out


def both_ways(distance: np.ndarray, bits: int) -> tuple[np.ndarray, np.ndarray]:
    """A distance of `bits` bits with its sign, rounded down, to what lies safely below and above it, with the bias."""
    biased = distance + (1 << (bits - 1))
    return np.maximum(biased - BELOW, 0), np.minimum(biased + ABOVE, (1 << bits) - 1)


def floor_scaled(x: np.ndarray, scale: np.ndarray, bits: int) -> np.ndarray:
    """float32 (N,) to floor(x * 2**scale) int64 (N,), saturated to `bits` bits and a sign; `scale` (N,) int64.

    An infinity counts as 2**128; of a NaN the result means nothing.
    """
    pattern = x.view(np.int32).astype(np.int64)
    exponent = (pattern >> 23) & 0xFF
    significand = np.where(exponent > 0, (pattern & 0x7FFFFF) | 0x800000, 0)
    # x = significand * 2**(exponent - 150), with its sign.
    return floor_shifted(np.where(pattern < 0, -significand, significand), exponent - 150 + scale, bits, SIGNIFICAND)


def floor_shifted(signed: np.ndarray, shift: np.ndarray, bits: int, significand: int) -> np.ndarray:
    """floor(signed * 2**shift), saturated to `bits` bits and a sign, where `signed` is 0 or of `significand` bits.

    `bits` is at most `significand`; int64 (N,) throughout.
    """
    # Shifted by more than this the bits do not fit any more, so nothing is ever shifted left.
    most = bits - significand
    saturated = np.where(signed < 0, -(1 << bits), (1 << bits) - 1)
    return np.where((shift > most) & (signed != 0), saturated, signed >> np.clip(-shift, -most, 31))
