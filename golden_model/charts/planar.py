"""Lightmap charts of flat geometry: each connected flat piece becomes one chart, each quad a rectangle.

A chart's bounding box runs from the centres of its first texels to the centres of its last ones. So reads at a quad's
border need no texel beyond it, and two walls that meet are both sampled where they meet.
"""

from dataclasses import dataclass

import numpy as np

from lightloom.golden_model.scene.flat_pieces import points_of
from lightloom.golden_model.scene.mesh import area_vectors, cross, dot

SQUARE = 0.05
"""A quad whose opposite sides, and diagonals, differ by less than this fraction is mapped to a rectangle."""

GAP = 2
"""Texels between two charts: a bilinear read in one never meets a texel of the other."""


@dataclass(frozen=True)
class ObjectCharts:
    """The charts of one object's F triangles."""

    width: int
    height: int
    uv: np.ndarray  # (F, 3, 2) float32, in texels
    chart: np.ndarray  # (F,) int32, from 0


def planar_charts(corners: np.ndarray, piece: np.ndarray, texel_size: float) -> ObjectCharts:
    """Charts of the flat pieces (`flat_pieces`) of an object, one each, packed into one map."""
    flat = np.zeros((len(corners), 3, 2))
    pieces = int(piece.max()) + 1
    sizes = np.zeros((pieces, 2), dtype=np.int64)
    for k in range(pieces):
        members = np.flatnonzero(piece == k)
        local = _flatten(corners[members].astype(np.float64))
        low = local.min(axis=(0, 1))
        span = local.max(axis=(0, 1)) - low
        steps = np.maximum(np.ceil(span / texel_size - 1e-6), 1)
        flat[members] = (local - low) / span * steps + 0.5
        sizes[k] = steps.astype(np.int64) + 1
    place, width, height = pack(sizes)
    return ObjectCharts(width, height, (flat + place[piece][:, None, :]).astype(np.float32), piece)


def pack(sizes: np.ndarray) -> tuple[np.ndarray, int, int]:
    """Rectangles (K, 2) of (columns, rows) onto shelves of one map: (first texel (K, 2) int64, width, height).

    Highest first, of equal ones the widest, then the lowest number; GAP texels between.
    """
    padded = sizes + GAP
    area = int((padded[:, 0] * padded[:, 1]).sum())
    width = max(int(padded[:, 0].max()), int(np.ceil(np.sqrt(area))))
    place = np.zeros_like(sizes)
    x = y = shelf = used = 0
    for k in sorted(range(len(sizes)), key=lambda k: (-sizes[k, 1], -sizes[k, 0], k)):
        columns, rows = int(padded[k, 0]), int(padded[k, 1])
        if x + columns > width:
            x, y, shelf = 0, y + shelf, 0
        place[k] = x, y
        x += columns
        shelf = max(shelf, rows)
        used = max(used, x)
    return place, used - GAP, y + shelf - GAP


def _border(point: np.ndarray) -> list[tuple[int, int]]:
    """Places (triangle, corner) where a border edge of the piece begins: edges without their reverse."""
    edges = {(a, b) for row in point.tolist() for a, b in zip(row, row[1:] + row[:1], strict=True)}
    return [
        (face, k)
        for face, row in enumerate(point.tolist())
        for k, (a, b) in enumerate(zip(row, row[1:] + row[:1], strict=True))
        if (b, a) not in edges
    ]


def _flatten(corners: np.ndarray) -> np.ndarray:
    """Corners (f, 3, 3) float64 of one piece to plane coordinates (f, 3, 2) in the scene's unit of length.

    The longest border edge lies along u. Seen from the front, u, v and the normal are right-handed.
    """
    point = points_of(corners)
    border = _border(point)
    ends = {point[f, k]: (point[f, (k + 1) % 3], corners[f, (k + 1) % 3] - corners[f, k]) for f, k in border}
    lengths = {start: float(np.sqrt(dot(edge, edge))) for start, (_, edge) in ends.items()}
    if not ends:  # a closed piece, which flat geometry cannot be; any edge will do
        edge = corners[0, 1] - corners[0, 0]
    else:
        first = max(ends, key=lambda start: (lengths[start], -int(start)))
        edge = ends[first][1]
        rectangle = _rectangle(first, ends, lengths, point) if len(corners) == 2 and len(ends) == 4 else None
        if rectangle is not None:
            return rectangle
    normal = area_vectors(corners)
    total = normal[0]
    for row in normal[1:]:
        total = total + row
    # The edge may lie a little off the mean plane; take the part within it.
    u = edge - total * (dot(edge, total) / dot(total, total))
    u = u / np.sqrt(dot(u, u))
    v = cross(total, u)
    v = v / np.sqrt(dot(v, v))
    moved = corners - corners[0, 0]
    return np.stack([dot(moved, u), dot(moved, v)], axis=-1)


def _rectangle(
    first: int, ends: dict[int, tuple[int, np.ndarray]], lengths: dict[int, float], point: np.ndarray
) -> np.ndarray | None:
    """Coordinates (2, 3, 2) of a quad that is nearly a rectangle, made one; None for any other."""
    loop = [first]
    while len(loop) < 4:
        loop.append(ends[loop[-1]][0])
    if len(set(loop)) < 4:
        return None
    edge = [ends[start][1] for start in loop]
    side = [lengths[start] for start in loop]
    diagonal = [float(np.sqrt(dot(edge[k] + edge[k + 1], edge[k] + edge[k + 1]))) for k in (0, 1)]
    for a, b in ((side[0], side[2]), (side[1], side[3]), (diagonal[0], diagonal[1])):
        if abs(a - b) > SQUARE * max(a, b):
            return None
    width, height = (side[0] + side[2]) / 2, (side[1] + side[3]) / 2
    place = dict(zip(loop, ((0.0, 0.0), (width, 0.0), (width, height), (0.0, height)), strict=True))
    return np.array([[place[p] for p in row] for row in point.tolist()])
