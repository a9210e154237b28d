"""The float model against two oracles: Berkeley SoftFloat 3e, and exact rational arithmetic."""

from collections.abc import Callable

import numpy as np
import pytest

from lightloom.golden_model.contract.interfaces import OPERATORS
from lightloom.golden_model.models import model_results
from lightloom.golden_model.numerics import floats
from tests.exact import exact_results
from tests.softfloat import softfloat_results
from tests.vectors import corner_vectors, differences, random_vectors

SEED = 20250101
RANDOM = 200_000
EXACT = 5_000
"""Vectors of either kind for the slow oracle; the long run takes more."""


@pytest.mark.parametrize("name", OPERATORS)
def test_corners_agree_with_softfloat(name: str) -> None:
    operands = corner_vectors(name)
    assert len(operands) >= 40_000
    results = {"SoftFloat": softfloat_results(name, operands), "model": model_results(name, operands)}
    report = differences(operands, f"corner_vectors({name!r})", results)
    assert not report, report


@pytest.mark.parametrize("name", OPERATORS)
def test_random_vectors_agree_with_softfloat(name: str) -> None:
    operands = random_vectors(name, RANDOM, SEED)
    assert len(operands) == RANDOM
    results = {"SoftFloat": softfloat_results(name, operands), "model": model_results(name, operands)}
    report = differences(operands, f"random_vectors({name!r}, {RANDOM}, {SEED})", results)
    assert not report, report


@pytest.mark.parametrize("name", OPERATORS)
def test_agrees_with_exact_arithmetic(name: str) -> None:
    corners = np.random.default_rng(SEED).choice(corner_vectors(name), EXACT, replace=False)
    operands = np.concatenate([corners, random_vectors(name, EXACT, SEED)])
    results = {"exact": exact_results(name, operands), "model": model_results(name, operands)}
    report = differences(operands, f"{EXACT} corners and {EXACT} random, seed {SEED}", results)
    assert not report, report


def test_vectors_depend_on_the_seed_alone() -> None:
    for name in OPERATORS:
        first, again = (random_vectors(name, 1000, SEED).tobytes() for _ in range(2))
        assert first == again
        assert first != random_vectors(name, 1000, SEED + 1).tobytes()


def _float64(operands: np.ndarray) -> list[np.ndarray]:
    """The flushed operands, exactly."""
    return [floats.flush(operands[field]).astype(np.float64) for field in operands.dtype.names or ()]


@pytest.mark.parametrize("name", ["float_multiply", "float_divide", "float_difference_of_products"])
def test_vectors_reach_the_hard_cases(name: str) -> None:
    """Results that only rounding lifts to the least normal number or to infinity, that are flushed, or cancel."""
    operands = random_vectors(name, RANDOM, SEED)
    result = model_results(name, operands)["z"]
    with np.errstate(all="ignore"):
        a, b, *rest = _float64(operands)
        if name == "float_multiply":
            exact = a * b
        elif name == "float_divide":
            exact = a / b
        else:
            exact = a * b - rest[0] * rest[1]
            cancelled = np.abs(exact) < np.abs(a * b) * 2.0**-20
            assert (cancelled & (exact != 0)).sum() > 1000
            assert ((a * b == rest[0] * rest[1]) & (a * b != 0) & np.isfinite(exact)).sum() > 1000
        size = np.abs(exact)
        assert ((size < 2.0**-126) & (np.abs(result) == floats.TINY)).sum() > 100, "lifted to the least normal number"
        assert ((size < 2.0**-126) & (size > 0) & (result == 0)).sum() > 1000, "flushed"
        assert ((size > 2.0**127) & (size < 2.0**128)).sum() > 300, "large"
        assert ((size >= 2.0**128) & np.isfinite(size) & np.isinf(result)).sum() > 500, "overflow"


TINY, MAX, INF, NAN = float(floats.TINY), float(np.finfo(np.float32).max), np.inf, np.nan
SUBNORMAL = 1e-40

