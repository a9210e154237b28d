"""Regions of 8 x 8 texels, in which the maps are published ([0084]): their texels, and which texel is shown in which.

A map of w x h texels has ceil(w / 8) x ceil(h / 8) regions, numbered row by row, map after map; those at its right and
lower border may be cut off. A region shows the texels that `fill` names for its own, so a texel at a chart's border is
shown in every region that repeats it: in its own, and in those of the eight around that one that eight bits name.
"""

from dataclasses import dataclass

import numpy as np

from lightloom.golden_model.tables.lightmap import SIDE, SIDE_LEVELS, Levels, Lightmaps, levels_of


@dataclass(frozen=True, kw_only=True)
class Regions:
    """R regions over O maps with N texels together. Made once a scene; everything in it is a table of the hardware."""

    levels: Levels
    object: np.ndarray
    """Map of each region, (R,) int64."""
    row: np.ndarray
    """Row of regions in its map, (R,) int64."""
    column: np.ndarray
    """Column of regions in its map, (R,) int64."""
    of_texel: np.ndarray
    """Region that each texel of level 0 lies in, (N,) int64."""
    covered: np.ndarray
    """Texels that are some surface's own: that `fill` names for themselves, (N,) bool. Only these count in levels."""
    shown_start: np.ndarray
    """Where in `shown_in` the regions that show a texel begin, (N + 1,) int64."""
    shown_in: np.ndarray
    """Regions that show each texel, ascending: none for a texel that nobody shows."""

    def by_region(self) -> np.ndarray:
        """The texels of level 0 as memory has them, region by region and row by row: (N,) int64."""
        return np.argsort(self.of_texel, kind="stable")

    @property
    def count(self) -> int:
        """R."""
        return len(self.object)

    def texels(self, which: np.ndarray) -> np.ndarray:
        """Texels of level 0 of regions (K,), region by region and row by row: (M,) int64, M <= 64 K."""
        return place_of(self.levels, 0, *self.places(which, 0))

    def places(self, which: np.ndarray, level: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The texels of level 0 to 3 inside regions (K,): their (map, row, column), each (M,); none where no level."""
        side = SIDE >> level
        row, column = np.divmod(np.arange(side * side), side)
        owner = np.repeat(self.object[which], side * side)
        rows = (self.row[which, None] * side + row).reshape(-1)
        columns = (self.column[which, None] * side + column).reshape(-1)
        there = level <= self.levels.count[owner]
        level = min(level, self.levels.width.shape[1] - 1)
        there &= (rows < self.levels.height[owner, level]) & (columns < self.levels.width[owner, level])
        return owner[there], rows[there], columns[there]

    def showing(self, texel: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """All pairs of a place in `texel` (M,) and a region that shows this texel: (place, region), each (P,)."""
        begin, end = self.shown_start[texel], self.shown_start[texel + 1]
        place = np.repeat(np.arange(len(texel)), end - begin)
        before = np.cumsum(end - begin) - (end - begin)
        return place, self.shown_in[begin[place] + np.arange(len(place)) - before[place]]


def place_of(levels: Levels, level: int, owner: np.ndarray, row: np.ndarray, column: np.ndarray) -> np.ndarray:
    """Numbers in a published array of texels (row, column) of a level of maps `owner`, all (M,): (M,) int64."""
    return levels.first[owner, level] + row * levels.width[owner, level] + column


def regions_of(lightmaps: Lightmaps) -> Regions:
    """The regions of all maps, from their sizes and from `fill` (texel states do not matter: they may move)."""
    levels = levels_of(lightmaps)
    columns, rows = (-(-size.astype(np.int64) >> SIDE_LEVELS) for size in (lightmaps.width, lightmaps.height))
    count = columns * rows
    owner = np.repeat(np.arange(len(count)), count)
    first = np.cumsum(count) - count
    row, column = np.divmod(np.arange(len(owner)) - first[owner], columns[owner])

    number = np.arange(len(lightmaps.texels))
    area = lightmaps.width.astype(np.int64) * lightmaps.height
    map_of = np.repeat(np.arange(len(area)), area)
    texel_row, texel_column = np.divmod(number - lightmaps.offset[map_of], lightmaps.width[map_of].astype(np.int64))
    of_texel = first[map_of] + (texel_row >> SIDE_LEVELS) * columns[map_of] + (texel_column >> SIDE_LEVELS)

    shows = lightmaps.fill >= 0
    pairs = np.unique(lightmaps.fill[shows].astype(np.int64) * len(owner) + of_texel[shows])
    source, shown_in = np.divmod(pairs, max(len(owner), 1))
    return Regions(
        levels=levels,
        object=owner,
        row=row,
        column=column,
        of_texel=of_texel,
        covered=lightmaps.fill == number,
        shown_start=np.searchsorted(source, np.arange(len(number) + 1)),
        shown_in=shown_in,
    )
