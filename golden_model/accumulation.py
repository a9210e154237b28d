"""Sums what the rays of a texel bring, in fixed point: integer sums do not depend on the order in which rays return."""

import numpy as np

from golden_model.floats import float_to_fixed
from golden_model.scene import Scene

HEADROOM_BITS = 10


def fraction_bits(scene: Scene) -> int:
    """Bits after the binary point for the accumulators of a scene: 0 to 31.

    A contribution saturates at 2**31 / 2**fraction, at least 2**10 times the brightest emission of the scene (of point
    lights: the irradiance of all of them from half the scene's longest side away), and is resolved to 2**-20 of it. So
    what saturates is the rare glare of a light sample right beside the texel. Where a wall shines all the way into its
    corners such samples carry a per cent of the light (with 6 bits of headroom it were eight).
    """
    brightest = float(scene.emission[np.unique(scene.material)].max(initial=0.0))
    if len(scene.point_lights):
        corners = scene.corners.reshape(-1, 3)
        distance = float((corners.max(axis=0) - corners.min(axis=0)).max()) / 2
        intensity = float(scene.point_lights["intensity"].astype(np.float64).sum(axis=0).max())
        brightest = max(brightest, intensity / (distance * distance))
    exponent = int(np.frexp(brightest)[1])  # brightest < 2**exponent
    return int(np.clip(31 - HEADROOM_BITS - exponent, 0, 31))


def accumulate(slot: np.ndarray, contribution: np.ndarray, slots: int, fraction: int) -> np.ndarray:
    """Contributions of rays (R, 3) float32 to accumulators `slot` (R,) of `slots`: their sums, (slots, 3) int64.

    Each contribution is rounded to `fraction` bits after the point, to nearest even, saturating at 32 bits (NaN is 0);
    the sums are exact. Hardware needs 32 + log2(rays a texel) bits.
    """
    total = np.zeros((slots, 3), dtype=np.int64)
    np.add.at(total, slot, float_to_fixed(contribution, fraction).astype(np.int64))
    return total


def irradiance(total: np.ndarray, fraction: int) -> np.ndarray:
    """Accumulators (M, 3) int64 to float32, rounded once; |total| < 2**53."""
    return np.ldexp(total.astype(np.float64), -fraction).astype(np.float32)
