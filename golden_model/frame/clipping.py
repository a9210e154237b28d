"""Clips triangles in view space against the near plane and the guard band.

The guard band keeps every screen coordinate within 24 bits of fixed point, so that the rasterizer's edge functions are
exact in int64 (and in a few dozen bits of hardware). What is merely off the screen is left to the rasterizer.

Where an edge crosses a plane, it is computed to some 2**-22 of the edge's length. Of edges that are millions of times
longer than the crossing is deep this leaves nothing of the depth, which then could be anything, negative too, and the
triangle would hide what is in front of it: such points are brought back to the plane, in depth alone.
"""

import numpy as np

from lightloom.golden_model.numerics.floats import flush, quiet
from lightloom.golden_model.tables.pinhole import View

# The guard band reaches this many pixels from the middle of the picture. With at most 8192 pixels from the middle to
# the border, a coordinate stays below 2**15 pixels, which with 8 fraction bits is 24 bits with the sign.
GUARD_PIXELS = np.float32(16384)
NEARLY = np.float32(15 / 16)  # of the depth that a plane asks for: what rounding leaves of it in ordinary scenes
PLANES = 5  # the near plane and the four of the guard band


@quiet
def _distances(points: np.ndarray, view: View) -> np.ndarray:
    """Signed distances of (..., >=3) view-space points from the five planes, (..., 5); inside where >= 0."""
    x, y, z = points[..., 0], points[..., 1], points[..., 2]
    reach = flush(z * GUARD_PIXELS)
    x, y = flush(x * view.focal), flush(y * view.focal)
    return np.stack([z - view.near, reach + x, reach - x, reach + y, reach - y], axis=-1)


@quiet
def _brought_back(polygons: np.ndarray, view: View, planes: int) -> np.ndarray:
    """Polygons (M, V, k) clipped against the first planes, of which no point is before them by more than NEARLY allows.

    Points of ordinary triangles stay as they are: they are off a plane by rounding alone.
    """
    x, y, z = polygons[..., 0], polygons[..., 1], polygons[..., 2]
    x, y = flush(flush(x * view.focal) / GUARD_PIXELS), flush(flush(y * view.focal) / GUARD_PIXELS)
    least = np.stack([np.full_like(z, view.near), -x, x, -y, y])[:planes].max(axis=0)
    out = polygons.copy()
    out[..., 2] = np.where(z < flush(least * NEARLY), least, z)
    return out


@quiet
def _clip(polygons: np.ndarray, count: np.ndarray, distance: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """One plane of Sutherland and Hodgman 1974: polygons (M, V, k) of `count` (M,) vertices, `distance` (M, V).

    A crossing point is computed from the inner vertex to the outer one, so that two triangles that share an edge get
    the same point. Returns (M, V + 1, k) and the new counts.
    """
    rows, size, width = polygons.shape
    index = np.arange(size)
    valid = index < count[:, None]
    following = np.where(index + 1 < count[:, None], index + 1, 0)
    row = np.arange(rows)[:, None]
    inside = (distance >= 0) & valid
    next_inside = inside[row, following]
    crossing = valid & (inside != next_inside)

    here, there = polygons, polygons[row, following]
    d_here, d_there = distance, distance[row, following]
    inner, outer = np.where(inside[..., None], here, there), np.where(inside[..., None], there, here)
    d_inner, d_outer = np.where(inside, d_here, d_there), np.where(inside, d_there, d_here)
    step = flush(d_inner / flush(d_inner - d_outer))[..., None]
    point = flush(inner + flush(step * flush(outer - inner)))

    emitted = np.stack([here, point], axis=2).reshape(rows, 2 * size, width)
    keep = np.stack([inside, crossing], axis=2).reshape(rows, 2 * size)
    order = np.argsort(~keep, axis=1, kind="stable")[:, : size + 1]
    return emitted[row, order], keep.sum(axis=1)


def clip_triangles(corners: np.ndarray, view: View) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """View-space triangles (T, 3, 3) to the parts of them that may be drawn.

    Returns (points (S, 3, 3) in view space, barycentric (S, 3, 2) = (u, v) of these points in the whole triangle,
    primitive (S,) = index of the whole triangle, not falling). A triangle that no plane cuts is returned as it is;
    one that is not finite, or that lies outside one plane, not at all.
    """
    usable, cut = np.ones(len(corners), dtype=bool), np.zeros(len(corners), dtype=bool)
    for distance in np.moveaxis(_distances(corners, view), -1, 0):  # one plane after the other
        outside, finite = (distance < 0).T, np.isfinite(distance).T
        usable &= finite[0] & finite[1] & finite[2] & ~(outside[0] & outside[1] & outside[2])
        cut |= outside[0] | outside[1] | outside[2]
    cut &= usable
    whole = np.flatnonzero(usable & ~cut)
    own = np.broadcast_to(np.array([[0, 0], [1, 0], [0, 1]], dtype=np.float32), (len(corners), 3, 2))
    parts = [(corners[whole], own[whole], whole)]

    primitive = np.flatnonzero(cut)
    if len(primitive):
        polygons = np.concatenate([corners[primitive], own[primitive]], axis=2)
        count = np.full(len(primitive), 3)
        for plane in range(PLANES):
            polygons, count = _clip(polygons, count, _distances(polygons, view)[..., plane])
            polygons = _brought_back(polygons, view, plane + 1)
        for last in range(2, polygons.shape[1]):  # a fan around the first vertex
            some = count > last
            fan = polygons[some][:, [0, last - 1, last]]
            parts.append((fan[..., :3], fan[..., 3:], primitive[some]))

    if len(parts) == 1:
        return parts[0]
    points, barycentric, index = (np.concatenate(column) for column in zip(*parts, strict=True))
    order = np.argsort(index, kind="stable")
    return points[order], barycentric[order], index[order]
