"""The blend update: a running average that forgets ([0076] to [0078], claims 5 and 14)."""

import numpy as np

from golden_model.floats import canonical, float_add, float_divide, float_multiply
from golden_model.formats import BLEND, BLENDED, TEXEL_STATE

ALPHA_MIN = np.float32(0.10)
COUNT_MAX = 255
"""Where `count` stops, so that an average of the first samples can be as long as that."""
NUMBERS = 4096
"""The updates of a texel are numbered modulo NUMBERS."""


def blend(operands: np.ndarray) -> np.ndarray:
    """BLEND (N,) to BLENDED (N,): new = old + alpha * (sample - old), alpha = max(1 / (count + 1), alpha_min).

    Every operation rounds once, as the number units do. A texel that was never sampled (count 0) takes the sample as
    it is, whatever it held; so to drop an old value ([0077], claim 14) set its count to 0. `count` stops at 255.
    """
    count = operands["count"].astype(np.int64)
    updates = np.minimum(count + 1, COUNT_MAX)
    alpha = np.maximum(float_divide(np.ones(1, np.float32), (count + 1).astype(np.float32)), operands["alpha_min"])[
        :, None
    ]
    old, sample = operands["irradiance"], operands["sample"]
    moved = float_add(old, float_multiply(alpha, float_add(sample, old, subtract=True)))
    out = np.zeros(len(operands), dtype=BLENDED)
    out["irradiance"] = np.where((count == 0)[:, None], canonical(sample), moved)
    out["count"] = updates
    return out


def blend_texels(state: np.ndarray, texel: np.ndarray, sample: np.ndarray, alpha_min: np.float32, frame: int) -> None:
    """Blends samples (M, 3) into the texels (M,), all different, of `state` TEXEL_STATE (N,), in place."""
    assert state.dtype == TEXEL_STATE
    operands = np.zeros(len(texel), dtype=BLEND)
    before = state[texel]
    operands["irradiance"], operands["count"] = before["irradiance"], before["count"]
    operands["sample"], operands["alpha_min"] = sample, alpha_min
    result = blend(operands)
    before["irradiance"], before["count"] = result["irradiance"], result["count"]
    before["frame"] = frame % 65536
    before["number"] = (before["number"] + 1) % NUMBERS
    state[texel] = before
