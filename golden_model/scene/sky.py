"""The picture of a sky as rays read it, and the table by which light samples choose from it.

A sky comes by latitude and longitude, which takes angles to read. So it is laid out once on an octahedral map
(`golden_model.tables.octahedral`), turned into the world: every texel the mean of what it covers. Pixels, mirrors and
glass read that map between its texels. Rays of texels read a coarse one of `TABLE_SIDE` squared *cells*, each the mean
of what the fine one has there, so the energy is the same; and light samples choose a cell by its light, from whole
numbers. That a cell is even is what keeps both quiet: no sample within it is brighter than another.

What is made here once is float64 without a sine of the host's; what is read and chosen with every ray is float32 under
the numeric contract and integers.
"""

import numpy as np

from lightloom.golden_model.numerics.affine import transformed
from lightloom.golden_model.numerics.directions import sine_cosine_of
from lightloom.golden_model.numerics.floats import flush
from lightloom.golden_model.tables.octahedral import unfolded
from lightloom.golden_model.tables.sky import TABLE_BITS, TABLE_SIDE, SkyMap, SkyTable, luminance

LARGEST_SIDE = 1024
"""Of a fine map: a texel of a tenth to a fifth of a degree."""
_SPLIT = 4  # points along each side of a texel that its mean is made of
_PI = 3.141592653589793


def fine_side(height: int) -> int:
    """Of the fine map of a picture of so many rows: a power of two, twice as many, `TABLE_SIDE` to `LARGEST_SIDE`."""
    return min(max(TABLE_SIDE, 2 << (height - 1).bit_length()), LARGEST_SIDE)


def laid_out(picture: np.ndarray, rotation: np.ndarray, side: int) -> SkyMap:
    """A picture by latitude and longitude, (H, 2 H, 3), turned by `rotation` (3, 3), as a map of `side` squared texels.

    A pixel of the picture is even. A texel is the mean of `_SPLIT` squared points, each by its solid angle.
    """
    out = np.zeros((side, side, 3), dtype=np.float32)
    steps = (np.arange(side * _SPLIT) + 0.5) * (2.0 / (side * _SPLIT)) - 1.0
    back, borders = rotation.astype(np.float64).T, _borders(picture.shape[0])
    for row in range(side):
        across = np.broadcast_to(steps, (_SPLIT, len(steps)))
        down = np.broadcast_to(steps[row * _SPLIT : (row + 1) * _SPLIT, None], across.shape)
        point = unfolded(np.stack([across, down], axis=-1))
        value = picture[_pixels(transformed(point, back, np.zeros(3)), *borders)].astype(np.float64)
        out[row] = _mean(value, _solid_angle(point), _SPLIT)[0]
    return SkyMap(radiance=flush(out))


def _solid_angle(point: np.ndarray) -> np.ndarray:
    """Of unit pieces of the square around points of the octahedron (..., 3) float64: (...)."""
    square = point[..., 0] * point[..., 0] + point[..., 1] * point[..., 1] + point[..., 2] * point[..., 2]
    return 1.0 / (square * np.sqrt(square))


def _mean(value: np.ndarray, weight: np.ndarray, side: int) -> np.ndarray:
    """The weighted means of squares of `side` of values (H, W, 3), by weights (H, W)."""

    def squares(array: np.ndarray) -> np.ndarray:
        height, width = array.shape[0] // side, array.shape[1] // side
        parts = array.reshape(height, side, width, side, -1).swapaxes(1, 2).reshape(height, width, side * side, -1)
        return np.cumsum(parts, axis=2)[:, :, -1]

    return squares(value * weight[..., None]) / squares(weight)


def _borders(height: int) -> tuple[np.ndarray, np.ndarray]:
    """Where the pixels of a picture of `height` rows meet: of rows -cosine, of columns `_around`; both rising."""
    _, upright = sine_cosine_of(np.arange(1, height) * (_PI / height))
    return -upright, _around(*sine_cosine_of(np.arange(1, 2 * height) * (_PI / height) - _PI))


def _pixels(direction: np.ndarray, rows: np.ndarray, columns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Row and column of the pixels in directions (..., 3) float64: found among their borders, so no arc is needed."""
    x, y, z = direction[..., 0], direction[..., 1], direction[..., 2]
    downwards = -y / np.sqrt(x * x + y * y + z * z)
    return np.searchsorted(rows, downwards, side="right"), np.searchsorted(columns, _around(x, -z), side="right")


def _around(sine: np.ndarray, cosine: np.ndarray) -> np.ndarray:
    """What rises with the angle from -pi to pi whose sine and cosine these are, up to a common factor: -2 to 2."""
    size = np.abs(sine) + np.abs(cosine)
    return np.copysign(1.0 - cosine / np.where(size > 0, size, 1.0), sine)


def table_of(fine: SkyMap, side: int = TABLE_SIDE) -> SkyTable:
    """The table of a map, of `side` squared cells or as many as the map has texels."""
    side = min(side, fine.side)
    factor = fine.side // side
    steps = (np.arange(fine.side) + 0.5) * (2.0 / fine.side) - 1.0
    point = unfolded(np.stack(np.broadcast_arrays(steps[None, :], steps[:, None]), axis=-1))
    angle = _solid_angle(point)
    cells = _mean(fine.radiance.astype(np.float64), angle, factor)
    light = luminance(cells)
    covered = _mean(angle[..., None], np.ones_like(angle), factor)[..., 0]
    power = light * covered
    # However they are rounded their sum stays below 2**TABLE_BITS; what shines at all is chosen sometimes.
    weight = np.rint(power / max(_total(power), 1e-300) * (2.0**TABLE_BITS - 2 * side * side))
    weight = np.where(power > 0, np.maximum(weight, 1), 0).astype(np.uint64)
    begin = np.concatenate([np.zeros((side, 1), dtype=np.uint64), np.cumsum(weight, axis=1)], axis=1)
    row_begin = np.concatenate([[0], np.cumsum(begin[:, -1])]).astype(np.uint64)
    area = (2.0 / side) ** 2
    wide = weight.astype(np.float64)
    share = np.where(wide > 0, row_begin[-1].astype(np.float64) * area / np.maximum(wide, 1), 0)
    colour = np.array([_total(cells[..., k] * covered) for k in range(3)]) / _total(covered)
    mean = float(luminance(colour))
    return SkyTable(
        map=SkyMap(radiance=flush(cells.astype(np.float32))),
        row_begin=row_begin,
        begin=begin,
        share=share.astype(np.float32),
        mean_colour=colour,
        contrast=float(light.max()) / mean if mean > 0 else 0.0,
    )


def _total(values: np.ndarray) -> float:
    return float(np.cumsum(values.reshape(-1))[-1])
