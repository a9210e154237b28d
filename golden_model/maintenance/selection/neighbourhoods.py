"""Windows of 3 x 3 texels in lightmaps, for flags and bins of a few bits.

Nothing reaches over a chart's border, or through what stands on it.

In hardware: the map's flags pass by row by row, with two rows held back (a line buffer of 2 x width entries), and each
repetition of a window is one more such stage. In the model the neighbours are looked up.
"""

import numpy as np

from lightloom.golden_model.scene.lightmap import VALID, Lightmaps, joined


class Windows:
    """Neighbours of the N texels of lightmaps. Texels that are not valid have none and are nobody's."""

    def __init__(self, lightmaps: Lightmaps):
        """From sizes, links and states of the maps."""
        count = len(lightmaps.texels)
        texel = np.arange(count)
        width = lightmaps.width[lightmaps.texels["object"]]
        valid = np.append(lightmaps.texels["state"] == VALID, False)
        right, down = joined(lightmaps)

        def neighbour(reached: np.ndarray, step: np.ndarray | int) -> np.ndarray:
            other = np.where(reached, texel + step, count)
            return np.where(valid[:-1] & valid[other], other, count)

        def before(reached: np.ndarray, step: np.ndarray | int) -> np.ndarray:
            """Whether the texel `step` before is joined to each."""
            other = np.maximum(texel - step, 0)
            return (texel >= step) & reached[other]

        self.left = neighbour(before(right, 1), -1)
        """The texel one column before, (N,) int64, N where there is none; so with the others."""
        self.right = neighbour(right, 1)
        self.up = neighbour(before(down, width), -width)
        self.down = neighbour(down, width)

    def largest(self, values: np.ndarray, times: int = 1) -> np.ndarray:
        """Values (N,) of an unsigned type to the largest of each 3 x 3 window; `times` over."""
        for _ in range(times):
            for one, two in ((self.left, self.right), (self.up, self.down)):
                padded = _padded(values)
                values = np.maximum(np.maximum(values, padded[one]), padded[two])
        return values

    def total(self, values: np.ndarray) -> np.ndarray:
        """Values (N,) uint8 to the sums of each 3 x 3 window, modulo 256."""
        for one, two in ((self.left, self.right), (self.up, self.down)):
            padded = _padded(values)
            values = values + padded[one] + padded[two]
        return values


def _padded(values: np.ndarray) -> np.ndarray:
    """With a zero behind, for neighbours that are not there."""
    return np.append(values, values.dtype.type(0))
