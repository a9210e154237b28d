"""Other points that a texel may be sampled at: those of its chart that lie less than a texel from its centre.

Every read that touches a texel is made that close to it. So where the point at the centre is buried, any other one of
these that is not stands for it better than the texels around it.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from lightloom.golden_model.charts.texels import inside_border, surface_texels
from lightloom.golden_model.tables.lightmap import Lightmaps, row_and_column

_SIDE = np.arange(-7, 8, 2) / 8
OFFSETS = np.array(sorted(((x, y) for x in _SIDE for y in _SIDE), key=lambda place: place[0] ** 2 + place[1] ** 2))
"""Where they are looked for, in texels from the centre, the nearest first."""

CHUNK = 1 << 22  # pairs of texel and triangle compared at a time: bounds the memory


@dataclass(frozen=True, kw_only=True)
class ChartedTriangles:
    """T triangles of a scene at rest, with all that makes texel records of points of theirs."""

    corners: np.ndarray
    """(T, 3, 3) float32."""
    normals: np.ndarray
    """Unit normals at the corners, (T, 3, 3) float32."""
    uv: np.ndarray
    """Lightmap coordinates of the corners, (T, 3, 2) float32."""
    chart: np.ndarray
    """Chart of each, numbered through all maps, (T,) int32; -1: none."""
    span: np.ndarray
    """As `ray_offset.ray_start` takes it, (T,) float32."""
    border: np.ndarray
    """How far points keep from each edge, in texels, (T, 3) float64: 0 within a chart."""


def other_points(
    triangles: ChartedTriangles, lightmaps: Lightmaps, texel: np.ndarray
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """For texels (M,), offset by offset, those that have a point there, (K,) places in `texel`, and its TEXEL (K,).

    `object` is that of the texel.
    """
    owner = lightmaps.texels["object"][texel]
    row, column = row_and_column(lightmaps, texel)
    centre = np.stack([column, row], axis=1) + 0.5
    place, face = _near(triangles, lightmaps.chart[texel], centre)
    corner = triangles.uv[face].astype(np.float64)
    for offset in OFFSETS:
        weight = _weights(corner, centre[place] + offset)
        inside = np.flatnonzero((weight >= 0).all(axis=1))
        found, first = np.unique(place[inside], return_index=True)
        chosen = inside[first]
        kept = inside_border(weight[chosen], corner[chosen], triangles.border[face[chosen]])
        record = surface_texels(face[chosen], kept, triangles.corners, triangles.normals, triangles.uv, triangles.span)
        record["object"] = owner[found]
        yield found, record


def _near(triangles: ChartedTriangles, chart: np.ndarray, centre: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Pairs of a texel of charts (M,) with centres (M, 2) and a triangle of its chart less than a texel away."""
    low, high = triangles.uv.min(axis=1) - 1, triangles.uv.max(axis=1) + 1
    places, faces = [np.zeros(0, dtype=np.int64)], [np.zeros(0, dtype=np.int64)]
    order = np.argsort(triangles.chart, kind="stable")
    for number in np.unique(chart):
        members = order[slice(*np.searchsorted(triangles.chart[order], [number, number + 1]))]
        mine = np.flatnonzero(chart == number)
        for begin in range(0, len(mine), max(CHUNK // len(members), 1)):
            part = mine[begin : begin + max(CHUNK // len(members), 1)]
            point = centre[part, None]
            near = ((point > low[members]) & (point < high[members])).all(axis=2)
            i, k = np.nonzero(near)
            places.append(part[i])
            faces.append(members[k])
    return np.concatenate(places), np.concatenate(faces)


def _weights(corner: np.ndarray, point: np.ndarray) -> np.ndarray:
    """Barycentric weights (P, 3) of points (P, 2) in triangles (P, 3, 2); negative or NaN outside."""
    first, second, toward = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0], point - corner[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        area = first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]
        u = (toward[:, 0] * second[:, 1] - toward[:, 1] * second[:, 0]) / area
        v = (first[:, 0] * toward[:, 1] - first[:, 1] * toward[:, 0]) / area
    return np.stack([1 - u - v, u, v], axis=1)
