"""Intervals of float32: what a computation can come to, of operands that lie between known ends.

Addition, subtraction and multiplication round monotonically, and so does the flush. So the same operations on the ends
(Moore 1966, "Interval Analysis"), in the same order, bound in every bit what any operands between them give: no margin
is added, and what the bound rules out cannot happen. That holds as long as all operands are finite (`finite`).
"""

from dataclasses import dataclass
from functools import partial

import numpy as np

from lightloom.golden_model.numerics.floats import float_minmax, flush


@dataclass(frozen=True)
class Interval:
    """Numbers from `low` to `high`, float32 of one shape; vectors have a last axis of 3."""

    low: np.ndarray
    high: np.ndarray

    def __add__(self, other: "Interval | np.ndarray") -> "Interval":
        """Rounded once and flushed, as all that follow."""
        end = _interval(other)
        return Interval(flush(self.low + end.low), flush(self.high + end.high))

    def __sub__(self, other: "Interval | np.ndarray") -> "Interval":
        return self + -_interval(other)

    def __mul__(self, other: "Interval | np.ndarray") -> "Interval":
        end = _interval(other)
        a, b, c, d = (flush(one * other) for one in (self.low, self.high) for other in (end.low, end.high))
        return Interval(_smaller(_smaller(a, b), _smaller(c, d)), _larger(_larger(a, b), _larger(c, d)))

    def __neg__(self) -> "Interval":
        return Interval(-self.high, -self.low)

    @property
    def least_size(self) -> np.ndarray:
        """The smallest absolute value of them."""
        return _larger(_larger(self.low, -self.high), np.float32(0))

    @property
    def greatest_size(self) -> np.ndarray:
        """The largest absolute value of them."""
        return _larger(np.abs(self.low), np.abs(self.high))

    @property
    def finite(self) -> np.ndarray:
        """Whether both ends are numbers."""
        return np.asarray(np.isfinite(self.low) & np.isfinite(self.high))

    def scalar_product(self, other: "Interval | np.ndarray") -> "Interval":
        """Of vectors, as `vectors.dot`: (x + y) + z of the products."""
        products = self * other
        x, y, z = (Interval(products.low[..., k], products.high[..., k]) for k in range(3))
        return (x + y) + z


def _interval(numbers: "Interval | np.ndarray") -> Interval:
    """Of single numbers, which are flushed as those of a number unit are."""
    return numbers if isinstance(numbers, Interval) else Interval(flush(numbers), flush(numbers))


_smaller = float_minmax
_larger = partial(float_minmax, maximum=True)
