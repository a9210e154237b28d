"""Sums what the rays of a texel bring, in fixed point: integer sums do not depend on the order in which rays return."""

import numpy as np

from lightloom.golden_model.numerics.floats import beyond_fixed, fixed64_to_float, float_to_fixed
from lightloom.golden_model.numerics.logarithm import half_octaves
from lightloom.golden_model.numerics.sample_spread import LUMINANCE_BITS, luminance
from lightloom.golden_model.scene.light_unit import around_point_lights
from lightloom.golden_model.scene.scene import Scene

HEADROOM_BITS = 10
"""Of contributions that have no bound: what point lights bring, and area lights that shadow rays alone find."""
BALANCED_HEADROOM_BITS = 6
"""Of contributions of area lights where both ways to find them are balanced: at most pi times the emission …

… over the number of rays, and as much again for each bounce, so that nothing saturates unless light adds up to more
than twenty times what the brightest light emits, in one ray."""
SETTLED_BITS = 10
"""Light is settled if less than 2**-SETTLED_BITS of it is still to come."""
REST_BITS = 6
"""All light is at rest if sampling every texel anew changes it by less than 2**-REST_BITS half octaves on average."""
_LUMINANCE_SHIFT = 4
"""A contribution's luminance is added up in units of 4 of the accumulators' (and is the mean of four parts)."""


def fraction_bits(scene: Scene, balanced: bool) -> int:
    """Bits after the binary point for the accumulators of a scene at rest, for all its frames: 0 to 31.

    A contribution saturates at 2**31 / 2**fraction: 2**6 times the brightest emission of an area light and of the sky,
    or more, where they are `balanced`, otherwise 2**10 times; and 2**10 times the irradiance of the sun, and of all
    point lights from half the scene's longest side away. It is resolved to 2**-25, 2**-21 and 2**-21 of these or finer.
    """
    exponents = []
    headroom = BALANCED_HEADROOM_BITS if balanced else HEADROOM_BITS
    for brightest in (scene.brightest, scene.environment.brightest):
        if brightest > 0:
            exponents.append(int(np.frexp(brightest)[1]) + headroom)
    if scene.environment.sun is not None and scene.environment.sun.irradiance.any():
        exponents.append(int(np.frexp(scene.environment.sun.irradiance.max())[1]) + HEADROOM_BITS)
    if len(scene.point_lights):
        exponents.append(int(np.frexp(around_point_lights(scene))[1]) + HEADROOM_BITS)
    return int(np.clip(31 - max(exponents, default=0), 0, 31))


def beyond(contribution: np.ndarray, fraction: int) -> int:
    """How many contributions of rays (R, 3) float32 saturate, in any colour: light that gets lost."""
    return int(np.count_nonzero(beyond_fixed(contribution, fraction).any(axis=1)))


def accumulate(slot: np.ndarray, contribution: np.ndarray, slots: int, fraction: int) -> np.ndarray:
    """Contributions of rays (R, 3) float32 to accumulators `slot` (R,) of `slots`: their sums, (slots, 3) int64.

    Each contribution is rounded to `fraction` bits after the point, to nearest even, saturating at 32 bits (NaN is 0);
    the sums are exact. Hardware needs 32 + log2(rays a texel) bits.
    """
    total = np.zeros((slots, 3), dtype=np.int64)
    np.add.at(total, slot, float_to_fixed(contribution, fraction).astype(np.int64))
    return total


def luminance_sums(
    slot: np.ndarray, contribution: np.ndarray, slots: int, fraction: int
) -> tuple[np.ndarray, np.ndarray]:
    """Sums of the luminance of contributions and of its square, (slots,) int64 each; arguments as for `accumulate`.

    Of the rounded contributions: (r + 2 g + b) / 16, rounded down, saturating at 24 bits. The sums are exact; hardware
    needs 24 + log2(rays a texel) and 48 + log2(rays a texel) bits, 37 and 61 for 8192 rays.
    """
    fixed = float_to_fixed(contribution, fraction).astype(np.int64)
    value = (fixed[:, 0] + 2 * fixed[:, 1] + fixed[:, 2]) >> _LUMINANCE_SHIFT
    value = np.clip(value, 0, (1 << LUMINANCE_BITS) - 1)
    sums, squares = np.zeros(slots, dtype=np.int64), np.zeros(slots, dtype=np.int64)
    np.add.at(sums, slot, value)
    np.add.at(squares, slot, value * value)
    return sums, squares


def light_of(irradiance: np.ndarray, fraction: int) -> int:
    """Luminance of texels (M, 3) float32 together, in fixed point as contributions are; 32 + log2(M) bits."""
    return int(float_to_fixed(luminance(irradiance), fraction).sum(dtype=np.int64))


def settled(totals: list[int]) -> bool:
    """Whether light that comes to rest, a bounce a round, lacks less than 2**-SETTLED_BITS of what it will come to.

    `totals` is all light after each round so far, from darkness on. Late rounds rise in geometric progression; the rest
    is the sum of its further terms, d * d / (c - d) for rises of c and then d. Three rounds are needed for that.
    """
    if len(totals) < 3 or not totals[-1]:
        return False
    before, last = totals[-2] - totals[-3], totals[-1] - totals[-2]
    return last <= 0 or (last < before and (last * last << SETTLED_BITS) < totals[-1] * (before - last))


def dark(totals: list[int]) -> bool:
    """Whether no light has come in three rounds: there is none where they look, and none will come from there."""
    return len(totals) >= 3 and not totals[-1]


def brightness_of(irradiance: np.ndarray, fraction: int) -> int:
    """Luminance of texels (M, 3) float32 as a logarithm in half octaves, of all together."""
    return int(half_octaves(float_to_fixed(luminance(irradiance), fraction).astype(np.int64)).sum())


def at_rest(sweeps: list[int], texels: int) -> bool:
    """Whether so many texels, after each time that all were sampled anew, changed little the last two times.

    `sweeps` has their brightness (`brightness_of`) each time. By less than 2**-REST_BITS half octaves on average, half
    a per cent, and what noise may come to in the sum: the root of twice their number. Logarithms, because a dark corner
    that light comes to after many bounces says nothing in a sum beside the lamp.
    """
    last = sweeps[-3:]
    if len(last) < 3:
        return False
    excess = (max(last) - min(last) << REST_BITS) - texels
    return excess < 0 or excess * excess < texels << 2 * REST_BITS + 1


def irradiance(total: np.ndarray, fraction: np.ndarray | int) -> np.ndarray:
    """Accumulators (M, 3) int64 to float32, rounded once."""
    return np.asarray(fixed64_to_float(total, fraction))
