"""Distances of t lie on the right side of the exact product, in float32 and exhaustively in narrow arithmetic."""

from fractions import Fraction
from typing import Any

import numpy as np
import pytest

from lightloom.golden_model.contract.formats import RAY_TIME, SCALE_BIAS, TIME_BIAS
from lightloom.golden_model.tracing.wide_bvh.ray_time import TIME_MAX, both_ways, floor_shifted, ray_time
from tests.golden_model.narrow_boxes import LARGER, SMALL, Narrow, rounded

SEED = 61


def times(t: Any, rate: Any, scale: Any) -> np.ndarray:
    """RAY_TIME (N,) with the scale given without its bias."""
    columns = np.broadcast_arrays(*np.atleast_1d(t, rate, scale))
    out = np.zeros(len(columns[0]), dtype=RAY_TIME)
    with np.errstate(over="ignore"):
        out["t"], out["rate"], out["scale"] = columns[0], columns[1], columns[2] + SCALE_BIAS
    return out


def random_times(count: int) -> np.ndarray:
    """Of all exponents, with the products spread over the range of distances and beyond it."""
    rng = np.random.default_rng(SEED)
    t, rate = (rng.choice([-1, 1], count) * np.ldexp(1 + rng.random(count), rng.integers(-60, 60, count)) for _ in "tr")
    exponent = np.frexp(t * rate)[1]
    return times(t.astype(np.float32), np.abs(rate).astype(np.float32), rng.integers(-6, 28, count) - exponent)


def test_the_exact_distance_lies_between() -> None:
    tests = random_times(5000)
    result = ray_time(tests)
    inner = 0
    for test, low, high in zip(tests, result["low"].tolist(), result["high"].tolist(), strict=True):
        scale = int(test["scale"]) - SCALE_BIAS
        exact = Fraction(float(test["t"])) * Fraction(float(test["rate"])) * Fraction(2) ** scale + TIME_BIAS
        assert low == 0 or low <= exact, f"seed {SEED}: {test}"
        assert high == TIME_MAX or high >= exact, f"seed {SEED}: {test}"
        # And no farther than the rounding and the margins.
        if 16 < exact < TIME_MAX - 16:
            inner += 1
            assert exact - 6 < low < high < exact + 6, f"seed {SEED}: {test}"
    assert inner > 2000


def test_known_distances() -> None:
    result = ray_time(times([0.0, 1, -1, 0.5, 1.25, 1e9, -1e9], 1, [0, 0, 0, 0, 1, 0, 0]))
    assert (result["low"].astype(int) - TIME_BIAS).tolist() == [-4, -3, -5, -4, -2, (1 << 24) - 5, -(1 << 24)]
    assert (result["high"].astype(int) - TIME_BIAS).tolist() == [5, 6, 4, 5, 7, (1 << 24) - 1, -(1 << 24) + 5]


@pytest.mark.parametrize("scale", [-107, 0, 100])
def test_infinite_products_and_nans_are_the_whole_range(scale: int) -> None:
    t = np.array([np.inf, -np.inf, np.nan, 3e38, -3e38, 0], dtype=np.float32)
    rate = np.array([1, 1, 1, 2, 2, np.inf], dtype=np.float32)
    result = ray_time(times(t, rate, scale))
    assert (result["low"] == 0).all()
    assert (result["high"] == TIME_MAX).all()


def test_a_greater_t_is_never_at_a_lower_distance() -> None:
    rng = np.random.default_rng(SEED)
    tests = random_times(4000)
    result = ray_time(tests)
    tests["t"] = np.nextafter(tests["t"], np.float32(np.inf))
    tests["t"] += np.abs(tests["t"]) * np.exp2(rng.integers(-30, 4, len(tests))).astype(np.float32)
    after = ray_time(tests)
    finite = np.isfinite(tests["t"] * tests["rate"])
    for name in ("low", "high"):
        assert (after[name] >= result[name])[finite].all()


@pytest.mark.parametrize("narrow", [SMALL, LARGER], ids=["8 bits", "9 bits"])
def test_all_narrow_distances_lie_between(narrow: Narrow) -> None:
    """Every pair of significands, both signs, from far below a unit to beyond the range: exact in whole numbers."""
    least, beyond = 1 << (narrow.bits - 1), 1 << narrow.bits
    t, rate = np.meshgrid(np.arange(least, beyond), np.arange(least, beyond), indexing="ij")
    bias = 1 << narrow.bits
    for sign in (-1, 1):
        significand, exponent = rounded(sign * t * rate, narrow.bits)
        for scale in range(-3 * narrow.bits - 2, -narrow.bits + 4):
            low, high = both_ways(
                floor_shifted(significand, exponent + scale, narrow.bits, narrow.bits), narrow.widths.time
            )
            exact = np.ldexp((sign * t * rate).astype(np.float64), scale) + bias
            assert ((low == 0) | (low <= exact)).all()
            assert ((high == 2 * bias - 1) | (high >= exact)).all()
