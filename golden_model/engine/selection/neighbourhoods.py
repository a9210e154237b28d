"""Windows of 3 x 3 texels in lightmaps, for flags and bins of a few bits; nothing reaches over a chart's border.

In hardware: the map's flags pass by row by row, with two rows held back (a line buffer of 2 x width entries), and each
repetition of a window is one more such stage. In the model whole maps are laid over each other, a texel or a row apart.
"""

from collections.abc import Iterator
from functools import cached_property

import numpy as np

from lightloom.golden_model.tables.lightmap import VALID, Lightmaps, followed, part_of, steps_of


class Windows:
    """Neighbours of the N texels of lightmaps. Texels that are not valid have none and are nobody's."""

    def __init__(self, lightmaps: Lightmaps):
        """From sizes, charts and states of the maps."""
        number, valid = np.arange(len(lightmaps.texels)), lightmaps.texels["state"] == VALID
        self._next = []
        for there, step in zip(followed(lightmaps), steps_of(lightmaps), strict=True):
            other = np.where(there, number + step, number)
            joined = there & valid & valid[other] & (lightmaps.chart == lightmaps.chart[other])
            self._next.append((joined, step))
        # What lies as far apart, row by row: all maps side by side, and the columns of each map.
        self._rows = [(slice(0, len(number)), 1)]
        self._columns = [(part_of(lightmaps, k), int(width)) for k, width in enumerate(lightmaps.width)]

    @cached_property
    def pairs(self) -> list[tuple[np.ndarray, np.ndarray]]:
        """All texels that have one to their right, and that one, (K,) int64 each; then those with one below."""
        firsts = [np.flatnonzero(joined) for joined, _ in self._next]
        return [(first, first + step[first]) for first, (_, step) in zip(firsts, self._next, strict=True)]

    def largest(self, values: np.ndarray, times: int = 1) -> np.ndarray:
        """Values (N,) of an unsigned type to the largest of each 3 x 3 window; `times` over."""
        return self._gathered(np.maximum, values, times)

    def total(self, values: np.ndarray) -> np.ndarray:
        """Integers (N,) to the sums of each 3 x 3 window, of the same type."""
        return self._gathered(np.add, values, 1)

    def _gathered(self, merge: np.ufunc, values: np.ndarray, times: int) -> np.ndarray:
        """Values merged with those of the texels to both sides, the results with those above and below."""
        for _ in range(times):
            for (joined, _), lines in zip(self._next, (self._rows, self._columns), strict=True):
                out = values.copy()
                for first, second in _apart(lines):
                    there = joined[first]
                    merge(out[first], values[second] * there, out=out[first])
                    merge(out[second], values[first] * there, out=out[second])
                values = out
        return values


def _apart(lines: list[tuple[slice, int]]) -> Iterator[tuple[slice, slice]]:
    """Of parts of the maps the texels that have one `step` after them, and these."""
    for part, step in lines:
        if part.stop - part.start > step:
            yield slice(part.start, part.stop - step), slice(part.start + step, part.stop)
