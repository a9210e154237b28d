"""Blend and accumulation, against exact rational arithmetic and against the definition."""

from fractions import Fraction

import numpy as np
import pytest

from golden_model.accumulation import accumulate, irradiance
from golden_model.blend import Blending, blend, blend_texels
from golden_model.floats import float_to_fixed
from golden_model.formats import BLEND, TEXEL_STATE


def rounded(value: Fraction) -> np.float32:
    """A rational to the nearest float32, ties to even; for values in the normal range."""
    if value == 0:
        return np.float32(0)
    exponent = 0
    while abs(value) / Fraction(2) ** exponent >= 2**24:
        exponent += 1
    while abs(value) / Fraction(2) ** exponent < 2**23:
        exponent -= 1
    return np.float32(np.ldexp(float(round(value / Fraction(2) ** exponent)), exponent))


def test_blend_rounds_each_operation_once() -> None:
    seed = 5
    rng = np.random.default_rng(seed)
    operands = np.zeros(1500, dtype=BLEND)
    operands["irradiance"] = rng.uniform(0, 50, (1500, 3))
    operands["sample"] = rng.uniform(0, 50, (1500, 3))
    operands["count"] = rng.choice([0, 1, 2, 3, 5, 8, 9, 10, 11, 40, 254, 255], 1500)
    operands["alpha_min"] = rng.choice(np.array([0.1, 0.01, 0.5, 1.0, 0.0], dtype=np.float32), 1500)
    result = blend(operands)
    for operand, out in zip(operands, result, strict=True):
        n = int(operand["count"])
        assert out["count"] == min(n + 1, 255)
        alpha = max(rounded(Fraction(1, n + 1)), operand["alpha_min"])
        for old, sample, new in zip(operand["irradiance"], operand["sample"], out["irradiance"], strict=True):
            expected = sample
            if n:
                difference = rounded(Fraction(float(sample)) - Fraction(float(old)))
                step = rounded(Fraction(float(alpha)) * Fraction(float(difference)))
                expected = rounded(Fraction(float(old)) + Fraction(float(step)))
            assert new == expected, f"seed {seed}: {operand}"


def test_weight_is_the_mean_first_and_then_the_floor() -> None:
    """The mean of the first ten samples; afterwards a tenth of each new one ([0076])."""
    state = np.zeros(1, dtype=TEXEL_STATE)
    texel = np.zeros(1, dtype=np.int64)
    samples = np.random.default_rng(0).uniform(0, 9, (10, 1, 3)).astype(np.float32)
    for k, sample in enumerate(samples):
        blend_texels(state, texel, sample, Blending(), k)
    assert state["irradiance"][0] == pytest.approx(samples.mean(axis=0)[0], rel=1e-6)
    before = state["irradiance"].copy()
    blend_texels(state, texel, before + np.float32(1), Blending(), 70000)
    assert state["irradiance"] == pytest.approx(before + 0.1, rel=1e-6)
    assert state["count"][0] == 11
    assert state["frame"][0] == 70000 % 65536


def test_light_that_goes_off_and_on_comes_back() -> None:
    """float32 accumulators do not get stuck: after many updates the old light is gone, and then back."""
    state = np.zeros(1, dtype=TEXEL_STATE)
    texel = np.zeros(1, dtype=np.int64)
    for level, rounds in ((7.0, 50), (0.0, 300), (7.0, 300)):
        for _ in range(rounds):
            blend_texels(state, texel, np.full((1, 3), level, dtype=np.float32), Blending(), 0)
        assert state["irradiance"][0] == pytest.approx([level] * 3, rel=1e-6, abs=1e-9)


def test_dropped_texels_take_the_sample_whatever_they_held() -> None:
    operands = np.zeros(1, dtype=BLEND)
    operands["irradiance"] = [np.nan, np.inf, -3e38]
    operands["sample"] = [1, 2, 3e38]
    assert blend(operands)["irradiance"].tolist() == [[1, 2, np.float32(3e38)]]


def test_only_the_chosen_texels_change() -> None:
    state = np.zeros(5, dtype=TEXEL_STATE)
    blend_texels(state, np.array([3, 1]), np.ones((2, 3), dtype=np.float32), Blending(), 4)
    assert state["count"].tolist() == [0, 1, 0, 1, 0]
    assert state["frame"].tolist() == [0, 4, 0, 4, 0]


def test_accumulation_is_exact_and_free_of_order() -> None:
    seed = 11
    rng = np.random.default_rng(seed)
    value = (rng.uniform(0, 1, (4000, 3)) * np.exp2(rng.uniform(-30, 20, (4000, 1)))).astype(np.float32)
    value[::97] = np.nan
    slot = rng.integers(0, 40, 4000)
    for fraction in (0, 12, 31):
        total = accumulate(slot, value, 41, fraction)
        shuffled = rng.permutation(4000)
        assert (accumulate(slot[shuffled], value[shuffled], 41, fraction) == total).all(), f"seed {seed}"
        fixed = float_to_fixed(value, fraction)
        expected = [[sum(int(x) for x in fixed[slot == s, c]) for c in range(3)] for s in range(41)]
        assert total.tolist() == expected
        assert irradiance(total, fraction)[3, 1] == np.float32(expected[3][1] / 2**fraction)


def test_accumulation_saturates_a_contribution_not_the_sum() -> None:
    total = accumulate(np.zeros(3, dtype=int), np.full((3, 3), 1e9, dtype=np.float32), 1, 16)
    assert (total == 3 * (2**31 - 1)).all()
