"""How coarse a level may be read at each texel: no read mixes in what is of another chart, or behind a wall.

Charts lie two texels apart, so already in level 1 a texel may stand for texels of two charts, which can be walls that
face away from each other; and within a chart it may stand for texels on both sides of what stands there. Next to such a
texel reads stay in a finer level: there the map is read a little too sharply, never in the colours of another place.
"""

from dataclasses import dataclass

import numpy as np

from lightloom.golden_model.tables.lightmap import Lightmaps, joined, levels_of

MIXED = -2


@dataclass(frozen=True)
class _Level:
    """Texels (H, W) of one level of a map."""

    owner: np.ndarray
    """The chart whose texels each stands for; MIXED: those of several, or some that are not joined within it."""
    there: np.ndarray
    """Whether any of them is covered."""
    right: np.ndarray
    """Whether any of them is joined to one of the texel to the right."""
    down: np.ndarray
    """Whether any of them is joined to one of the texel below."""


def deepest_levels(lightmaps: Lightmaps) -> np.ndarray:
    """For each texel of level 0 the coarsest level in which all reads at it meet one side of one chart: (N,) uint8.

    Reads at a texel are those at coordinates in its square. A texel of a coarser level belongs to the charts of the
    covered texels that it stands for; where it stands for none, to those that `fill` shows there. All texels of level 0
    that the four of a read stand for are joined to each other.
    """
    deepest = np.zeros(len(lightmaps.texels), dtype=np.uint8)
    levels = levels_of(lightmaps)
    fill = lightmaps.fill
    chart = np.where(fill >= 0, lightmaps.chart[np.maximum(fill, 0)], -1)
    covered = fill == np.arange(len(fill))
    # Without links nothing is known to stand anywhere.
    right, down = joined(lightmaps) if lightmaps.links is not None else (np.ones_like(covered), np.ones_like(covered))
    for number in range(len(lightmaps.width)):
        shape = int(levels.height[number, 0]), int(levels.width[number, 0])
        first = int(levels.first[number, 0])
        part = slice(first, first + shape[0] * shape[1])
        own = chart[part].reshape(shape)
        level_now = _Level(own, *(each[part].reshape(shape) for each in (covered, right, down)))
        safe = np.ones(shape, dtype=np.bool_)
        for level in range(1, int(levels.count[number]) + 1):
            level_now = _coarser(level_now)
            safe &= _safe(level_now, own, level)
            if not safe.any():
                break
            deepest[part][safe.reshape(-1)] = level
    return deepest


def _safe(now: _Level, own: np.ndarray, level: int) -> np.ndarray:
    """Whether reads at each of (H, W) texels of level 0 meet four texels of `level` that are joined, of its own chart.

    Four that lie in a square are joined to each other if three of their four links are there.
    """
    rows, columns = (_taps(size, level, limit) for size, limit in zip(own.shape, now.owner.shape, strict=True))
    safe = np.ones(own.shape, dtype=np.bool_)
    for row in rows:
        for column in columns:
            safe &= now.owner[row[:, None], column] == own
    high, wide = rows[0] != rows[1], columns[0] != columns[1]
    links = np.zeros(own.shape, dtype=np.int64)
    for row in rows:
        links += now.right[row[:, None], columns[0]] & wide
    for column in columns:
        links += now.down[rows[0][:, None], column] & high[:, None]
    # Where the two rows are one, each link is counted twice, or there are none to count.
    needed = np.where(high[:, None] & wide, 3, np.where(high[:, None] | wide, 2, 0))
    return np.asarray(safe & (links >= needed))


def _coarser(below: _Level) -> _Level:
    """One level up."""
    size = below.owner.shape
    even = tuple((0, side % 2) for side in size)
    rows, columns = (size[0] + 1) // 2, (size[1] + 1) // 2

    def fours(image: np.ndarray, beyond: int) -> np.ndarray:
        padded = np.pad(image, even, constant_values=beyond)
        return padded.reshape(rows, 2, columns, 2).swapaxes(1, 2).reshape(rows, columns, 4)

    exists = fours(np.ones(size, dtype=np.bool_), False)
    charts, inside = fours(below.owner, MIXED), fours(below.there, False)
    above = inside.sum(axis=2) > 0
    counts = np.where(above[..., None], inside, exists)
    low = np.where(counts, charts, np.iinfo(charts.dtype).max).min(axis=2)
    high = np.where(counts, charts, MIXED).max(axis=2)
    right, down = fours(below.right, False), fours(below.down, False)
    within = ((right, 0, 1), (right, 2, 3), (down, 0, 2), (down, 1, 3))
    links = np.sum([each[..., a] & counts[..., a] & counts[..., b] for each, a, b in within], axis=0)
    # Two that touch at a corner have no link; what is between them is of no chart, or buried.
    aslant = counts[..., 0] & counts[..., 3] | counts[..., 1] & counts[..., 2]
    number = counts.sum(axis=2)
    whole = (links >= number - 1) | (aslant & (number == 2))
    across = (right[..., 1] & counts[..., 1]) | (right[..., 3] & counts[..., 3])
    downward = (down[..., 2] & counts[..., 2]) | (down[..., 3] & counts[..., 3])
    return _Level(np.where((low == high) & whole, low, MIXED), above, across, downward)


def _taps(size: int, level: int, limit: int) -> tuple[np.ndarray, np.ndarray]:
    """The two rows (or columns) of `level` between which reads at each of `size` texels lie; the last ones repeat."""
    before = (2 * np.arange(size) + 1 - (1 << level)) >> (level + 1)
    return np.clip(before, 0, limit - 1), np.clip(before + 1, 0, limit - 1)
