"""Lightmaps: one map of texels an object, all maps in one flat array, and the lookup that shading does.

A texel (column i, row j) of object o is number offset[o] + j * width[o] + i, its centre is at (i + 0.5, j + 0.5) of the
object's lightmap coordinates.

Published maps have coarser levels as well ([0034], [0084]): a texel (i, j) of level l stands for the 2**l x 2**l texels
from (i * 2**l, j * 2**l) on, so coordinates in a level are those of the map times 2**-l; `levels_of` says where they
lie.
"""

from dataclasses import dataclass

import numpy as np

from lightloom.golden_model.numerics.floats import flush, quiet
from lightloom.golden_model.numerics.vectors import interpolate

EMPTY, VALID, BURIED = 0, 1, 2
"""States of a texel; see `golden_model.contract.formats.TEXEL`."""


@dataclass(frozen=True, kw_only=True)
class Lightmaps:
    """O maps with N texels together, over T triangles."""

    width: np.ndarray
    """Columns of each map, (O,) int32."""
    height: np.ndarray
    """Rows of each map, (O,) int32."""
    offset: np.ndarray
    """First texel of each map, (O,) int32."""
    uv: np.ndarray
    """Lightmap coordinates of the corners, in texels of the object's map, (T, 3, 2) float32."""
    texels: np.ndarray
    """TEXEL (N,)."""
    chart: np.ndarray
    """Chart of each texel, (N,) int32, numbered through all maps; -1 outside all charts."""
    fill: np.ndarray
    """Texel whose value is shown at each texel, (N,) int32: a valid one (itself if it is), -1 if its map has none."""
    deepest: np.ndarray | None = None
    """Coarsest level that may be read at each texel (`golden_model.charts.read_levels`), (N,) uint8; None: any."""


