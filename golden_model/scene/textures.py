"""Textures and their mip chains: what a fragment's or a hit's albedo is multiplied with ([0041], [0057]).

A texture is a picture of linear light that repeats in both directions. Each of its levels is the one before at half the
size (rounded down, at least 1), every texel the mean of what it covers there. The mean of a level is that of the
picture, whatever its size: where three texels become one in part, each counts for the part of it that is covered.

A lookup takes the two levels around the level of detail, each bilinearly, and goes between them in 1/256ths: exact sums
of texels that binary16 holds, rounded once (`golden_model.scene.filters`).
"""

from dataclasses import dataclass

import numpy as np

from lightloom.golden_model.numerics.floats import (
    fixed_to_float,
    float_to_fixed_down,
    float_to_half,
    flush,
    half_to_float,
    quiet,
)
from lightloom.golden_model.scene.filters import LEVEL_BITS, corner, corners_of, read, read_between, weighted
from lightloom.golden_model.scene.scene import Scene

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


def _halved(rows: np.ndarray) -> np.ndarray:
    """(n, ...) float64 to (max(n // 2, 1), ...): means of what each covers, (first + middle) + last."""
    n = len(rows)
    if n == 1:
        return rows
    m = n // 2
    place = np.arange(m, dtype=np.float64).reshape(-1, *[1] * (rows.ndim - 1))
    if n % 2 == 0:
        return (rows[0::2] + rows[1::2]) * 0.5
    # Output k covers n/m input rows from k n/m on: parts of the first and the third, all of the second.
    return (rows[0 : n - 1 : 2] * ((m - place) / n) + rows[1::2] * (m / n)) + rows[2::2] * ((place + 1) / n)


def build_textures(pictures: tuple[np.ndarray, ...]) -> Textures | None:
    """The mip chains of pictures (H, W, 3) float32, row 0 at v = 0, at most 65504; None without pictures.

    Made in float64 from level to level; each level is rounded to float32 and to binary16, the next is made of the
    unrounded one.
    """
    if not pictures:
        return None
    parts: list[np.ndarray] = []
    sizes: list[list[tuple[int, int, int]]] = []
    used = 0
    for picture in pictures:
        level = picture.astype(np.float64)
        chain = []
        while True:
            chain.append((level.shape[1], level.shape[0], used))
            parts.append(level.astype(np.float32).reshape(-1, 3))
            used += len(parts[-1])
            if level.shape[:2] == (1, 1):
                break
            level = _halved(_halved(level).swapaxes(0, 1)).swapaxes(0, 1)
        sizes.append(chain)
    most = max(map(len, sizes))
    table = np.array([chain + [(1, 1, chain[-1][2])] * (most - len(chain)) for chain in sizes], dtype=np.int64)
    width, height = table[..., 0], table[..., 1]
    return Textures(
        texels=half_to_float(float_to_half(np.concatenate(parts))),
        levels=np.array([len(chain) for chain in sizes], dtype=np.int64),
        width=width,
        height=height,
        offset=table[..., 2],
        inverse=np.stack([1 / width[:, 0], 1 / height[:, 0]], axis=-1).astype(np.float32),
    )


@quiet
def texel_coordinates(scene: Scene, primitive: np.ndarray) -> np.ndarray:
    """Texture coordinates of the corners of triangles (N,), in texels of the finest level, (N, 3, 2) float32.

    (0, 0) where a triangle has no texture; its emission's is as large as that of its albedo.
    """
    sizes = np.array([(0, 0), *((p.shape[1], p.shape[0]) for p in scene.textures)], dtype=np.float32)
    size = sizes[np.where(scene.texture >= 0, scene.texture, scene.emission_texture)[scene.material[primitive]] + 1]
    return flush(scene.texture_uv[primitive] * size[:, None, :])


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
