"""Deviation across frames and spread within one, against exact arithmetic and against textbook estimators."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lightloom.golden_model.contract.formats import RELATIVE_MAX
from lightloom.golden_model.driver.rest import at_rest, settled
from lightloom.golden_model.engine.sampling.accumulate import brightness_of, light_of, luminance_sums
from lightloom.golden_model.numerics.sample_spread import (
    luminance,
    relative_departure,
    relative_spread,
    running_mean,
)

levels = st.floats(0, 1e6, width=32).filter(lambda x: x == 0 or x > 1e-30)


def grey(*values: float) -> np.ndarray:
    return np.repeat(np.array(values, dtype=np.float32)[:, None], 3, axis=1)


def test_luminance_weighs_the_channels_one_two_one() -> None:
    assert luminance(np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [3, 5, 7]], dtype=np.float32)).tolist() == [
        0.25,
        0.5,
        0.25,
        5,
    ]


@settings(max_examples=100, deadline=None, derandomize=True)
@given(old=levels, sample=levels)
def test_relative_deviation_is_the_exact_one_within_a_rounding(old: float, sample: float) -> None:
    found = abs(int(relative_departure(grey(old), grey(sample))[0]))
    if old == 0:
        assert found == (RELATIVE_MAX if sample else 0)
        return
    exact = abs(Fraction(sample) - Fraction(old)) / Fraction(old) * 256
    if exact >= RELATIVE_MAX + 1:
        assert found == RELATIVE_MAX
    else:
        assert abs(found - exact) <= Fraction(1) / 2 + exact / 2**21 + (exact > RELATIVE_MAX)


def test_any_channel_that_changes_shows() -> None:
    for channel in range(3):
        changed = np.ones((1, 3), dtype=np.float32)
        changed[0, channel] = 2
        assert relative_departure(np.ones((1, 3), dtype=np.float32), changed)[0] >= 64


@settings(max_examples=30, deadline=None, derandomize=True)
@given(start=st.integers(0, RELATIVE_MAX), goal=st.integers(0, RELATIVE_MAX))
def test_running_mean_goes_all_the_way_and_by_an_eighth(start: int, goal: int) -> None:
    value = np.array([start])
    for _ in range(60):
        step = running_mean(value, np.array([goal]), np.array([8]))
        assert abs(int(step[0]) - (int(value[0]) + (goal - int(value[0])) / 8)) < 1
        assert min(value[0], goal) <= step[0] <= max(value[0], goal)
        value = step
    assert value[0] == goal


def test_first_deviations_are_averaged_and_not_pulled_towards_zero() -> None:
    weight = [8 / 8, 4 / 8, 4 / 8, 2 / 8, 2 / 8, 2 / 8, 2 / 8, 1 / 8]
    for count, expected in enumerate(weight, 1):
        assert running_mean(np.array([0]), np.array([800]), np.array([count]))[0] == 800 * expected


def test_running_mean_of_noise_is_its_mean() -> None:
    seed = 4
    rng = np.random.default_rng(seed)
    value = np.zeros(4000, dtype=np.int64)
    for count in range(1, 60):
        value = running_mean(value, np.abs(rng.normal(0, 40, 4000)).astype(np.int64), np.full(4000, count))
    assert value.mean() == pytest.approx(40 * np.sqrt(2 / np.pi), rel=0.05), f"seed {seed}"


def sums_of(contribution: np.ndarray, fraction: int) -> tuple[np.ndarray, np.ndarray]:
    """Of contributions (texels, rays), grey."""
    texels, rays = contribution.shape
    slot = np.repeat(np.arange(texels), rays)
    return luminance_sums(slot, np.repeat(contribution.reshape(-1, 1), 3, axis=1), texels, fraction)


def test_spread_is_the_standard_error_of_the_sum_over_the_sum() -> None:
    seed = 8
    rng = np.random.default_rng(seed)
    indirect = rng.exponential(0.1, (300, 16)).astype(np.float32)
    light = rng.uniform(0, 0.5, (300, 4)).astype(np.float32)
    light[rng.random((300, 4)) < 0.3] = 0  # in shadow
    found = relative_spread([(*sums_of(indirect, 20), 16), (*sums_of(light, 20), 4)])
    wide, bright = indirect.astype(np.float64), light.astype(np.float64)
    variance = 16 * wide.var(axis=1, ddof=1) + 4 * bright.var(axis=1, ddof=1)
    expected = 256 * np.sqrt(variance) / (wide.sum(axis=1) + bright.sum(axis=1))
    assert found == pytest.approx(expected, abs=0.6), f"seed {seed}"


def test_spread_does_not_depend_on_the_order_of_the_rays_or_on_the_unit_of_light() -> None:
    rng = np.random.default_rng(9)
    contribution, slot = rng.exponential(1, (500, 3)).astype(np.float32), rng.integers(0, 30, 500)
    rays = np.bincount(slot, minlength=30)
    one = luminance_sums(slot, contribution, 30, 18)
    order = rng.permutation(500)
    two = luminance_sums(slot[order], contribution[order], 30, 18)
    assert (one[0] == two[0]).all()
    assert (one[1] == two[1]).all()
    brighter = luminance_sums(slot, contribution * np.float32(64), 30, 12)
    assert (relative_spread([(*one, rays)]) == relative_spread([(*brighter, rays)])).all()


def test_spread_of_equal_single_and_dark_rays_is_nothing() -> None:
    assert relative_spread([(*sums_of(np.full((1, 16), 0.3, dtype=np.float32), 20), 16)])[0] == 0
    assert relative_spread([(*sums_of(np.full((1, 1), 0.3, dtype=np.float32), 20), 1)])[0] == 0
    assert relative_spread([(*sums_of(np.zeros((1, 16), dtype=np.float32), 20), 16)])[0] == 0
    lone = np.zeros((1, 16), dtype=np.float32)
    lone[0, 3] = 1
    assert relative_spread([(*sums_of(lone, 20), 16)])[0] == 256, "one ray of sixteen: as uncertain as large"


def test_widths_of_the_sums_of_8192_glaring_rays() -> None:
    sums, squares = sums_of(np.full((1, 8192), 1e9, dtype=np.float32), 12)
    assert sums[0] == 8192 * (2**24 - 1) < 2**37
    assert squares[0] == 8192 * (2**24 - 1) ** 2 < 2**61


def test_light_has_settled_when_what_is_missing_is_a_thousandth() -> None:
    """Bounces in geometric progression: the rest is known from the last two rises."""
    for reflected in (0.3, 0.5, 0.8, 0.95):
        whole = 1 / (1 - reflected)
        totals: list[int] = []
        while not settled(totals):
            totals.append(int(2**30 * whole * (1 - reflected ** (len(totals) + 1))))
        missing = reflected ** len(totals)
        assert reflected * 2**-10 * 0.9 < missing < 2**-10 * 1.1
    assert not settled([])
    assert not settled([0, 0, 0]), "no light yet"
    assert not settled([1, 2, 4, 8]), "it still grows faster"
    assert settled([4, 5, 5])


def test_light_of_texels_is_their_luminance_in_fixed_point() -> None:
    assert light_of(np.array([[1, 2, 3], [0, 0, 4]], dtype=np.float32), 8) == 3 * 256


def test_a_dark_corner_counts_for_being_at_rest_as_a_bright_one_does() -> None:
    """A half octave in a few texels, or a sixty-fourth of one in each, whatever light there is beside them."""
    bright = np.full((900, 3), 1000, dtype=np.float32)
    dark = np.full((100, 3), 0.5, dtype=np.float32)
    before, after = (brightness_of(np.concatenate([bright, each]), 12) for each in (dark, dark * 2))
    assert after - before == 2 * 100
    assert brightness_of(np.zeros((7, 3), dtype=np.float32), 12) == 0
    assert not at_rest([before, after], 1000)
    assert not at_rest([before], 1000)
    assert at_rest([0, before, before + 60, before + 8], 1000)
    assert not at_rest([0, before + 61, before, before], 1000), "once is chance"
    assert not at_rest([before, before], 1000)
