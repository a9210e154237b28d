"""float32 arithmetic under Lightloom's numeric contract; each function is the model of the unit of the same name.

Round to nearest, ties to even. Subnormal operands and results become zero of the same sign (a result is flushed after
it was rounded as IEEE 754 rounds it). The only NaN that leaves an operation is `NAN`, 0x7FC00000. Every operation
rounds exactly once. All functions take and return arrays (or scalars) of dtype float32 unless they say otherwise,
broadcast like NumPy, and raise nothing.
"""

import functools
from collections.abc import Callable
from typing import Any, ParamSpec

import numpy as np

P = ParamSpec("P")
Array = np.ndarray[Any, Any]

TINY = np.float32(2.0**-126)
NAN = np.uint32(0x7FC00000).view(np.float32)
LARGEST_HALF = np.float32(65504)
"""The largest number that binary16 holds; brighter light is kept as this."""


def quiet(function: Callable[P, Any]) -> Callable[P, Any]:
    """Runs a function without NumPy's warnings: overflow, NaN and division by zero are defined results here."""

    @functools.wraps(function)
    def wrapped(*args: P.args, **kwargs: P.kwargs) -> Any:
        with np.errstate(all="ignore"):
            return function(*args, **kwargs)

    return wrapped


def flush(x: Array) -> Array:
    """Subnormals to zero of the same sign; everything else, NaN included, unchanged.

    Code that works on operands already flushed writes `flush(a * b)` and has the contract's multiplication, up to the
    payload of a NaN.
    """
    return x * (np.abs(x) >= TINY).astype(np.float32)


def canonical(x: Array) -> Array:
    """Flushes subnormals and replaces every NaN by the canonical one: the last step of every unit."""
    return np.where(np.isnan(x), NAN, flush(x))


@quiet
def float_add(a: Array, b: Array, subtract: Array | bool = False) -> Array:
    """a + b, or a - b where `subtract` (bool)."""
    a, b = flush(np.asarray(a)), flush(np.asarray(b))
    return canonical(a + np.where(subtract, -b, b))


@quiet
def float_multiply(a: Array, b: Array) -> Array:
    """a * b."""
    return canonical(flush(np.asarray(a)) * flush(np.asarray(b)))


@quiet
def float_divide(a: Array, b: Array) -> Array:
    """a / b."""
    return canonical(flush(np.asarray(a)) / flush(np.asarray(b)))


@quiet
def float_sqrt(a: Array) -> Array:
    """Square root; of a negative number the NaN, of -0 and of negative subnormals -0."""
    return canonical(np.sqrt(flush(np.asarray(a))))


def difference_of_products(a: Array, b: Array, c: Array, d: Array) -> Array:
    """a*b - c*d rounded once and flushed, for operands already flushed; NaN payloads as they come.

    The float64 products of float32 values are exact. Their difference is split into its float64 rounding and the exact
    error (Knuth's two-sum), rounded to odd, and only then to float32: 53 bits are more than 24 + 2, so this is the
    correctly rounded result (Boldo and Melquiond 2008). Hence the sign of the result is exact too.
    """
    p = np.multiply(a, b, dtype=np.float64)
    q = -np.multiply(c, d, dtype=np.float64)
    s = np.asarray(p + q)
    virtual = s - p
    error = (p - (s - virtual)) + (q - virtual)
    pattern = s.view(np.int64)
    inexact = np.isfinite(s) & (error != 0) & ((pattern & 1) == 0)
    away = (error > 0) == (s > 0)  # the exact value lies further from zero than s
    odd = np.where(inexact, pattern + np.where(away, 1, -1), pattern).view(np.float64)
    return flush(odd.astype(np.float32))


@quiet
def float_difference_of_products(a: Array, b: Array, c: Array, d: Array) -> Array:
    """a*b - c*d with one rounding, so that its sign is exact (Woop, Benthin, Wald 2013 need it for edge functions)."""
    a, b, c, d = (flush(np.asarray(x)) for x in (a, b, c, d))
    return canonical(difference_of_products(a, b, c, d))


