"""Texel records: charts are rasterized in lightmap space, and every texel that a read can touch gets its surface point.

A read between texels touches those whose centres lie less than one texel away in u and in v. So a texel belongs to a
chart when the chart enters the open square of side two around its centre. Where the centre itself lies outside, the
nearest point of the chart stands for it: reads at the border of a chart meet values of the surface, never zeros.
"""

from collections.abc import Iterator

import numpy as np

from lightloom.golden_model.contract.formats import TEXEL
from lightloom.golden_model.scene.mesh import area_vectors, cross, dot
from lightloom.golden_model.tables.lightmap import VALID
from lightloom.golden_model.tables.ray_offset import ray_start

MARGIN = 1.0 / 16
"""Points keep this distance, in texels, from the border of their chart, so that none lies in a wall that meets it."""

CHUNK = 1 << 20  # pairs of triangle and texel worked on at a time: bounds the memory


def texel_records(
    corners: np.ndarray,
    normals: np.ndarray,
    uv: np.ndarray,
    chart: np.ndarray,
    width: int,
    height: int,
    span: np.ndarray,
    margin: np.ndarray | float = MARGIN,
) -> tuple[np.ndarray, np.ndarray]:
    """One object's F triangles to its texels.

    corners, normals (F, 3, 3) float32, uv (F, 3, 2) float32 in texels, chart (F,), span (F,) float32 as `ray_start`
    takes it, margin, one or (F,), in texels. Returns TEXEL (height * width,), `object` not set, and the chart of each
    texel, (height * width,) int32. A texel takes its point from the triangle nearest to its centre, of equal ones from
    the lower. Its position is where its rays start, a little off that triangle.
    """
    texels = np.zeros(width * height, dtype=TEXEL)
    nearest = np.full(width * height, np.inf)
    owner = np.full(width * height, -1, dtype=np.int64)
    wide = uv.astype(np.float64)
    for face, texel, centre in _candidates(wide, width, height):
        touching = _enters_square(wide[face], centre)
        face, texel, centre = face[touching], texel[touching], centre[touching]
        distance = nearest_point(wide[face], centre)[1]
        # Nearest first, then the lower triangle; of the pairs of one texel the first counts.
        order = np.lexsort((face, distance, texel))
        face, texel, distance = face[order], texel[order], distance[order]
        first = np.flatnonzero(np.diff(texel, prepend=-1))
        better = first[distance[first] < nearest[texel[first]]]
        nearest[texel[better]] = distance[better]
        owner[texel[better]] = face[better]

    used = np.flatnonzero(owner >= 0)
    face = owner[used]
    centre = np.stack([used % width + 0.5, used // width + 0.5], axis=1)
    border = chart_border(uv, chart) * np.broadcast_to(margin, len(uv))[:, None]
    weight = inside_border(nearest_point(wide[face], centre)[0], wide[face], border[face])
    texels[used] = surface_texels(face, weight, corners, normals, uv, span)
    charts = np.full(width * height, -1, dtype=np.int32)
    charts[used] = chart[face]
    return texels, charts


def surface_texels(
    face: np.ndarray, weight: np.ndarray, corners: np.ndarray, normals: np.ndarray, uv: np.ndarray, span: np.ndarray
) -> np.ndarray:
    """TEXEL (M,), valid, at points of triangles (M,), given by weights (M, 3); the rest as `texel_records` takes it."""
    texels = np.zeros(len(face), dtype=TEXEL)
    point = _weighted(weight, corners[face].astype(np.float64)).astype(np.float32)
    wall = unit(area_vectors(corners[face]))
    normal = unit(_weighted(weight, normals[face].astype(np.float64)))
    # Opposite normals at the corners of one triangle can cancel; then the face's own normal serves.
    flat = ~np.isfinite(normal).all(axis=1)
    normal[flat] = wall[flat]
    texels["position"] = ray_start(point, wall.astype(np.float32), span[face])
    texels["normal"] = normal
    texels["tangent"] = _tangents(corners[face].astype(np.float64), uv[face].astype(np.float64), normal)
    texels["state"] = VALID
    return texels


def _candidates(uv: np.ndarray, width: int, height: int) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """(triangle, texel, centre) of all pairs whose bounding boxes come within a texel, some at a time."""
    low = np.clip(np.ceil(uv.min(axis=1) - 1.5).astype(np.int64), 0, [width - 1, height - 1])
    high = np.clip(np.floor(uv.max(axis=1) + 0.5).astype(np.int64), 0, [width - 1, height - 1])
    columns, rows = (high - low + 1).T
    total = np.cumsum(columns * rows)
    begin = 0
    while begin < len(uv):
        done = total[begin - 1] if begin else 0
        end = max(int(np.searchsorted(total, done + CHUNK, side="right")), begin + 1)
        count = (columns * rows)[begin:end]
        face = np.repeat(np.arange(begin, end), count)
        place = np.arange(len(face)) - np.repeat(np.cumsum(count) - count, count)
        i = low[face, 0] + place % columns[face]
        j = low[face, 1] + place // columns[face]
        yield face, j * width + i, np.stack([i + 0.5, j + 0.5], axis=1)
        begin = end


def _edges(triangle: np.ndarray) -> np.ndarray:
    """(N, 3, 2) corners to edges, edge k from corner k to the next."""
    return np.roll(triangle, -1, axis=1) - triangle


def _enters_square(triangle: np.ndarray, centre: np.ndarray) -> np.ndarray:
    """Whether triangles (N, 3, 2) enter the open square of side two around centres (N, 2): separating axes."""
    moved = triangle - centre[:, None, :]
    inside = ((moved.min(axis=1) < 1) & (moved.max(axis=1) > -1)).all(axis=1)
    for edge in np.moveaxis(_edges(triangle), 1, 0):
        along = moved[:, :, 1] * edge[:, None, 0] - moved[:, :, 0] * edge[:, None, 1]
        reach = np.abs(edge[:, 0]) + np.abs(edge[:, 1])
        inside &= (along.min(axis=1) < reach) & (along.max(axis=1) > -reach)
    return inside


def nearest_point(triangle: np.ndarray, centre: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Barycentric weights (N, 3) of the points of triangles (N, 3, 2) nearest to (N, 2), and squared distances."""
    edge = _edges(triangle)
    toward = centre[:, None, :] - triangle
    area = edge[:, 0, 0] * edge[:, 1, 1] - edge[:, 0, 1] * edge[:, 1, 0]
    side = edge[..., 0] * toward[..., 1] - edge[..., 1] * toward[..., 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        weight = np.roll(side, -1, axis=1) / area[:, None]  # edge k + 1 lies opposite corner k
    covered = (weight >= 0).all(axis=1)
    weight[:, 2] = 1.0 - weight[:, 0] - weight[:, 1]
    best = np.where(covered, 0.0, np.inf)
    for k in range(3):
        square = edge[:, k, 0] ** 2 + edge[:, k, 1] ** 2
        step = toward[:, k, 0] * edge[:, k, 0] + toward[:, k, 1] * edge[:, k, 1]
        step = np.clip(step / np.where(square > 0, square, 1), 0, 1)
        gap = toward[:, k] - edge[:, k] * step[:, None]
        distance = gap[:, 0] ** 2 + gap[:, 1] ** 2
        nearer = distance < best
        best = np.where(nearer, distance, best)
        on_edge = np.zeros_like(weight)
        on_edge[:, k], on_edge[:, (k + 1) % 3] = 1.0 - step, step
        weight = np.where(nearer[:, None], on_edge, weight)
    return weight, best


def chart_border(uv: np.ndarray, chart: np.ndarray) -> np.ndarray:
    """Which edges (F, 3) lie on the border of their chart: no other triangle of the chart has the same two ends."""
    a, b = uv.reshape(-1, 2), np.roll(uv, -1, axis=1).reshape(-1, 2)
    swapped = ((a[:, 0] > b[:, 0]) | ((a[:, 0] == b[:, 0]) & (a[:, 1] > b[:, 1])))[:, None]
    owner = np.repeat(chart, 3)[:, None].astype(np.float64)
    keys = np.concatenate([np.where(swapped, b, a), np.where(swapped, a, b), owner], axis=1)
    _, edge, count = np.unique(keys, axis=0, return_inverse=True, return_counts=True)
    return (count[edge.reshape(-1)] == 1).reshape(-1, 3)


def inside_border(weight: np.ndarray, triangle: np.ndarray, margin: np.ndarray) -> np.ndarray:
    """Moves points, given by weights (N, 3), to at least `margin` (N, 3) from each edge; at most to weights of 1/8."""
    edge = _edges(triangle)
    area = np.abs(edge[:, 0, 0] * edge[:, 1, 1] - edge[:, 0, 1] * edge[:, 1, 0])
    # The height over edge k + 1, opposite corner k, is the doubled area over the edge's length.
    reach = np.roll(np.sqrt(edge[..., 0] ** 2 + edge[..., 1] ** 2) * margin, -1, axis=1)
    least = np.where(reach < area[:, None] / 8, reach / np.where(area > 0, area, 1)[:, None], 1 / 8)
    raised = weight < least
    fixed, free = np.where(raised, least, 0.0), np.where(raised, 0.0, weight)
    # The other weights shrink together, so that the point moves towards the raised corners and nowhere else.
    rest = (1.0 - _total(fixed)) / _total(free)
    return np.where(raised, least, weight * rest[:, None])


def _total(weight: np.ndarray) -> np.ndarray:
    return weight[:, 0] + weight[:, 1] + weight[:, 2]


def _weighted(weight: np.ndarray, values: np.ndarray) -> np.ndarray:
    """(N, 3) weights and (N, 3, 3) corner values to (N, 3)."""
    return weight[:, :1] * values[:, 0] + weight[:, 1:2] * values[:, 1] + weight[:, 2:] * values[:, 2]


def unit(vectors: np.ndarray) -> np.ndarray:
    """Vectors (N, 3) at unit length; a zero vector gives NaN."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return vectors / np.sqrt(dot(vectors, vectors))[:, None]


def _tangents(corners: np.ndarray, uv: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """Unit tangents (N, 3) along the direction in which u grows on each triangle."""
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    v1, v2 = uv[:, 1, 1] - uv[:, 0, 1], uv[:, 2, 1] - uv[:, 0, 1]
    u1, u2 = uv[:, 1, 0] - uv[:, 0, 0], uv[:, 2, 0] - uv[:, 0, 0]
    mirrored = (u1 * v2 - u2 * v1 < 0)[:, None]
    along = first * v2[:, None] - second * v1[:, None]
    along = np.where(mirrored, -along, along)
    tangent = unit(along - normal * dot(along, normal)[:, None])
    # A chart folded to a line, or a shading normal along u: any tangent will do, so take the first axis that works.
    for axis in np.eye(3):
        bad = ~np.isfinite(tangent).all(axis=1)
        side = np.broadcast_to(axis, tangent.shape)
        replacement = unit(cross(normal, side))
        usable = bad & (np.abs(dot(normal, side)) < 0.8)
        tangent[usable] = replacement[usable]
    return tangent
