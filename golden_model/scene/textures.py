"""Textures and their mip chains: what a fragment's or a hit's albedo is multiplied with ([0041], [0057]).

A texture is a picture of linear light that repeats in both directions. Each of its levels is the one before at half the
size (rounded down, at least 1), every texel the mean of what it covers there. The mean of a level is that of the
picture, whatever its size: where three texels become one in part, each counts for the part of it that is covered.

A lookup takes the two levels around the level of detail, each bilinearly, and goes between them in 1/256ths.
"""

from dataclasses import dataclass

import numpy as np

from lightloom.golden_model.numerics.floats import flush, quiet
from lightloom.golden_model.scene.scene import Scene

LOD_ONE = 256
"""Steps of the level of detail from one level to the next."""


@dataclass(frozen=True, kw_only=True)
class Textures:
    """K textures with up to L levels each, all texels in one array."""

    texels: np.ndarray
    """Linear RGB, (texels, 3) float32: texture by texture, level by level, row by row from v = 0."""
    levels: np.ndarray
    """Levels of each texture, (K,) int64."""
    width: np.ndarray
    """Columns of each level, (K, L) int64, 1 beyond the last."""
    height: np.ndarray
    """Rows of each level, (K, L) int64, 1 beyond the last."""
    offset: np.ndarray
    """First texel of each level, (K, L) int64."""
    scale: np.ndarray
    """Size of each level over that of the finest, across and down, (K, L, 2) float32."""


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
    """The mip chains of pictures (H, W, 3) float32, row 0 at v = 0; None without pictures.

    Made in float64 from level to level, rounded once to float32.
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
        texels=flush(np.concatenate(parts)),
        levels=np.array([len(chain) for chain in sizes], dtype=np.int64),
        width=width,
        height=height,
        offset=table[..., 2],
        scale=np.stack([width / width[:, :1], height / height[:, :1]], axis=-1).astype(np.float32),
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
def _bilinear(textures: Textures, index: np.ndarray, level: np.ndarray, place: np.ndarray) -> np.ndarray:
    """Levels (N,) of textures (N,) read at `place` (N, 2) in texels of the finest level: (N, 3)."""
    width, height = textures.width[index, level], textures.height[index, level]
    at = flush(flush(place * textures.scale[index, level]) - np.float32(0.5))
    whole = np.floor(at)
    fx, fy = flush(at - whole).T
    gx, gy = flush(np.float32(1) - fx), flush(np.float32(1) - fy)
    x, y = whole.astype(np.int64).T
    columns, rows = (x % width, (x + 1) % width), (y % height, (y + 1) % height)
    total = np.zeros((len(index), 3), dtype=np.float32)
    for j, weight_y in ((0, gy), (1, fy)):
        for i, weight_x in ((0, gx), (1, fx)):
            texel = textures.texels[textures.offset[index, level] + rows[j] * width + columns[i]]
            total = flush(total + flush(texel * flush(weight_x * weight_y)[:, None]))
    return total


@quiet
def sample_textures(textures: Textures, index: np.ndarray, place: np.ndarray, lod: np.ndarray) -> np.ndarray:
    """Textures (N,) read at `place` (N, 2), texels of the finest level, at a level of detail (N,) in 1/256ths: (N, 3).

    Up to 0 the finest level, from the last level on the last one; between two levels a + f (b - a).
    """
    last = (textures.levels[index] - 1) * LOD_ONE
    lod = np.clip(lod.astype(np.int64), 0, last)
    level, fraction = lod // LOD_ONE, lod % LOD_ONE
    out = _bilinear(textures, index, level, place)
    mixed = np.flatnonzero(fraction)
    coarser = _bilinear(textures, index[mixed], level[mixed] + 1, place[mixed])
    step = flush(fraction[mixed].astype(np.float32) * np.float32(1 / LOD_ONE))[:, None]
    out[mixed] = flush(out[mixed] + flush(step * flush(coarser - out[mixed])))
    return out
