"""What averages are worth at most by what their samples have shown: a tracking signal, as forecasts have.

Samples of light that is at rest depart from their average to either side alike. Where they keep departing to one side
the light has changed, by about the mean of their departures, though none of them was unusual. The mean over that of
their magnitudes is the signal of Trigg 1964, "Monitoring a forecasting system", and by it the weight of new samples is
raised (Trigg and Leach 1967, "Exponential smoothing with an adaptive response rate"). Texels of 3 x 3 decide together,
because one of them would need many updates to be sure.
"""

import numpy as np

from lightloom.golden_model.contract.formats import COUNT_MAX, ONE_SAMPLE
from lightloom.golden_model.engine.selection.neighbourhoods import Windows
from lightloom.golden_model.numerics.logarithm import half_octaves
from lightloom.golden_model.numerics.sample_spread import SETTLED

LEAST_WORTH = 2 * ONE_SAMPLE
"""No average comes to be worth less than two samples by it."""
_SQUARED = 25
"""In 16ths the square of 1.25: of noise the mean magnitude is 0.8 of the standard deviation."""


def most_worth(state: np.ndarray, windows: Windows) -> np.ndarray:
    """By TEXEL_STATE (N,): samples in 16ths, (N,) uint16; COUNT_MAX where nothing speaks against the average.

    Of the texels of each window whose averages are worth SETTLED samples or more, B is the sum of `bias`, D that of
    `deviation`, and K how many they are. Of noise alone B * B * K exceeds D * D about once in 500 times, three
    standard deviations. An average of samples whose standard deviation is 1.25 * D, off by B, is worth (1.25 D / B)**2
    of them; its root is taken in half octaves.
    """
    settled = state["count"] >= SETTLED * ONE_SAMPLE
    texels = windows.total(settled.astype(np.uint8))
    bias, usual = (
        np.abs(windows.total(state[name] * settled.astype(np.int32)).astype(np.int64)) for name in ("bias", "deviation")
    )
    off = np.flatnonzero(settled & (bias * bias * texels > usual * usual))
    power = np.maximum(half_octaves(usual[off]) - half_octaves(bias[off]), 0)
    most = np.full(len(state), COUNT_MAX, dtype=np.uint16)
    most[off] = np.clip(_SQUARED << power, LEAST_WORTH, COUNT_MAX)
    return most
