"""The rasterizer: triangles to a G-buffer of what each pixel centre sees ([0055], [0056]).

Vertices are transformed and projected in float32 and snapped to 1/256 of a pixel. From there coverage is exact: edge
functions in integers with the top-left rule, so that triangles that share an edge cover each pixel centre between them
exactly once. Attributes are interpolated perspective-correctly in float32, from the exact edge functions.

Coverage is a question of inequalities that are linear along a row of pixels. Hardware evaluates them pixel by pixel;
the model solves them for the span of each row by exact integer division, which covers the same pixels.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from golden_model.camera import View, to_view
from golden_model.clipping import clip_triangles
from golden_model.floats import float_to_fixed, flush, quiet
from golden_model.formats import GBUFFER
from golden_model.vectors import interpolate, normalize

SUBPIXEL_BITS = 8
SUBPIXEL = 1 << SUBPIXEL_BITS
CHUNK = 1 << 20  # fragments worked on at a time: bounds the memory
NOTHING = np.uint64(0xFFFFFFFFFFFFFFFF)


@dataclass(frozen=True)
class _Setup:
    """Triangles ready for coverage, S of them, in order of their primitives.

    Edge k is opposite corner k and its function is `step_x[k] * px + step_y[k] * py + constant[k]` in subpixel units
    (px, py of a pixel centre): positive inside, and its value is corner k's weight.
    """

    primitive: np.ndarray  # (S,)
    step_x: np.ndarray  # (S, 3) int64
    step_y: np.ndarray  # (S, 3) int64
    constant: np.ndarray  # (S, 3) int64
    bias: np.ndarray  # (S, 3) int64: 0 where the edge owns the points on it, else -1
    inverse_depth: np.ndarray  # (S, 3) float32, 1/z of the corners
    barycentric: np.ndarray  # (S, 3, 2) float32, (u, v) of the corners
    front: np.ndarray  # (S,) bool
    rows: np.ndarray  # (S, 2): first row, and the row after the last

    def edges(self, index: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Edge functions (N, 3) int64 of triangles `index` at the centres of pixels (x, y)."""
        px, py = (x * SUBPIXEL + SUBPIXEL // 2)[:, None], (y * SUBPIXEL + SUBPIXEL // 2)[:, None]
        return self.step_x[index] * px + self.step_y[index] * py + self.constant[index]

    @quiet
    def weights(self, index: np.ndarray, edges: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Corner weights over depth (N, 3) and their sum (N,): each edge rounded to float32, times 1/z; (0 + 1) + 2."""
        weight = flush(edges.astype(np.float32) * self.inverse_depth[index])
        return weight, flush(flush(weight[:, 0] + weight[:, 1]) + weight[:, 2])


@quiet
def _setup(triangles: np.ndarray, view: View) -> _Setup:
    corners = np.stack([triangles["v0"], triangles["v1"], triangles["v2"]], axis=1)
    points, barycentric, primitive = clip_triangles(to_view(view, corners), view)

    inverse_depth = flush(np.float32(1) / points[..., 2])
    x = flush(flush(points[..., 0] * view.focal) * inverse_depth) + np.float32(view.width / 2)
    y = np.float32(view.height / 2) - flush(flush(points[..., 1] * view.focal) * inverse_depth)
    x = float_to_fixed(x, SUBPIXEL_BITS).astype(np.int64)
    y = float_to_fixed(y, SUBPIXEL_BITS).astype(np.int64)

    area = (x[:, 1] - x[:, 0]) * (y[:, 2] - y[:, 0]) - (y[:, 1] - y[:, 0]) * (x[:, 2] - x[:, 0])
    # y runs down, so a triangle that is counter-clockwise to the eye has a negative area: exchange two corners of it.
    order = np.where((area < 0)[:, None], [0, 2, 1], [0, 1, 2])
    x, y = np.take_along_axis(x, order, axis=1), np.take_along_axis(y, order, axis=1)
    inverse_depth = np.take_along_axis(inverse_depth, order, axis=1)
    barycentric = np.take_along_axis(barycentric, order[..., None], axis=1)

    start, end = [1, 2, 0], [2, 0, 1]
    dx, dy = x[:, end] - x[:, start], y[:, end] - y[:, start]
    owns = (dy < 0) | ((dy == 0) & (dx > 0))  # left edges run up, top edges to the right
    # A row is met where its centre lies between the lowest and the highest corner.
    first = -((SUBPIXEL // 2 - y.min(axis=1)) // SUBPIXEL)
    last = (y.max(axis=1) - SUBPIXEL // 2) // SUBPIXEL
    rows = np.stack([np.clip(first, 0, view.height), np.clip(last + 1, 0, view.height)], axis=1)
    keep = (area != 0) & (rows[:, 0] < rows[:, 1])
    return _Setup(
        primitive=primitive[keep],
        step_x=-dy[keep],
        step_y=dx[keep],
        constant=(dy * x[:, start] - dx * y[:, start])[keep],
        bias=np.where(owns, 0, -1)[keep],
        inverse_depth=inverse_depth[keep],
        barycentric=barycentric[keep],
        front=(area < 0)[keep],
        rows=rows[keep],
    )


def _runs(lengths: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Expands runs: (which run, place in it) of every element, for runs of the given lengths."""
    which = np.repeat(np.arange(len(lengths)), lengths)
    return which, np.arange(len(which)) - np.repeat(np.cumsum(lengths) - lengths, lengths)


def _pieces(lengths: np.ndarray) -> Iterator[slice]:
    """Slices of runs that hold about CHUNK elements together."""
    total = np.cumsum(lengths)
    begin = 0
    while begin < len(lengths):
        done = total[begin - 1] if begin else 0
        end = max(int(np.searchsorted(total, done + CHUNK, side="right")), begin + 1)
        yield slice(begin, end)
        begin = end


def _spans(setup: _Setup, index: np.ndarray, y: np.ndarray, width: int) -> tuple[np.ndarray, np.ndarray]:
    """The covered pixels of triangles `index` in rows y: first, and the one after the last."""
    py = (y * SUBPIXEL + SUBPIXEL // 2)[:, None]
    step = setup.step_x[index]
    # What the edge function with its bias is at x = 0; a pixel is covered where this + step * SUBPIXEL * x >= 0.
    at_zero = setup.step_y[index] * py + setup.constant[index] + setup.bias[index] + step * (SUBPIXEL // 2)
    limit = at_zero // np.where(step == 0, 1, np.abs(step) * SUBPIXEL)
    first = np.where(step > 0, -limit, np.where((step == 0) & (at_zero < 0), width, 0)).max(axis=1)
    last = np.where(step < 0, limit, width - 1).min(axis=1)
    first = np.maximum(first, 0)
    return first, np.maximum(np.minimum(last + 1, width), first)


def _fragments(setup: _Setup, view: View) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """(triangle of the setup, x, y) of every covered pixel centre, some at a time."""
    heights = setup.rows[:, 1] - setup.rows[:, 0]
    for piece in _pieces(heights):
        index, row = _runs(heights[piece])
        index += piece.start
        y = setup.rows[index, 0] + row
        first, end = _spans(setup, index, y, view.width)
        lengths = end - first
        for part in _pieces(lengths):
            span, place = _runs(lengths[part])
            span += part.start
            yield index[span], first[span] + place, y[span]


@quiet
def _visible(setup: _Setup, view: View) -> tuple[np.ndarray, np.ndarray]:
    """The depth test: (pixel, triangle of the setup that is nearest there), pixels rising; equal depth: the lower."""
    nearest = np.full(view.height * view.width, NOTHING)
    for index, x, y in _fragments(setup, view):
        edges = setup.edges(index, x, y)
        depth = _depth(setup.weights(index, edges)[1], edges)
        # Depth is positive, so its bits order as it does; the triangle's index below them breaks ties.
        key = (depth.view(np.uint32).astype(np.uint64) << np.uint64(32)) | index.astype(np.uint64)
        np.minimum.at(nearest, y * view.width + x, key)
    pixel = np.flatnonzero(nearest != NOTHING)
    return pixel, (nearest[pixel] & np.uint64(0xFFFFFFFF)).astype(np.int64)


def _depth(total: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """Area over the sum of weights: the perspective-correct depth."""
    return flush(edges.sum(axis=1).astype(np.float32) / total)


@quiet
def rasterize(
    view: View, triangles: np.ndarray, normals: np.ndarray, object_id: np.ndarray, lightmap_uv: np.ndarray
) -> np.ndarray:
    """TRIANGLE (T,), corner normals (T, 3, 3), objects (T,) and lightmap coordinates (T, 3, 2) to GBUFFER (H, W).

    Both sides of a triangle are drawn. The nearest depth wins, of equal ones the lower primitive. Triangles that are
    degenerate on the screen or not finite cover nothing.
    """
    setup = _setup(triangles, view)
    pixel, index = _visible(setup, view)
    y, x = np.divmod(pixel, view.width)
    edges = setup.edges(index, x, y)
    weight, total = setup.weights(index, edges)
    inverse = flush(np.float32(1) / total)
    corner = setup.barycentric[index]
    primitive = setup.primitive[index]

    def blend(weights: np.ndarray) -> np.ndarray:
        """Sum over the corners of weight times (u, v), (N, 2): (0 + 1) + 2."""
        part = flush(weights[..., None] * corner)
        return flush(flush(part[:, 0] + part[:, 1]) + part[:, 2])

    def gradient(step: np.ndarray) -> np.ndarray:
        """Texels of the lightmap per pixel along one axis of the screen, (N, 2), for a step of the edge functions."""
        change, change_total = setup.weights(index, step * SUBPIXEL)
        d_uv = flush(flush(blend(change) - flush(uv * change_total[:, None])) * inverse[:, None])
        along_u, along_v = map_uv[:, 1] - map_uv[:, 0], map_uv[:, 2] - map_uv[:, 0]
        return flush(flush(d_uv[:, :1] * along_u) + flush(d_uv[:, 1:] * along_v))

    uv = flush(blend(weight) * inverse[:, None])
    u, v = uv.T
    map_uv = lightmap_uv[primitive]
    normal = normals[primitive]

    out = np.zeros(view.height * view.width, dtype=GBUFFER)
    out["primitive"] = out["object"] = -1
    out["depth"] = np.inf
    seen = out[pixel]
    seen["primitive"] = primitive
    seen["object"] = object_id[primitive]
    seen["depth"] = _depth(total, edges)
    seen["u"], seen["v"] = u, v
    seen["normal"] = normalize(interpolate(normal[:, 0], normal[:, 1], normal[:, 2], u, v))
    seen["lightmap"] = interpolate(map_uv[:, 0], map_uv[:, 1], map_uv[:, 2], u, v)
    seen["lod"] = level_of_detail(gradient(setup.step_x[index]), gradient(setup.step_y[index]))
    seen["front"] = setup.front[index]
    out[pixel] = seen
    return out.reshape(view.height, view.width)


@quiet
def level_of_detail(across: np.ndarray, down: np.ndarray) -> np.ndarray:
    """Base-2 logarithm, in 1/256ths, of the longer of two gradients (N, 2) in texels per pixel: (N,) int16.

    The bits of a float32, read as an integer, are its logarithm with straight lines between powers of two (Mitchell
    1962); the square of the length is read so and halved. At most 0.044 too low; a zero gradient gives -16256.
    """

    def square(g: np.ndarray) -> np.ndarray:
        return flush(flush(g[:, 0] * g[:, 0]) + flush(g[:, 1] * g[:, 1]))

    longest = np.ascontiguousarray(np.maximum(square(across), square(down)))
    return ((longest.view(np.int32) - np.int32(127 << 23)) >> 16).astype(np.int16)
