"""Blend and accumulation, against exact rational arithmetic and against the definition."""

import re
from dataclasses import replace
from fractions import Fraction
from typing import Any

import numpy as np
import pytest

from lightloom.golden_model.contract.formats import ONE_SAMPLE, TEXEL_BLEND, TEXEL_STATE
from lightloom.golden_model.engine.sampling.accumulate import accumulate, irradiance
from lightloom.golden_model.engine.sampling.running_average import Blending, blend_texels, drop, mark_heavy
from lightloom.golden_model.engine.sampling.texel_blend import texel_blend
from lightloom.golden_model.host.errors import InputError
from lightloom.golden_model.host.parameters import parameters
from lightloom.golden_model.numerics.floats import float_to_fixed
from lightloom.golden_model.scene.files.cornell_box import cornell_box
from lightloom.golden_model.scene.light_unit import fraction_bits
from tests import ROOT
from tests.golden_model.engine.sample_sums import FRACTION, sums_of

PATENT = Blending(alpha_min=np.float32(0.10))
"""What samples weigh at least by [0076]; by default they weigh less."""


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
    operands = np.zeros(1500, dtype=TEXEL_BLEND)
    operands["irradiance"] = rng.uniform(0, 50, (1500, 3))
    operands["total"] = rng.integers(0, 50 << 30, (1500, 3))
    operands["fraction"] = rng.integers(25, 32, 1500)
    operands["count"] = rng.choice([0, 1, 15, 16, 32, 40, 48, 80, 128, 144, 160, 176, 640, 4064, 4080, 4095], 1500)
    operands["heavy"] = rng.choice([0, 0, 1, 7], 1500)
    operands["alpha_min"] = rng.choice(np.array([0.1, 0.01, 0.5, 1.0, 0.0], dtype=np.float32), 1500)
    operands["alpha_heavy"] = rng.choice(np.array([0.05, 0.5, 1.0], dtype=np.float32), 1500)
    result = texel_blend(operands)
    for operand, out in zip(operands, result, strict=True):
        n = int(operand["count"])
        assert out["count"] == min(n + 16, 4095)
        assert out["heavy"] == max(int(operand["heavy"]) - 1, 0)
        alpha = max(rounded(Fraction(16, n + 16)), operand["alpha_min"])
        if operand["heavy"]:
            alpha = max(alpha, operand["alpha_heavy"])
        for old, total, new in zip(operand["irradiance"], operand["total"], out["irradiance"], strict=True):
            expected = sample = rounded(Fraction(int(total), 1 << int(operand["fraction"])))
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
        blend_texels(state, texel, sums_of(sample), FRACTION, PATENT, k)
    assert state["irradiance"][0] == pytest.approx(samples.mean(axis=0)[0], rel=1e-6)
    before = state["irradiance"].copy()
    blend_texels(state, texel, sums_of(before + np.float32(1)), FRACTION, PATENT, 70000)
    assert state["irradiance"] == pytest.approx(before + 0.1, rel=1e-6)
    assert state["count"][0] == 11 * 16
    assert state["frame"][0] == 70000 % 4096


def test_a_step_is_followed_within_22_updates_and_within_6_when_heavy() -> None:
    """Noise-free samples step from 1 to 3: what is left of the step is 0.9 a sample, or 0.5 while heavy, exactly.

    After heavy ones samples weigh as beside an average of three, then of four and so on.
    """
    for heavy, within in ((0, 22), (4, 6)):
        state, texel = np.zeros(1, dtype=TEXEL_STATE), np.zeros(1, dtype=np.int64)
        for _ in range(40):
            blend_texels(state, texel, sums_of(np.ones((1, 3), dtype=np.float32)), FRACTION, PATENT, 0)
        if heavy:
            mark_heavy(state, texel, heavy)
        left = 1.0
        for k in range(within):
            blend_texels(state, texel, sums_of(np.full((1, 3), 3, dtype=np.float32)), FRACTION, PATENT, 0)
            left *= 0.5 if k < heavy else 1 - 1 / (4 + k - heavy) if heavy else 0.9
            assert state["irradiance"][0] == pytest.approx([3 - 2 * left] * 3, rel=1e-6)
        assert left <= 0.1
        assert state["heavy"] == 0


