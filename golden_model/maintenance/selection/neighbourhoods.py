"""Windows of 3 x 3 texels in lightmaps, for flags and bins of a few bits; nothing reaches over a chart's border.

In hardware: the map's flags pass by row by row, with two rows held back (a line buffer of 2 x width entries), and each
repetition of a window is one more such stage. In the model the neighbours are looked up.
"""

import numpy as np

from lightloom.golden_model.scene.lightmap import VALID, Lightmaps


class Windows:
    """Neighbours of the N texels of lightmaps. Texels that are not valid have none and are nobody's."""

    def __init__(self, lightmaps: Lightmaps):
        """From sizes, charts and states of the maps."""
        count = len(lightmaps.texels)
        owner = lightmaps.texels["object"]
        texel = np.arange(count)
        row, column = np.divmod(texel - lightmaps.offset[owner], lightmaps.width[owner])
        valid = lightmaps.texels["state"] == VALID

        def neighbour(inside: np.ndarray, step: np.ndarray | int) -> np.ndarray:
            other = np.where(inside, texel + step, texel)
            joined = inside & valid & valid[other] & (lightmaps.chart == lightmaps.chart[other])
            return np.where(joined, other, count)

        self.left = neighbour(column > 0, -1)
        """The texel one column before, (N,) int64, N where there is none; so with the others."""
        self.right = neighbour(column < lightmaps.width[owner] - 1, 1)
        self.up = neighbour(row > 0, -lightmaps.width[owner])
        self.down = neighbour(row < lightmaps.height[owner] - 1, lightmaps.width[owner])

    def largest(self, values: np.ndarray, times: int = 1) -> np.ndarray:
        """Values (N,) of an unsigned type to the largest of each 3 x 3 window; `times` over."""
        for _ in range(times):
            for one, two in ((self.left, self.right), (self.up, self.down)):
                padded = _padded(values)
                values = np.maximum(np.maximum(values, padded[one]), padded[two])
        return values

    def total(self, values: np.ndarray) -> np.ndarray:
        """Integers (N,) to the sums of each 3 x 3 window, of the same type."""
        for one, two in ((self.left, self.right), (self.up, self.down)):
            padded = _padded(values)
            values = values + padded[one] + padded[two]
        return values


def _padded(values: np.ndarray) -> np.ndarray:
    """With a zero behind, for neighbours that are not there."""
    return np.append(values, values.dtype.type(0))
