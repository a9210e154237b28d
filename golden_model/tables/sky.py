"""A sky as rays read it, and the table by which light samples choose from it.

Pixels, mirrors and glass read a map on an octahedron (`golden_model.tables.octahedral`) between its texels. Rays of
texels read a coarse one of `TABLE_SIDE` squared *cells*, each the mean of what the fine one has there, so the energy is
the same; and light samples choose a cell by its light, from whole numbers. That a cell is even is what keeps both
quiet: no sample within it is brighter than another. `golden_model.scene.sky` makes both.
"""

from dataclasses import dataclass

import numpy as np

from lightloom.golden_model.numerics.counter_rng import uniform
from lightloom.golden_model.numerics.floats import float_to_fixed_down, flush, quiet
from lightloom.golden_model.tables.octahedral import folded, unfolded

TABLE_SIDE = 64
"""Cells of a table along each side, a power of two."""
TABLE_BITS = 31
"""The whole-number weights of all cells add up to less than 2**TABLE_BITS."""
SAMPLED_CONTRAST = 16.0
"""A sky is chosen by light samples if a cell is more than so many times as bright as the mean of all: from there on it
pays, whether there is a sun beside it or not (docs/update.md)."""


@dataclass(frozen=True, kw_only=True)
class SkyMap:
    """A sky on an octahedral map of S by S texels, S a power of two."""

    radiance: np.ndarray
    """(S, S, 3) float32; the first axis is z, the second x, both from -1 to 1."""

    @property
    def side(self) -> int:
        """S."""
        return len(self.radiance)

    def texel(self, point: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Row and column of the texels at points of the octahedron (..., 3), int64 each."""
        half = np.float32(self.side / 2)
        at = float_to_fixed_down(flush(flush(folded(point) + np.float32(1)) * half)).astype(np.int64)
        at = np.clip(at, 0, self.side - 1)
        return at[..., 1], at[..., 0]

    def nearest(self, point: np.ndarray) -> np.ndarray:
        """Radiance of the texels at points of the octahedron (..., 3): (..., 3) float32."""
        return self.radiance[self.texel(point)]

    @quiet
    def between(self, point: np.ndarray) -> np.ndarray:
        """Radiance between the four texels around points of the octahedron (N, 3): (N, 3) float32."""
        if self.side == 1:
            return np.broadcast_to(self.radiance[0, 0], point.shape)
        half, one = np.float32(self.side / 2), np.float32(1)
        at = flush(flush(flush(folded(point) + one) * half) - np.float32(0.5))
        first = float_to_fixed_down(at).astype(np.int64)
        part = flush(at - first.astype(np.float32))
        weight = flush(one - part), part
        total = np.zeros(point.shape, dtype=np.float32)
        for j in (0, 1):
            for i in (0, 1):
                row, column = self._across(first[:, 1] + j, first[:, 0] + i)
                share = flush(weight[i][:, 0] * weight[j][:, 1])
                total = flush(total + flush(self.radiance[row, column] * share[:, None]))
        return total

    def _across(self, row: np.ndarray, column: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Texels up to one beyond the border to those that are their neighbours over the fold."""
        last = self.side - 1
        for _ in range(2):
            outside = (column < 0) | (column > last)
            row, column = np.where(outside, last - row, row), np.clip(column, 0, last)
            row, column = column, row
        return row, column


@dataclass(frozen=True, kw_only=True)
class SkyTable:
    """The cells of a sky, S by S, and how light samples choose from them: a row first, then a cell of it."""

    map: SkyMap
    row_begin: np.ndarray
    """Row r is chosen for whole numbers row_begin[r] <= n < row_begin[r + 1], (S + 1,) uint64."""
    begin: np.ndarray
    """Cell c of row r is chosen for whole numbers begin[r, c] <= n < begin[r, c + 1], (S, S + 1) uint64."""
    share: np.ndarray
    """Area of a cell on the square over its chance to be chosen, (S, S) float32; 0 for cells that never are."""
    mean_colour: np.ndarray
    """Radiance over all directions, (3,) float64."""
    contrast: float
    """Luminance of the brightest cell over the mean, 1 or more; 0 for a black sky."""

    @property
    def mean(self) -> float:
        """Luminance over all directions."""
        return float(luminance(self.mean_colour))

    @property
    def sampled(self) -> bool:
        """Whether light samples choose from it; else rays that meet nothing bring all of its light.

        For an even sky those are the better: cosine-distributed as they are, nothing but what is in their way is left
        to chance, while half of all light samples would lie behind the surface.
        """
        return self.contrast > SAMPLED_CONTRAST

    def choose(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Points of the octahedron (..., 3) float32 for uint32 fractions x and y (...)."""
        row, y = chosen(self.row_begin[None], np.zeros(y.shape, dtype=np.int64), y)
        column, x = chosen(self.begin, row, x)
        step = np.float32(2.0 / self.map.side)
        place = [
            flush(flush(flush(cell.astype(np.float32) + uniform(within)) * step) - np.float32(1))
            for cell, within in ((column, x), (row, y))
        ]
        return unfolded(np.stack(place, axis=-1))

    def share_at(self, point: np.ndarray) -> np.ndarray:
        """`share` of the cells at points of the octahedron (..., 3): (...) float32."""
        return self.share[self.map.texel(point)]


def chosen(begin: np.ndarray, table: np.ndarray, fraction: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The entry that uint32 `fraction` (...) chooses from tables `table` (...), and the fraction within it, uint32.

    `begin` (T, S + 1) uint64, S a power of two: entry k of a table of sum n is chosen where begin[k] <= fraction n /
    2**32 < begin[k + 1]. Halving finds it, in log2 S reads.
    """
    scaled = fraction.astype(np.uint64) * begin[table, -1]
    entry, step = np.zeros(fraction.shape, dtype=np.int64), (begin.shape[1] - 1) // 2
    while step:
        entry += np.where(begin[table, entry + step] <= scaled >> np.uint64(32), step, 0)
        step //= 2
    width = begin[table, entry + 1] - begin[table, entry]
    within = (scaled - (begin[table, entry] << np.uint64(32))) // np.maximum(width, np.uint64(1))
    return entry, within.astype(np.uint32)


def luminance(rgb: np.ndarray) -> np.ndarray:
    """(..., 3) float64 to (...)."""
    return 0.2126 * rgb[..., 0] + 0.7152 * rgb[..., 1] + 0.0722 * rgb[..., 2]
