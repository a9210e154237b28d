"""The ray-triangle model: against exact arithmetic, against geometry, and at every corner of its definition."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from golden_model.bitpack import equal
from golden_model.formats import TRIANGLE_HIT
from golden_model.ray_setup import ray_setup
from golden_model.ray_triangle import ray_triangle, triangle_tests
from tests.golden_model import exact_rays
from tests.golden_model.patches import PATCH, patches
from verif import ray_vectors
from verif.ray_vectors import RAY_TRIANGLE_FAMILIES, SPECIALS, VERTICES, mixed, rays, triangles

SEED = 11
MISS = np.zeros(1, dtype=TRIANGLE_HIT)

# Seen from +z, looking down: counter-clockwise.
VERTEX_LIST = [[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0]]


def shoot(
    origin: object,
    direction: object,
    vertices: object = VERTEX_LIST,
    *,
    t_min: float = 0.0,
    t_max: float = math.inf,
    cull: bool = False,
) -> np.void:
    """One ray at one triangle."""
    ray = rays(np.array([origin], dtype=np.float32), np.array([direction], dtype=np.float32))
    ray["t_min"], ray["t_max"] = t_min, t_max
    return ray_triangle(triangle_tests(ray_setup(ray), triangles(np.array([vertices], dtype=np.float32)), cull))[0]


# --- exact arithmetic -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("family", RAY_TRIANGLE_FAMILIES)
def test_agrees_with_exact_arithmetic(family: str) -> None:
    operands = RAY_TRIANGLE_FAMILIES[family](250, np.random.default_rng(SEED))
    results = ray_triangle(operands)
    for k in range(len(operands)):
        one = slice(k, k + 1)
        assert equal(results[one], exact_rays.ray_triangle(operands[one])).all(), (
            f"{family}, seed {SEED}, {operands[k]}"
        )


# --- conventions ----------------------------------------------------------------------------------------------------


def test_barycentrics_and_distance() -> None:
    hit = shoot([1, 2, 6], [0, 0, -2])
    # 0.25 * v0 + 0.25 * v1 + 0.5 * v2 = (1, 2, 0), at 6 / 2 directions' lengths.
    assert (hit["t"], hit["u"], hit["v"], hit["hit"], hit["front"]) == (3, 0.25, 0.5, True, True)


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("above", [True, False])
def test_front_is_counter_clockwise_and_cull_drops_backs(axis: int, above: bool) -> None:
    side = 1.0 if above else -1.0
    origin, direction, vertices = (
        np.roll(np.array(a), axis, axis=-1) for a in ([1, 1, side], [0, 0, -side], VERTEX_LIST)
    )
    hit = shoot(origin, direction, vertices)
    assert hit["hit"]
    assert hit["front"] == above
    assert shoot(origin, direction, vertices, cull=True)["hit"] == above
    assert shoot(origin, direction, vertices[::-1], cull=True)["hit"] != above


def test_front_agrees_with_the_geometric_normal() -> None:
    rng = np.random.default_rng(SEED)
    corners = rng.normal(size=(50_000, 3, 3)).astype(np.float32)
    origin = rng.normal(size=(50_000, 3)).astype(np.float32)
    direction = (mixed(corners, ray_vectors.weights(50_000, rng)) - origin).astype(np.float32)
    result = ray_triangle(triangle_tests(ray_setup(rays(origin, direction)), triangles(corners)))
    wide = corners.astype(np.float64)
    normal = np.cross(wide[:, 1] - wide[:, 0], wide[:, 2] - wide[:, 0])
    facing = (normal * direction).sum(axis=1)
    clear = result["hit"] & (np.abs(facing) > 1e-4)
    assert clear.mean() > 0.9
    assert (result["front"][clear] == (facing < 0)[clear]).all()


def test_zero_is_never_negative_in_barycentrics() -> None:
    # The back face at v0 itself: two edge functions are +0 and the determinant is negative.
    hit = shoot([0, 0, -1], [0, 0, 1])
    assert hit["hit"]
    assert not hit["front"]
    assert hit["u"].view(np.uint32) == hit["v"].view(np.uint32) == 0


@pytest.mark.parametrize("family", RAY_TRIANGLE_FAMILIES)
def test_results_are_in_range_and_misses_all_zero(family: str) -> None:
    operands = RAY_TRIANGLE_FAMILIES[family](50_000, np.random.default_rng(SEED))
    result = ray_triangle(operands)
    hits = result[result["hit"]]
    assert len(hits)
    for name in ("u", "v"):
        assert not np.signbit(hits[name]).any()
        assert (hits[name] <= 1).all()
    assert (hits["u"].astype(np.float64) + hits["v"] <= 1 + 2.0**-22).all()
    assert np.isfinite(hits["t"]).all()
    assert (hits["t"] > operands["t_min"][result["hit"]]).all()
    assert (hits["t"] <= operands["t_max"][result["hit"]]).all()
    assert equal(result[~result["hit"]], np.repeat(MISS, (~result["hit"]).sum())).all()


# --- the range of t -------------------------------------------------------------------------------------------------


def test_t_min_is_exclusive_and_t_max_inclusive() -> None:
    operands = ray_vectors.inside(20_000, np.random.default_rng(SEED))
    first = ray_triangle(operands)
    operands, t = operands[first["hit"]], first["t"][first["hit"]]

    def hits(t_min: object, t_max: object) -> np.ndarray:
        ranged = operands.copy()
        ranged["t_min"], ranged["t_max"] = t_min, t_max
        return ray_triangle(ranged)["hit"]

    below, above = np.nextafter(t, np.float32(-np.inf)), np.nextafter(t, np.float32(np.inf))
    assert len(t) > 10_000
    assert not hits(t, np.inf).any()
    assert hits(below, np.inf).all()
    assert hits(0, t).all()
    assert not hits(0, below).any()
    assert hits(below, t).all()
    assert not hits(t, above).any()


def test_a_surface_at_the_origin_is_hit_only_below_zero() -> None:
    assert not shoot([1, 1, 0], [0, 0, -1])["hit"]
    assert not shoot([1, 1, 0], [0, 0, -1], t_min=-0.0)["hit"]
    hit = shoot([1, 1, 0], [0, 0, -1], t_min=-1)
    assert hit["hit"]
    assert hit["t"] == 0
    assert shoot([1, 1, -2], [0, 0, -1], t_min=-3)["t"] == -2
    assert not shoot([1, 1, -2], [0, 0, -1])["hit"]


@pytest.mark.parametrize(("t_min", "t_max"), [(math.nan, 9), (0, math.nan), (3, 2), (1, 1), (0, -math.inf)])
def test_empty_and_nan_ranges_miss(t_min: float, t_max: float) -> None:
    assert shoot([1, 1, 1], [0, 0, -1])["hit"]
    assert not shoot([1, 1, 1], [0, 0, -1], t_min=t_min, t_max=t_max)["hit"]


# --- what always misses ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("special", SPECIALS[SPECIALS >= 0x7F800000])
@pytest.mark.parametrize("name", ["origin", "shear", *VERTICES])
def test_fields_that_are_not_finite_miss(name: str, special: int) -> None:
    operands = np.repeat(ray_vectors.inside(4000, np.random.default_rng(SEED)), 3)
    hit = ray_triangle(operands)["hit"]
    operands[name].view(np.uint32)[np.arange(len(operands)), np.arange(len(operands)) % 3] = special
    assert hit.mean() > 0.8
    assert not ray_triangle(operands)["hit"].any()
    operands[name] = -operands[name]
    assert not ray_triangle(operands)["hit"].any()


@pytest.mark.parametrize("direction", [(0, 0, 0), (0, 0, -0.0), (0, 0, -math.inf), (0, math.nan, -1), (0, 0, -1e-40)])
def test_unusable_directions_miss(direction: tuple[float, float, float]) -> None:
    assert shoot([1, 1, 1], [0, 0, -1])["hit"]
    assert not shoot([1, 1, 1], direction)["hit"]


@given(
    st.lists(st.floats(width=32, allow_nan=False), min_size=6, max_size=6),
    st.lists(st.floats(-2, 2, width=32), min_size=6, max_size=6),
    st.permutations([0, 0, 1]),
)
def test_two_equal_vertices_always_miss(corners: list[float], ray: list[float], order: list[int]) -> None:
    points = np.array(corners, dtype=np.float32).reshape(2, 3)
    assert not shoot(ray[:3], ray[3:], points[order])["hit"]


def test_two_equal_vertices_always_miss_when_aimed_at() -> None:
    operands = ray_vectors.edges(100_000, np.random.default_rng(SEED))
    assert ray_triangle(operands)["hit"].mean() > 0.4
    for one, two in (("v0", "v1"), ("v1", "v2"), ("v2", "v0")):
        equal_pair = operands.copy()
        equal_pair[one] = equal_pair[two]
        assert not ray_triangle(equal_pair)["hit"].any()


def test_collinear_vertices_are_hit_only_on_their_line() -> None:
    """Rounding can give three points on a line an area: a hit is then possible, but never off the line."""
    rng = np.random.default_rng(SEED)
    count = 100_000
    start, step = rng.integers(-8, 9, (2, count, 3)).astype(np.float32)
    corners = np.stack([start, start + step, start + 2 * step], axis=1)  # exact: small whole numbers
    target = mixed(corners, ray_vectors.weights(count, rng))
    origin = rng.normal(size=(count, 3)).astype(np.float32)
    operands = triangle_tests(ray_setup(rays(origin, target - origin)), triangles(corners))
    assert 0 < ray_triangle(operands)["hit"].mean() < 0.2
    # Seen along an axis from whole numbers nothing is rounded: no hits at all.
    whole = np.rint(target)
    whole[:, 2] = 32
    operands = triangle_tests(ray_setup(rays(whole, np.tile([0.0, 0.0, -1.0], (count, 1)))), triangles(corners))
    assert not ray_triangle(operands)["hit"].any()


def test_edge_on_triangles_miss_where_nothing_is_rounded() -> None:
    assert not shoot([-1, 1, 0], [1, 0, 0])["hit"]
    assert not shoot([-1, 0, 0], [1, 0, 0])["hit"]


@pytest.mark.parametrize(("exponent", "usable"), [(-51, False), (-50, True), (0, True), (61, True), (62, False)])
def test_limits_of_the_determinant(exponent: int, usable: bool) -> None:
    """Twice the projected area, here 16 * 4**exponent, counts where it is above 2**-97 and at most 2**126."""
    scale = 2.0**exponent
    assert shoot([scale, scale, 1], [0, 0, -1], np.array(VERTEX_LIST) * scale)["hit"] == usable


@pytest.mark.parametrize(("exponent", "usable"), [(-45, False), (-42, True), (0, True), (41, True), (42, False)])
def test_limits_of_size_where_the_distance_scales_too(exponent: int, usable: bool) -> None:
    """The determinant times the depth, here 16 * 8**exponent, must stay within float32 as well."""
    scale = 2.0**exponent
    hit = shoot([scale, scale, scale], [0, 0, -1], np.array(VERTEX_LIST) * scale)
    assert hit["hit"] == usable
    assert hit["t"] == (scale if usable else 0)


# --- geometry -------------------------------------------------------------------------------------------------------

UNIT = 2.0**-24
BOUND = 18.0
"""Units of 2**-24 times the greatest |vertex - origin|: see docs/ray_triangle.md."""


def aimed(count: int, kind: str, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Origins, directions (N, 3) and vertices (N, 3, 3), float32, that strain the rounding: oblique, far, grazing."""
    origin = rng.normal(size=(count, 3)).astype(np.float32)
    direction = rng.uniform(-1, 1, (count, 3))
    corners = rng.uniform(-1, 1, (count, 3, 3)) * np.exp2(rng.integers(-3, 4, (count, 1, 1)))
    if kind == "diagonal":
        direction = rng.choice([-1, 1], (count, 3)) * rng.uniform(0.9, 1, (count, 3))
        corners *= rng.choice([0.001, 0.01, 0.1, 1], (count, 1, 1))
    elif kind == "far":
        corners *= np.exp2(rng.integers(-12, -3, (count, 1, 1)))
    elif kind == "grazing":
        corners = corners * np.exp2(rng.integers(-20, -1, (count, 1, 1)))
        corners += direction[:, None] * rng.uniform(-8, 8, (count, 3, 1))
    direction = direction.astype(np.float32)
    weight = ray_vectors.weights(count, rng)
    corners += (direction * rng.uniform(0.1, 4, (count, 1)) - mixed(corners, weight))[:, None]
    return origin, direction, (corners + origin[:, None]).astype(np.float32)


