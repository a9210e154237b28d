"""The number units in exact rational arithmetic: the contract written out, one scalar at a time.

Slow and plain on purpose: Python's fractions and integers, no floating point anywhere. Operands and results are the
bits of the fields.
"""

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from math import floor, isqrt

import numpy as np

from lightloom.golden_model.contract.interfaces import OPERATORS

NAN, INFINITY, HALF_NAN, SIGN = 0x7FC00000, 0x7F800000, 0x7E00, 1 << 31


@dataclass(frozen=True)
class Number:
    """A decoded operand: `value` is its magnitude with its sign; None for infinities and NaNs."""

    negative: bool
    value: Fraction | None
    nan: bool = False

    @property
    def infinite(self) -> bool:
        return self.value is None and not self.nan

    @property
    def order(self) -> tuple[Fraction | float, bool]:
        """Sorts like the numbers, -0 before +0."""
        if self.value is None:
            return (float("-inf") if self.negative else float("inf")), not self.negative
        return self.value, not self.negative


def decode(bits: int, fraction_bits: int = 23, exponent_bits: int = 8) -> Number:
    """IEEE bits to a Number, subnormals as they are."""
    negative = bool(bits >> (fraction_bits + exponent_bits))
    fraction = bits & ((1 << fraction_bits) - 1)
    exponent = bits >> fraction_bits & ((1 << exponent_bits) - 1)
    if exponent == (1 << exponent_bits) - 1:
        return Number(negative, None, nan=fraction != 0)
    bias = (1 << (exponent_bits - 1)) - 1
    significand = fraction + ((1 << fraction_bits) if exponent else 0)
    magnitude = significand * Fraction(2) ** (max(exponent, 1) - bias - fraction_bits)
    return Number(negative, -magnitude if negative else magnitude)


def encode(value: Fraction, negative_zero: bool = False, fraction_bits: int = 23, exponent_bits: int = 8) -> int:
    """A rational to the bits of the nearest IEEE number (ties to even), subnormals and infinity among them."""
    top = fraction_bits + exponent_bits
    if value == 0:
        return int(negative_zero) << top
    magnitude = abs(value)
    least = 2 - (1 << (exponent_bits - 1))
    exponent = magnitude.numerator.bit_length() - magnitude.denominator.bit_length()
    if Fraction(2) ** exponent > magnitude:
        exponent -= 1
    exponent = max(exponent, least)
    steps = round(magnitude / Fraction(2) ** (exponent - fraction_bits))  # Python rounds a Fraction half to even
    bits = min(((exponent - least) << fraction_bits) + steps, ((1 << exponent_bits) - 1) << fraction_bits)
    return int(value < 0) << top | bits


def _operand(bits: int) -> Number:
    """A float32 operand of the contract: subnormals are zeros."""
    return decode(bits & SIGN if not bits & INFINITY else bits)


def _result(value: Fraction, negative_zero: bool = False) -> int:
    bits = encode(value, negative_zero)
    return bits if bits & INFINITY else bits & SIGN


def _infinity(negative: bool) -> int:
    return INFINITY | (SIGN if negative else 0)


def _sum(x: Number, y: Number) -> int:
    if x.nan or y.nan or (x.infinite and y.infinite and x.negative != y.negative):
        return NAN
    if x.value is None or y.value is None:
        return _infinity(x.negative if x.infinite else y.negative)
    return _result(x.value + y.value, x.negative and y.negative)


def _product(x: Number, y: Number) -> Number:
    """x * y, not rounded."""
    negative = x.negative != y.negative
    if x.value is None or y.value is None:
        return Number(negative, None, nan=x.nan or y.nan or x.value == 0 or y.value == 0)
    return Number(negative, x.value * y.value)


def float_add(a: int, b: int, subtract: int) -> int:
    return _sum(_operand(a), _operand(b ^ (SIGN if subtract else 0)))


def float_multiply(a: int, b: int) -> int:
    product = _product(_operand(a), _operand(b))
    if product.value is None:
        return NAN if product.nan else _infinity(product.negative)
    return _result(product.value, product.negative)


