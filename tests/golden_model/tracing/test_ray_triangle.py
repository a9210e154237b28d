"""The ray-triangle model: against exact arithmetic, and at every corner of its definition."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lightloom.golden_model.contract.bitpack import equal
from lightloom.golden_model.contract.formats import TRIANGLE_HIT
from lightloom.golden_model.tracing.ray_setup import ray_setup
from lightloom.golden_model.tracing.ray_triangle import ray_triangle, triangle_tests
from lightloom.verif.vectors import ray_vectors
from lightloom.verif.vectors.ray_vectors import RAY_TRIANGLE_FAMILIES, SPECIALS, VERTICES, mixed, rays, triangles
from tests.golden_model import exact_rays

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


@settings(deadline=None)
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
