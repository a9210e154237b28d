"""What texels without a sample show: a smooth surface through the sampled ones of their side (`tables.sides`).

Pull and push of Gortler et al. 1996 with weights 0 and 1, in cells of 4 x 4 texels, then of 8 x 8 and so on, each of
one side alone: a place where two sides meet has a cell of either. A cell is the mean of what is known in it; what is
unknown is read bilinearly from the coarser cells of its side, which were filled first. Of the finest cells four are a
region's, and there are a sixteenth as many as texels.

Values are whole numbers in 2**-24, as every binary16 number is. Sums are exact, so their order does not matter; means
and reads are rounded down, and what a texel shows of them to float32 and then to binary16, to nearest even.
"""

from dataclasses import dataclass

import numpy as np

from lightloom.golden_model.numerics.floats import LARGEST_HALF, float_minmax, float_to_half, half_to_float, quiet
from lightloom.golden_model.tables.filters import in_fixed, to_half
from lightloom.golden_model.tables.lightmap import Lightmaps, part_of
from lightloom.golden_model.tables.sides import sides_of

_FINEST = 2
"""Texels across a finest cell, as a power of two."""


@dataclass(frozen=True)
class _Level:
    """Cells (K,) of one level of a map, or its texels, and how they hang together with the cells of the next."""

    child: np.ndarray  # (4 or 16, J): for each cell of the next level those in it, row by row; K where there is none
    near: np.ndarray  # (K,): the cell of the next level that each lies in
    beside: np.ndarray  # (3, K): of its side, the cells below or above that one, right or left of it, and aslant
    share: np.ndarray  # (4, K): eighths of eighths that are read of the near one, and of these three


class Filler:
    """Fills the maps of one scene. Its tables are made when they are first used."""

    def __init__(self, lightmaps: Lightmaps):
        """Of lightmaps at rest."""
        self.lightmaps = lightmaps
        self._side = sides_of(lightmaps)
        self._tables: dict[int, tuple[np.ndarray, np.ndarray, list[_Level]]] = {}

    @quiet
    def fill(self, number: int, values: np.ndarray, known: np.ndarray, once: np.ndarray) -> np.ndarray:
        """Values (n, 3) float32 of a map's texels (n,), those that are a surface's own filled where not `known` (n,).

        What is known counts with the binary16 number that it is shown as, and what is filled is one. A side of which
        nothing is known any more shows what was known `once` (n,). One of which nothing ever was shows the mean of the
        others of its map, or zero where nothing of them is known either.
        """
        texel, side, levels = self._table(number)
        if known[texel].all() or not known[texel].any():
            return np.where((known | once)[:, None], values, np.float32(0))
        stack = [(in_fixed(in_half(values[texel])), known[texel])]
        for level in levels:
            stack.append(_pulled(level, *stack[-1]))
        filled = _everywhere(*stack[-1])
        for level, (value, there) in zip(reversed(levels), reversed(stack[:-1]), strict=True):
            filled = np.where(there[:, None], value, _pushed(level, filled))
        lost = ~stack[-1][1][side] & once[texel]
        kept = lost | known[texel]
        out = np.where(known[:, None], values, np.float32(0))
        out[texel] = np.where(kept[:, None], values[texel], to_half(filled))
        return out

    def _table(self, number: int) -> tuple[np.ndarray, np.ndarray, list[_Level]]:
        if number not in self._tables:
            self._tables[number] = self._made(number)
        return self._tables[number]

    def _made(self, number: int) -> tuple[np.ndarray, np.ndarray, list[_Level]]:
        """Of a map its own texels, counted from its first, their sides, and its levels up to one cell a side."""
        part = part_of(self.lightmaps, number)
        texel = np.flatnonzero(self.lightmaps.fill[part] == np.arange(part.start, part.stop))
        _, side = np.unique(self._side[part][texel], return_inverse=True)
        row, column = np.divmod(texel, int(self.lightmaps.width[number]))
        levels: list[_Level] = []
        cells = side
        while len(cells) and len(cells) > int(cells.max()) + 1:
            level, (cells, row, column) = _next(cells, row, column, 1 if levels else _FINEST)
            levels.append(level)
        return texel, side, levels


def _next(
    side: np.ndarray, row: np.ndarray, column: np.ndarray, step: int
) -> tuple[_Level, tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """The level of cells (K,), and side, row and column of the cells of the next one, 2**step times as large."""
    rows, columns = int(row.max()) + 3, int(column.max()) + 3  # from -1 to one past the last

    def key(row: np.ndarray, column: np.ndarray) -> np.ndarray:
        return (side * rows + row + 1) * columns + column + 1

    up, left = row >> step, column >> step
    within_row, within_column = row - (up << step), column - (left << step)
    cells, near = np.unique(key(up, left), return_inverse=True)
    count = len(cells)
    child = np.full((1 << 2 * step, count), len(side), dtype=np.int64)
    child[(within_row << step) + within_column, near] = np.arange(len(side))

    def at(row: np.ndarray, column: np.ndarray, otherwise: np.ndarray) -> np.ndarray:
        wanted = key(row, column)
        place = np.minimum(np.searchsorted(cells, wanted), count - 1)
        return np.where(cells[place] == wanted, place, otherwise)

    (across, below), (along, right) = _toward(within_row, step), _toward(within_column, step)
    far_row, far_column = at(up + across, left, near), at(up, left + along, near)
    aslant = at(up + across, left + along, np.where(far_row != near, far_row, far_column))
    share = np.stack([(8 - below) * (8 - right), below * (8 - right), (8 - below) * right, below * right])
    level = _Level(child, near, np.stack([far_row, far_column, aslant]), share)
    first = np.unique(near, return_index=True)[1]
    return level, (side[first], up[first], left[first])


def _toward(within: np.ndarray, step: int) -> tuple[np.ndarray, np.ndarray]:
    """Of places in a cell 2**step across: the way to the nearest other cell, -1 or 1, and its share in eighths."""
    from_middle = 2 * within + 1 - (1 << step)
    return np.sign(from_middle), np.abs(from_middle) << 2 - step


def in_half(value: np.ndarray) -> np.ndarray:
    """Irradiance (M, 3) as binary16 holds it, float32."""
    return half_to_float(float_to_half(float_minmax(value, LARGEST_HALF)))


def _pulled(level: _Level, value: np.ndarray, known: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The next level: the means (J, 3) of what is known in each cell, and whether anything is, (J,) bool."""
    value = np.concatenate([np.where(known[:, None], value, 0), np.zeros((1, 3), dtype=np.int64)])
    count = np.append(known, False)[level.child].sum(axis=0)
    return value[level.child].sum(axis=0) // np.maximum(count, 1)[:, None], count > 0


def _pushed(level: _Level, coarse: np.ndarray) -> np.ndarray:
    """Cells (K, 3) read between those of the next level (J, 3), bilinearly."""
    total = coarse[level.near] * level.share[0][:, None]
    for beside, share in zip(level.beside, level.share[1:], strict=True):
        total += coarse[beside] * share[:, None]
    return total >> 6


def _everywhere(value: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Sides (S, 3) of which some are `known` (S,): the others as the mean of these."""
    mean = value[known].sum(axis=0) // max(int(known.sum()), 1)
    return np.where(known[:, None], value, mean)