def test_an_average_is_worth_two_samples_at_most_before_one_that_is_heavy() -> None:
    """Those after it weigh as they do beside an average of three; without it a twenty-second."""
    for heavy, weights in ((1, (1 / 2, 1 / 4, 1 / 5)), (0, (1 / 21, 1 / 22, 1 / 23))):
        state, texel = np.zeros(1, dtype=TEXEL_STATE), np.zeros(1, dtype=np.int64)
        state["count"], state["heavy"], state["irradiance"] = 20 * ONE_SAMPLE, heavy, 1
        missing = 1.0
        for weight in weights:
            sample = np.full((1, 3), 2, dtype=np.float32)
            blend_texels(state, texel, sums_of(sample), FRACTION, Blending(alpha_min=np.float32(0)), 0)
            missing *= 1 - weight
            # float32 rounds the weight and each step: a few parts in ten million.
            assert state["irradiance"][0] == pytest.approx([2 - missing] * 3, rel=1e-5)
        assert state["count"][0] == (5 if heavy else 23) * ONE_SAMPLE


class HalfFloatAverage:
    """The naive accumulator: the average is kept in binary16."""

    def __init__(self) -> None:
        self.value = np.zeros(3, dtype=np.float16)

    def update(self, sample: np.ndarray, alpha: float) -> None:
        self.value = (self.value + np.float32(alpha) * (sample - self.value)).astype(np.float16)


@pytest.mark.parametrize(("alpha", "reflected", "rounds"), [(0.1, 0.0, 150), (0.1, 0.8, 650), (0.02, 0.0, 650)])
def test_light_that_goes_off_and_on_comes_back(alpha: float, reflected: float, rounds: int) -> None:
    """float32 comes back to what it was; binary16 stops where a step is below half a unit in its last place.

    The samples are free of noise: a light, and `reflected` of what is held, as light that has been reflected is. The
    stuck error is up to 2**-11 / alpha, and each bounce adds its own: a per cent and more in the last two cases.
    """
    blending, texel = Blending(alpha_min=np.float32(alpha)), np.zeros(1, dtype=np.int64)
    state, half = np.zeros(1, dtype=TEXEL_STATE), HalfFloatAverage()
    light = 4.1 * (1 - reflected)
    for emitted in (light, 0.0, light):
        for _ in range(rounds):
            emission = np.full((1, 3), emitted, dtype=np.float32)
            met = sums_of(emission + np.float32(reflected) * state["irradiance"])
            blend_texels(state, texel, met, FRACTION, blending, 0)
            half.update(emission[0] + np.float32(reflected) * half.value.astype(np.float32), alpha)
        assert state["irradiance"][0] == pytest.approx([emitted / (1 - reflected)] * 3, rel=1e-5, abs=1e-4)
    short = 1 - float(half.value[0]) / 4.1
    assert short > (0.01 if alpha < 0.1 or reflected else 0.003), short


def test_updates_are_numbered_for_ever_and_counted_up_to_255_and_15_sixteenths() -> None:
    """So the runs of directions go on for ever; with the count as the number they would stop at one of them.

    The run after the last number's is the one that 0 would have had; but 0 stands for no update at all."""
    state, texel = np.zeros(1, dtype=TEXEL_STATE), np.zeros(1, dtype=np.int64)
    state["number"], state["count"] = 4090, 250 * 16
    numbers, counts = [], []
    for _ in range(10):
        numbers.append(int(state["number"][0]))
        counts.append(int(state["count"][0]))
        blend_texels(state, texel, sums_of(np.ones((1, 3), dtype=np.float32)), FRACTION, Blending(), 0)
    assert numbers == [4090, 4091, 4092, 4093, 4094, 4095, 2048, 2049, 2050, 2051]
    assert counts == [4000, 4016, 4032, 4048, 4064, 4080, 4095, 4095, 4095, 4095]
    drop(state, texel)
    assert (state["count"], state["number"]) == (0, 2052)
    blend_texels(state, texel, sums_of(np.full((1, 3), 9, dtype=np.float32)), FRACTION, Blending(), 0)
    assert state["irradiance"].tolist() == [[9, 9, 9]]
    assert (state["count"], state["number"]) == (16, 2053)


