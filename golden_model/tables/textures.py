"""Textures as they are read: what a fragment's or a hit's albedo is multiplied with ([0041], [0057]).

A lookup takes the two levels around the level of detail, each bilinearly, and goes between them in 1/256ths: exact sums
of texels that binary16 holds, rounded once (`golden_model.tables.filters`).
"""

from dataclasses import dataclass

import numpy as np

from lightloom.golden_model.numerics.floats import fixed_to_float, float_to_fixed_down, flush, quiet
from lightloom.golden_model.tables.filters import LEVEL_BITS, corner, corners_of, read, read_between, weighted

LOD_ONE = 1 << LEVEL_BITS
"""Steps of the level of detail from one level to the next."""


@dataclass(frozen=True, kw_only=True)
class Textures:
    """K textures with up to L levels each, all texels in one array."""

    texels: np.ndarray
    """Linear RGB that binary16 holds, (texels, 3) float32.

    Texture by texture, level by level, row by row from v = 0.
    """
    levels: np.ndarray
    """Levels of each texture, (K,) int64."""
    width: np.ndarray
    """Columns of each level, (K, L) int64, 1 beyond the last."""
    height: np.ndarray
    """Rows of each level, (K, L) int64, 1 beyond the last."""
    offset: np.ndarray
    """First texel of each level, (K, L) int64."""
    inverse: np.ndarray
    """One over the columns and the rows of the finest level, (K, 2) float32."""


@quiet
def _wrapped(textures: Textures, index: np.ndarray, place: np.ndarray) -> np.ndarray:
    """Places (N, 2) in texels of the finest levels of textures (N,) to what is left of whole pictures, 0 to 1."""
    pictures = flush(place * textures.inverse[index])
    part = flush(pictures - fixed_to_float(float_to_fixed_down(pictures)))
    # Beyond 2**31 pictures every place is a whole number, or infinite.
    return np.where((part < 0) | (part > 1), flush(pictures - pictures), part)


@quiet
def _level(textures: Textures, index: np.ndarray, level: np.ndarray, part: np.ndarray) -> np.ndarray:
    """The weighted sums at parts (N, 2) of pictures, in levels (N,) of textures (N,): (N, 3), for `read`."""
    width, height = textures.width[index, level], textures.height[index, level]
    x, y, weight = corner(flush(part * np.stack([width, height], axis=1).astype(np.float32)))
    # The last column is beside the first. Where the place is not a number, so is the column: 0.
    column, row = (
        [np.where(c + k < 0, c + k + size, (c + k) * (c + k < size)) for k in (0, 1)]
        for c, size in ((x, width), (y, height))
    )
    return weighted(textures.texels, corners_of(column, row, textures.offset[index, level], width), weight)


@quiet
def sample_textures(textures: Textures, index: np.ndarray, place: np.ndarray, lod: np.ndarray) -> np.ndarray:
    """Textures (N,) read at `place` (N, 2), texels of the finest level, at a level of detail (N,) in 1/256ths: (N, 3).

    Up to 0 the finest level, from the last level on the last one; between two levels, with f the fraction of the level
    of detail, (1 - f) a + f b.
    """
    last = (textures.levels[index] - 1) * LOD_ONE
    lod = np.clip(lod.astype(np.int64), 0, last)
    level, fraction = lod >> LEVEL_BITS, lod & (LOD_ONE - 1)
    part = _wrapped(textures, index, place)
    fine = _level(textures, index, level, part)
    out = read(fine)
    mixed = np.flatnonzero(fraction)
    coarser = _level(textures, index[mixed], level[mixed] + 1, part[mixed])
    out[mixed] = read_between(fine[mixed], coarser, fraction[mixed])
    return out
