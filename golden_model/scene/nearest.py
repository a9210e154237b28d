"""The nearest of many points, by a grid of cells: for builders, outside the frame loop."""

import numpy as np

from lightloom.golden_model.scene.mesh import dot

SAME_WAY = 0.5
"""Cosine above which two normals face the same way."""

QUERIES = 1 << 14  # worked on at a time: bounds the memory

Normals = tuple[np.ndarray, np.ndarray]


def nearest(points: np.ndarray, queries: np.ndarray, cell: float, normals: Normals | None = None) -> np.ndarray:
    """For each of `queries` (M, 3) the nearest of `points` (N, 3), N > 0, as (M,) int64; of equal ones the first.

    `cell` > 0 is about the distance of neighbouring points. With `normals` ((N, 3) of the points, (M, 3) of the
    queries) the nearest of those that face the same way as the query, or of all where none does.
    """
    wide, wanted = points.astype(np.float64), queries.astype(np.float64)
    found = _search(wide, wanted, cell, normals)
    left = np.flatnonzero(found < 0)
    if len(left):
        found[left] = _search(wide, wanted[left], cell, None)
    return found


def _search(points: np.ndarray, queries: np.ndarray, cell: float, normals: Normals | None) -> np.ndarray:
    """As `nearest`, -1 where no point faces the same way."""
    low = np.minimum(points.min(axis=0), queries.min(axis=0))
    extent = float((np.maximum(points.max(axis=0), queries.max(axis=0)) - low).max())
    cell = max(cell, extent / (1 << 19))  # three cell numbers fit in 63 bits
    found = np.full(len(queries), -1, dtype=np.int64)
    left = np.arange(len(queries))
    while len(left):
        grid = _Grid(points, low, cell)
        last = cell > extent  # then the cells around a query hold every point
        settled = np.zeros(len(left), dtype=bool)
        for begin in range(0, len(left), QUERIES):
            part = left[begin : begin + QUERIES]
            best, square = grid.nearest(points, queries[part], part, normals)
            # A point outside the cells around a query is further away than one cell's side.
            sure = (square <= cell * cell) | last
            found[part[sure]] = best[sure]
            settled[begin : begin + QUERIES] = sure
        left = left[~settled]
        cell *= 2
    return found


class _Grid:
    """Points sorted by the cell they lie in."""

    def __init__(self, points: np.ndarray, low: np.ndarray, cell: float):
        self.low, self.cell = low, cell
        key = self._key(self._place(points))
        self.order = np.argsort(key, kind="stable")
        self.keys = key[self.order]

    def _place(self, points: np.ndarray) -> np.ndarray:
        # From 1, so that the cell before the first has a number too.
        return np.floor((points - self.low) / self.cell).astype(np.int64) + 1

    def _key(self, place: np.ndarray) -> np.ndarray:
        return (place[:, 0] << 42) | (place[:, 1] << 21) | place[:, 2]

    def nearest(
        self, points: np.ndarray, queries: np.ndarray, number: np.ndarray, normals: Normals | None
    ) -> tuple[np.ndarray, np.ndarray]:
        """The nearest point in the 27 cells around each query, -1 for none, and its squared distance."""
        best = np.full(len(queries), -1, dtype=np.int64)
        least = np.full(len(queries), np.inf)
        place = self._place(queries)
        for offset in np.ndindex(3, 3, 3):
            key = self._key(place + np.array(offset) - 1)
            start, end = np.searchsorted(self.keys, key, side="left"), np.searchsorted(self.keys, key, side="right")
            count = end - start
            query = np.repeat(np.arange(len(queries)), count)
            point = self.order[np.arange(len(query)) + np.repeat(start - (np.cumsum(count) - count), count)]
            if normals is not None:
                facing = dot(normals[0][point].astype(np.float64), normals[1][number[query]].astype(np.float64))
                query, point = query[facing > SAME_WAY], point[facing > SAME_WAY]
            way = points[point] - queries[query]
            square = dot(way, way)
            order = np.lexsort((point, square, query))
            first = order[np.flatnonzero(np.diff(query[order], prepend=-1))]
            query, point, square = query[first], point[first], square[first]
            better = (square < least[query]) | ((square == least[query]) & (point < best[query]))
            best[query[better]], least[query[better]] = point[better], square[better]
        return best, least