@pytest.mark.parametrize("kind", ["plain", "diagonal", "far", "grazing"])
def test_hits_lie_near_the_triangle(kind: str) -> None:
    """origin + t * direction, and the point that u and v name, against the plane point in float64."""
    origin, direction, corners = aimed(200_000, kind, np.random.default_rng(SEED))
    result = ray_triangle(triangle_tests(ray_setup(rays(origin, direction)), triangles(corners)))
    hit = result["hit"]
    assert hit.mean() > 0.5
    vertex = corners[hit].astype(np.float64) - origin[hit, None]
    reach = np.abs(vertex).max(axis=(1, 2))
    end = result["t"][hit, None].astype(np.float64) * direction[hit]
    u, v = (result[name][hit].astype(np.float64) for name in ("u", "v"))
    named = mixed_points(vertex, np.stack([1 - u - v, u, v], axis=1))
    # (u, v) carry six roundings each, of lengths up to 2 * reach: 24 units more.
    assert (np.abs(end - named).max(axis=1) <= (BOUND + 24) * UNIT * reach).all()
    assert (distance(end, vertex) <= BOUND * UNIT * reach).all()


def mixed_points(vertex: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """(N, 3, 3) and weights (N, 3) to (N, 3), float64."""
    return (vertex * weight[:, :, None]).sum(axis=1)


def distance(point: np.ndarray, vertex: np.ndarray) -> np.ndarray:
    """An upper bound, to float64's rounding, of the distance (greatest component) of points (N, 3) from triangles.

    The nearest of: the foot of the perpendicular where it lies inside, and the nearest points of the three edges.
    """
    a, b, c = vertex[:, 0], vertex[:, 1], vertex[:, 2]
    candidates = []
    for start, end in ((a, b), (b, c), (c, a)):
        along = end - start
        length = np.maximum((along * along).sum(axis=1), 1e-300)
        part = np.clip(((point - start) * along).sum(axis=1) / length, 0, 1)
        candidates.append(np.abs(start + along * part[:, None] - point).max(axis=1))
    normal = np.cross(b - a, c - a)
    length = np.maximum(np.sqrt((normal * normal).sum(axis=1)), 1e-300)
    normal /= length[:, None]
    foot = point - normal * ((point - a) * normal).sum(axis=1)[:, None]
    sides = [(np.cross(q - p, foot - p) * normal).sum(axis=1) for p, q in ((a, b), (b, c), (c, a))]
    within = np.min(sides, axis=0) >= 0
    candidates.append(np.where(within, np.abs(foot - point).max(axis=1), np.inf))
    return np.min(candidates, axis=0)


def test_the_worst_hit_that_a_search_found() -> None:
    """Hill climbing over the bits of ray and triangle: 8.2 units; the bound is 18, the pad of the box test 32."""
    origin = np.array([[-1.0752848, 0.39601168, -0.07766929]], dtype=np.float32)
    direction = np.array([[0.90175915, 0.99281275, -0.9580782]], dtype=np.float32)
    corners = np.array(
        [
            [
                [-0.8942227, 0.59288806, -0.20285484],
                [-0.59810954, 0.92455834, -0.58508444],
                [-0.7552267, 0.6123906, -0.4791517],
            ]
        ],
        dtype=np.float32,
    )
    result = ray_triangle(triangle_tests(ray_setup(rays(origin, direction)), triangles(corners)))
    vertex = corners.astype(np.float64) - origin[:, None]
    off = distance(result["t"][:, None].astype(np.float64) * direction, vertex) / (UNIT * np.abs(vertex).max())
    assert result["hit"].all()
    assert off[0] < BOUND


@pytest.mark.parametrize("kind", ["plain", "diagonal", "far"])
def test_clear_hits_and_misses_agree_with_geometry(kind: str) -> None:
    """Rays that pass an edge at a distance of more than the bound, seen along the ray, are decided rightly."""
    rng = np.random.default_rng(SEED)
    origin, direction, corners = aimed(100_000, kind, rng)
    # Every second triangle is pushed aside, so that there are misses.
    aside = rng.normal(size=(50_000, 1, 3)) * np.abs(corners[::2] - corners[::2, :1]).max(axis=(1, 2), keepdims=True)
    corners[::2] += aside.astype(np.float32)
    result = ray_triangle(triangle_tests(ray_setup(rays(origin, direction)), triangles(corners)))
    vertex = corners.astype(np.float64) - origin[:, None]
    toward = direction / np.sqrt((direction.astype(np.float64) ** 2).sum(axis=1, keepdims=True))
    clearance, margin = [], 2 * BOUND * UNIT * np.abs(vertex).max(axis=(1, 2))
    for k in range(3):
        p, q = vertex[:, k], vertex[:, (k + 1) % 3]
        across = np.cross(toward, q - p)
        clearance.append((across * -p).sum(axis=1) / np.maximum(np.sqrt((across * across).sum(axis=1)), 1e-300))
    facing = (np.cross(vertex[:, 1] - vertex[:, 0], vertex[:, 2] - vertex[:, 0]) * toward).sum(axis=1)
    clearance_in = np.min(np.array(clearance) * np.sign(facing), axis=0)
    depth = (np.cross(vertex[:, 1] - vertex[:, 0], vertex[:, 2] - vertex[:, 0]) * vertex[:, 0]).sum(axis=1) / facing
    clear_hit = (clearance_in > margin) & (depth > margin * 10)
    clear_miss = (clearance_in < -margin) | (depth < -margin * 10)
    assert clear_hit.mean() > 0.3
    assert clear_miss.mean() > 0.2
    assert result["hit"][clear_hit].all()
    assert not result["hit"][clear_miss].any()


# --- watertight -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("cells", "scale"), [(8, 1.0), (32, 1e-3), (181, 1.0), (181, 1e4)])
def test_no_ray_passes_between_the_triangles_of_a_mesh(cells: int, scale: float) -> None:
    operands = patches(25_000, cells, SEED, scale)
    hits = ray_triangle(operands.ravel())["hit"].reshape(-1, PATCH).sum(axis=1)
    assert (hits > 0).all(), f"cells {cells}, scale {scale}, seed {SEED}, rays {np.flatnonzero(hits == 0)[:5]}"
    assert (hits >= 2).mean() > 0.1, "rays through vertices and edges should be many"


coordinate = st.integers(-(2**11), 2**11).map(lambda n: n * 2.0**-8)


@settings(max_examples=300)
@given(
    st.lists(st.tuples(coordinate, coordinate, coordinate), min_size=7, max_size=7),
    st.tuples(coordinate, coordinate, coordinate),
    st.integers(0, 5),
    st.integers(0, 127),
)
def test_a_ray_at_the_hub_of_any_fan_hits(
    points: list[tuple[float, float, float]], origin: tuple[float, float, float], edge: int, reversals: int
) -> None:
    """Six rim points around a hub, seen from `origin`: the ray at the hub, or at a point of a spoke, hits the fan.

    The rim points are pushed out in six directions around the line of sight, so that the fan surrounds it.
    """
    hub, eye = np.array(points[6]), np.add(origin, [0, 0, 24])
    sight = hub - eye
    side = np.cross(sight, [1.0, 0.0, 0.0])
    upward = np.cross(sight, side)
    side, upward = side / np.abs(side).max(), upward / np.abs(upward).max()
    around = [(1, 0), (0.5, 0.9), (-0.5, 0.9), (-1, 0), (-0.5, -0.9), (0.5, -0.9)]
    rim = np.array(
        [hub + (x * side + y * upward) * 4 + np.array(p) / 64 for (x, y), p in zip(around, points, strict=False)]
    )
    corners = np.array([[hub, rim[k], rim[(k + 1) % 6]][:: -1 if reversals >> k & 1 else 1] for k in range(6)])
    for part in (0.0, 0.25, 1 / 3):
        ray = ray_setup(rays(eye[None], (hub + (rim[edge] - hub) * part - eye)[None]))
        assert ray_triangle(triangle_tests(np.repeat(ray, 6), triangles(corners)))["hit"].any()


def test_every_ray_inside_a_closed_mesh_hits() -> None:
    """From inside a deformed octahedron, along and near the axes and its edges, nothing escapes."""
    rng = np.random.default_rng(SEED)
    count = 4000
    poles = np.concatenate([np.eye(3), -np.eye(3)]) * 2
    faces = np.array([(x, y, z) for x in (0, 3) for y in (1, 4) for z in (2, 5)])
    corners = (poles + rng.choice([0, 0.25, 0.3], (count, 6, 3))).astype(np.float32)
    weight = rng.choice([0.0, 0.0, 1.0, 1.0, 0.5], (count, 3)) + 1e-9
    face = faces[rng.integers(0, 8, count)]
    target = mixed(np.take_along_axis(corners, face[:, :, None], axis=1), weight / weight.sum(axis=1, keepdims=True))
    origin = rng.choice(np.array([0.0, -0.0, 0.125, 1e-30, -1e-12], dtype=np.float32), (count, 3))
    prepared = ray_setup(rays(origin, target - origin))
    hit = np.zeros(count, dtype=bool)
    for chosen in faces:
        hit |= ray_triangle(triangle_tests(prepared, triangles(corners[:, chosen])))["hit"]
    assert hit.all(), f"seed {SEED}, rays {np.flatnonzero(~hit)[:5]}"
