"""Where rays start: off the surface by as much as float32 can be wrong about it, and hardly more.

A point of a triangle, as computed, lies near the triangle's plane but seldom on it, and the plane that the intersection
test sees is not quite the triangle's either. A ray that started at the point would meet the triangle that it leaves. So
every ray starts a little along the triangle's normal: texels hold such points, and `ray_start` makes them of hits. How
far is a matter of the point's own coordinates, which round the point, and of the triangle's size, which bounds the
error of the test; nothing else in the scene counts. docs/traversal.md derives both factors.

Everything is float32 under the numeric contract: five multiplications and three additions give the lift, two of them by
powers of two, which is an addition to the exponent in hardware.
"""

import numpy as np

from lightloom.golden_model.numerics.equal_points import numbered
from lightloom.golden_model.numerics.floats import flush, quiet
from lightloom.golden_model.numerics.vectors import add, dot, scale

COORDINATE = np.float32(2.0**-23)
"""Of the point's coordinates, each by what it counts along the normal: the rounding of the point and of the start."""

SPAN = np.float32(2.0**-19)
"""Of the span of what the intersection test sees: a half more than its errors can amount to."""


@quiet
def lift(point: np.ndarray, normal: np.ndarray, span: np.ndarray) -> np.ndarray:
    """How far along the triangle's unit `normal` (..., 3) a ray starts from `point` (..., 3): (...) float32.

    `span` (...) is no less than the distance to any vertex of a triangle that the ray must not meet: the triangle's own
    (`Scene.spans`). |n . p|, taken component by component, is how far the rounding of p can move it along n: nothing
    where an axis-parallel plane goes through zero, however far off the point lies on it.
    """
    rounding = dot(np.abs(normal), np.abs(point))
    return flush(flush(rounding * COORDINATE) + flush(span * SPAN))


def ray_start(point: np.ndarray, normal: np.ndarray, span: np.ndarray) -> np.ndarray:
    """Points (..., 3) of triangles with unit normals (..., 3), on the side that the rays leave, to where they start."""
    return add(point, scale(normal, lift(point, normal, span)))


def longest_edges(corners: np.ndarray) -> np.ndarray:
    """Of each triangle (T, 3, 3) float32: (T,) float64."""
    edges = corners.astype(np.float64) - np.roll(corners, 1, axis=1).astype(np.float64)
    return np.sqrt((edges[..., 0] ** 2 + edges[..., 1] ** 2 + edges[..., 2] ** 2).max(axis=1))


def spans(corners: np.ndarray) -> np.ndarray:
    """The span of each triangle (T, 3, 3) float32: (T,) float32.

    The longest edge of the triangle and of all that touch it at a vertex, because a ray must not meet a coplanar
    neighbour either. Turning and moving the triangles leaves it as it is.
    """
    point, _ = numbered(corners.reshape(-1, 3))
    around = np.zeros(len(point))
    np.maximum.at(around, point, np.repeat(longest_edges(corners), 3))
    return around[point].reshape(-1, 3).max(axis=1).astype(np.float32)
