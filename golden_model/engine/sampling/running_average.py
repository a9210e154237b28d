"""The states of texels, update by update, and how a sample weighs in them ([0076] to [0078], claims 5 and 14)."""

from dataclasses import dataclass

import numpy as np

from lightloom.golden_model.contract.formats import (
    FRAMES,
    ONE_SAMPLE,
    RELATIVE_MAX,
    SAMPLE_SUMS,
    TEXEL_BLEND,
    TEXEL_BLENDED,
    TEXEL_STATE,
)
from lightloom.golden_model.engine.sampling.texel_blend import texel_blend
from lightloom.golden_model.host.errors import InputError
from lightloom.golden_model.host.parameters import check, number

ALPHA_MIN, ALPHA_HEAVY = np.float32(1 / 16), np.float32(0.5)
NUMBERS = 4096
"""The updates of a texel are numbered from 0 to NUMBERS - 1, then from the middle on again: 0 says that there was none,
and the runs of the sequences, a power of two of them, go on in their order."""
HEAVY_MAX = 7
"""The most updates that can be marked to weigh more."""
HEAVY_WORTH = 2 * ONE_SAMPLE
"""What an average is worth at most before a sample that weighs more: it comes to hold the last few alone, and those
that follow have to weigh as much beside it as beside any average of few."""


@dataclass(frozen=True, kw_only=True)
class Blending:
    """How a new sample weighs against the average, and when it counts as a sign of change."""

    alpha_min: np.float32 = number(ALPHA_MIN, 0.0, 1.0, "Smallest weight of a new sample; [0076] names 0.10.")
    alpha_heavy: np.float32 = number(ALPHA_HEAVY, 0.0, 1.0, "Smallest weight while the texel is marked `heavy`.")
    notice_factor: int = number(
        64, 0, 255, "A sample is noticed if it departs by more than notice_factor / 16 times the usual deviation …"
    )
    notice_floor: int = number(13, 0, RELATIVE_MAX, "… plus notice_floor / 256 of the average …")
    notice_count: int = number(8, 1, 255, "… and the average is of so many samples at least.")

    def __post_init__(self) -> None:
        check(self, "blending")


def blend_texels(
    state: np.ndarray, texel: np.ndarray, sums: np.ndarray, fraction: int, blending: Blending, frame: int
) -> None:
    """Blends SAMPLE_SUMS (M,) into the texels (M,), all different, of `state` TEXEL_STATE (N,), in place.

    `fraction` is the number of bits after the point of the sums' totals.
    """
    assert state.dtype == TEXEL_STATE
    operands = np.zeros(len(texel), dtype=TEXEL_BLEND)
    before = state[texel]
    before["count"] = np.where(before["heavy"] > 0, np.minimum(before["count"], HEAVY_WORTH), before["count"])
    for name in ("irradiance", "count", "heavy", "deviation", "bias"):
        operands[name] = before[name]
    for name in SAMPLE_SUMS.names or ():
        operands[name] = sums[name]
    operands["fraction"] = fraction
    for name in ("alpha_min", "alpha_heavy", "notice_factor", "notice_floor", "notice_count"):
        operands[name] = getattr(blending, name)
    result = texel_blend(operands)
    for name in TEXEL_BLENDED.names or ():
        before[name] = result[name]
    before["frame"] = frame % FRAMES
    before["number"] = np.where(before["number"] < NUMBERS - 1, before["number"] + 1, NUMBERS // 2)
    state[texel] = before


def drop(state: np.ndarray, texel: np.ndarray) -> None:
    """Forgets what is known of the texels (M,) of `state`, in place: the next sample is taken as it is ([0077])."""
    state["count"][texel] = 0


def mark_heavy(state: np.ndarray, texel: np.ndarray, updates: int) -> None:
    """The next `updates` (1 to HEAVY_MAX) samples of the texels (M,) of `state` weigh at least alpha_heavy ([0076])."""
    if not 1 <= updates <= HEAVY_MAX:
        raise InputError(f"heavy {updates}: must be 1 to {HEAVY_MAX}")
    state["heavy"][texel] = updates
