"""Which texels are sampled in a frame: for now all of them in turn, as many as the budget pays for.

This is the room of the selection policy: visibility, age, variability and influence ([0068] to [0083]) move in here.
"""

import numpy as np

from golden_model.lightmap import VALID, Lightmaps


def coarse_to_fine(lightmaps: Lightmaps) -> np.ndarray:
    """The valid texels, (V,) int64, ordered so that every beginning of the list is spread evenly over all maps.

    Texels are ordered by the reversed bits of their Morton code: first those of a wide lattice, then the ones that
    halve its spacing, and so on. So a map that starts empty appears as a whole and becomes finer, and what is sampled
    in one frame lies far apart. Texels of several maps that share a place go by their number.
    """
    texel = np.flatnonzero(lightmaps.texels["state"] == VALID)
    map_of = lightmaps.texels["object"][texel]
    row, column = np.divmod(texel - lightmaps.offset[map_of], lightmaps.width[map_of])
    levels = int(max(row.max(initial=0), column.max(initial=0))).bit_length()
    key = np.zeros(len(texel), dtype=np.int64)
    for level in range(levels):
        key = (key << 2) | (((row >> level) & 1) << 1) | ((column >> level) & 1)
    return texel[np.lexsort((texel, key))]


class RoundRobin:
    """Takes the texels of `order` in turn, for ever; no texel twice in one call."""

    def __init__(self, order: np.ndarray):
        """`order` (V,): texel numbers."""
        self.order = order
        self.next = 0
        """Place in `order` of the texel whose turn it is."""

    def select(self, budget: int, cost: int) -> np.ndarray:
        """The texels of a frame, (M,) int64: at most budget // cost of them, and at most each one once.

        `budget` is in rays, `cost` >= 1 the rays that one update traces. With V texels every texel is selected at
        least once in ceil(V / (budget // cost)) calls.
        """
        count = min(budget // cost, len(self.order))
        if count == 0:
            return self.order[:0]
        chosen = self.order[(self.next + np.arange(count)) % len(self.order)]
        self.next = (self.next + count) % len(self.order)
        return chosen
