"""Polygons of mesh files to triangles that cover them once, all turned as the polygon is.

A polygon that its first corner sees whole, as each corner of a convex one does, becomes the fan of triangles around it;
another one the fan around the first of its corners that does, so that corners on a straight line stay corners of
triangles; all others are cut up by Mapbox's earcut, laid into the plane in which they look largest.
"""

from dataclasses import dataclass

import numpy as np

from lightloom.golden_model.numerics.floats import quiet
from lightloom.golden_model.scene.mesh import cross, dot, without_area

FAN_CORNERS = 64
"""Of polygons with more corners only the first is tried for a fan."""

COVERED = 1e-9
"""Triangles cover a polygon if their areas differ from its own by less than this fraction."""


@dataclass(frozen=True)
class Triangulation:
    """T triangles of F polygons, those of a polygon together, polygons in their order."""

    face: np.ndarray
    """The polygon of each triangle, (T,)."""
    corner: np.ndarray
    """The places of its corners in the list of all polygons' corners, (T, 3)."""
    crossing: np.ndarray
    """Polygons that no triangles can cover once, because they cross themselves; rising."""


@quiet
def triangulated(points: np.ndarray, corners: np.ndarray, sizes: np.ndarray) -> Triangulation:
    """Points (P, 3) float64, corners (N,) as numbers of points, and how many of them each polygon has, (F,), 3 or more.

    Corners must name points that exist. Polygons with points that are not finite become fans.
    """
    first = np.cumsum(sizes) - sizes
    face: list[np.ndarray] = [np.zeros(0, dtype=np.int64)]
    place: list[np.ndarray] = [np.zeros((0, 3), dtype=np.int64)]
    crossing = []
    for size in np.unique(sizes).tolist():
        faces = np.flatnonzero(sizes == size)
        ring = first[faces][:, None] + np.arange(size)
        fan = _fan(size, 0)
        whole = np.ones(len(faces), dtype=bool)
        if size > 3:
            whole = _all_in_front(points[corners[ring]], fan)
        face.append(np.repeat(faces[whole], len(fan)))
        place.append(ring[whole][:, fan].reshape(-1, 3))
        for k in np.flatnonzero(~whole):
            triangles, once = _cut(points[corners[ring[k]]])
            face.append(np.full(len(triangles), faces[k]))
            place.append(ring[k][triangles])
            if not once:
                crossing.append(int(faces[k]))
    every = np.concatenate(face)
    order = np.argsort(every, kind="stable")
    return Triangulation(every[order], np.concatenate(place)[order], np.array(sorted(crossing), dtype=np.int64))


def _fan(size: int, apex: int) -> np.ndarray:
    """The triangles (size - 2, 3) around a corner."""
    k = np.arange(size - 2)
    return (apex + np.stack([0 * k, k + 1, k + 2], axis=1)) % size


def _areas(rings: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Polygons (F, n, 3), triangles (t, 3) of their corners to area vectors (F, t, 3)."""
    a, b, c = (rings[:, triangles[:, k]] for k in range(3))
    return cross(b - a, c - a)


def _all_in_front(rings: np.ndarray, fan: np.ndarray) -> np.ndarray:
    """Whether all triangles of a fan have an area and are turned as the polygon is, (F,) bool."""
    areas = _areas(rings, fan)
    # The area vector of the polygon (Newell's normal) is the sum of those of any fan.
    normal = np.cumsum(areas, axis=1)[:, -1]
    with_area = ~without_area(rings[:, fan].reshape(-1, 3, 3).astype(np.float32)).reshape(areas.shape[:2])
    return ((dot(areas, normal[:, None]) > 0) & with_area).all(axis=1) | ~np.isfinite(normal).all(axis=1)


def _cut(ring: np.ndarray) -> tuple[np.ndarray, bool]:
    """A polygon (n, 3) that its first corner does not see whole: triangles (t, 3), whether they cover it once."""
    import mapbox_earcut

    size = len(ring)
    for apex in range(1, size if size <= FAN_CORNERS else 1):
        fan = _fan(size, apex)
        if _all_in_front(ring[None], fan).all():
            return fan, True
    fan = _fan(size, 0)
    areas = _areas(ring[None], fan)[0]
    normal = np.cumsum(areas, axis=0)[-1]
    axis = int(np.argmax(np.abs(normal)))
    if normal[axis] == 0:
        return fan, not areas.any()
    # Without the coordinate in which its normal is largest, turned so that the front is in front: no rounding.
    plane = [(axis + 1) % 3, (axis + 2) % 3]
    flat = np.ascontiguousarray(ring[:, plane if normal[axis] > 0 else plane[::-1]])
    found = mapbox_earcut.triangulate_float64(flat, np.array([size], dtype=np.uint32))
    triangles = found.astype(np.int64).reshape(-1, 3)
    edge = flat[triangles[:, 1:]] - flat[triangles[:, :1]]
    area = edge[:, 0, 0] * edge[:, 1, 1] - edge[:, 0, 1] * edge[:, 1, 0]
    whole = abs(normal[axis])
    return triangles, bool((area >= 0).all() and abs(area.sum() - whole) <= COVERED * whole)
