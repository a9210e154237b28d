"""Exact bounds of what box set-up makes of rays, in arithmetic so narrow that all of it can be tried.

Floats have M bits of significand instead of 24; all widths of the box test shrink with it. Over- and underflow have no
counterpart: the exponents are unbounded.
"""

from dataclasses import dataclass

import numpy as np

from lightloom.golden_model.contract.formats import BOX_FRACTION, BoxWidths
from lightloom.golden_model.tracing.wide_bvh.box_setup import slope_of
from lightloom.golden_model.tracing.wide_bvh.ray_time import floor_shifted


@dataclass(frozen=True)
class Narrow:
    """The widths of a narrow box test; those of the true one follow from M = 24 in the same way."""

    bits: int
    """M."""
    widths: BoxWidths

    @property
    def lattice_bits(self) -> int:
        return self.bits - 4

    @property
    def position_bits(self) -> int:
        """Without the sign."""
        return self.bits - 2

    @property
    def steepest(self) -> int:
        return self.bits + 3

    @property
    def coarsest(self) -> int:
        return self.bits + 1

    @property
    def grid(self) -> int:
        """Steps of a unit in which positions are tried: every tie of the rounding lies on one of them."""
        return 1 << (self.bits + 1)


TINY = Narrow(7, BoxWidths(plane=2, exponent=2, slope=4, short=3, time=8))
SMALL = Narrow(8, BoxWidths(plane=2, exponent=3, slope=5, short=3, time=9))
LARGER = Narrow(9, BoxWidths(plane=2, exponent=4, slope=6, short=4, time=10))


def rounded(x: np.ndarray, bits: int) -> tuple[np.ndarray, np.ndarray]:
    """Positive and negative int64 to the nearest even of `bits` bits: (significand with its sign, exponent)."""
    magnitude = np.abs(x)
    length = np.frexp(magnitude.astype(np.float64))[1].astype(np.int64)
    shift = np.maximum(length - bits, 0)
    whole = magnitude >> shift
    rest = (magnitude - (whole << shift)) * 2
    unit = np.int64(1) << shift
    whole += (rest > unit) | ((rest == unit) & (whole & 1 == 1))
    # Rounding up may make it a power of two with one bit too many; and shorter ones are made longer.
    carry = whole >> bits
    whole, shift = whole >> carry, shift + carry
    longer = np.where(whole > 0, bits - np.frexp(whole.astype(np.float64))[1], 0).astype(np.int64)
    return np.sign(x) * (whole << longer), shift - longer


def position_bounds(narrow: Narrow) -> tuple[np.ndarray, np.ndarray]:
    """For each position, from the lowest, where exactly the ray may be: the least and the greatest place, in steps.

    Positions between two steps belong to one of them, so a step is added on either side.
    """
    limit = 1 << narrow.position_bits
    place = np.arange(-limit * narrow.grid + 1, limit * narrow.grid)
    significand, exponent = rounded(place, narrow.bits)
    # A ray's coarseness sees to it that what rounds to the limit has a greater unit.
    fits = np.abs(significand.astype(np.float64)) * np.exp2(exponent) < limit * narrow.grid
    place, significand, exponent = place[fits], significand[fits], exponent[fits]
    position = floor_shifted(significand, exponent - (narrow.bits + 1), narrow.position_bits, narrow.bits) + limit
    least, greatest = np.full(2 * limit, place.max()), np.full(2 * limit, place.min())
    np.minimum.at(least, position, place - 1)
    np.maximum.at(greatest, position, place + 1)
    return least, greatest


def slope_bounds(narrow: Narrow) -> np.ndarray:
    """Rows (slope, steepness, numerator and denominator of the least exact ratio, and of the greatest), int64 (K, 6).

    All pairs of significands of the dominant and another component are tried, in all steepnesses and two beyond the
    cap. At the cap the greatest ratio is endless: 1 / 0, as it is where a component is zero.
    """
    least, beyond = 1 << (narrow.bits - 1), 1 << narrow.bits
    rate, other, lower = np.meshgrid(
        np.arange(least, beyond), np.arange(least, beyond), np.arange(narrow.steepest + 3), indexing="ij"
    )
    valid = (lower > 0) | (rate >= other)
    rate, other, lower = rate[valid], other[valid], lower[valid]
    # The reciprocal of other * 2**-lower; enough bits before rounding that no quotient looks like a tie and is none.
    spare = 1 << (4 * narrow.bits)
    inverse, scale = rounded(spare // other * 2 + (spare % other > 0), narrow.bits)
    product, more = rounded(rate * inverse, narrow.bits)
    exponent = more + scale + narrow.bits - 1 - (4 * narrow.bits + 1) + lower
    slope, steepness = slope_of(product, exponent, False, narrow.bits, narrow.widths.slope)
    steepness = np.minimum(steepness, narrow.steepest)

    # Ratios of short numbers are told apart by float64.
    order = np.lexsort((np.ldexp(rate / other, lower), slope, steepness))
    slope, steepness, rate, other, lower = (x[order] for x in (slope, steepness, rate, other, lower))
    starts = np.flatnonzero(np.append(True, (np.diff(slope) != 0) | (np.diff(steepness) != 0)))
    ends = np.append(starts[1:], len(slope)) - 1
    rows = [slope[starts], steepness[starts], *(x for i in (starts, ends) for x in (rate[i] << lower[i], other[i]))]
    out = np.stack(rows, axis=1)
    capped = out[:, 1] == narrow.steepest
    # Beyond the cap every slope belongs to the cap, and a zero component has the slope 1.
    out[capped, 4], out[capped, 5] = 1, 0
    return out


UNIT = 1 << BOX_FRACTION
"""Units of the ray in a lattice unit, at coarseness 0."""