def float_difference_of_products(a: int, b: int, c: int, d: int) -> int:
    return _sum(_product(_operand(a), _operand(b)), _product(_operand(c ^ SIGN), _operand(d)))


def float_divide(a: int, b: int) -> int:
    x, y = _operand(a), _operand(b)
    negative = x.negative != y.negative
    if x.nan or y.nan or (x.infinite and y.infinite) or (x.value == 0 and y.value == 0):
        return NAN
    if x.value is None or y.value == 0:
        return _infinity(negative)
    return _result(Fraction(0) if y.value is None else x.value / y.value, negative)


def float_sqrt(a: int) -> int:
    x = _operand(a)
    if x.nan or (x.negative and x.value != 0):
        return NAN
    if x.value is None:
        return INFINITY
    radicand = x.value * (1 << 400)  # an integer: float32 values are multiples of 2**-149
    root = isqrt(int(radicand))
    inexact = root * root != radicand
    # Anywhere between two neighbouring integers this large rounds like the middle.
    return _result((root + Fraction(int(inexact), 2)) / (1 << 200), x.negative)


def float_compare(a: int, b: int) -> int:
    x, y = _operand(a), _operand(b)
    if x.nan or y.nan:
        return 8
    left, right = x.order[0], y.order[0]
    return int(left < right) | int(left == right) << 1 | int(left > right) << 2


def float_minmax(a: int, b: int, maximum: int) -> int:
    numbers = [(number.order, bits) for bits in (a, b) if not (number := _operand(bits)).nan]
    if not numbers:
        return NAN
    _, bits = max(numbers) if maximum else min(numbers)
    return bits if bits & INFINITY else bits & SIGN


def float_to_half(a: int) -> int:
    x = _operand(a)
    if x.nan:
        return HALF_NAN
    if x.value is None:
        return 0xFC00 if x.negative else 0x7C00
    return encode(x.value, x.negative, fraction_bits=10, exponent_bits=5)


def half_to_float(a: int) -> int:
    x = decode(a, fraction_bits=10, exponent_bits=5)
    if x.nan:
        return NAN
    return _infinity(x.negative) if x.value is None else _result(x.value, x.negative)


def float_to_fixed(a: int, fraction: int, to_integer: Callable[[Fraction], int] = round) -> int:
    x = _operand(a)
    if x.nan:
        return 0
    low, high = -(1 << 31), (1 << 31) - 1
    if x.value is None:
        return (low if x.negative else high) & 0xFFFFFFFF
    return min(max(to_integer(x.value * (1 << fraction)), low), high) & 0xFFFFFFFF


def float_to_fixed_down(a: int, fraction: int) -> int:
    return float_to_fixed(a, fraction, floor)


def fixed_to_float(a: int, fraction: int, sign: int = SIGN) -> int:
    return _result(Fraction(a - ((a & sign) << 1), 1 << fraction))


def fixed64_to_float(a: int, fraction: int) -> int:
    return fixed_to_float(a, fraction, 1 << 63)


def _column(values: np.ndarray) -> list[int]:
    raw = values if values.dtype == np.bool_ else np.ascontiguousarray(values).view(f"<u{values.itemsize}")
    return [int(value) for value in raw]


def exact_results(name: str, operands: np.ndarray) -> np.ndarray:
    """Operands (N,) of a number unit to results (N,), each by exact arithmetic (some 30,000 a second)."""
    unit = OPERATORS[name]
    function: Callable[..., int] = globals()[name]
    rows = zip(*(_column(operands[field]) for field in unit.input.names or ()), strict=True)
    z = np.array([function(*row) for row in rows], np.uint32)
    out = np.zeros(len(operands), unit.output)
    if name == "float_compare":
        for position, field in enumerate(unit.output.names or ()):
            out[field] = z >> position & 1
    else:
        kind = unit.output["z"]
        out["z"] = z.astype(f"<u{kind.itemsize}").view(kind)
    return out
