"""The compiled twin of `node_test`, for one ray and one node: the same steps and bits. Needs numba."""

from typing import Any

import numpy as np

from lightloom.golden_model.contract.formats import BOX_RAY, BOX_WIDTHS, NODE_EXPONENT_MAX, POSITION_BIAS, WIDTH
from lightloom.golden_model.tracing.compiled import compiled, plain
from lightloom.golden_model.tracing.wide_bvh import node_test

corner_distance = compiled(node_test.corner_distance)
base_products = compiled(node_test.base_products)
planes_met = compiled(node_test.planes_met)
plane_products = compiled(node_test.plane_products)
saturated = compiled(node_test.saturated)


COMPILED_RAY = plain(BOX_RAY)
"""How `node_hits` takes a BOX_RAY: `rays.view(COMPILED_RAY)` costs nothing."""


@compiled
def shared_by_planes(ray: Any, node: Any, axis: int) -> tuple[Any, Any, Any, Any, Any, Any]:
    """What all planes of an axis share: base products near and far, slope, steepness, exponent, direction."""
    backwards = np.int64(ray.backwards[axis])
    slope, steepness = np.int64(ray.slope[axis]), np.int64(ray.steepness[axis])
    position = np.int64(ray.position[axis]) - POSITION_BIAS
    exponent = min(np.int64(node.exponent[axis]), NODE_EXPONENT_MAX)
    away = corner_distance(
        np.int64(node.origin[axis]), exponent, position, backwards, np.int64(ray.coarseness), BOX_WIDTHS
    )
    base_near, base_far = base_products(away, np.int64(ray.pad), slope, BOX_WIDTHS)
    return base_near, base_far, slope, steepness, exponent, backwards


@compiled
def cut(shared: Any, coarseness: Any, lower: Any, upper: Any, entry: Any, leave: Any) -> tuple[Any, Any]:
    """The part of a ray from `entry` to `leave` that lies between a box's planes of an axis."""
    base_near, base_far, slope, steepness, exponent, backwards = shared
    near, far = planes_met(np.int64(lower), np.int64(upper), backwards, BOX_WIDTHS)
    plane_near, plane_far = plane_products(near, far, slope, exponent, coarseness, BOX_WIDTHS)
    entry = max(entry, saturated(base_near + plane_near, steepness, BOX_WIDTHS))
    return entry, min(leave, saturated(base_far + plane_far, steepness, BOX_WIDTHS))


@compiled
def node_hits(ray: Any, t_max: Any, node: Any, slots: Any, entries: Any) -> int:
    """The children that a ray enters at or before `t_max`, nearest first, and how many they are.

    `ray` is a COMPILED_RAY record, `t_max` a TIME (`ray_time`'s `high` of the best hit), `node` a NODE_BLOCK record as
    `bitpack.unpack` gives it. `slots` and `entries`, int64 (WIDTH,), take the result; beyond the count they mean
    nothing.
    """
    count: int = min(int(node.count), WIDTH)
    if ray.blind:
        for slot in range(count):
            slots[slot], entries[slot] = slot, 0
        return count

    x, y, z = shared_by_planes(ray, node, 0), shared_by_planes(ray, node, 1), shared_by_planes(ray, node, 2)
    coarseness = np.int64(ray.coarseness)
    listed = 0
    for slot in range(count):
        entry, leave = np.int64(ray.t_min), np.int64(t_max)
        entry, leave = cut(x, coarseness, node.lower_x[slot], node.upper_x[slot], entry, leave)
        entry, leave = cut(y, coarseness, node.lower_y[slot], node.upper_y[slot], entry, leave)
        entry, leave = cut(z, coarseness, node.lower_z[slot], node.upper_z[slot], entry, leave)
        if entry > leave:
            continue
        # Sorted as they come: equal entries keep the order of their slots.
        place = listed
        while place > 0 and entries[place - 1] > entry:
            slots[place], entries[place] = slots[place - 1], entries[place - 1]
            place -= 1
        slots[place], entries[place] = slot, entry
        listed += 1
    return listed
