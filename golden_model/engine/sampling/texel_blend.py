"""The blend update: a running average that forgets ([0076] to [0078], claims 5 and 14), and notices what changes."""

import numpy as np

from lightloom.golden_model.contract.formats import (
    COUNT_BITS,
    COUNT_MAX,
    NOTICE_BITS,
    ONE_SAMPLE,
    RAY_GROUPS,
    TEXEL_BLENDED,
)
from lightloom.golden_model.engine.sampling.accumulate import irradiance
from lightloom.golden_model.numerics.floats import float_add, float_divide, float_minmax, float_multiply
from lightloom.golden_model.numerics.sample_spread import (
    relative_departure,
    relative_spread,
    running_bias,
    running_mean,
)


def texel_blend(operands: np.ndarray) -> np.ndarray:
    """TEXEL_BLEND (N,) to TEXEL_BLENDED (N,): new = old + a * (sample - old), a = max(1 / (n + 1), alpha_min).

    The old average is worth n samples; `count` holds n in 16ths.

    The sample is what the rays have brought in all (`accumulate.irradiance`), its spread is theirs. While `heavy` is
    not 0 it counts down and a is at least alpha_heavy. Every operation rounds once, as the number units do. A texel of
    which nothing is known (count 0) takes the sample as it is, whatever it held; so to drop an old value ([0077], claim
    14) set its count to 0. `count` stops at COUNT_MAX.

    The deviation of the sample from the old average goes into the running mean of deviations, after it was compared
    with it: `noticed`. Without an old average nothing is noticed; of one that is not worth a sample the deviation is 0.
    So with the departure, which has a sign, and its running mean, the bias.
    """
    old, sample = operands["irradiance"], irradiance(operands["total"], operands["fraction"][:, None])
    count, heavy, usual = (operands[name].astype(np.int64) for name in ("count", "heavy", "deviation"))
    known, whole = count > 0, count >> COUNT_BITS
    step = float_multiply(_alpha(operands)[:, None], float_add(sample, old, subtract=True))
    departure = relative_departure(old, sample)
    latest, bias = np.abs(departure), operands["bias"].astype(np.int64)
    limit = operands["notice_factor"].astype(np.int64) * usual
    limit += operands["notice_floor"].astype(np.int64) << NOTICE_BITS
    out = np.zeros(len(operands), dtype=TEXEL_BLENDED)
    out["irradiance"] = np.where(known[:, None], float_add(old, step), sample)
    out["count"] = np.minimum(count + ONE_SAMPLE, COUNT_MAX)
    out["heavy"] = np.maximum(heavy - 1, 0)
    out["noticed"] = known & (whole >= operands["notice_count"]) & ((latest << NOTICE_BITS) > limit)
    out["deviation"] = np.where(whole > 0, running_mean(usual, latest, whole), 0)
    out["bias"] = np.where(whole > 0, running_bias(bias, departure, whole, heavy), 0)
    sums, squares, rays = (operands[name] for name in ("sums", "squares", "rays"))
    out["spread"] = relative_spread([(sums[:, k], squares[:, k], rays[:, k]) for k in range(RAY_GROUPS)])
    return out


def _alpha(operands: np.ndarray) -> np.ndarray:
    """The weight of the sample, (N,) float32."""
    one = np.float32(ONE_SAMPLE)
    mean = float_divide(np.full(1, one), operands["count"].astype(np.float32) + one)
    alpha = float_minmax(mean, operands["alpha_min"], True)
    return np.where(operands["heavy"] > 0, float_minmax(alpha, operands["alpha_heavy"], True), alpha)
