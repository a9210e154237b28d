"""The compiled twin of `node_test`, for one ray and one node: the same steps and bits. Needs numba.

Nothing here is cached on disk by itself: callers that are name `SOURCES` among what they draw on
(`traversal_numba` says how).
"""

from types import ModuleType
from typing import Any

import numba
import numpy as np

from golden_model import formats, node_test
from golden_model.formats import BOX_RAY, NODE_EXPONENT_MAX, POSITION_BIAS, WIDTH

SOURCES: tuple[ModuleType, ...] = (formats, node_test)
"""Modules whose functions and constants are compiled in here, besides this one."""

FULL = node_test.FULL

compiled = numba.njit(error_model="numpy")
corner_distance = compiled(node_test.corner_distance)
base_products = compiled(node_test.base_products)
planes_met = compiled(node_test.planes_met)
plane_products = compiled(node_test.plane_products)
saturated = compiled(node_test.saturated)


def plain(dtype: np.dtype) -> np.dtype:
    """A structured dtype with bytes for bools: numba knows no fields of several bools."""
    fields = [(name, dtype[name].base, dtype[name].shape) for name in dtype.names or ()]
    return np.dtype([(name, np.uint8 if base == np.bool_ else base, shape) for name, base, shape in fields])


COMPILED_RAY = plain(BOX_RAY)
"""How `node_hits` takes a BOX_RAY: `rays.view(COMPILED_RAY)` costs nothing."""


@compiled
def cut(ray: Any, node: Any, axis: int, lower: Any, upper: Any, entries: Any, leaves: Any, count: int) -> None:
    """Raises `entries` and lowers `leaves` of the first `count` slots to where it meets an axis's planes."""
    backwards = np.int64(ray.backwards[axis])
    slope, steepness = np.int64(ray.slope[axis]), np.int64(ray.steepness[axis])
    coarseness, pad = np.int64(ray.coarseness), np.int64(ray.pad)
    position = np.int64(ray.position[axis]) - POSITION_BIAS
    exponent = min(np.int64(node.exponent[axis]), NODE_EXPONENT_MAX)
    away = corner_distance(np.int64(node.origin[axis]), exponent, position, backwards, coarseness, FULL)
    base_near, base_far = base_products(away, pad, slope, FULL)
    for slot in range(count):
        near, far = planes_met(np.int64(lower[slot]), np.int64(upper[slot]), backwards, FULL)
        plane_near, plane_far = plane_products(near, far, slope, exponent, coarseness, FULL)
        entries[slot] = max(entries[slot], saturated(base_near + plane_near, steepness, FULL))
        leaves[slot] = min(leaves[slot], saturated(base_far + plane_far, steepness, FULL))


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

    leaves = np.full(WIDTH, np.int64(t_max))
    entries[:count] = np.int64(ray.t_min)
    cut(ray, node, 0, node.lower_x, node.upper_x, entries, leaves, count)
    cut(ray, node, 1, node.lower_y, node.upper_y, entries, leaves, count)
    cut(ray, node, 2, node.lower_z, node.upper_z, entries, leaves, count)

    # Sorted in place: what has been read makes room for what is listed.
    listed = 0
    for slot in range(count):
        entry = entries[slot]
        if entry > leaves[slot]:
            continue
        place = listed
        while place > 0 and entries[place - 1] > entry:
            slots[place], entries[place] = slots[place - 1], entries[place - 1]
            place -= 1
        slots[place], entries[place] = slot, entry
        listed += 1
    return listed