SPECIAL: list[tuple[str, Callable[..., np.ndarray], list[float], float]] = [
    # What docs/operators.md says about special cases, one by one.
    ("3 + -3 is +0", floats.float_add, [3, -3], 0.0),
    ("-0 + -0", floats.float_add, [-0.0, -0.0], -0.0),
    ("-0 + +0", floats.float_add, [-0.0, 0.0], 0.0),
    ("inf + -inf", floats.float_add, [INF, -INF], NAN),
    ("a subnormal operand is a zero", floats.float_add, [-SUBNORMAL, -0.0], -0.0),
    ("0 * inf", floats.float_multiply, [0, INF], NAN),
    ("subnormal * inf", floats.float_multiply, [SUBNORMAL, INF], NAN),
    ("flushed, the sign stays", floats.float_multiply, [-TINY, 0.5], -0.0),
    ("rounds up to the least normal", floats.float_multiply, [TINY, 1 - 2.0**-24], TINY),
    ("just below that", floats.float_multiply, [TINY, 1 - 2.0**-23], 0.0),
    ("1 / -0", floats.float_divide, [1, -0.0], -INF),
    ("1 / subnormal", floats.float_divide, [1, SUBNORMAL], INF),
    ("0 / 0", floats.float_divide, [0, 0], NAN),
    ("inf / -inf", floats.float_divide, [INF, -INF], NAN),
    ("1 / max is flushed", floats.float_divide, [1, MAX], 0.0),
    ("sqrt(-0)", floats.float_sqrt, [-0.0], -0.0),
    ("sqrt of a negative subnormal", floats.float_sqrt, [-SUBNORMAL], -0.0),
    ("sqrt(-1)", floats.float_sqrt, [-1], NAN),
    ("2*3 - -6*-1", floats.float_difference_of_products, [2, 3, -6, -1], 0.0),
    ("-0*1 - 0*1", floats.float_difference_of_products, [-0.0, 1, 0, 1], -0.0),
    ("products beyond the range", floats.float_difference_of_products, [MAX, MAX, MAX, MAX], 0.0),
    ("inf*1 - inf*1", floats.float_difference_of_products, [INF, 1, INF, 1], NAN),
    ("min(+0, -0)", floats.float_minmax, [0.0, -0.0, False], -0.0),
    ("max(-0, +0)", floats.float_minmax, [-0.0, 0.0, True], 0.0),
    ("min(NaN, 1)", floats.float_minmax, [NAN, 1, False], 1),
    ("max(1, NaN)", floats.float_minmax, [1, NAN, True], 1),
    ("min(-NaN, NaN)", floats.float_minmax, [-NAN, NAN, False], NAN),
]


@pytest.mark.parametrize(("function", "operands", "expected"), [s[1:] for s in SPECIAL], ids=[s[0] for s in SPECIAL])
def test_special_cases(function: Callable[..., np.ndarray], operands: list[float], expected: float) -> None:
    found = function(*(np.array([x], bool if isinstance(x, bool) else np.float32) for x in operands))
    wanted = floats.NAN if np.isnan(expected) else np.float32(expected)
    assert found.dtype == np.float32
    assert f"{found.view(np.uint32)[0]:08x}" == f"{wanted.view(np.uint32):08x}"


def test_conversions_at_their_limits() -> None:
    half = floats.float_to_half(np.array([65519.996, 65520, 2.0**-25, 2.0**-24 * 0.75, -np.inf, np.nan], np.float32))
    assert half.view(np.uint16).tolist() == [0x7BFF, 0x7C00, 0x0000, 0x0001, 0xFC00, 0x7E00]
    fixed = floats.float_to_fixed(np.array([0.5, 1.5, -2.5, 3e9, -3e9, np.nan, np.inf], np.float32))
    assert fixed.tolist() == [0, 2, -2, 2**31 - 1, -(2**31), 0, 2**31 - 1]
    assert floats.fixed_to_float(np.array([-(2**31)], np.int32), 31).tolist() == [-1.0]
