"""Seeded families of rays for a scene's triangles: what renderers trace, and what attacks traversal.

A family is a function of TRIANGLE (T,), a count and a seed to RAY (count,); the same arguments give the same rays on
every machine.
`RAY_FAMILIES` names them. Directions of "diffuse" rays have unit length, so their t are lengths; "camera" rays have t
along the view axis; "shadow" rays end at the lamp with t = 1. Shadow rays ask only whether anything is in the way
(`any_hit`); nothing prevents the other question.

Vertices must be finite, as those of a scene are. All raise InputError where there is no triangle, the first three
where none has an area.
"""

from collections.abc import Callable

import numpy as np

from lightloom.golden_model.contract.formats import F4, RAY
from lightloom.golden_model.host.errors import InputError
from lightloom.golden_model.numerics.directions import cosine_table, rotation_table, tangent_of, to_world
from lightloom.golden_model.numerics.floats import quiet
from lightloom.golden_model.numerics.vectors import cross, interpolate, normalize, subtract
from lightloom.golden_model.scene.assemble import framing_camera
from lightloom.golden_model.scene.mesh import area_vectors, dot
from lightloom.golden_model.tables.pinhole import look_at
from lightloom.golden_model.tracing.ray_setup import ray_setup
from lightloom.golden_model.tracing.ray_triangle import ray_triangle, triangle_tests

Generator = np.random.Generator
RayFamily = Callable[[np.ndarray, int, int], np.ndarray]
AdversarialKind = Callable[[np.ndarray, int, Generator], np.ndarray]

TEXEL_RAYS = 16
"""Rays of a texel that follow each other, as many as an update takes by default."""
T_MIN = 1e-4
"""Where rays begin that start on a surface, in parts of the scene's extent: their own triangle lies before it."""

EVERYTHING = 1 << 20
"""Triangle tests that rays whose pad holds the whole scene may come to, for each kind that makes such rays."""

SIGNED = np.array([0.0, -0.0, 1.0, -1.0, 2.0, -0.5], dtype=np.float32)


# --- geometry ---------------------------------------------------------------------------------------------------------


def corners_of(triangles: np.ndarray) -> np.ndarray:
    """TRIANGLE (T,) to its corners (T, 3, 3) float32."""
    return np.ascontiguousarray(triangles).view(F4).reshape(-1, 3, 3)


