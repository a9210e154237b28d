"""How coarse a level may be read at each texel, so that no read mixes in what belongs to another chart.

Charts lie two texels apart, so already in level 1 a texel may stand for texels of two charts, which can be walls that
face away from each other. Next to such a texel reads stay in a finer level: at the border of a chart the map is read a
little too sharply, never in the colours of another place.
"""

import numpy as np

from lightloom.golden_model.scene.lightmap import Lightmaps, levels_of

MIXED = -2


def deepest_levels(lightmaps: Lightmaps) -> np.ndarray:
    """For each texel of level 0 the coarsest level in which all reads at it meet its own chart alone: (N,) uint8.

    Reads at a texel are those at coordinates in its square. A texel of a coarser level belongs to the charts of the
    covered texels that it stands for; where it stands for none, to those that `fill` shows there.
    """
    deepest = np.zeros(len(lightmaps.texels), dtype=np.uint8)
    levels = levels_of(lightmaps)
    fill = lightmaps.fill
    chart = np.where(fill >= 0, lightmaps.chart[np.maximum(fill, 0)], -1)
    covered = fill == np.arange(len(fill))
    for number in range(len(lightmaps.width)):
        shape = int(levels.height[number, 0]), int(levels.width[number, 0])
        first = int(levels.first[number, 0])
        part = slice(first, first + shape[0] * shape[1])
        own = chart[part].reshape(shape)
        owner, there = own, covered[part].reshape(shape)
        safe = np.ones(shape, dtype=np.bool_)
        for level in range(1, int(levels.count[number]) + 1):
            owner, there = _coarser(owner, there)
            rows, columns = (_taps(size, level, limit) for size, limit in zip(shape, owner.shape, strict=True))
            for row in rows:
                for column in columns:
                    safe &= owner[row[:, None], column] == own
            if not safe.any():
                break
            deepest[part][safe.reshape(-1)] = level
    return deepest


def _coarser(owner: np.ndarray, covered: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Charts (H, W) and whether anything is covered (H, W), one level up."""
    even = tuple((0, size % 2) for size in owner.shape)
    rows, columns = (owner.shape[0] + 1) // 2, (owner.shape[1] + 1) // 2

    def fours(image: np.ndarray, beyond: int) -> np.ndarray:
        padded = np.pad(image, even, constant_values=beyond)
        return padded.reshape(rows, 2, columns, 2).swapaxes(1, 2).reshape(rows, columns, 4)

    exists = fours(np.ones(owner.shape, dtype=np.bool_), False)
    charts, inside = fours(owner, MIXED), fours(covered, False)
    above = inside.sum(axis=2) > 0
    counts = np.where(above[..., None], inside, exists)
    low = np.where(counts, charts, np.iinfo(charts.dtype).max).min(axis=2)
    high = np.where(counts, charts, MIXED).max(axis=2)
    return np.where(low == high, low, MIXED), above


def _taps(size: int, level: int, limit: int) -> tuple[np.ndarray, np.ndarray]:
    """The two rows (or columns) of `level` between which reads at each of `size` texels lie; the last ones repeat."""
    before = (2 * np.arange(size) + 1 - (1 << level)) >> (level + 1)
    return np.clip(before, 0, limit - 1), np.clip(before + 1, 0, limit - 1)