def test_a_change_is_noticed_and_noise_is_not() -> None:
    """Samples with 10 % noise: at most three in a thousand are noticed; most are when light is halved."""
    seed, texels = 21, 2000
    rng = np.random.default_rng(seed)
    state, texel = np.zeros(texels, dtype=TEXEL_STATE), np.arange(texels)

    def update(level: float) -> float:
        sample = level * np.repeat(rng.normal(1, 0.1, (texels, 1)), 3, axis=1).astype(np.float32)
        blend_texels(state, texel, sums_of(sample), FRACTION, Blending(), 0)
        return float(state["noticed"].mean())

    early = [update(5) for _ in range(8)]
    assert not any(early), "an average of less than notice_count samples is no measure"
    calm = [update(5) for _ in range(60)]
    assert np.mean(calm) < 3e-3, f"seed {seed}"
    # The mean of |normal| is 0.8 of its deviation; the average's own noise adds a little.
    assert state["deviation"].mean() / 256 == pytest.approx(0.1 * 0.82, rel=0.05), f"seed {seed}"
    assert update(2.5) > 0.8, f"seed {seed}"
    assert update(2.5) < 0.2, "noticed is of the last sample alone; the deviation has risen"


@pytest.mark.parametrize(
    "wrong",
    [
        {"alpha_min": 1.5},
        {"alpha_min": float("nan")},
        {"alpha_heavy": -0.1},
        {"notice_factor": 256},
        {"notice_floor": 4096},
        {"notice_count": 0},
    ],
)
def test_settings_out_of_range_are_refused(wrong: dict[str, Any]) -> None:
    with pytest.raises(InputError, match=next(iter(wrong))):
        Blending(**wrong)
    for updates in (0, 8):
        with pytest.raises(InputError, match="heavy"):
            mark_heavy(np.zeros(1, dtype=TEXEL_STATE), np.zeros(1, dtype=np.int64), updates)


def test_the_page_has_every_setting_with_its_default_and_range() -> None:
    table = (ROOT / "docs" / "update.md").read_text(encoding="utf-8").split("| parameter of `Blending` |")[1]
    rows = re.findall(r"^\| `(\w+)` \| ([^|]+) \| ([^|]+) to ([^|]+) \|$", table.split("\n\n")[0], re.MULTILINE)
    assert rows == [
        (each.name, *(f"{value:g}" for value in (each.default, *(each.range or ()))))
        for each in parameters(Blending).values()
    ]


def test_dropped_texels_take_the_sample_whatever_they_held() -> None:
    operands = np.zeros(1, dtype=TEXEL_BLEND)
    operands["irradiance"] = [np.nan, np.inf, -3e38]
    operands["total"] = [1, 2, 2**44 - 1]
    assert texel_blend(operands)["irradiance"].tolist() == [[1, 2, 2.0**44]]


def test_only_the_chosen_texels_change() -> None:
    state = np.zeros(5, dtype=TEXEL_STATE)
    blend_texels(state, np.array([3, 1]), sums_of(np.ones((2, 3), dtype=np.float32)), FRACTION, Blending(), 4)
    assert state["count"].tolist() == [0, 16, 0, 16, 0]
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


def test_headroom_follows_the_brightest_light_and_the_kind_of_rays() -> None:
    """64 times the brightest emission fits into one contribution; without balance there is 16 times the room."""
    for emission in (1.0, 1000.0, 1e-3):
        scene = replace(cornell_box(), emission=cornell_box().emission * np.float32(emission))
        brightest = float(scene.emission.max())
        for balanced, room in ((True, 64), (False, 1024)):
            largest = 2.0 ** (31 - fraction_bits(scene, balanced))
            assert room * brightest <= largest <= 2 * room * brightest
