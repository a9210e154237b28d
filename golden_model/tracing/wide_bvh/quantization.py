"""The lattice on which the boxes of a tree in memory lie: integers of LATTICE_BITS bits an axis that cover the scene.

Coordinates become integers by exact arithmetic, rounded outwards, whatever the scene's scale and place. Subnormal
coordinates count as zeros, as everywhere.
"""

from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from lightloom.golden_model.contract.formats import LATTICE_BITS
from lightloom.golden_model.numerics.floats import flush

LEAST_EXPONENT = -126
"""A finer lattice would tell coordinates apart that float32 arithmetic does not."""
LAST = (1 << LATTICE_BITS) - 1
"""The greatest lattice coordinate."""
SATURATION = 2.0**40


@dataclass(frozen=True, kw_only=True, eq=False)
class Lattice:
    """The points origin + integer * 2**exponent, on each axis."""

    origin: np.ndarray
    """(3,) float32, the scene's lower corner; no subnormals, no -0."""
    exponent: int
    """-126 to 110."""

    def floor(self, points: np.ndarray) -> np.ndarray:
        """Finite float32 (N, 3) to the greatest lattice coordinates that are no greater, (N, 3) int64.

        Beyond 2**40 on either side, which is far outside the scene, they saturate.
        """
        whole, rounded, error = self._units(points)
        return (whole - ((rounded == whole) & (error < 0))).astype(np.int64)

    def ceil(self, points: np.ndarray) -> np.ndarray:
        """As `floor`, the least lattice coordinates that are no less."""
        whole, rounded, error = self._units(points)
        return (whole + ((rounded > whole) | ((rounded == whole) & (error > 0)))).astype(np.int64)

    def _units(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """points - origin in lattice units: floor of the rounded difference, the difference, its rounding error.

        The difference is below 2**40, so it has more than 10 bits after the point. Its error is less than the least of
        them: it decides only where the rounded difference is a whole number.
        """
        point, origin = flush(points).astype(np.float64), self.origin.astype(np.float64)
        difference = point - origin
        # Knuth's two-sum: the error is exact.
        moved = point - difference
        error = (point - (difference + moved)) + (moved - origin)
        rounded = np.clip(np.ldexp(difference, -self.exponent), -SATURATION, SATURATION)
        return np.floor(rounded), rounded, error


def lattice_around(lower: np.ndarray, upper: np.ndarray) -> Lattice:
    """The finest lattice that covers the box with the finite corners (3,) float32."""
    origin, top = flush(lower), flush(upper)
    extent = max(Fraction(float(high)) - Fraction(float(low)) for low, high in zip(origin, top, strict=True))
    exponent = LEAST_EXPONENT
    if extent > 0:
        # 2**(bits - 1) < ratio < 2**(bits + 1), so the search below is short.
        ratio = extent / LAST
        exponent = max(ratio.numerator.bit_length() - ratio.denominator.bit_length() - 1, LEAST_EXPONENT)
    while extent > LAST * Fraction(2) ** exponent:
        exponent += 1
    return Lattice(origin=origin + np.float32(0), exponent=exponent)


def half_areas(lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
    """Half the surfaces of boxes, lattice coordinates (..., 3) int64 to (...) float64, exact.

    A unit is added to each side. The traversal's pad does so too, and it keeps flat boxes from costing nothing.
    """
    x, y, z = np.moveaxis(upper - lower + 1, -1, 0)
    return (x * y + y * z + z * x).astype(np.float64)
