"""Drift: whether the light of a whole map is on its way to somewhere else.

One texel's sample is too noisy to tell a change of light from chance. All samples of a map in a frame together are not:
where they depart from the averages to one side, by more than chance explains, the averages lag behind. That is so
after a light was switched for as long as its reflections go from map to map, many frames after the influence of the
switch itself has been dealt with ([0076]: a weighting that depends on changes; [0078]). A map drifts when that is so in
two frames in a row, and to the same side: once in a while chance alone goes as far, but seldom twice. Sums of integers,
one set of registers a map; the order of the samples does not matter.
"""

import numpy as np

from lightloom.golden_model.numerics.floats import float_to_fixed
from lightloom.golden_model.numerics.sample_spread import luminance

_SHIFT = 8
"""Luminances are added up in units of 2**_SHIFT of the accumulators': 24 bits."""


def departures(
    owner: np.ndarray,
    before: np.ndarray,
    sample: np.ndarray,
    maps: int,
    fraction: int,
    least: int,
    certainty: int,
) -> np.ndarray:
    """To which side each of `maps` maps departs, (O,) int8: 1 lighter, -1 darker, 0 neither.

    From samples (M, 3) float32 of texels of maps `owner` (M,).
    `before` (M, 3) float32 are their averages before, `fraction` the bits after the point of the accumulators. A map
    departs if the sum D of the differences is more than `least` / 256 of the sum of the averages, and more than
    `certainty` times what chance makes of it, the root of the sum of their squares: D * D > certainty**2 * sum(d * d).
    """
    old, new = (float_to_fixed(luminance(values), fraction).astype(np.int64) >> _SHIFT for values in (before, sample))
    difference = new - old
    averages, departed = np.zeros((2, maps), dtype=np.int64)
    # Python's integers: a map has up to 2**25 texels, and 46 bits more are 71; the squares of sums need 96.
    squares = np.zeros(maps, dtype=object)
    for sums, values in ((averages, old), (departed, difference), (squares, difference * difference)):
        np.add.at(sums, owner, values.astype(sums.dtype))
    large = np.abs(departed) << 8 > averages * least
    beyond = [int(d) ** 2 > certainty * certainty * q for d, q in zip(departed, squares, strict=True)]
    return np.where(large & np.array(beyond, dtype=bool), np.sign(departed), 0).astype(np.int8)
