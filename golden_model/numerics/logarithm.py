"""Logarithms that need no multiplier: of whole numbers, in half octaves."""

import numpy as np


def half_octaves(number: np.ndarray) -> np.ndarray:
    """Twice the base-2 logarithm of whole numbers (N,) below 2**53, rounded down, int64; of what is below 1 it is 0.

    Twice the place of the top bit, and 1 more from 181 / 128 = 1.4140625 times that on: the square root of two in eight
    bits.
    """
    fraction, exponent = np.frexp(np.maximum(number, 1).astype(np.float64))
    return 2 * (exponent.astype(np.int64) - 1) + (fraction >= 181 / 256)
