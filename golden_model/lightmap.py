"""Lightmaps: one map of texels an object, all maps in one flat array, and the lookup that shading does.

A texel (column i, row j) of object o is number offset[o] + j * width[o] + i, its centre is at (i + 0.5, j + 0.5) of the
object's lightmap coordinates.
"""

from dataclasses import dataclass

import numpy as np

from golden_model.floats import flush, quiet
from golden_model.vectors import interpolate

EMPTY, VALID, BURIED = 0, 1, 2
"""States of a texel; see `golden_model.formats.TEXEL`."""


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


def lightmap_coordinates(lightmaps: Lightmaps, primitive: np.ndarray, u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Where hits (triangle (N,), barycentrics (N,)) lie in their object's map: (N, 2) float32, in texels."""
    corners = lightmaps.uv[primitive]
    return interpolate(corners[:, 0], corners[:, 1], corners[:, 2], u, v)


@quiet
def bilinear_taps(lightmaps: Lightmaps, object_id: np.ndarray, uv: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The four texels around lightmap coordinates (N, 2) of objects (N,), and their weights.

    Returns (texel (N, 4) int64, weight (N, 4) float32), in the order (0,0), (1,0), (0,1), (1,1) of (column, row).
    Beyond the border of the map its last texels are repeated. Weights are the float32 products of the fractions.
    """
    half = np.float32(0.5)
    x, y = flush(uv[:, 0] - half), flush(uv[:, 1] - half)
    left, top = np.floor(x), np.floor(y)
    fx, fy = flush(x - left), flush(y - top)
    gx, gy = flush(np.float32(1) - fx), flush(np.float32(1) - fy)
    width, height = lightmaps.width[object_id].astype(np.int64), lightmaps.height[object_id].astype(np.int64)
    column = [np.clip(left.astype(np.int64) + k, 0, width - 1) for k in (0, 1)]
    row = [np.clip(top.astype(np.int64) + k, 0, height - 1) for k in (0, 1)]
    base = lightmaps.offset[object_id].astype(np.int64)
    texel = np.stack([base + row[j] * width + column[i] for j in (0, 1) for i in (0, 1)], axis=1)
    weight = np.stack([flush(gx * gy), flush(fx * gy), flush(gx * fy), flush(fx * fy)], axis=1)
    return texel, weight


@quiet
def bilinear(lightmaps: Lightmaps, values: np.ndarray, object_id: np.ndarray, uv: np.ndarray) -> np.ndarray:
    """Values (texels, K) float32 read between texels at coordinates (N, 2) of objects (N,): (N, K) float32.

    ((w0 t0 + w1 t1) + w2 t2) + w3 t3, flushed at each step. Read values to which `fill` was applied.
    """
    texel, weight = bilinear_taps(lightmaps, object_id, uv)
    total = flush(values[texel[:, 0]] * weight[:, :1])
    for k in (1, 2, 3):
        total = flush(total + flush(values[texel[:, k]] * weight[:, k : k + 1]))
    return total


def filled(lightmaps: Lightmaps, values: np.ndarray) -> np.ndarray:
    """Values (N, K) with those of empty and buried texels replaced by the texel that `fill` names; zero where none."""
    return np.where((lightmaps.fill >= 0)[:, None], values[np.maximum(lightmaps.fill, 0)], values.dtype.type(0))
