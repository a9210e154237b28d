"""A ray against the boxes of a node's children, in integers, conservatively (docs/node_test.md derives it).

On each axis the near and the far plane of a box lie at corner + plane * 2**exponent from the node's corner that the
ray meets first, so that

    distance = ((corner -+ pad - position) + plane * 2**exponent) * slope * 2**steepness

The first summand is multiplied once a node; of the second only the product of 8 bits of plane and 12 bits of slope is
made for each plane. The sum is exact or rounded outwards, and the steepness is a saturating shift of the whole sum.

The steps of one axis are functions of integers: of arrays here, of scalars in `node_test_numba`. They take the widths
of their operands, so that narrow ones can be tried exhaustively.
"""

from typing import Any

import numpy as np

from lightloom.golden_model.contract.formats import (
    BOX_FRACTION,
    BOX_WIDTHS,
    NODE_HITS,
    POSITION_BIAS,
    TIME_BITS,
    WIDTH,
    BoxWidths,
)


def node_test(tests: np.ndarray) -> np.ndarray:
    """NODE_TEST (N,) to NODE_HITS (N,): the children that the ray enters at or before t_max, nearest first.

    A child's `entry` is the distance at which the ray enters its box, at least t_min; it does not depend on t_max, so
    with a smaller t_max the list loses children at its end and is otherwise the same.
    """
    count = len(tests)
    entry = np.repeat(tests["t_min"].astype(np.int64)[:, None], WIDTH, axis=1)
    leave = np.repeat(tests["t_max"].astype(np.int64)[:, None], WIDTH, axis=1)
    coarseness, pad = _column(tests["coarseness"]), _column(tests["pad"])
    for k, axis in enumerate("xyz"):
        backwards = _column(tests["backwards"][:, k])
        exponent = np.minimum(_column(tests["exponent"][:, k]), BOX_WIDTHS.exponent)
        slope, steepness = _column(tests["slope"][:, k]), _column(tests["steepness"][:, k])
        lower, upper = tests[f"lower_{axis}"].astype(np.int64), tests[f"upper_{axis}"].astype(np.int64)
        position = _column(tests["position"][:, k]) - POSITION_BIAS

        away = corner_distance(_column(tests["origin"][:, k]), exponent, position, backwards, coarseness, BOX_WIDTHS)
        base_near, base_far = base_products(away, pad, slope, BOX_WIDTHS)
        near, far = planes_met(lower, upper, backwards, BOX_WIDTHS)
        plane_near, plane_far = plane_products(near, far, slope, exponent, coarseness, BOX_WIDTHS)
        entry = np.maximum(entry, saturated(base_near + plane_near, steepness, BOX_WIDTHS))
        leave = np.minimum(leave, saturated(base_far + plane_far, steepness, BOX_WIDTHS))

    blind = tests["blind"][:, None]
    entry = np.where(blind, 0, entry)
    hit = (np.arange(WIDTH) < tests["count"][:, None]) & (blind | (entry <= leave))

    out = np.zeros(count, dtype=NODE_HITS)
    out["count"] = hit.sum(axis=1)
    order = np.argsort(np.where(hit, entry, 1 << TIME_BITS), axis=1, kind="stable")
    listed = np.arange(WIDTH) < out["count"][:, None]
    out["slot"] = np.where(listed, order, 0)
    out["entry"] = np.where(listed, np.take_along_axis(entry, order, axis=1), 0)
    return out


def _column(field: np.ndarray) -> np.ndarray:
    """(N,) to int64 (N, 1), which goes with (N, WIDTH)."""
    return field.astype(np.int64)[:, None]


# --- the steps of one axis: int64 arrays or scalars (so `backwards` is 0 or 1), distances in the ray's units ----------


def corner_distance(
    origin: Any, exponent: Any, position: Any, backwards: Any, coarseness: Any, widths: BoxWidths
) -> Any:
    """How far, along the ray, the node's corner that it meets first lies beyond its position."""
    corner = origin + backwards * (((1 << widths.plane) - 1) << exponent)
    return (((corner << BOX_FRACTION) >> coarseness) - position) * (1 - 2 * backwards)


def base_products(away: Any, pad: Any, slope: Any, widths: BoxWidths) -> tuple[Any, Any]:
    """The corner's distance times the slope, less and plus the pad: rounded down and up."""
    # The true slope is at least `slope` and less than `slope + 1`.
    near, far = away - pad, away + pad
    point = widths.slope - 1
    return (near * (slope + (near < 0))) >> point, ((far * (slope + (far >= 0))) >> point) + 1


def planes_met(lower: Any, upper: Any, backwards: Any, widths: BoxWidths) -> tuple[Any, Any]:
    """The planes that the ray meets first and last, counted from the corner that it meets first."""
    last = (1 << widths.plane) - 1
    return lower + backwards * (last - upper - lower), upper + backwards * (last - lower - upper)


def plane_products(
    near: Any, far: Any, slope: Any, exponent: Any, coarseness: Any, widths: BoxWidths
) -> tuple[Any, Any]:
    """What the planes add to the corner's distance, rounded down and up."""
    short = slope >> (widths.slope - widths.short)
    # 2**exponent lattice units are 2**(exponent + BOX_FRACTION - coarseness) of the ray's. Shifted left first by what
    # the greatest exponent needs, so that all shifts that depend on operands go right. From 31 on nothing is left.
    align = widths.exponent + BOX_FRACTION - (widths.short - 1)
    shift = np.minimum(widths.exponent - exponent + coarseness, 31)
    return ((near * short) << align) >> shift, (((far * (short + 1)) << align) >> shift) + 1


def saturated(distance: Any, steepness: Any, widths: BoxWidths) -> Any:
    """distance * 2**steepness saturated to the bits of a time, with the bias added."""
    bias = 1 << (widths.time - 1)
    return np.minimum(np.maximum(distance << steepness, -bias), bias - 1) + bias
