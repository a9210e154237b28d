"""What texels without a sample show: a smooth surface through the sampled ones of their side (`scene.sides`).

Pull and push of Gortler et al. 1996 with weights 0 and 1, in cells of 2 x 2, 4 x 4 and so on, each of one side alone: a
place where two sides meet has a cell of either. Each cell is the mean of what is known of its four; what is unknown is
read bilinearly from the coarser cells of its side, which were filled first. Sums run row by row.
"""

from dataclasses import dataclass

import numpy as np

from lightloom.golden_model.numerics.floats import LARGEST_HALF, float_minmax, flush, quiet
from lightloom.golden_model.scene.lightmap import Lightmaps, part_of
from lightloom.golden_model.scene.sides import sides_of

_FIXED = 2.0**24
"""Sums over sides are exact, in whole numbers of its inverse."""


@dataclass(frozen=True)
class _Level:
    """Cells (K,) of one level of a map, and how they hang together with those of the next."""

    child: np.ndarray  # (4, J): for each cell of the next level its four, row by row; K where there is none
    near: np.ndarray  # (K,): the cell of the next level that each lies in
    beside: np.ndarray  # (3, K): of its side, the cells below or above that one, right or left of it, and aslant


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

        A side of which nothing is known any more shows what was known `once` (n,). One of which nothing ever was shows
        the mean of the others of its map, or zero where nothing of them is known either.
        """
        texel, side, levels = self._table(number)
        if known[texel].all() or not known[texel].any():
            return np.where((known | once)[:, None], values, np.float32(0))
        out = np.where(known[:, None], values, np.float32(0))
        stack = [(values[texel], known[texel])]
        for level in levels:
            stack.append(_pulled(level, *stack[-1]))
        filled = _everywhere(*stack[-1])
        for level, (value, there) in zip(reversed(levels), reversed(stack[:-1]), strict=True):
            filled = np.where(there[:, None], value, _pushed(level, filled))
        lost = ~stack[-1][1][side] & once[texel]
        out[texel] = np.where(lost[:, None], values[texel], filled)
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
        levels, cells = [], side
        while len(cells) and len(cells) > int(cells.max()) + 1:
            level, (cells, row, column) = _next(cells, row, column)
            levels.append(level)
        return texel, side, levels


def _next(
    side: np.ndarray, row: np.ndarray, column: np.ndarray
) -> tuple[_Level, tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """The level of cells (K,), and side, row and column of the cells of the next one."""
    rows, columns = int(row.max()) + 3, int(column.max()) + 3  # from -1 to one past the last

    def key(row: np.ndarray, column: np.ndarray) -> np.ndarray:
        return (side * rows + row + 1) * columns + column + 1

    up, left = row >> 1, column >> 1
    cells, near = np.unique(key(up, left), return_inverse=True)
    count = len(cells)
    child = np.full((4, count), len(side), dtype=np.int64)
    child[(row & 1) * 2 + (column & 1), near] = np.arange(len(side))

    def at(row: np.ndarray, column: np.ndarray, otherwise: np.ndarray) -> np.ndarray:
        wanted = key(row, column)
        place = np.minimum(np.searchsorted(cells, wanted), count - 1)
        return np.where(cells[place] == wanted, place, otherwise)

    across, along = up + np.where(row & 1, 1, -1), left + np.where(column & 1, 1, -1)
    far_row, far_column = at(across, left, near), at(up, along, near)
    aslant = at(across, along, np.where(far_row != near, far_row, far_column))
    level = _Level(child, near, np.stack([far_row, far_column, aslant]))
    first = np.unique(near, return_index=True)[1]
    return level, (side[first], up[first], left[first])


def _pulled(level: _Level, value: np.ndarray, known: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The next level: the means (J, 3) of what is known of each cell's four, and whether anything is, (J,) bool."""
    value = np.concatenate([np.where(known[:, None], value, np.float32(0)), np.zeros((1, 3), dtype=np.float32)])
    known = np.append(known, False)
    total = np.zeros((level.child.shape[1], 3), dtype=np.float32)
    count = np.zeros(len(total), dtype=np.float32)
    for child in level.child:
        count += known[child]
        total = flush(total + value[child])
    return flush(total / float_minmax(count, np.float32(1), True)[:, None]), count > 0


def _pushed(level: _Level, coarse: np.ndarray) -> np.ndarray:
    """Cells (K, 3) read between those of the next level (J, 3): three quarters of the nearer one along either axis."""

    def between(near: np.ndarray, far: np.ndarray) -> np.ndarray:
        return flush(flush(near * np.float32(0.75)) + flush(far * np.float32(0.25)))

    far_row, far_column, aslant = (coarse[beside] for beside in level.beside)
    return between(between(coarse[level.near], far_row), between(far_column, aslant))


def _everywhere(value: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Sides (S, 3) of which some are `known` (S,): the others as the mean of these, rounded down to 2**-24."""
    fixed = np.rint(float_minmax(value[known], LARGEST_HALF).astype(np.float64) * _FIXED).astype(np.int64)
    mean = (fixed.sum(axis=0) // max(int(known.sum()), 1)).astype(np.float64) / _FIXED
    return np.where(known[:, None], value, mean.astype(np.float32))
