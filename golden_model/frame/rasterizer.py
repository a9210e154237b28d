"""The rasterizer: triangles to a G-buffer of what each pixel centre sees ([0039], [0055], [0056]).

Vertices are transformed and projected in float32 and snapped to 1/256 of a pixel. From there coverage is exact: edge
functions in integers with the top-left rule, so that triangles that share an edge cover each pixel centre between them
exactly once. Attributes are interpolated perspective-correctly in float32, from the exact edge functions.

Visible surfaces are determined in one of three ways ([0063]); the G-buffer is the same in all bits:

- "tile-deferred": triangles are binned to tiles; a tile finds the nearest triangle of each of its pixels, and only then
  each pixel is shaded, once;
- "immediate": triangles pass one after the other through the whole frame; a fragment that is nearer than all before it
  is shaded at its turn, and is wasted work where a later one covers it;
- "tiled-immediate": the same within a tile, so that depths and colours under way stay on the chip.

Coverage is a question of inequalities that are linear along a row of pixels. Hardware evaluates them pixel by pixel;
the model solves them for the span of each row by exact integer division, which covers the same pixels. Arrays hold one
quantity a row here ((3, S), not (S, 3)): NumPy works fastest on what lies together.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np

from lightloom.golden_model.contract.formats import GBUFFER
from lightloom.golden_model.frame.clipping import clip_triangles
from lightloom.golden_model.frame.tiles import TILE_SIDES, bin_triangles, by_tile, runs
from lightloom.golden_model.host.errors import InputError
from lightloom.golden_model.numerics.floats import float_minmax, float_to_fixed, flush, quiet
from lightloom.golden_model.numerics.structured import put
from lightloom.golden_model.tables.pinhole import View, to_view

SUBPIXEL_BITS = 8
SUBPIXEL = 1 << SUBPIXEL_BITS
CHUNK = 1 << 20  # fragments worked on at a time: bounds the memory
BLOCK = 1 << 14  # pixels whose attributes are worked on at a time: what they need stays in the processor's cache
MODES = ("tile-deferred", "immediate", "tiled-immediate")
FAR = np.int64(0xFFFFFFFF)  # beyond the bits of every depth

Shade = Callable[[np.ndarray], np.ndarray]
"""Fragment shading: GBUFFER (N,) to their colours (N, 3) float32."""


@dataclass(frozen=True, kw_only=True)
class Rasterization:
    """How visible surfaces are determined."""

    mode: str = "tile-deferred"
    """One of `MODES`."""
    tile: int = 32
    """Side of a tile in pixels, a power of two, 8 to 256; "immediate" has no tiles."""

    def __post_init__(self) -> None:
        if self.mode not in MODES:
            raise InputError(f"rasterizer mode {self.mode}: unknown; choose one of {', '.join(MODES)}")
        if self.tile not in TILE_SIDES:
            raise InputError(f"tile {self.tile}: must be one of {', '.join(map(str, TILE_SIDES))}")

    @property
    def tiled(self) -> bool:
        """Whether triangles are binned."""
        return self.mode != "immediate"

    @property
    def deferred(self) -> bool:
        """Whether shading waits for the final visible surface."""
        return self.mode == "tile-deferred"


@dataclass(frozen=True, kw_only=True)
class RasterFigures:
    """The work that one frame made."""

    triangles: int
    """Triangles given."""
    set_up: int
    """Triangles, after clipping, that may cover a pixel centre."""
    pairs: int
    """(tile, triangle) pairs binned, 0 without tiles."""
    tested: int
    """Fragments that were tested for depth: covered pixel centres, triangle by triangle."""
    shaded: int
    """Fragments whose attributes were interpolated and which were shaded."""
    written: int
    """Pixels written to the frame's memory: with tiles each at most once, else every fragment that was shaded."""


@dataclass(frozen=True, kw_only=True)
class Mesh:
    """The triangles of a frame with what is interpolated between their corners, T of them."""

    triangles: np.ndarray
    """TRIANGLE (T,)."""
    normals: np.ndarray
    """Of the corners, (T, 3, 3) float32."""
    object_id: np.ndarray
    """(T,) int32."""
    lightmap_uv: np.ndarray
    """Lightmap coordinates of the corners in texels, (T, 3, 2) float32."""
    back_rows: np.ndarray | None = None
    """Of triangles whose backs have texels, the rows from those of the front to them, 0 for others: (T,) float32."""
    texture_uv: np.ndarray | None = None
    """Texture coordinates of the corners in texels of the finest level, (T, 3, 2) float32; None: there are none."""


