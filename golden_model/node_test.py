"""A ray against the boxes of a node's children, in integers, conservatively (docs/node_test.md derives it).

On each axis the near and the far plane of a box lie at corner + plane * 2**exponent from the node's corner that the
ray meets first, so that

    distance = ((corner -+ pad - position) + plane * 2**exponent) * slope * 2**steepness

The first summand is multiplied once a node; of the second only the product of 8 bits of plane and 12 bits of slope is
made for each plane. The sum is exact or rounded outwards, and the steepness is a saturating shift of the whole sum.
"""

import numpy as np

from golden_model.formats import (
    NODE_EXPONENT_MAX,
    NODE_HITS,
    POSITION_BIAS,
    SLOPE_BITS,
    TIME_BIAS,
    TIME_BITS,
    WIDTH,
)

FRACTION = 2
"""As in `box_setup`."""
SHORT_BITS = 12
"""Bits of the slope that multiply a child's plane."""
ALIGN = 4
"""Bits that such a product is shifted left before it is shifted right, so that all shifts go one way."""


def node_test(tests: np.ndarray) -> np.ndarray:
    """NODE_TEST (N,) to NODE_HITS (N,): the children that the ray enters at or before t_max, nearest first.

    A child's `entry` is the distance at which the ray enters its box, at least t_min; it does not depend on t_max, so
    with a smaller t_max the list loses children at its end and is otherwise the same.
    """
    count = len(tests)
    entry = np.repeat(tests["t_min"].astype(np.int64)[:, None], WIDTH, axis=1)
    leave = np.repeat(tests["t_max"].astype(np.int64)[:, None], WIDTH, axis=1)
    coarseness = tests["coarseness"].astype(np.int64)
    pad = tests["pad"].astype(np.int64)
    for k, axis in enumerate("xyz"):
        backwards = tests["backwards"][:, k]
        exponent = np.minimum(tests["exponent"][:, k], NODE_EXPONENT_MAX).astype(np.int64)
        slope = tests["slope"][:, k].astype(np.int64)
        steepness = tests["steepness"][:, k].astype(np.int64)[:, None]
        lower, upper = tests[f"lower_{axis}"].astype(np.int64), tests[f"upper_{axis}"].astype(np.int64)

        # Seen along the ray: planes count from the corner that it meets first.
        corner = tests["origin"][:, k].astype(np.int64) + np.where(backwards, 255 << exponent, 0)
        away = ((corner << FRACTION) >> coarseness) - (tests["position"][:, k].astype(np.int64) - POSITION_BIAS)
        away = np.where(backwards, -away, away)
        near = np.where(backwards[:, None], 255 - upper, lower)
        far = np.where(backwards[:, None], 255 - lower, upper)

        # The slope is at least `slope` and less than `slope + 1`.
        base_near, base_far = away - pad, away + pad
        base_near = (base_near * (slope + (base_near < 0))) >> (SLOPE_BITS - 1)
        base_far = ((base_far * (slope + (base_far >= 0))) >> (SLOPE_BITS - 1)) + 1

        short = (slope >> (SLOPE_BITS - SHORT_BITS))[:, None]
        # 2**exponent lattice units are 2**(exponent + FRACTION - coarseness) of the ray's.
        shift = (SHORT_BITS - 1 + ALIGN - FRACTION - exponent + coarseness)[:, None]
        plane_near = ((near * short) << ALIGN) >> np.minimum(shift, 31)
        plane_far = (((far * (short + 1)) << ALIGN) >> np.minimum(shift, 31)) + 1

        entry = np.maximum(entry, _time(base_near[:, None] + plane_near, steepness))
        leave = np.minimum(leave, _time(base_far[:, None] + plane_far, steepness))

    entry = np.where(tests["blind"][:, None], 0, entry)
    hit = (np.arange(WIDTH) < tests["count"][:, None]) & (tests["blind"][:, None] | (entry <= leave))

    out = np.zeros(count, dtype=NODE_HITS)
    out["count"] = hit.sum(axis=1)
    order = np.argsort(np.where(hit, entry, 1 << TIME_BITS), axis=1, kind="stable")
    listed = np.arange(WIDTH) < out["count"][:, None]
    out["slot"] = np.where(listed, order, 0)
    out["entry"] = np.where(listed, np.take_along_axis(entry, order, axis=1), 0)
    return out


def _time(distance: np.ndarray, steepness: np.ndarray) -> np.ndarray:
    """distance * 2**steepness, saturated to TIME_BITS bits, with TIME_BIAS added."""
    return np.clip(distance << steepness, -TIME_BIAS, TIME_BIAS - 1) + TIME_BIAS
