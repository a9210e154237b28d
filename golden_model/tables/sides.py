"""Sides: what hangs together of the lightmaps along links, with nothing standing between. Fills go no further."""

import numpy as np

from lightloom.golden_model.tables.lightmap import VALID, Lightmaps, joined, steps_of


def sides_of(lightmaps: Lightmaps) -> np.ndarray:
    """The side of each valid texel, (N,) int64: the number of its first texel; of others their own number.

    Of lightmaps at rest.
    """
    side = np.arange(len(lightmaps.texels))
    valid = lightmaps.texels["state"] == VALID
    pairs = []
    for reached, step in zip(joined(lightmaps), steps_of(lightmaps), strict=True):
        first = np.flatnonzero(reached & valid)
        second = first + step[first]
        both = valid[second]
        pairs.append((first[both], second[both]))
    one, two = (np.concatenate(ends) for ends in zip(*pairs, strict=True))
    while True:
        low, high = np.minimum(side[one], side[two]), np.maximum(side[one], side[two])
        apart = low != high
        if not apart.any():
            return side
        one, two = one[apart], two[apart]
        np.minimum.at(side, high[apart], low[apart])  # what stands for one stands for the other
        while (side[side] != side).any():
            side = side[side]


def firsts_first(side: np.ndarray, order: np.ndarray) -> np.ndarray:
    """An order of texels (M,) with the first of each side before all others; `side` (N,) is that of all texels."""
    _, first = np.unique(side[order], return_index=True)
    before = np.zeros(len(order), dtype=np.bool_)
    before[first] = True
    return np.concatenate([order[before], order[~before]])
