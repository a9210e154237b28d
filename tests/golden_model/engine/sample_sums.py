"""Sums of rays that bring samples which tests choose."""

import numpy as np

from lightloom.golden_model.contract.formats import SAMPLE_SUMS

FRACTION = 24
"""Bits after the point of their totals."""


def sums_of(sample: np.ndarray) -> np.ndarray:
    """SAMPLE_SUMS (M,) of samples (M, 3), rounded to FRACTION bits after the point, whose rays all bring the same."""
    out = np.zeros(len(sample), dtype=SAMPLE_SUMS)
    out["total"] = np.rint(np.asarray(sample, dtype=np.float64) * 2**FRACTION)
    return out
