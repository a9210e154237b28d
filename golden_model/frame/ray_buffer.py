"""The buffer that the rays of a frame add to ([0045]): sums in fixed point, so that the order does not matter."""

import numpy as np

from lightloom.golden_model.numerics.floats import beyond_fixed, float_to_fixed


class RayBuffer:
    """What rays have brought to each pixel of a frame, RGB."""

    def __init__(self, height: int, width: int, fraction: int):
        """`fraction`, 0 to 31: bits after the binary point, as `light_unit.fraction_bits` finds them for a scene."""
        self.height, self.width, self.fraction = height, width, fraction
        self.total = np.zeros((height * width, 3), dtype=np.int64)
        """Row by row from the top; 32 bits and one for each doubling of the rays that a pixel may get."""
        self.clipped = 0
        """Values that were too bright, in any colour: light that is lost."""

    def add(self, pixel: np.ndarray, value: np.ndarray) -> None:
        """Adds values (N, 3) float32 to pixels (N,): each rounded to the fixed point, saturating at 32 bits."""
        self.clipped += int(np.count_nonzero(beyond_fixed(value, self.fraction).any(axis=1)))
        np.add.at(self.total, pixel, float_to_fixed(value, self.fraction).astype(np.int64))

    def values(self) -> np.ndarray:
        """The sums, rounded once, (H, W, 3) float32."""
        total = np.ldexp(self.total.astype(np.float64), -self.fraction).astype(np.float32)
        return total.reshape(self.height, self.width, 3)