def lightmap_coordinates(lightmaps: Lightmaps, primitive: np.ndarray, u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Where hits (triangle (N,), barycentrics (N,)) lie in their object's map: (N, 2) float32, in texels."""
    corners = lightmaps.uv[primitive]
    return interpolate(corners[:, 0], corners[:, 1], corners[:, 2], u, v)


@dataclass(frozen=True, kw_only=True)
class Levels:
    """Where the levels of O maps lie in a published array: level 0 of all maps first, as `Lightmaps` numbers them.

    After the N texels of level 0 come levels 1, 2, ... of the first map, then those of the second, and so on. Level l
    has ceil(width / 2**l) columns and ceil(height / 2**l) rows; the last one is a single texel.
    """

    count: np.ndarray
    """Number of a map's last level, (O,) int64: 0 for a map of one texel, at most 14."""
    width: np.ndarray
    """Columns of each level, (O, L) int64, L > every `count`."""
    height: np.ndarray
    """Rows of each level, (O, L) int64."""
    first: np.ndarray
    """First texel of each level, (O, L) int64; of no meaning past `count`."""
    total: int
    """Texels of all levels of all maps."""


def levels_of(lightmaps: Lightmaps) -> Levels:
    """The levels of all maps, from their widths, heights and offsets alone."""
    width, height = lightmaps.width.astype(np.int64), lightmaps.height.astype(np.int64)
    side = np.maximum(width, height)
    count = np.array([(int(s) - 1).bit_length() if s > 1 else 0 for s in side], dtype=np.int64)
    level = np.arange(count.max(initial=0) + 1)
    widths, heights = (-(-size[:, None] >> level) for size in (width, height))
    area = np.where((level >= 1) & (level <= count[:, None]), widths * heights, 0)
    base = len(lightmaps.texels)
    first = base + (np.cumsum(area.reshape(-1)) - area.reshape(-1)).reshape(area.shape)
    first[:, 0] = lightmaps.offset
    return Levels(count=count, width=widths, height=heights, first=first, total=base + int(area.sum()))


def bilinear_taps(lightmaps: Lightmaps, object_id: np.ndarray, uv: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The four texels around lightmap coordinates (N, 2) of objects (N,), and their weights.

    Returns (texel (N, 4) int64, weight (N, 4) float32), in the order (0,0), (1,0), (0,1), (1,1) of (column, row).
    Beyond the border of the map its last texels are repeated. Weights are the float32 products of the fractions.
    """
    width, height = lightmaps.width[object_id].astype(np.int64), lightmaps.height[object_id].astype(np.int64)
    return _taps(width, height, lightmaps.offset[object_id].astype(np.int64), uv)


@quiet
def _taps(width: np.ndarray, height: np.ndarray, base: np.ndarray, uv: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """As `bilinear_taps`, in images of (N,) columns and rows that begin at texel `base` (N,)."""
    half = np.float32(0.5)
    x, y = flush(uv[:, 0] - half), flush(uv[:, 1] - half)
    left, top = np.floor(x), np.floor(y)
    fx, fy = flush(x - left), flush(y - top)
    gx, gy = flush(np.float32(1) - fx), flush(np.float32(1) - fy)
    column = [np.clip(left.astype(np.int64) + k, 0, width - 1) for k in (0, 1)]
    row = [np.clip(top.astype(np.int64) + k, 0, height - 1) for k in (0, 1)]
    texel = np.stack([base + row[j] * width + column[i] for j in (0, 1) for i in (0, 1)], axis=1)
    weight = np.stack([flush(gx * gy), flush(fx * gy), flush(gx * fy), flush(fx * fy)], axis=1)
    return texel, weight


def bilinear(lightmaps: Lightmaps, values: np.ndarray, object_id: np.ndarray, uv: np.ndarray) -> np.ndarray:
    """Values (texels, K) float32 read between texels at coordinates (N, 2) of objects (N,): (N, K) float32.

    ((w0 t0 + w1 t1) + w2 t2) + w3 t3, flushed at each step. Read values to which `fill` was applied.
    """
    return _weighted(values, *bilinear_taps(lightmaps, object_id, uv))


@quiet
def _weighted(values: np.ndarray, texel: np.ndarray, weight: np.ndarray) -> np.ndarray:
    total = flush(values[texel[:, 0]] * weight[:, :1])
    for k in (1, 2, 3):
        total = flush(total + flush(values[texel[:, k]] * weight[:, k : k + 1]))
    return total


@quiet
def sample(
    lightmaps: Lightmaps, values: np.ndarray, object_id: np.ndarray, uv: np.ndarray, lod: np.ndarray
) -> np.ndarray:
    """Trilinear: values (texels of all levels, K) float32 at coordinates (N, 2) of objects (N,): (N, K) float32.

    `uv` is in texels of level 0, `lod` (N,) an integer in 1/256 of a level as in GBUFFER. At 0 or below this is
    `bilinear`, bit for bit; beyond the last level of the map, or the `deepest` one at the texel, it is that level.
    Between two levels, with f = fraction / 256: (1 - f) a + f b, each of a and b read bilinearly, flushed at each step.
    """
    out = np.empty((len(uv), values.shape[1]), dtype=np.float32)
    near = lod <= 0
    out[near] = bilinear(lightmaps, values, object_id[near], uv[near])
    far = ~near
    if not far.any():
        return out
    levels = levels_of(lightmaps)
    if len(values) != levels.total:
        raise ValueError(f"{len(values)} values: all levels of these maps have {levels.total}")
    owner, place = object_id[far], uv[far]
    wanted = np.minimum(lod[far].astype(np.int64), _deepest(lightmaps, levels, owner, place) << 8)
    fine, fraction = wanted >> 8, ((wanted & 255).astype(np.float32) * np.float32(1 / 256))[:, None]
    a, b = (
        _weighted(
            values,
            *_taps(
                levels.width[owner, level],
                levels.height[owner, level],
                levels.first[owner, level],
                flush(place * np.ldexp(np.float32(1), -level)[:, None]),
            ),
        )
        for level in (fine, np.minimum(fine + 1, levels.count[owner]))
    )
    out[far] = flush(flush(a * flush(np.float32(1) - fraction)) + flush(b * fraction))
    return out


@quiet
def _deepest(lightmaps: Lightmaps, levels: Levels, owner: np.ndarray, uv: np.ndarray) -> np.ndarray:
    """The coarsest level that may be read at coordinates (N, 2) of maps (N,): (N,) int64."""
    if lightmaps.deepest is None:
        return levels.count[owner]
    column, row = (np.floor(uv[:, axis]).astype(np.int64) for axis in (0, 1))
    column = np.clip(column, 0, levels.width[owner, 0] - 1)
    row = np.clip(row, 0, levels.height[owner, 0] - 1)
    return lightmaps.deepest[levels.first[owner, 0] + row * levels.width[owner, 0] + column].astype(np.int64)


def filled(lightmaps: Lightmaps, values: np.ndarray) -> np.ndarray:
    """Values (N, K) with those of empty and buried texels replaced by the texel that `fill` names; zero where none."""
    return np.where((lightmaps.fill >= 0)[:, None], values[np.maximum(lightmaps.fill, 0)], values.dtype.type(0))
