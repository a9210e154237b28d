"""Formats of floating-point numbers: widths and special values."""

from dataclasses import dataclass
from typing import Any

from amaranth import signed


@dataclass(frozen=True)
class FloatFormat:
    """A binary format built like float32: sign, biased exponent, fraction from the top down.

    Units use float32; narrower formats exist because every input of them can be tried.
    """

    exponent_bits: int = 8
    fraction_bits: int = 23

    @property
    def width(self) -> int:
        return 1 + self.exponent_bits + self.fraction_bits

    @property
    def precision(self) -> int:
        """Bits of a significand, the hidden one included."""
        return self.fraction_bits + 1

    @property
    def bias(self) -> int:
        return (1 << self.exponent_bits - 1) - 1

    @property
    def infinity(self) -> int:
        """The biased exponent of infinities and NaNs."""
        return (1 << self.exponent_bits) - 1

    @property
    def infinite_bits(self) -> int:
        """An infinity without its sign."""
        return self.infinity << self.fraction_bits

    @property
    def nan_bits(self) -> int:
        """The canonical NaN."""
        return self.infinite_bits | 1 << self.fraction_bits - 1

    @property
    def exponent(self) -> Any:
        """The shape of an exponent inside a unit: signed, with room for sums of two and for counts of zeros."""
        return signed(max(self.exponent_bits, (2 * self.precision + 4).bit_length()) + 2)


FLOAT32 = FloatFormat()
CANONICAL_NAN = FLOAT32.nan_bits
INFINITY = FLOAT32.infinity