@dataclass(frozen=True, kw_only=True)
class Raster:
    """What the rasterizer leaves of a frame."""

    gbuffer: np.ndarray
    """GBUFFER (H, W)."""
    image: np.ndarray | None
    """What `shade` made of the visible fragments, (H, W, 3) float32, zero where nothing is seen; None without it."""
    figures: RasterFigures


@dataclass(frozen=True)
class _Setup:
    """Triangles ready for coverage, S of them, in order of their primitives.

    Edge k is opposite corner k and its function is `step_x[k] * px + step_y[k] * py + constant[k]` in subpixel units
    (px, py of a pixel centre): positive inside, and its value is corner k's weight. Together the three are `area`.
    """

    primitive: np.ndarray  # (S,)
    step_x: np.ndarray  # (3, S) int64
    step_y: np.ndarray  # (3, S) int64
    constant: np.ndarray  # (3, S) int64
    bias: np.ndarray  # (3, S) int64: 0 where the edge owns the points on it, else -1
    area: np.ndarray  # (S,) int64, twice the area
    inverse_depth: np.ndarray  # (3, S) float32, 1/z of the corners
    barycentric: np.ndarray  # (2, 3, S) float32, (u, v) of the corners
    front: np.ndarray  # (S,) bool
    bounds: np.ndarray  # (4, S): first column, column after the last, first row, row after the last


def _pick(values: np.ndarray, mirrored: np.ndarray) -> np.ndarray:
    """Values (3, ...) of corners, the second and third exchanged where `mirrored`."""
    return np.stack([values[0], np.where(mirrored, values[2], values[1]), np.where(mirrored, values[1], values[2])])


