"""Lightmaps: one map of texels an object, all maps in one flat array, and the lookup that shading does.

A texel (column i, row j) of object o is number offset[o] + j * width[o] + i, its centre is at (i + 0.5, j + 0.5) of the
object's lightmap coordinates.

Published maps have coarser levels as well ([0034], [0084]): a texel (i, j) of level l stands for the 2**l x 2**l texels
from (i * 2**l, j * 2**l) on, so coordinates in a level are those of the map times 2**-l; `levels_of` says where they
lie.
"""

from dataclasses import dataclass

import numpy as np

from lightloom.golden_model.numerics.floats import float_to_fixed_down, flush, quiet
from lightloom.golden_model.numerics.vectors import interpolate
from lightloom.golden_model.tables.filters import LEVEL_BITS, corner, corners_of, read, read_between, weighted

EMPTY, VALID, BURIED = 0, 1, 2
"""States of a texel; see `golden_model.contract.formats.TEXEL`."""
RIGHT, DOWN = 1, 2
"""Bits of a texel's links: to the next one of its row, and to the one below."""

SIDE_LEVELS = 3
"""Levels inside a region, what is published at once: 4 x 4, 2 x 2 and 1 x 1 texels."""

SIDE = 1 << SIDE_LEVELS
"""Texels of level 0 along a region's side."""


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
    """Texel whose value is shown at each texel, (N,) int32: a valid one (itself if it is) of its region of 8 x 8 texels
    or of one of the eight around it; -1 if they have none that it may show: 0 is shown there."""
    back_rows: np.ndarray | None = None
    """Rows from the texels of fronts to those of backs, (O,) int32; 0 where backs have none. None: nowhere."""
    deepest: np.ndarray | None = None
    """Coarsest level that may be read at each texel (`golden_model.charts.read_levels`), (N,) uint8; None: any."""

    links: np.ndarray | None = None
    """RIGHT and DOWN: which neighbours each texel is joined to (`golden_model.charts.links`), (N,) uint8.

    None: to those of its chart.
    """


def joined(lightmaps: Lightmaps) -> tuple[np.ndarray, np.ndarray]:
    """Whether each texel is joined to the one to its right, and to the one below, (N,) bool each."""
    if lightmaps.links is not None:
        return (lightmaps.links & RIGHT) > 0, (lightmaps.links & DOWN) > 0
    chart, number = lightmaps.chart, np.arange(len(lightmaps.chart))
    out = []
    for there, step in zip(followed(lightmaps), steps_of(lightmaps), strict=True):
        other = np.where(there, number + step, number)
        out.append(there & (chart == chart[other]) & (chart >= 0))
    return out[0], out[1]


def followed(lightmaps: Lightmaps) -> tuple[np.ndarray, np.ndarray]:
    """Whether the map goes on to the right of each texel, and below it, (N,) bool each."""
    owner = lightmaps.texels["object"]
    row, column = row_and_column(lightmaps, np.arange(len(owner)))
    return column < lightmaps.width[owner] - 1, row < lightmaps.height[owner] - 1


def steps_of(lightmaps: Lightmaps) -> tuple[np.ndarray, np.ndarray]:
    """By how much the texel to the right of each has a larger number, and the one below it, (N,) int64 each."""
    width = lightmaps.width[lightmaps.texels["object"]].astype(np.int64)
    return np.ones_like(width), width


