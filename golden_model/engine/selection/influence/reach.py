"""Which lightmaps and which of their texels INFLUENCE records reach ([0081], [0082]).

First the loose bounds of whole maps are compared, object by object, then each texel of the maps that are reached:
float32, multiplications and comparisons.
"""

import numpy as np

from lightloom.golden_model.contract.formats import CHANGE_LEVELS, FOOTPRINT, SHADOW, WHOLE_CHANGE
from lightloom.golden_model.engine.selection.culling import RegionBoxes
from lightloom.golden_model.engine.selection.influence.region_reach import reached_regions
from lightloom.golden_model.numerics.floats import float_minmax, flush, quiet
from lightloom.golden_model.numerics.vectors import dot
from lightloom.golden_model.tables.lightmap import Lightmaps

_PARTS = (np.float32(1), np.float32(0.5), np.float32(0.25))
"""Of the reach, for levels 1, 2, 3: half the distance is four times the effect."""


@quiet
def touched(records: np.ndarray, boxes: np.ndarray) -> np.ndarray:
    """Which lightmaps (their loose bounds, (O, 2, 3)) INFLUENCE (K,) may reach: (K, O) bool."""
    here = (boxes[:, 0] <= boxes[:, 1]).all(axis=1)
    low, high = (np.broadcast_to(boxes[None, :, k], (len(records), *boxes[:, k].shape)) for k in (0, 1))
    # A shadow falls from the light onto the map, so what is compared is the box around both.
    shadow = (records["kind"] == SHADOW)[:, None, None]
    light_low = flush(records["light"] - records["light_half"])[:, None]
    light_high = flush(records["light"] + records["light_half"])[:, None]
    low = np.where(shadow, float_minmax(low, light_low), low)
    high = np.where(shadow, float_minmax(high, light_high, True), high)
    outer_low = flush(records["low"] - records["reach_low"])[:, None]
    outer_high = flush(records["high"] + records["reach_high"])[:, None]
    surface = records["surface"][:, None]
    meets = ((low <= outer_high) & (high >= outer_low)).all(axis=2)
    return meets & here & ((surface < 0) | (surface == np.arange(len(boxes))))


def texel_changes(
    records: np.ndarray,
    boxes: np.ndarray,
    lightmaps: Lightmaps,
    valid: np.ndarray,
    regions: RegionBoxes | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Change levels 0 to 3 of texels, and how much change is expected, 0 to WHOLE_CHANGE: (N,) uint8 each.

    The highest of all INFLUENCE (K,) that reach their map and them. 0: none is expected, e: light changes by its
    2**(WHOLE_CHANGE - e)-th part in this frame, WHOLE_CHANGE: nothing that is known of it is worth anything.

    `boxes` (O, 2, 3) are the loose bounds of the maps, `valid` (N,) bool the texels that count. Those of `regions` that
    no record can reach are not looked at.
    """
    levels, expected = np.zeros((2, len(valid)), dtype=np.uint8)
    for record, maps in zip(records, touched(records, boxes), strict=True):
        chosen = np.flatnonzero(valid & maps[lightmaps.texels["object"]])
        if regions is not None:
            chosen = chosen[reached_regions(record, regions)[regions.of_texel[chosen]]]
        level = _reached(record, lightmaps.texels[chosen])
        # A level is four times the effect of the one below.
        change = np.where(
            level > 0, WHOLE_CHANGE - 2 * (CHANGE_LEVELS - level.astype(np.int64)) - int(record["octaves"]), 0
        )
        levels[chosen] = np.maximum(levels[chosen], level)
        expected[chosen] = np.maximum(expected[chosen], change)
    return levels, expected


@quiet
def _reached(record: np.ndarray, texels: np.ndarray) -> np.ndarray:
    """Levels 0 to 3 that one INFLUENCE has at TEXEL (N,): (N,) uint8."""
    position, normal = texels["position"], texels["normal"]
    if record["kind"] == SHADOW:
        blocked = _between(record, position) & _faces(record["light"], record["light_half"], position, normal)
        return np.where(blocked, record["level"], np.uint8(0))
    if record["kind"] == FOOTPRINT:
        away, radius = flush(position - record["low"]), record["reach_low"][0]
        return np.where(dot(away, away) <= flush(radius * radius), record["level"], np.uint8(0))
    below, above = flush(record["low"] - position), flush(position - record["high"])
    level = np.zeros(len(position), dtype=np.uint8)
    for part in _PARTS:
        reach = flush(record["reach_low"] * part), flush(record["reach_high"] * part)
        level += ((below <= reach[0]) & (above <= reach[1])).all(axis=1)
    level = np.minimum(level, record["level"])
    if record["facing"]:
        # The object's own texels look away from its box and are touched all the same.
        half = flush(flush(record["high"] - record["low"]) * np.float32(0.5))
        towards = _faces(flush(record["low"] + half), half, position, normal)
        level *= towards | (texels["object"] == record["object"])
    return level


def _faces(centre: np.ndarray, half: np.ndarray, position: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """Whether any point of a box lies in front of points (N, 3) with normals (N, 3): (N,) bool."""
    nearest = flush(dot(normal, flush(centre - position)) + dot(np.abs(normal), half))
    return np.asarray(nearest > 0)


def _between(record: np.ndarray, position: np.ndarray) -> np.ndarray:
    """Whether the box of a SHADOW meets the segments from points (N, 3) to its light: (N,) bool, by separating axes.

    All lengths are doubled, so that nothing is halved; nothing is divided.
    """
    along = flush(record["light"] - position)
    middle = flush(flush(record["light"] + position) - flush(record["low"] + record["high"]))
    size = flush(record["high"] - record["low"])
    reach = np.abs(along)
    meets = np.asarray((np.abs(middle) <= flush(size + reach)).all(axis=1))
    for i, j in ((1, 2), (2, 0), (0, 1)):
        moment = np.abs(flush(flush(middle[:, i] * along[:, j]) - flush(middle[:, j] * along[:, i])))
        meets &= moment <= flush(flush(size[i] * reach[:, j]) + flush(size[j] * reach[:, i]))
    return meets
