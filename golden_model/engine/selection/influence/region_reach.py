"""Which regions a change may reach: the tests of `reach` on the boxes around a region's texels (`culling`)."""

import numpy as np

from lightloom.golden_model.contract.formats import FOOTPRINT, SHADOW
from lightloom.golden_model.engine.selection.culling import RegionBoxes
from lightloom.golden_model.engine.selection.intervals import Interval
from lightloom.golden_model.numerics.floats import flush, quiet


@quiet
def reached_regions(record: np.ndarray, regions: RegionBoxes) -> np.ndarray:
    """Whether any texel of each of R regions may have a level by one INFLUENCE: (R,) bool."""
    if record["kind"] == SHADOW:
        meets = _may_be_between(regions.position, record)
    elif record["kind"] == FOOTPRINT:
        away = regions.position - record["low"]
        nearest = Interval(away.least_size, away.greatest_size)
        distance, radius = nearest.scalar_product(nearest), flush(record["reach_low"][0])
        meets = (distance.low <= flush(radius * radius)) | ~distance.finite
    else:
        below, above = -(regions.position - record["low"]), regions.position - record["high"]
        within = (below.low <= flush(record["reach_low"])) & (above.low <= flush(record["reach_high"]))
        meets = (within | ~(below.finite & above.finite)).all(axis=1)
    return regions.filled & meets


def _may_be_between(position: Interval, record: np.ndarray) -> np.ndarray:
    """Whether the box of a SHADOW may meet a segment from boxes (R, 3) to its light: (R,) bool.

    By the axes of the box alone, of those of `reach._between`.
    """
    along = (position - record["light"]).greatest_size
    middle = (position + record["light"]) - flush(record["low"] + record["high"])
    size = flush(record["high"] - record["low"])
    meets = (middle.least_size <= flush(size + along)) | ~middle.finite
    return np.asarray(meets.all(axis=1))
