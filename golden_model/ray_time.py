"""A float32 distance t along a ray, as the integer distance of the box test, rounded down and up."""

import numpy as np

from golden_model.floats import float_multiply, quiet
from golden_model.formats import RAY_TIMES, SCALE_BIAS, TIME_BIAS, TIME_BITS

TIME_MAX = (1 << TIME_BITS) - 1
BELOW = 4
"""How far `low` lies below the rounded product: its float32 rounding is at most one at the greatest distance."""
ABOVE = 5
"""How far `high` lies above: one more, because the product is rounded down to an integer."""


@quiet
def ray_time(times: np.ndarray) -> np.ndarray:
    """RAY_TIME (N,) to RAY_TIMES (N,).

    The product t * rate (float32) in units of 2**-(scale - SCALE_BIAS), so that `low` <= distance <= `high`; both
    saturate at the ends of their range, which stand for everything beyond. A NaN gives the whole range.
    """
    product = float_multiply(times["t"], times["rate"])
    distance = floor_scaled(product, times["scale"].astype(np.int64) - SCALE_BIAS, TIME_BITS - 1) + TIME_BIAS
    nan = np.isnan(product)
    out = np.zeros(len(times), dtype=RAY_TIMES)
    out["low"] = np.where(nan, 0, np.maximum(distance - BELOW, 0))
    out["high"] = np.where(nan, TIME_MAX, np.minimum(distance + ABOVE, TIME_MAX))
    return out


def floor_scaled(x: np.ndarray, scale: np.ndarray, bits: int) -> np.ndarray:
    """float32 (N,) to floor(x * 2**scale) int64 (N,), saturated to `bits` bits and a sign; `scale` (N,) int64.

    `bits` is at most 24. Infinities saturate; of a NaN the result means nothing.
    """
    pattern = x.view(np.int32).astype(np.int64)
    exponent = (pattern >> 23) & 0xFF
    significand = np.where(exponent > 0, (pattern & 0x7FFFFF) | 0x800000, 0)
    signed = np.where(pattern < 0, -significand, significand)
    # x = signed * 2**(exponent - 150)
    shift = exponent - 150 + scale
    limit = 1 << bits
    # 24 bits shifted right by less than this do not fit any more, so nothing is ever shifted left.
    beyond = (shift > bits - 24) & (significand > 0)
    saturated = np.where(pattern < 0, -limit, limit - 1)
    return np.where(beyond, saturated, signed >> np.clip(-shift, 24 - bits, 31))
