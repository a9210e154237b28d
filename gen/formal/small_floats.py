"""Arithmetic of floating-point formats of a few bits, from the definition: exact rationals, and a list of all numbers.

Slow and plain on purpose: this is what the operators are compared with. The rules are those of docs/operators.md:
subnormal operands and results are zeros of the same sign, one NaN, one rounding to nearest even.
"""

from bisect import bisect_left
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from math import isqrt

INFINITE = "infinite"
NAN = "nan"


@dataclass(frozen=True)
class SmallFormat:
    """A sign, `exponent` and `fraction` bits, as in IEEE 754."""

    exponent: int
    fraction: int

    @property
    def bits(self) -> int:
        return 1 + self.exponent + self.fraction

    @property
    def bias(self) -> int:
        return (1 << (self.exponent - 1)) - 1

    @property
    def infinity(self) -> int:
        """The bits of the infinity; what is above it is a NaN."""
        return ((1 << self.exponent) - 1) << self.fraction

    @property
    def nan(self) -> int:
        return self.infinity | 1 << (self.fraction - 1)

    def value(self, magnitude: int) -> Fraction:
        """What the bits without the sign say, by IEEE's rules, subnormal numbers too."""
        biased, rest = divmod(magnitude, 1 << self.fraction)
        leading = 1 if biased else 0
        return Fraction((leading << self.fraction) + rest) * Fraction(2) ** (max(biased, 1) - self.bias - self.fraction)

    @cached_property
    def _numbers(self) -> list[Fraction]:
        # The bits of the infinity stand for the number that would follow the greatest: what rounds to it overflows.
        return [self.value(magnitude) for magnitude in range(self.infinity + 1)]

    def take(self, bits: int) -> tuple[bool, Fraction | str]:
        """Sign, and magnitude, INFINITE or NAN."""
        sign, magnitude = divmod(bits, 1 << (self.bits - 1))
        if magnitude >= self.infinity:
            return bool(sign), INFINITE if magnitude == self.infinity else NAN
        return bool(sign), self.value(magnitude) if magnitude >> self.fraction else Fraction(0)

    def give(self, sign: bool, magnitude: Fraction | str) -> int:
        """The bits of the number nearest to a magnitude of 0 or more; of two equally near, the even one."""
        if magnitude == NAN:
            return self.nan
        top = int(sign) << (self.bits - 1)
        if magnitude == INFINITE:
            return top | self.infinity
        assert isinstance(magnitude, Fraction)
        numbers = self._numbers
        above = min(bisect_left(numbers, magnitude), self.infinity)
        below = max(above - 1, 0)
        up, down = numbers[above] - magnitude, magnitude - numbers[below]
        nearest = above if up < down or (up == down and above % 2 == 0) else below
        return top | (nearest if nearest >> self.fraction else 0)

    # --- operators ----------------------------------------------------------------------------------------------------

    def add(self, a: int, b: int, subtract: int) -> int:
        (sign_a, x), (sign_b, y) = self.take(a), self.take(b)
        sign_b ^= bool(subtract)
        if NAN in (x, y) or (x == y == INFINITE and sign_a != sign_b):
            return self.nan
        if INFINITE in (x, y):
            return self.give(sign_a if x == INFINITE else sign_b, INFINITE)
        return self._signed(_with_sign(sign_a, x) + _with_sign(sign_b, y), sign_a and sign_b)

    def multiply(self, a: int, b: int) -> int:
        return self.give(*self.product(a, b))

    def divide(self, a: int, b: int) -> int:
        (sign_a, x), (sign_b, y) = self.take(a), self.take(b)
        sign = sign_a != sign_b
        if NAN in (x, y) or x == y == INFINITE or x == y == 0:
            return self.nan
        if x == INFINITE or y == 0:
            return self.give(sign, INFINITE)
        return self.give(sign, Fraction(0) if y == INFINITE else x / y)  # type: ignore[operator]

    def sqrt(self, a: int) -> int:
        sign, x = self.take(a)
        if x in (0, NAN):
            return self.give(sign, x)
        if sign:
            return self.nan
        if x == INFINITE:
            return self.give(sign, INFINITE)
        assert isinstance(x, Fraction)
        # Enough bits that what is cut off cannot change the rounding, and a lowest one that says whether there is any.
        places = 4 * (self.fraction + self.bias)
        scaled = x * 4**places
        root = isqrt(int(scaled))
        exact = Fraction(root) ** 2 == scaled
        return self.give(False, Fraction(2 * root + (not exact), 2) / 2**places)

    def difference_of_products(self, a: int, b: int, c: int, d: int) -> int:
        (sign, x), (sign_y, y) = self.product(a, b), self.product(c, d)
        sign_y = not sign_y
        if NAN in (x, y) or (x == y == INFINITE and sign != sign_y):
            return self.nan
        if INFINITE in (x, y):
            return self.give(sign if x == INFINITE else sign_y, INFINITE)
        return self._signed(_with_sign(sign, x) + _with_sign(sign_y, y), sign and sign_y)

    def compare(self, a: int, b: int) -> tuple[int, int, int, int]:
        """less, equal, greater, unordered."""
        x, y = self._number(a), self._number(b)
        if x is None or y is None:
            return 0, 0, 0, 1
        return int(x < y), int(x == y), int(x > y), 0

    def minmax(self, a: int, b: int, maximum: int) -> int:
        """minimumNumber and maximumNumber: a NaN loses; -0 is less than +0."""
        numbers = [(self._number(bits), not self.take(bits)[0], bits) for bits in (a, b)]
        known = [(number, positive, bits) for number, positive, bits in numbers if number is not None]
        if not known:
            return self.nan
        bits = (max if maximum else min)(known, key=lambda one: one[:2])[2]
        return self.give(*self.take(bits))

    def _number(self, bits: int) -> Fraction | None:
        """Its place on the number line, None for a NaN; infinities beyond all numbers."""
        sign, x = self.take(bits)
        return None if x == NAN else _with_sign(sign, 2 * self._numbers[-1] if x == INFINITE else x)

    def product(self, a: int, b: int) -> tuple[bool, Fraction | str]:
        """Sign and magnitude of the exact product."""
        (sign_a, x), (sign_b, y) = self.take(a), self.take(b)
        sign = sign_a != sign_b
        if NAN in (x, y) or (INFINITE in (x, y) and 0 in (x, y)):
            return sign, NAN
        return sign, INFINITE if INFINITE in (x, y) else x * y  # type: ignore[operator]

    def _signed(self, total: Fraction, both_negative: bool) -> int:
        """An exact sum; a sum of nothing is +0, but -0 of two zeros below."""
        return self.give(total < 0 or (total == 0 and both_negative), abs(total))


def _with_sign(sign: bool, magnitude: Fraction | str) -> Fraction:
    assert isinstance(magnitude, Fraction)
    return -magnitude if sign else magnitude
