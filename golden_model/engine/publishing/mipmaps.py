"""Coarser levels of published maps ([0084]), renewed above the regions whose texels have changed and nowhere else.

A texel of level l is the mean of the (up to four) texels of level l - 1 that it stands for, each weighed by its
coverage: texels outside all charts and buried ones count nothing, so they darken nothing. Where nothing is covered, the
mean of what is shown there (`fill` repeats the nearest covered texel) stands in, so that a read between texels at a
chart's border finds no black in any level.

Every level is made from the published binary16 texels of the level below, so a region needs nothing but its own 64
texels, and the levels above the regions nothing but the regions' last levels.
"""

import numpy as np

from lightloom.golden_model.engine.publishing.regions import Regions, place_of
from lightloom.golden_model.numerics.floats import float_to_half, flush, half_to_float, quiet
from lightloom.golden_model.tables.lightmap import SIDE_LEVELS

CHILDREN = ((0, 0), (0, 1), (1, 0), (1, 1))
"""(row, column) of the four texels below one, in the order in which they are added."""


def renew_levels(regions: Regions, rgba: np.ndarray, which: np.ndarray) -> np.ndarray:
    """Rewrites in `rgba` (texels of all levels, 4) binary16 the levels above regions `which` (K,), level 0 being done.

    Returns the numbers of the texels written, (M,) int64, each once, level by level: 21 a region and, for each level
    above the regions, one for all regions below it.
    """
    written = [np.zeros(0, dtype=np.int64)]
    levels = regions.levels
    for level in range(1, levels.width.shape[1]):
        if level <= SIDE_LEVELS:
            owner, row, column = regions.places(which, level)
        else:
            up = level - SIDE_LEVELS
            there = which[level <= levels.count[regions.object[which]]]
            owner, row, column = regions.object[there], regions.row[there] >> up, regions.column[there] >> up
        texel, first = np.unique(place_of(levels, level, owner, row, column), return_index=True)
        rgba[texel] = _coarser(regions, rgba, level, owner[first], row[first], column[first])
        written.append(texel)
    return np.concatenate(written)


@quiet
def _coarser(
    regions: Regions, rgba: np.ndarray, level: int, owner: np.ndarray, row: np.ndarray, column: np.ndarray
) -> np.ndarray:
    """Texels (row, column) of `level` >= 1 of maps `owner`, all (M,), from the level below: (M, 4) binary16.

    With coverage c and colour v of the four: colour (((c0 v0 + c1 v1) + c2 v2) + c3 v3) / (((c0 + c1) + c2) + c3), the
    c all 1 where they are all 0, and coverage (((c0 + c1) + c2) + c3) / 4; float32, flushed at each step, rounded to
    binary16 at the end. Texels beyond the map's border do not exist: no colour, coverage 0.
    """
    levels = regions.levels
    colour, coverage, exists = [], [], []
    for down, right in CHILDREN:
        i, j = 2 * column + right, 2 * row + down
        inside = (i < levels.width[owner, level - 1]) & (j < levels.height[owner, level - 1])
        texel = np.where(inside, place_of(levels, level - 1, owner, j, i), 0)
        below = half_to_float(rgba[texel])
        weight = regions.covered[texel].astype(np.float32) if level == 1 else below[:, 3]
        colour.append(below[:, :3])
        coverage.append(np.where(inside, weight, np.float32(0)))
        exists.append(inside.astype(np.float32))
    covered = _sum(coverage)
    bare = covered == 0
    weights = [np.where(bare, there, weight) for there, weight in zip(exists, coverage, strict=True)]
    total = _sum([flush(value * weight[:, None]) for value, weight in zip(colour, weights, strict=True)])
    mean = flush(total / _sum(weights)[:, None])
    return float_to_half(np.concatenate([mean, flush(covered * np.float32(0.25))[:, None]], axis=1))


def _sum(parts: list[np.ndarray]) -> np.ndarray:
    """((p0 + p1) + p2) + p3."""
    total = parts[0]
    for part in parts[1:]:
        total = flush(total + part)
    return total