@quiet
def float_compare(a: Array, b: Array) -> tuple[Array, Array, Array, Array]:
    """(less, equal, greater, unordered), bool each, exactly one of them true; -0 equals +0."""
    a, b = flush(np.asarray(a)), flush(np.asarray(b))
    return a < b, a == b, a > b, np.isnan(a) | np.isnan(b)


@quiet
def float_minmax(a: Array, b: Array | np.float32, maximum: Array | bool = False) -> Array:
    """IEEE 754-2019 minimumNumber, or maximumNumber where `maximum` (bool).

    A NaN loses against a number; two NaN give the NaN. -0 is less than +0.
    """
    a, b = canonical(np.asarray(a)), canonical(np.asarray(b))
    sign_a = np.signbit(a)
    b_greater = (a < b) | ((a == b) & sign_a & ~np.signbit(b))
    take_b = np.where(maximum, b_greater, ~b_greater)
    return np.where(np.isnan(a), b, np.where(np.isnan(b), a, np.where(take_b, b, a)))


@quiet
def float_to_half(a: Array) -> Array:
    """float32 to binary16 (float16). Beyond 65504 by half a unit or more becomes infinity.

    binary16 results below 2**-14 are kept as subnormals: a published texel loses nothing to the flush, and texture
    units read binary16 subnormals. float32 subnormal operands are zero. NaN becomes 0x7E00.
    """
    half = np.asarray(a).astype(np.float16)  # what would be flushed rounds to zero anyway
    return np.where(np.isnan(half), np.uint16(0x7E00).view(np.float16), half)


@quiet
def half_to_float(a: Array) -> Array:
    """binary16 (float16) to float32: exact, subnormals included; NaN becomes the canonical one."""
    single = np.asarray(a).astype(np.float32)  # never subnormal
    return np.where(np.isnan(single), NAN, single)


@quiet
def float_to_fixed(a: Array, fraction: Array | int = 0) -> Array:
    """float32 to int32 with `fraction` (0..31) bits after the point: nearest even, saturating; NaN becomes 0."""
    scaled = np.rint(np.ldexp(flush(np.asarray(a)).astype(np.float64), np.asarray(fraction, dtype=np.int32)))
    return np.clip(np.where(np.isnan(scaled), 0.0, scaled), -(2.0**31), 2.0**31 - 1).astype(np.int32)


@quiet
def float_to_fixed_down(a: Array, fraction: Array | int = 0) -> Array:
    """float32 to int32 with `fraction` (0..31) bits after the point: the greatest integer that is not more than `a`,
    saturating; NaN becomes 0.
    """
    scaled = np.floor(np.ldexp(flush(np.asarray(a)).astype(np.float64), np.asarray(fraction, dtype=np.int32)))
    return np.clip(np.where(np.isnan(scaled), 0.0, scaled), -(2.0**31), 2.0**31 - 1).astype(np.int32)


@quiet
def beyond_fixed(a: Array, fraction: int = 0) -> Array:
    """Whether `a` is too large for `float_to_fixed`, which then stops at its largest number: bool."""
    return np.asarray(flush(np.asarray(a)) >= np.float32(2.0 ** (31 - fraction)))


@quiet
def fixed_to_float(a: Array, fraction: Array | int = 0) -> Array:
    """int32 with `fraction` (0..31) bits after the point to float32; never subnormal."""
    return np.ldexp(np.asarray(a).astype(np.float64), -np.asarray(fraction, dtype=np.int32)).astype(np.float32)


@quiet
def fixed64_to_float(a: Array, fraction: Array | int = 0) -> Array:
    """int64 with `fraction` (0..31) bits after the point to float32; never subnormal."""
    return np.ldexp(np.asarray(a).astype(np.int64).astype(np.float32), -np.asarray(fraction, dtype=np.int32))
