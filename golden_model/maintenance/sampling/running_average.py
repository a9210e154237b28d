"""The blend update: a running average that forgets ([0076] to [0078], claims 5 and 14), and notices what changes."""

from dataclasses import dataclass

import numpy as np

from lightloom.golden_model.contract.formats import BLEND, BLENDED, TEXEL_STATE
from lightloom.golden_model.host.errors import InputError
from lightloom.golden_model.host.parameters import check, number
from lightloom.golden_model.numerics.floats import canonical, float_add, float_divide, float_multiply
from lightloom.golden_model.numerics.sample_spread import LARGEST, relative_deviation, running_deviation

ALPHA_MIN, ALPHA_HEAVY = np.float32(0.10), np.float32(0.5)
COUNT_MAX = 255
"""Where `count` stops."""
NUMBERS = 4096
"""The updates of a texel are numbered modulo NUMBERS."""
HEAVY_MAX = 7
"""The most updates that can be marked to weigh more."""
FACTOR_BITS = 4
"""Bits after the point of `Blending.notice_factor`."""


@dataclass(frozen=True, kw_only=True)
class Blending:
    """How a new sample weighs against the average, and when it counts as a sign of change."""

    alpha_min: np.float32 = number(ALPHA_MIN, 0.0, 1.0, "Smallest weight of a new sample.")
    alpha_heavy: np.float32 = number(ALPHA_HEAVY, 0.0, 1.0, "Smallest weight while the texel is marked `heavy`.")
    notice_factor: int = number(
        64, 0, 255, "A sample is noticed if it departs by more than notice_factor / 16 times the usual deviation …"
    )
    notice_floor: int = number(13, 0, LARGEST, "… plus notice_floor / 256 of the average …")
    notice_count: int = number(8, 1, 255, "… and the average is of so many samples at least.")

    def __post_init__(self) -> None:
        check(self, "blending")


def blend(operands: np.ndarray) -> np.ndarray:
    """BLEND (N,) to BLENDED (N,): new = old + alpha * (sample - old), alpha = max(1 / (count + 1), alpha_min).

    While `heavy` is not 0 it counts down and alpha is at least alpha_heavy. Every operation rounds once, as the number
    units do. A texel of which nothing is known (count 0) takes the sample as it is, whatever it held; so to drop an old
    value ([0077], claim 14) set its count to 0. `count` stops at COUNT_MAX.

    The deviation of the sample from the old average goes into the running mean of deviations, after it was compared
    with it: `noticed`. Without an old average the deviation is 0 and nothing is noticed.
    """
    count = operands["count"].astype(np.int64)
    heavy = operands["heavy"].astype(np.int64)
    alpha = np.maximum(float_divide(np.ones(1, np.float32), (count + 1).astype(np.float32)), operands["alpha_min"])
    alpha = np.where(heavy > 0, np.maximum(alpha, operands["alpha_heavy"]), alpha)[:, None]
    old, sample = operands["irradiance"], operands["sample"]
    moved = float_add(old, float_multiply(alpha, float_add(sample, old, subtract=True)))
    usual = operands["deviation"].astype(np.int64)
    latest = relative_deviation(old, sample)
    limit = operands["notice_factor"].astype(np.int64) * usual
    limit += operands["notice_floor"].astype(np.int64) << FACTOR_BITS
    known = count > 0
    out = np.zeros(len(operands), dtype=BLENDED)
    out["irradiance"] = np.where(known[:, None], moved, canonical(sample))
    out["count"] = np.minimum(count + 1, COUNT_MAX)
    out["heavy"] = np.maximum(heavy - 1, 0)
    out["noticed"] = known & (count >= operands["notice_count"]) & ((latest << FACTOR_BITS) > limit)
    out["deviation"] = np.where(known, running_deviation(usual, latest, count), 0)
    return out


def blend_texels(
    state: np.ndarray,
    texel: np.ndarray,
    sample: np.ndarray,
    blending: Blending,
    frame: int,
    spread: np.ndarray | int = 0,
) -> None:
    """Blends samples (M, 3) into the texels (M,), all different, of `state` TEXEL_STATE (N,), in place.

    `spread` (M,) is the spread of each sample's rays, as from `sample_spread.relative_spread`.
    """
    assert state.dtype == TEXEL_STATE
    operands = np.zeros(len(texel), dtype=BLEND)
    before = state[texel]
    for name in ("irradiance", "count", "heavy", "deviation"):
        operands[name] = before[name]
    for name in ("alpha_min", "alpha_heavy", "notice_factor", "notice_floor", "notice_count"):
        operands[name] = getattr(blending, name)
    operands["sample"] = sample
    result = blend(operands)
    for name in BLENDED.names or ():
        before[name] = result[name]
    before["frame"] = frame % 65536
    before["number"] = (before["number"] + 1) % NUMBERS
    before["spread"] = spread
    state[texel] = before


def drop(state: np.ndarray, texel: np.ndarray) -> None:
    """Forgets what is known of the texels (M,) of `state`, in place: their next sample is taken as it is ([0077])."""
    state["count"][texel] = 0


def mark_heavy(state: np.ndarray, texel: np.ndarray, updates: int) -> None:
    """The next `updates` (1 to HEAVY_MAX) samples of the texels (M,) of `state` weigh at least alpha_heavy ([0076])."""
    if not 1 <= updates <= HEAVY_MAX:
        raise InputError(f"heavy {updates}: must be 1 to {HEAVY_MAX}")
    state["heavy"][texel] = updates