def _centres(coordinate: np.ndarray, side: int) -> tuple[np.ndarray, np.ndarray]:
    """The pixels whose centres lie between the lowest and the highest of three coordinates (3, S): first, end."""
    low = np.minimum(np.minimum(coordinate[0], coordinate[1]), coordinate[2])
    high = np.maximum(np.maximum(coordinate[0], coordinate[1]), coordinate[2])
    first = -((SUBPIXEL // 2 - low) >> SUBPIXEL_BITS)
    last = (high - SUBPIXEL // 2) >> SUBPIXEL_BITS
    return np.clip(first, 0, side), np.clip(last + 1, 0, side)


@quiet
def _setup(triangles: np.ndarray, view: View) -> _Setup:
    corners = np.stack([triangles["v0"], triangles["v1"], triangles["v2"]], axis=1)
    points, barycentric, primitive = clip_triangles(to_view(view, corners), view)
    x_view, y_view, z_view = np.ascontiguousarray(points.transpose(2, 1, 0))

    inverse_depth = flush(np.float32(1) / z_view)
    x_screen = flush(flush(x_view * view.focal) * inverse_depth) + np.float32(view.width / 2)
    y_screen = np.float32(view.height / 2) - flush(flush(y_view * view.focal) * inverse_depth)
    x = float_to_fixed(x_screen, SUBPIXEL_BITS).astype(np.int64)
    y = float_to_fixed(y_screen, SUBPIXEL_BITS).astype(np.int64)

    columns, rows = _centres(x, view.width), _centres(y, view.height)
    area = (x[1] - x[0]) * (y[2] - y[0]) - (y[1] - y[0]) * (x[2] - x[0])
    keep = np.flatnonzero((area != 0) & (columns[0] < columns[1]) & (rows[0] < rows[1]))
    # y runs down, so a triangle that is counter-clockwise to the eye has a negative area: exchange two corners of it.
    front = area[keep] < 0
    x, y = _pick(x[:, keep], front), _pick(y[:, keep], front)
    start, end = [1, 2, 0], [2, 0, 1]
    dx, dy = x[end] - x[start], y[end] - y[start]
    owns = (dy < 0) | ((dy == 0) & (dx > 0))  # left edges run up, top edges to the right
    corner = barycentric[keep].transpose(1, 2, 0)
    return _Setup(
        primitive=primitive[keep],
        step_x=-dy,
        step_y=dx,
        constant=dy * x[start] - dx * y[start],
        bias=np.where(owns, 0, -1),
        area=np.abs(area[keep]),
        inverse_depth=_pick(inverse_depth[:, keep], front),
        barycentric=np.ascontiguousarray(_pick(corner, front).transpose(1, 0, 2)),
        front=front,
        bounds=np.stack([*columns, *rows])[:, keep],
    )


@quiet
def _weights(edges: tuple[np.ndarray, ...], inverse_depth: np.ndarray) -> tuple[list[np.ndarray], np.ndarray]:
    """Corner weights over depth, 3 times (N,), and their sum: each edge rounded to float32, times 1/z; (0 + 1) + 2."""
    weight = [flush(edge.astype(np.float32) * inverse) for edge, inverse in zip(edges, inverse_depth, strict=True)]
    return weight, flush(flush(weight[0] + weight[1]) + weight[2])


def _pieces(lengths: np.ndarray) -> Iterator[slice]:
    """Slices of runs that hold about CHUNK elements together."""
    total = np.cumsum(lengths)
    begin = 0
    while begin < len(lengths):
        done = total[begin - 1] if begin else 0
        end = max(int(np.searchsorted(total, done + CHUNK, side="right")), begin + 1)
        yield slice(begin, end)
        begin = end


@dataclass(frozen=True)
class _Boxes:
    """Rectangles of pixels to be searched for covered ones, in this order, each for one triangle of the setup."""

    triangle: np.ndarray  # (B,)
    left: np.ndarray  # (B,)
    right: np.ndarray  # (B,): the column after the last
    top: np.ndarray  # (B,)
    bottom: np.ndarray  # (B,): the row after the last


def _boxes(setup: _Setup, view: View, how: Rasterization) -> tuple[_Boxes, int]:
    """The rectangles in order of work, and the number of pairs binned."""
    if not how.tiled:
        return _Boxes(np.arange(len(setup.primitive)), *setup.bounds), 0
    tile, triangle = bin_triangles(setup.bounds, how.tile, view.width)
    row, column = np.divmod(tile, -(-view.width // how.tile))
    left = np.maximum(setup.bounds[0, triangle], column * how.tile)
    right = np.minimum(setup.bounds[1, triangle], (column + 1) * how.tile)
    top = np.maximum(setup.bounds[2, triangle], row * how.tile)
    bottom = np.minimum(setup.bounds[3, triangle], (row + 1) * how.tile)
    met = np.ones(len(tile), dtype=bool)
    for k in range(3):  # a triangle does not meet a tile of which one edge leaves out even the farthest pixel centre
        step_x, step_y = setup.step_x[k, triangle], setup.step_y[k, triangle]
        px = np.where(step_x > 0, right - 1, left) * SUBPIXEL + SUBPIXEL // 2
        py = np.where(step_y > 0, bottom - 1, top) * SUBPIXEL + SUBPIXEL // 2
        met &= step_x * px + step_y * py + setup.constant[k, triangle] + setup.bias[k, triangle] >= 0
    order = np.flatnonzero(met)
    _, order = by_tile(tile[order], order)
    return _Boxes(triangle[order], left[order], right[order], top[order], bottom[order]), len(order)


def _spans(setup: _Setup, boxes: _Boxes, box: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The covered pixels of boxes `box` in rows y: first, and the one after the last."""
    index = boxes.triangle[box]
    first, end = boxes.left[box], boxes.right[box]
    py = y * SUBPIXEL + SUBPIXEL // 2
    for k in range(3):
        step = setup.step_x[k, index]
        # What the edge function with its bias is at x = 0; a pixel is covered where this + step * SUBPIXEL * x >= 0.
        at_zero = setup.step_y[k, index] * py + (setup.constant[k] + setup.bias[k])[index] + step * (SUBPIXEL // 2)
        limit = at_zero // np.where(step == 0, 1, np.abs(step) * SUBPIXEL)
        first = np.maximum(first, np.where(step > 0, -limit, 0))
        end = np.minimum(end, np.where(step < 0, limit + 1, np.where((step == 0) & (at_zero < 0), 0, end)))
    return first, np.maximum(end, first)


def _fragments(setup: _Setup, boxes: _Boxes, view: View) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """(triangle of the setup, pixel, depth as the bits of its float32) of every covered pixel centre, some at a time.

    Edge functions are computed once a span and step along it, as the hardware's do.
    """
    heights = boxes.bottom - boxes.top
    for piece in _pieces(heights):
        box, row = runs(heights[piece])
        box += piece.start
        y = boxes.top[box] + row
        first, end = _spans(setup, boxes, box, y)
        lengths = end - first
        some = np.flatnonzero(lengths)
        index, y, first, lengths = boxes.triangle[box[some]], y[some], first[some], lengths[some]
        px, py = first * SUBPIXEL + SUBPIXEL // 2, y * SUBPIXEL + SUBPIXEL // 2
        edge = [setup.step_x[k, index] * px + setup.step_y[k, index] * py + setup.constant[k, index] for k in (0, 1)]
        for part in _pieces(lengths):
            span, place = runs(lengths[part])
            span += part.start
            triangle = index[span]
            e0, e1 = (edge[k][span] + (setup.step_x[k] * SUBPIXEL)[triangle] * place for k in (0, 1))
            area = setup.area[triangle]
            _, total = _weights((e0, e1, area - e0 - e1), setup.inverse_depth[:, triangle])
            depth = _depth(area, total).view(np.uint32).astype(np.int64)
            yield triangle, (y * view.width + first)[span] + place, depth


def _depth(area: np.ndarray, total: np.ndarray) -> np.ndarray:
    """Area over the sum of weights: the perspective-correct depth, positive, so that its bits order as it does."""
    return flush(area.astype(np.float32) / total)


@dataclass
class _Visibility:
    """Finds what is shaded, from fragments in order of work; each pixel's come in order of their primitives."""

    pixels: int
    nearest: np.ndarray = field(init=False)  # (pixels,) int64: depth bits, and below them the triangle of the setup
    tested: int = 0

    def __post_init__(self) -> None:
        self.nearest = np.full(self.pixels, FAR << np.int64(31))

    @staticmethod
    def _key(depth: np.ndarray, index: np.ndarray) -> np.ndarray:
        """Orders by depth, equal depth by triangle. Depth bits are below 2**31 but for a NaN's sign."""
        return (depth << np.int64(31)) | index

    def resolve(self, index: np.ndarray, pixel: np.ndarray, depth: np.ndarray) -> None:
        """The depth test of deferred shading: the least key of each pixel stays."""
        self.tested += len(pixel)
        np.minimum.at(self.nearest, pixel, self._key(depth, index))

    def visible(self) -> tuple[np.ndarray, np.ndarray]:
        """(pixel, triangle of the setup) of every pixel that sees something, pixels rising."""
        pixel = np.flatnonzero(self.nearest < FAR << np.int64(31))
        return pixel, self.nearest[pixel] & np.int64(0x7FFFFFFF)

    def passing(self, index: np.ndarray, pixel: np.ndarray, depth: np.ndarray) -> np.ndarray:
        """The depth test of immediate shading: which fragments are nearer than all before them at their pixel.

        Fragments are brought together by pixel, each pixel's in their order, and compared with the least depth so far;
        the pixel's number above the depth, counted down, starts the running minimum anew for each pixel.
        """
        self.tested += len(pixel)
        order = np.argsort(pixel, kind="stable")
        pixel, key = pixel[order], self._key(depth, index)[order]
        begins = np.concatenate([[True], pixel[1:] != pixel[:-1]])[: len(pixel)]
        segment = np.int64(np.count_nonzero(begins)) - np.cumsum(begins)
        shallow = key >> np.int64(31)
        least = np.minimum.accumulate((segment << np.int64(32)) | shallow) & FAR
        so_far = np.where(begins, FAR, np.roll(least, 1))
        passed = shallow < np.minimum(so_far, self.nearest[pixel] >> np.int64(31))
        np.minimum.at(self.nearest, pixel[passed], key[passed])
        return np.sort(order[passed])


class _Attributes:
    """Interpolates what the G-buffer holds. Everything that is constant over a triangle is computed once for it."""

    def __init__(self, setup: _Setup, mesh: Mesh, view: View, index: np.ndarray):
        """For the triangles `index` of the setup (repeats are welcome)."""
        used = np.zeros(len(setup.primitive), dtype=bool)
        used[index] = True
        self._row = np.cumsum(used) - 1  # triangle of the setup to its row in the tables below
        used_index = np.flatnonzero(used)
        self._width = view.width
        self._textured = mesh.texture_uv is not None
        self._back_rows = None if mesh.back_rows is None else mesh.back_rows[setup.primitive[used_index]]
        self._primitive = setup.primitive[used_index]
        self._object = mesh.object_id[self._primitive]
        self._front = setup.front[used_index]
        self._integers = np.concatenate(
            [setup.step_x[:2, used_index], setup.step_y[:2, used_index], setup.constant[:2, used_index]]
        )
        area = setup.area[used_index]
        inverse_depth, corner = setup.inverse_depth[:, used_index], setup.barycentric[:, :, used_index]
        columns = [*inverse_depth, *corner[0], *corner[1]]
        for step in (setup.step_x, setup.step_y):
            change, total = _weights(tuple(step[:, used_index] * SUBPIXEL), inverse_depth)
            columns += [_sum3(change, corner[0]), _sum3(change, corner[1]), total]
        columns += [*mesh.normals[self._primitive].reshape(-1, 9).T]
        for uv in (mesh.lightmap_uv, mesh.texture_uv):
            if uv is not None:
                corners = uv[self._primitive]
                columns += [*corners.reshape(-1, 6).T]
                columns += [*flush(corners[:, 1] - corners[:, 0]).T, *flush(corners[:, 2] - corners[:, 0]).T]
        self._floats = np.stack(columns)
        self._area = area

    @quiet
    def interpolate(self, index: np.ndarray, pixel: np.ndarray) -> np.ndarray:
        """GBUFFER (N,) of triangles `index` of the setup at the centres of `pixel` (N,)."""
        out = np.zeros(len(pixel), dtype=GBUFFER)
        for begin in range(0, len(pixel), BLOCK):
            part = slice(begin, begin + BLOCK)
            self._block(out[part], self._row[index[part]], pixel[part])
        return out

    def _block(self, out: np.ndarray, row: np.ndarray, pixel: np.ndarray) -> None:
        y, x = np.divmod(pixel, self._width)
        px, py = x * SUBPIXEL + SUBPIXEL // 2, y * SUBPIXEL + SUBPIXEL // 2
        sx0, sx1, sy0, sy1, c0, c1 = np.take(self._integers, row, axis=1)
        area = self._area[row]
        e0, e1 = sx0 * px + sy0 * py + c0, sx1 * px + sy1 * py + c1
        table = iter(np.take(self._floats, row, axis=1))

        def take(count: int) -> list[np.ndarray]:
            return [next(table) for _ in range(count)]

        weight, total = _weights((e0, e1, area - e0 - e1), np.stack(take(3)))
        inverse = flush(np.float32(1) / total)
        u, v = (flush(_sum3(weight, take(3)) * inverse) for _ in range(2))
        slopes = []  # of u and v, per pixel across and down
        for _ in range(2):
            change_u, change_v, change_total = take(3)
            slopes.append(
                tuple(
                    flush(flush(change - flush(value * change_total)) * inverse)
                    for change, value in ((change_u, u), (change_v, v))
                )
            )
        first = flush(flush(np.float32(1) - u) - v)

        def between(c0: np.ndarray, c1: np.ndarray, c2: np.ndarray) -> np.ndarray:
            return flush(flush(flush(c0 * first) + flush(c1 * u)) + flush(c2 * v))

        corner = take(9)
        normal = [between(*corner[axis::3]) for axis in range(3)]
        square = flush(
            flush(flush(normal[0] * normal[0]) + flush(normal[1] * normal[1])) + flush(normal[2] * normal[2])
        )
        length = np.sqrt(square)

        out["primitive"], out["object"], out["front"] = self._primitive[row], self._object[row], self._front[row]
        out["depth"] = _depth(area, total)
        out["u"], out["v"] = u, v
        for axis in range(3):
            out["normal"][:, axis] = flush(normal[axis] / length)
        for name, lod in (("lightmap", "lod"), ("texture", "texture_lod"))[: 1 + self._textured]:
            corner, along_u, along_v = take(6), take(2), take(2)
            squares = []
            for axis in range(2):
                out[name][:, axis] = between(*corner[axis::2])
            for d_u, d_v in slopes:
                step = [flush(flush(d_u * along_u[axis]) + flush(d_v * along_v[axis])) for axis in range(2)]
                squares.append(flush(flush(step[0] * step[0]) + flush(step[1] * step[1])))
            out[lod] = _half_logarithm(float_minmax(squares[0], squares[1], True))
        if self._back_rows is not None:
            rows = np.where(out["front"], np.float32(0), self._back_rows[row])
            out["lightmap"][:, 1] = flush(out["lightmap"][:, 1] + rows)
            out["normal"] = np.where((rows > 0)[:, None], -out["normal"], out["normal"])


def _sum3(values: list[np.ndarray], factor: np.ndarray | list[np.ndarray]) -> np.ndarray:
    """Sum of three products of (N,): (0 + 1) + 2."""
    part = [flush(value * by) for value, by in zip(values, factor, strict=True)]
    return flush(flush(part[0] + part[1]) + part[2])


@quiet
def draw(view: View, mesh: Mesh, how: Rasterization | None = None, shade: Shade | None = None) -> Raster:
    """Draws a frame: the nearest depth wins, of equal ones the lower primitive; both sides of a triangle are drawn.

    `shade` is called with the fragments that `how` shades, some or all at a time: of deferred modes the visible ones,
    of immediate modes all that pass the depth test at their turn. It has to treat each fragment on its own. Triangles
    that are degenerate on the screen or not finite cover nothing.
    """
    how = how or Rasterization()
    setup = _setup(mesh.triangles, view)
    boxes, pairs = _boxes(setup, view, how)
    pixels = view.height * view.width
    gbuffer = np.zeros(pixels, dtype=GBUFFER)
    gbuffer["primitive"] = gbuffer["object"] = -1
    gbuffer["depth"] = np.inf
    image = None if shade is None else np.zeros((pixels, 3), dtype=np.float32)
    visibility = _Visibility(pixels)
    shaded = 0

    def finish(index: np.ndarray, pixel: np.ndarray) -> None:
        """Shades fragments and writes them; of several at one pixel the last, which is the nearest, stays."""
        nonlocal shaded
        shaded += len(pixel)
        fragment = _Attributes(setup, mesh, view, index).interpolate(index, pixel)
        put(gbuffer, pixel, fragment)
        if shade is not None and image is not None:
            image[pixel] = shade(fragment)

    for index, pixel, depth in _fragments(setup, boxes, view):
        if how.deferred:
            visibility.resolve(index, pixel, depth)
        else:
            now = visibility.passing(index, pixel, depth)
            finish(index[now], pixel[now])
    covered, index = visibility.visible()
    if how.deferred:
        finish(index, covered)
    figures = RasterFigures(
        triangles=len(mesh.triangles),
        set_up=len(setup.primitive),
        pairs=pairs,
        tested=visibility.tested,
        shaded=shaded,
        written=len(covered) if how.tiled else shaded,
    )
    shape = view.height, view.width
    return Raster(
        gbuffer=gbuffer.reshape(shape), image=None if image is None else image.reshape(*shape, 3), figures=figures
    )


def rasterize(
    view: View, triangles: np.ndarray, normals: np.ndarray, object_id: np.ndarray, lightmap_uv: np.ndarray
) -> np.ndarray:
    """TRIANGLE (T,), corner normals (T, 3, 3), objects (T,) and lightmap coordinates (T, 3, 2) to GBUFFER (H, W)."""
    mesh = Mesh(triangles=triangles, normals=normals, object_id=object_id, lightmap_uv=lightmap_uv)
    return draw(view, mesh).gbuffer


@quiet
def level_of_detail(across: np.ndarray, down: np.ndarray) -> np.ndarray:
    """Base-2 logarithm, in 1/256ths, of the longer of two gradients (N, 2) in texels per pixel: (N,) int16.

    At most 0.044 too low; a zero gradient gives -16256.
    """

    def square(g: np.ndarray) -> np.ndarray:
        return flush(flush(g[:, 0] * g[:, 0]) + flush(g[:, 1] * g[:, 1]))

    return _half_logarithm(float_minmax(square(across), square(down), True))


def _half_logarithm(square: np.ndarray) -> np.ndarray:
    """Half the base-2 logarithm of (N,) float32 in 1/256ths, int16.

    The bits of a float32, read as an integer, are its logarithm with straight lines between powers of two (Mitchell
    1962); that of the square of a length is read so and halved.
    """
    return ((np.ascontiguousarray(square).view(np.int32) - np.int32(127 << 23)) >> 16).astype(np.int16)