def rays_from(origin: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """(N, 3) each to RAY (N,) with the range 0 < t <= infinity."""
    out = np.zeros(len(origin), dtype=RAY)
    out["origin"], out["direction"], out["t_max"] = origin, direction, np.inf
    return out


def mixed(corners: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Corners (N, 3, 3) and their weights (N, 3) to the points (N, 3), in float64."""
    wide = corners.astype(np.float64)
    return sum((wide[:, k] * weight[:, k, None] for k in range(3)), np.zeros((len(corners), 3)))


def weights(count: int, rng: Generator) -> np.ndarray:
    """Barycentric weights (N, 3) float64, uniform over the triangle."""
    # Not rng.dirichlet, which takes logarithms, and those differ between hosts.
    u, v = rng.random((2, count))
    outside = u + v > 1
    u, v = np.where(outside, 1 - u, u), np.where(outside, 1 - v, v)
    return np.stack([(1 - u) - v, u, v], axis=1)


def magnitudes(low: int, high: int, shape: int | tuple[int, ...], rng: Generator) -> np.ndarray:
    """Numbers from 2**low to 2**high, as many in each octave, float64."""
    return np.ldexp(1 + rng.random(shape), rng.integers(low, high, shape))


def directions(count: int, rng: Generator) -> np.ndarray:
    """Unit vectors (N, 3) float64 to all sides, more of them towards the corners of a cube."""
    way = rng.uniform(-1, 1, (count, 3))
    return way / np.sqrt(dot(way, way))[:, None]


def points_on(triangles: np.ndarray, count: int, rng: Generator) -> np.ndarray:
    """(N, 3) float32 points at vertices, on edges and on faces of random triangles, a third each."""
    weight = weights(count, rng)
    kind = rng.integers(0, 3, count)
    weight[kind == 1, 0] = 0
    weight[kind == 0] = np.eye(3)[rng.integers(0, 3, (kind == 0).sum())]
    weight = rng.permuted(weight, axis=1)
    weight /= weight.sum(axis=1, keepdims=True)
    return mixed(corners_of(triangles)[rng.integers(0, len(triangles), count)], weight).astype(np.float32)


def aimed(triangles: np.ndarray, origin: np.ndarray, rng: Generator) -> np.ndarray:
    """RAY (N,) from origins (N, 3) towards points on the triangles; half of the directions are of unit length."""
    direction = points_on(triangles, len(origin), rng) - origin.astype(np.float32)
    length = np.sqrt((direction.astype(np.float64) ** 2).sum(axis=1, keepdims=True))
    unit = rng.integers(0, 2, (len(origin), 1)).astype(bool) & (length > 0)
    return rays_from(origin, np.where(unit, direction / np.where(length > 0, length, 1), direction))


def bounds(triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """The lower and upper corner of a scene of finite vertices, (3,) float64 each, and its extent: the longest side."""
    corners = corners_of(triangles).astype(np.float64)
    if not len(corners):
        raise InputError("no triangles to aim rays at; a scene needs at least one")
    low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
    return low, high, float((high - low).max())


def surface_points(
    triangles: np.ndarray, weight: np.ndarray, count: int, rng: Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Points uniform over triangles that are drawn by `weight` (T,) float64, and which triangles: (N, 3) and (N,).

    The points are float32, so on their triangle up to their own rounding.
    """
    # Ordered sums, so that the same seed gives the same rays on every machine.
    cumulative = np.cumsum(weight)
    if not cumulative[-1] > 0:
        raise InputError("no triangle has an area that rays could start from; at least one must")
    index = np.searchsorted(cumulative, rng.random(count) * cumulative[-1], side="right")
    u, v = rng.random((2, count), dtype=np.float32)
    outside = u + v > 1
    u, v = np.where(outside, 1 - u, u), np.where(outside, 1 - v, v)
    v0, v1, v2 = (triangles[name][index] for name in ("v0", "v1", "v2"))
    return interpolate(v0, v1, v2, u, v), index


# --- what renderers trace -----------------------------------------------------------------------------------------


def diffuse_rays(triangles: np.ndarray, count: int, seed: int) -> np.ndarray:
    """Rays from points uniform by area on the surface, on their front sides, cosine-distributed about the normal.

    The normal is that of the triangle. The origins are not lifted: t_min is 1e-4 of the scene's extent. t_max is
    infinite. Their order is random, so rays that follow each other have nothing in common.
    """
    rng = np.random.default_rng([seed, 1])
    return _rays_of_points(triangles, *_uniform_points(triangles, count, rng), rng)


def texel_rays(triangles: np.ndarray, count: int, seed: int) -> np.ndarray:
    """As `diffuse_rays`, but as the maintenance of a lightmap emits them: TEXEL_RAYS from a point, and the points in
    the order of their places, so that rays that follow each other start near each other.
    """
    rng = np.random.default_rng([seed, 5])
    origin, index = _uniform_points(triangles, -(-count // TEXEL_RAYS), rng)
    order = np.argsort(_place(origin), kind="stable")
    origin, index = (np.repeat(values[order], TEXEL_RAYS, axis=0)[:count] for values in (origin, index))
    return _rays_of_points(triangles, origin, index, rng)


def _uniform_points(triangles: np.ndarray, count: int, rng: Generator) -> tuple[np.ndarray, np.ndarray]:
    """As `surface_points`, by area."""
    bounds(triangles)  # refuses a scene without triangles
    area = area_vectors(corners_of(triangles))
    return surface_points(triangles, np.sqrt(dot(area, area)), count, rng)


def _rays_of_points(triangles: np.ndarray, origin: np.ndarray, index: np.ndarray, rng: Generator) -> np.ndarray:
    """RAY (N,) from points (N, 3) on the triangles `index` (N,), cosine-distributed about the triangles' normals."""
    count = len(origin)
    extent = bounds(triangles)[2]
    v0, v1, v2 = (triangles[name][index] for name in ("v0", "v1", "v2"))
    # Scaled first, so that no square leaves the range.
    normal = normalize(cross(*(subtract(v, v0) / np.float32(extent) for v in (v1, v2))))
    local = cosine_table()[rng.integers(0, len(cosine_table()), count)]
    rotation = rotation_table()[rng.integers(0, len(rotation_table()), count)]
    rays = rays_from(origin, to_world(local, normal, tangent_of(normal), rotation))
    rays["t_min"] = T_MIN * extent
    return rays


def _place(points: np.ndarray) -> np.ndarray:
    """Morton code of points (N, 3) on a grid of 1024 cells an axis around them, (N,) int64."""
    low = points.min(axis=0)
    span = np.ptp(points, axis=0).max()
    cells = np.clip((points - low) / (span if span > 0 else np.float32(1)) * np.float32(1023), 0, 1023).astype(np.int64)
    code = np.zeros(len(points), dtype=np.int64)
    for bit in range(10):
        for axis in range(3):
            code |= ((cells[:, axis] >> bit) & 1) << (3 * bit + axis)
    return code


def camera_rays(triangles: np.ndarray, count: int, seed: int) -> np.ndarray:
    """Rays of a pinhole camera outside the scene, one at a random place in each pixel, row by row.

    The camera is the one that mesh files get (`framing_camera`); the window is the least one that shows every vertex,
    with square pixels, so that most rays meet the scene. Rays that follow each other are neighbours.
    """
    rng = np.random.default_rng([seed, 2])
    low, high, _ = bounds(triangles)
    camera = framing_camera(low, high)
    view = look_at(camera.position, camera.target, camera.up, camera.fov_y_tan, 1, 1)
    axes = [axis.astype(np.float64) for axis in (view.right, view.up, view.forward)]
    moved = corners_of(triangles).reshape(-1, 3).astype(np.float64) - view.position
    across, upwards, depth = (dot(moved, axis) for axis in axes)
    left, right = (across / depth).min(), (across / depth).max()
    bottom, top = (upwards / depth).min(), (upwards / depth).max()
    # The least numbers of columns and rows that make pixels about square and have room for all rays.
    shape = (right - left) / (top - bottom) if top > bottom else 1.0
    columns = max(int(np.ceil(np.sqrt(count * shape))), 1)
    rows = max(-(-count // columns), 1)
    row, column = np.divmod(np.arange(count), columns)
    x = left + (column + rng.random(count)) / columns * (right - left)
    y = top - (row + rng.random(count)) / rows * (top - bottom)
    rays = rays_from(np.tile(view.position, (count, 1)), axes[2] + x[:, None] * axes[0] + y[:, None] * axes[1])
    rays["t_min"] = view.near
    return rays


def shadow_rays(triangles: np.ndarray, count: int, seed: int) -> np.ndarray:
    """Rays from surface points to points of a lamp over the scene: t_max is 1, at the lamp.

    The lamp is a box over the middle of the scene, half as long and wide, which begins a quarter of the extent below
    the scene's top (so that some of it is within a room) and ends three quarters above. Surface points are drawn as
    the lamp's middle lights them: by area and the cosine towards it, and by area alone where it lights none. t_min is
    1e-4 of the extent, in lengths of the direction.
    """
    rng = np.random.default_rng([seed, 3])
    low, high, extent = bounds(triangles)
    corners = corners_of(triangles)
    area = area_vectors(corners)
    middle = np.array([(low[0] + high[0]) / 2, high[1] + extent / 4, (low[2] + high[2]) / 2])
    toward = middle - corners[:, 0]
    lit = np.maximum(dot(area, toward), 0.0) / np.sqrt(dot(toward, toward))
    origin, _ = surface_points(triangles, lit if lit.max() > 0 else np.sqrt(dot(area, area)), count, rng)
    size = np.array([(high[0] - low[0]) / 2, extent, (high[2] - low[2]) / 2])
    lamp = middle + (rng.random((count, 3)) - 0.5) * size
    rays = rays_from(origin, lamp - origin)
    wide = rays["direction"].astype(np.float64)
    rays["t_min"] = T_MIN * extent / np.sqrt(dot(wide, wide))
    rays["t_max"] = 1
    return rays


# --- what attacks traversal: kinds of adversarial rays, functions of (triangles, count, generator) --------------------


def few(triangles: np.ndarray, count: int, rng: Generator) -> np.ndarray:
    """A choice of rays (N,) bool: about a hundredth, but no more than may be tested against every triangle.

    The farther away a ray begins and the longer its direction, the wider is the pad that boxes must have (`ray_box`),
    until every box is entered. A few such rays show that it is so; many would take all the time there is.
    """
    chosen = np.zeros(count, dtype=bool)
    number = min(-(-count // 100), max(EVERYTHING // len(triangles), 1))
    chosen[rng.permutation(count)[:number]] = True
    return chosen


def axis_parallel(triangles: np.ndarray, count: int, rng: Generator) -> np.ndarray:
    """Through points on triangles, along an axis or in an axis plane, with zeros of both signs.

    A third aims at vertices: their coordinates are those of the origin, bit for bit, where the direction is zero.
    """
    extent = np.float32(bounds(triangles)[2])
    direction = rng.choice(SIGNED, (count, 3))
    alone = rng.integers(0, 2, count).astype(bool)
    axis = rng.integers(0, 3, count)
    direction[alone] = np.where(np.arange(3) == axis[alone, None], direction[alone], direction[alone] * 0)
    none = ~direction.any(axis=1)
    direction[none, axis[none]] = rng.choice(np.array([-1, 1], dtype=np.float32), none.sum())
    away = direction * extent * rng.uniform(0, 2, (count, 1)).astype(np.float32)
    return rays_from(points_on(triangles, count, rng) - away, direction)


def from_surfaces(triangles: np.ndarray, count: int, rng: Generator) -> np.ndarray:
    """From vertices, edges and faces to other such points, t_min zero, the least number or a little below zero."""
    rays = aimed(triangles, points_on(triangles, count, rng), rng)
    rays["t_min"] = rng.choice(np.array([0.0, -0.0, 2.0**-126, -1e-6], dtype=np.float32), count)
    return rays


def along_edges(triangles: np.ndarray, count: int, rng: Generator) -> np.ndarray:
    """Along an edge, from its end or from beyond: all triangles at it are seen edge-on or at their vertices."""
    corners = corners_of(triangles)[rng.integers(0, len(triangles), count)]
    end = rng.integers(0, 3, count)
    row = np.arange(count)
    start, direction = corners[row, end], corners[row, (end + 1) % 3] - corners[row, end]
    before = rng.choice(np.array([0, 0.5, 1, 4, 64], dtype=np.float32), (count, 1))
    return rays_from(start - before * direction, direction)


def at_vertices(triangles: np.ndarray, count: int, rng: Generator) -> np.ndarray:
    """From around the scene exactly at a vertex, as exactly as float32 can say."""
    low, high, extent = bounds(triangles)
    corners = corners_of(triangles)[rng.integers(0, len(triangles), count)]
    origin = rng.uniform(low - extent, high + extent, (count, 3)).astype(np.float32)
    return rays_from(origin, corners[np.arange(count), rng.integers(0, 3, count)] - origin)


def in_planes(triangles: np.ndarray, count: int, rng: Generator) -> np.ndarray:
    """Within an axis plane through a vertex, so within axis-aligned faces and within faces of boxes of the tree."""
    low, high, extent = bounds(triangles)
    axis = rng.integers(0, 3, (count, 1)) == np.arange(3)
    target = points_on(triangles, count, rng)
    # Half of the planes bound the scene or a triangle of it, half go through any vertex.
    corners = corners_of(triangles)[rng.integers(0, len(triangles), count)]
    face = np.stack([corners.min(axis=1), corners.max(axis=1), corners[:, 0], corners[:, 1]])
    plane = face[rng.integers(0, 4, count), np.arange(count)]
    outermost = rng.integers(0, 8, count) == 0
    plane[outermost] = np.where(rng.integers(0, 2, (outermost.sum(), 1)), low, high)
    origin = rng.uniform(low - extent / 4, high + extent / 4, (count, 3)).astype(np.float32)
    zero = np.copysign(np.float32(0), rng.choice(np.array([-1, 1], dtype=np.float32), (count, 3)))
    direction = np.where(axis, zero, target - origin)
    return rays_from(np.where(axis, plane, origin), direction)


def grazing(triangles: np.ndarray, count: int, rng: Generator) -> np.ndarray:
    """Nearly in a triangle's plane: towards a point of it, from beside it and 2**-30 to 2**-4 of its size above it."""
    corners = corners_of(triangles)[rng.integers(0, len(triangles), count)].astype(np.float64)
    area = area_vectors(corners)
    length = np.sqrt(dot(area, area))[:, None]
    up = area / np.where(length > 0, length, 1)
    target = mixed(corners, weights(count, rng))
    side = (corners[:, 1] - corners[:, 0]) * rng.uniform(-2, 2, (count, 1)) + (corners[:, 2] - corners[:, 0])
    size = np.sqrt(dot(side, side))[:, None]
    rise = up * size * magnitudes(-30, -4, (count, 1), rng) * rng.choice([-1, 1], (count, 1))
    origin = (target - side * rng.uniform(1, 8, (count, 1)) + rise).astype(np.float32)
    return rays_from(origin, target - origin)


def from_afar(triangles: np.ndarray, count: int, rng: Generator) -> np.ndarray:
    """From up to 2**10 of the scene's extent away, a `few` from up to 2**40, at points on it."""
    low, high, extent = bounds(triangles)
    far = few(triangles, count, rng)
    distance = extent * np.where(far, magnitudes(10, 40, count, rng), magnitudes(1, 10, count, rng))
    away = directions(count, rng) * distance[:, None]
    return aimed(triangles, ((low + high) / 2 + away).astype(np.float32), rng)


def from_inside(triangles: np.ndarray, count: int, rng: Generator) -> np.ndarray:
    """From points in the scene's box in all directions, with all kinds of ranges of t."""
    low, high, extent = bounds(triangles)
    rays = rays_from(rng.uniform(low, high, (count, 3)), directions(count, rng))
    rays["t_min"] = rng.choice([0, -1, 0.1], count) * extent
    rays["t_max"] = rng.choice([0.3, 2, np.inf], count) * extent
    return rays


@quiet
def odd_lengths(triangles: np.ndarray, count: int, rng: Generator) -> np.ndarray:
    """Directions of lengths from 2**-126 to 2**16 of the scene's extent, a `few` up to 2**125, at points on it."""
    low, high, extent = bounds(triangles)
    rays = aimed(triangles, rng.uniform(low - extent, high + extent, (count, 3)), rng)
    greatest = np.abs(rays["direction"]).max(axis=1, keepdims=True)
    ordinary = min(16 + int(np.frexp(extent)[1]), 125)
    exponent = np.where(
        few(triangles, count, rng), rng.integers(ordinary, 126, count), rng.integers(-126, ordinary, count)
    )
    rays["direction"] = np.ldexp(rays["direction"] / np.where(greatest > 0, greatest, 1), exponent[:, None])
    return rays


@quiet
def nearly_parallel(triangles: np.ndarray, count: int, rng: Generator) -> np.ndarray:
    """Directions with components many magnitudes below the greatest, subnormals among them."""
    low, high, extent = bounds(triangles)
    rays = aimed(triangles, rng.uniform(low - extent / 2, high + extent / 2, (count, 3)), rng)
    small = magnitudes(-150, -10, (count, 3), rng) * rng.choice([-1, 1], (count, 3))
    kept = rng.integers(0, 3, (count, 1)) == np.arange(3)
    # The origin goes where the ray would meet its target without the small components.
    target = rays["origin"] + rays["direction"]
    rays["origin"] = np.where(kept, rays["origin"], target)
    rays["direction"] = np.where(kept, rays["direction"], small)
    return rays


def at_the_range(triangles: np.ndarray, count: int, rng: Generator) -> np.ndarray:
    """Ranges of t that begin or end exactly at a hit, or at the number before or after it."""
    low, high, extent = bounds(triangles)
    index = rng.integers(0, len(triangles), count)
    origin = rng.uniform(low - extent, high + extent, (count, 3)).astype(np.float32)
    target = mixed(corners_of(triangles)[index], weights(count, rng))
    rays = rays_from(origin, target - origin)
    t = ray_triangle(triangle_tests(ray_setup(rays), triangles[index]))["t"]
    near = rng.choice(np.array([-np.inf, 0, np.inf], dtype=np.float32), count)
    bound = np.where(near == 0, t, np.nextafter(t, near))
    begins = rng.integers(0, 2, count).astype(bool)
    rays["t_min"] = np.where(begins, bound, 0)
    rays["t_max"] = np.where(begins, np.inf, bound)
    return rays


def invalid(triangles: np.ndarray, count: int, rng: Generator) -> np.ndarray:
    """Rays that miss whatever there is, though aimed at it: a fault in the direction, the origin or the range of t.

    A direction that is zero (subnormal components count as zero) or beyond 2**126, or has a NaN or infinite component;
    an origin that has one; a NaN t_min or t_max; t_min equal to t_max or above it.
    """
    rays = at_vertices(triangles, count, rng)
    t = rng.random(count, dtype=np.float32)
    kind, axis, row = rng.integers(0, 10, count), rng.integers(0, 3, count), np.arange(count)
    rays["t_min"] = np.where(kind == 0, np.nan, np.where(kind <= 2, t, rays["t_min"]))
    rays["t_max"] = np.where(kind == 1, t, np.where(kind == 2, t - 1, np.where(kind == 3, np.nan, rays["t_max"])))
    for number, value in ((4, np.nan), (5, np.inf), (6, -np.inf), (7, np.float32(1.5 * 2.0**126))):
        rays["direction"][row[kind == number], axis[kind == number]] = value
    tiny = rng.choice(np.array([0.0, -0.0, 2.0**-127, -(2.0**-149)], dtype=np.float32), (count, 3))
    rays["direction"][kind == 8] = tiny[kind == 8]
    wrong = rng.choice(np.array([np.nan, np.inf, -np.inf], dtype=np.float32), count)
    rays["origin"][row[kind == 9], axis[kind == 9]] = wrong[kind == 9]
    return rays


ADVERSARIAL_KINDS: dict[str, AdversarialKind] = {
    kind.__name__: kind
    for kind in (
        axis_parallel,
        from_surfaces,
        along_edges,
        at_vertices,
        in_planes,
        grazing,
        from_afar,
        from_inside,
        odd_lengths,
        nearly_parallel,
        at_the_range,
        invalid,
    )
}
"""Each a twelfth of `adversarial_rays`."""


def adversarial_rays(triangles: np.ndarray, count: int, seed: int) -> np.ndarray:
    """An equal part of each of ADVERSARIAL_KINDS, shuffled."""
    rng = np.random.default_rng([seed, 4])
    part = -(-count // len(ADVERSARIAL_KINDS))
    rays = np.concatenate([kind(triangles, part, rng) for kind in ADVERSARIAL_KINDS.values()])
    return rays[rng.permutation(len(rays))[:count]]


RAY_FAMILIES: dict[str, RayFamily] = {
    "diffuse": diffuse_rays,
    "camera": camera_rays,
    "shadow": shadow_rays,
    "adversarial": adversarial_rays,
}
