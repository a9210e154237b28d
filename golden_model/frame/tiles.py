"""Tiles of the frame: which triangles each one has to look at ([0039], [0055]: geometry sorted by region of the frame).

A tile is a square of pixels small enough for its depths (and colours) to stay on the chip. The binner writes, for every
tile, the list of the triangles that may cover some of its pixel centres, in order of their primitives. What a tile does
with its list is the rasterizer's business.
"""

import numpy as np

TILE_SIDES = (8, 16, 32, 64, 128, 256)
"""Sides that a tile may have, in pixels."""


def runs(lengths: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Expands runs: (which run, place in it) of every element, int64, for runs of the given lengths (R,)."""
    which = np.repeat(np.arange(len(lengths)), lengths)
    return which, np.arange(len(which)) - np.repeat(np.cumsum(lengths) - lengths, lengths)


def bin_triangles(bounds: np.ndarray, tile: int, width: int) -> tuple[np.ndarray, np.ndarray]:
    """Pairs (tile, triangle) by bounding box: (tile (P,), triangle (P,)), int64, triangle by triangle.

    `bounds` (4, S) int64: first column, column after the last, first row, row after the last of the pixels that each
    triangle may cover; none of them empty. Tiles are numbered row by row from the top left of a frame `width` pixels
    wide.
    """
    across = -(-width // tile)
    first_column, first_row = bounds[0] // tile, bounds[2] // tile
    columns = (bounds[1] - 1) // tile - first_column + 1
    rows = (bounds[3] - 1) // tile - first_row + 1
    triangle, place = runs(columns * rows)
    row, column = np.divmod(place, columns[triangle])
    return (first_row[triangle] + row) * across + first_column[triangle] + column, triangle


def by_tile(tile: np.ndarray, triangle: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Pairs as the tiles read them: tile after tile, each tile's triangles in the order in which they were binned.

    Hardware appends to one list a tile; here a stable sort by the tile's number does the same.
    """
    order = np.argsort(tile, kind="stable")
    return tile[order], triangle[order]