def row_and_column(lightmaps: Lightmaps, texel: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where texels (M,) lie in their maps, (M,) int64 each."""
    owner = lightmaps.texels["object"][texel]
    row, column = np.divmod(texel - lightmaps.offset[owner], lightmaps.width[owner])
    return row, column


def part_of(lightmaps: Lightmaps, number: int) -> slice:
    """The texels of one map."""
    first = int(lightmaps.offset[number])
    return slice(first, first + int(lightmaps.width[number]) * int(lightmaps.height[number]))


def lightmap_coordinates(lightmaps: Lightmaps, primitive: np.ndarray, u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Where hits (triangle (N,), barycentrics (N,)) lie in their object's map: (N, 2) float32, in texels."""
    corners = lightmaps.uv[primitive]
    return interpolate(corners[:, 0], corners[:, 1], corners[:, 2], u, v)


@quiet
def on_side(lightmaps: Lightmaps, object_id: np.ndarray, uv: np.ndarray, front: np.ndarray) -> np.ndarray:
    """Coordinates (N, 2) of fronts of objects (N,) to those of the side that is seen, the front or not (N,)."""
    if lightmaps.back_rows is None:
        return uv
    rows = np.where(front, 0, lightmaps.back_rows[object_id]).astype(np.float32)
    return np.stack([uv[:, 0], flush(uv[:, 1] + rows)], axis=1)


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

    Returns (texel (N, 4) int64, weight (N, 4) int64), in the order (0,0), (1,0), (0,1), (1,1) of (column, row). Beyond
    the border of the map its last texels are repeated. Coordinates are rounded to 1/256 of a texel, so weights are
    integers in 2**-16 that add up to 2**16.
    """
    width, height = lightmaps.width[object_id].astype(np.int64), lightmaps.height[object_id].astype(np.int64)
    return _taps(width, height, lightmaps.offset[object_id].astype(np.int64), uv)


def _taps(width: np.ndarray, height: np.ndarray, base: np.ndarray, uv: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """As `bilinear_taps`, in images of (N,) columns and rows that begin at texel `base` (N,)."""
    x, y, weight = corner(uv)
    column, row = ([np.clip(c + k, 0, size - 1) for k in (0, 1)] for c, size in ((x, width), (y, height)))
    return corners_of(column, row, base, width), weight


def bilinear(lightmaps: Lightmaps, values: np.ndarray, object_id: np.ndarray, uv: np.ndarray) -> np.ndarray:
    """Values (texels, K) read between texels at coordinates (N, 2) of objects (N,): (N, K) float32.

    Values are float32 that binary16 holds, 0 or more, as `readable` gives them, with `fill` applied. The weighted sum
    is exact, whatever the order, and rounded once.
    """
    return read(weighted(values, *bilinear_taps(lightmaps, object_id, uv)))


@quiet
def sample(
    lightmaps: Lightmaps, values: np.ndarray, object_id: np.ndarray, uv: np.ndarray, lod: np.ndarray
) -> np.ndarray:
    """Trilinear: values (texels of all levels, K), as `bilinear` takes them, at coordinates (N, 2) of objects (N,).

    Returns (N, K) float32. `uv` is in texels of level 0, `lod` (N,) an integer in 1/256 of a level as in GBUFFER. At 0
    or below this is `bilinear`, bit for bit; beyond the last level of the map, or the `deepest` one at the texel, it is
    that level. Between two levels, with f = fraction / 256: (1 - f) a + f b, exact like a and b, and rounded once.
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
    wanted = np.minimum(lod[far].astype(np.int64), _deepest(lightmaps, levels, owner, place) << LEVEL_BITS)
    fine = wanted >> LEVEL_BITS
    a, b = (
        weighted(
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
    out[far] = read_between(a, b, wanted - (fine << LEVEL_BITS))
    return out


@quiet
def _deepest(lightmaps: Lightmaps, levels: Levels, owner: np.ndarray, uv: np.ndarray) -> np.ndarray:
    """The coarsest level that may be read at coordinates (N, 2) of maps (N,): (N,) int64."""
    if lightmaps.deepest is None:
        return levels.count[owner]
    column, row = (float_to_fixed_down(uv[:, axis]).astype(np.int64) for axis in (0, 1))
    column = np.clip(column, 0, levels.width[owner, 0] - 1)
    row = np.clip(row, 0, levels.height[owner, 0] - 1)
    return lightmaps.deepest[levels.first[owner, 0] + row * levels.width[owner, 0] + column].astype(np.int64)


def filled(lightmaps: Lightmaps, values: np.ndarray) -> np.ndarray:
    """Values (N, K) with those of empty and buried texels replaced by the texel that `fill` names; zero where none."""
    return np.where((lightmaps.fill >= 0)[:, None], values[np.maximum(lightmaps.fill, 0)], values.dtype.type(0))
