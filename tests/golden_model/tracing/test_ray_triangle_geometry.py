"""The ray-triangle model as geometry: how far hits lie from their triangles, and that nothing passes between them."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lightloom.golden_model.tracing.ray_setup import ray_setup
from lightloom.golden_model.tracing.ray_triangle import ray_triangle, triangle_tests
from lightloom.verif.vectors import ray_vectors
from lightloom.verif.vectors.ray_vectors import mixed, rays, triangles
from tests.golden_model.patches import PATCH, patches

SEED = 11

# --- hits lie near their triangles ----------------------------------------------------------------------------------

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


@settings(max_examples=200, deadline=None)
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
