"""The mip chains of textures, made once a scene; `golden_model.tables.textures` reads them.

A texture is a picture of linear light that repeats in both directions. Each of its levels is the one before at half the
size (rounded down, at least 1), every texel the mean of what it covers there. The mean of a level is that of the
picture, whatever its size: where three texels become one in part, each counts for the part of it that is covered.
"""

import numpy as np

from lightloom.golden_model.numerics.floats import (
    float_to_half,
    flush,
    half_to_float,
    quiet,
)
from lightloom.golden_model.scene.scene import Scene
from lightloom.golden_model.tables.textures import Textures


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
