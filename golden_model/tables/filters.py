"""Reads between texels, of lightmaps and of textures: exact sums of binary16 values, each rounded once.

Places are rounded to 1/256 of a texel. So the weights of the four texels around one are whole numbers in 2**-16 that
add up to 2**16; and as every binary16 number is a whole number of 2**-24, the weighted sums are whole numbers too: the
same bits in whatever order they are added, and below 2**64 between two levels as well.
"""

import numpy as np

from lightloom.golden_model.numerics.floats import float_to_fixed, float_to_half, flush, half_to_float, quiet

PLACE_BITS = 8
"""Of a place between two texels, after the point: a bilinear read has weights of twice as many."""
_ONE = 1 << PLACE_BITS
VALUE_BITS = 24
"""After the point of every binary16 number, subnormal ones included; before it there are 16."""
LEVEL_BITS = 8
"""Of a level of detail, after the point."""


@quiet
def corner(place: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Which texels lie around places (N, 2) float32, in texels: (column (N,), row (N,), weight (N, 4)), all int64.

    The first of the four texels is at (column, row), which lies outside the image by one where the place is within half
    a texel of its border, and further where it is outside itself. Weights are those of `corners_of`.
    """
    x, y = float_to_fixed(flush(place - np.float32(0.5)), PLACE_BITS).astype(np.int64).T
    fx, fy = x & (_ONE - 1), y & (_ONE - 1)
    weight = np.stack([(_ONE - fx) * (_ONE - fy), fx * (_ONE - fy), (_ONE - fx) * fy, fx * fy], axis=1)
    return x >> PLACE_BITS, y >> PLACE_BITS, weight


def corners_of(column: list[np.ndarray], row: list[np.ndarray], base: np.ndarray, width: np.ndarray) -> np.ndarray:
    """Texels of two columns (N,) each and two rows in images of `width` (N,) that begin at texel `base` (N,).

    Returns (N, 4) int64, in the order (0,0), (1,0), (0,1), (1,1) of (column, row).
    """
    return np.stack([base + row[j] * width + column[i] for j in (0, 1) for i in (0, 1)], axis=1)


def in_fixed(values: np.ndarray) -> np.ndarray:
    """Float32 (...) that binary16 holds as whole numbers of 2**-VALUE_BITS: (...) int64."""
    return (values.astype(np.float64) * 2.0**VALUE_BITS).astype(np.int64)


def to_half(total: np.ndarray, bits: int = 0) -> np.ndarray:
    """Whole numbers (...) int64 in 2**-(VALUE_BITS + bits) as binary16 holds them: (...) float32.

    Rounded twice, to nearest even: to float32, and then to binary16, as the number units do it.
    """
    return half_to_float(float_to_half(_rounded(total, bits)))


def weighted(values: np.ndarray, texel: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """The sum over four texels (N, 4) of `values` (texels, K), float32 that binary16 holds, 0 or more.

    Returns (N, K) int64 below 2**56, in 2**-40.
    """
    return np.asarray((in_fixed(values[texel]) * weight[:, :, None]).sum(axis=1))


def read(total: np.ndarray) -> np.ndarray:
    """What `weighted` gives, (N, K), to float32: the only rounding, to nearest even."""
    return _rounded(total, 2 * PLACE_BITS)


def read_between(a: np.ndarray, b: np.ndarray, fraction: np.ndarray) -> np.ndarray:
    """(1 - f) a + f b of what `weighted` gives of two levels, (N, K), with f (N,) in 1/256ths: (N, K) float32."""
    part = fraction[:, None].astype(np.uint64)
    # Below 2**64, so its bits are those of an unsigned number.
    total = (np.uint64(1 << LEVEL_BITS) - part) * a.view(np.uint64) + part * b.view(np.uint64)
    return _rounded(total, 2 * PLACE_BITS + LEVEL_BITS)


def _rounded(total: np.ndarray, bits: int) -> np.ndarray:
    """Sums of values times weights of so many bits after the point."""
    return total.astype(np.float32) * np.float32(2.0 ** -(VALUE_BITS + bits))
