"""Where rays start: never on the wrong side of what they leave, and no farther off than float32 makes necessary.

Triangles have vertices that are whole multiples of a power of two, so that a neighbour can lie in the very same plane.
"""

import warnings
from dataclasses import dataclass, replace
from functools import cache, partial
from pathlib import Path

import numpy as np
import pytest

from lightloom.golden_model.charts.buried import hemisphere_rays
from lightloom.golden_model.charts.unwrap import unwrap
from lightloom.golden_model.contract.formats import HIT, RAY, TRIANGLE
from lightloom.golden_model.driver.geometry import shapes_of
from lightloom.golden_model.numerics.directions import cosine_table
from lightloom.golden_model.rays.hit_surface import surface_at
from lightloom.golden_model.rays.light_samples import direct_candidates
from lightloom.golden_model.scene.files.load import load_scene
from lightloom.golden_model.scene.lights import lights_of
from lightloom.golden_model.scene.pose import moved_records, scene_at
from lightloom.golden_model.scene.scene import Scene
from lightloom.golden_model.structures.structure import Structure
from lightloom.golden_model.tables import ray_offset
from lightloom.golden_model.tables.lightmap import VALID
from lightloom.golden_model.tracing.bvh.build import build
from lightloom.golden_model.tracing.bvh.traversal import trace
from lightloom.golden_model.tracing.ray_setup import ray_setup
from lightloom.golden_model.tracing.ray_triangle import ray_triangle, triangle_tests

SEED = 20260714
PAIRS = 20_000
RAYS = 6
"""Rays a point and side."""


@dataclass(frozen=True)
class Pairs:
    """Triangles and a neighbour of each in the same plane across its first edge."""

    scene: Scene
    """2N triangles: the N, then their neighbours."""
    normal: np.ndarray
    """Of the N, exact but for their length, (N, 3) float64."""


def scene_of(corners: np.ndarray) -> Scene:
    """A scene of triangles (T, 3, 3) and nothing else."""
    triangles = np.zeros(len(corners), dtype=TRIANGLE)
    for k in range(3):
        triangles[f"v{k}"] = corners[:, k]
    nothing = np.zeros(len(corners), dtype=np.int32)
    normals = np.zeros((len(corners), 3, 3), dtype=np.float32)
    return replace(load_scene("cornell-box"), triangles=triangles, normals=normals, object_id=nothing, material=nothing)


@cache
def pairs() -> Pairs:
    """Triangles of 1e-9 to 1e6, around the origin and up to 4e6 away: any, slivers, and parallel to the axes."""
    random = np.random.default_rng(SEED)
    unit = np.exp2(random.integers(-30, 2, PAIRS).astype(np.float64))[:, None, None]
    size = np.exp2(random.uniform(1, 19, (PAIRS, 1, 1)))
    edges = np.rint(random.uniform(-1, 1, (PAIRS, 2, 3)) * size)
    sliver = random.random(PAIRS) < 0.2
    along = np.rint(edges[:, 0] * random.uniform(-1, 2, (PAIRS, 1)))
    edges[sliver, 1] = (along + random.integers(-2, 3, (PAIRS, 3)))[sliver]
    flat = random.random(PAIRS) < 0.3
    axis = random.integers(0, 3, PAIRS)
    edges[flat, :, axis[flat]] = 0
    # Each coordinate of the place by itself: none, or up to 22 bits, beyond which vertices would not be exact.
    shift = np.rint(random.uniform(-1, 1, (PAIRS, 3)) * np.exp2(random.uniform(0, 22, (PAIRS, 3))))
    shift[random.random((PAIRS, 3)) < 0.3] = 0
    wide = np.exp2(random.integers(0, 4, PAIRS))[:, None]
    first = np.stack([shift, shift + edges[:, 0], shift + edges[:, 1]], axis=1) * unit
    other = np.stack([shift + edges[:, 0], shift, shift - wide * edges[:, 1]], axis=1) * unit
    normal = np.cross(edges[:, 0], edges[:, 1])
    good = (normal != 0).any(axis=1) & (np.abs(other).max(axis=(1, 2)) < 4e6)
    assert (first.astype(np.float32) == first).all()
    assert (other.astype(np.float32) == other).all()
    corners = np.concatenate([first[good], other[good]]).astype(np.float32)
    return Pairs(scene_of(corners), normal[good])


def points_of(count: int, random: np.random.Generator) -> np.ndarray:
    """HIT (count,), one of each of the first `count` triangles: within, at edges and vertices and close by them."""
    hits = np.zeros(count, dtype=HIT)
    hits["primitive"] = np.arange(count)
    u, v = random.random((2, count))
    beyond = u + v > 1
    u, v = np.where(beyond, 1 - u, u), np.where(beyond, 1 - v, v)
    near = np.exp2(-random.uniform(1, 40, count))
    kind = random.integers(0, 5, count)
    hits["u"] = np.select([kind == 0, kind == 1, kind == 2], [0, near, 1 - near], u)
    hits["v"] = np.select([kind == 1, kind == 2, kind == 3], [near, 0, near], v)
    hits["v"] = np.minimum(hits["v"], 1 - hits["u"])
    return hits


def directions_from(normal: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """Directions (N, 3) float32 that leave planes with normals (N, 3) float64, from steep to within the last bit."""
    unit = normal / np.linalg.norm(normal, axis=1, keepdims=True)
    any_way = random.normal(size=normal.shape)
    axes = np.eye(3)[random.integers(0, 3, len(normal))] * random.choice([-1, 1], (len(normal), 1))
    any_way = np.where(random.random((len(normal), 1)) < 0.2, axes, any_way)
    within = any_way - unit * (any_way * unit).sum(axis=1, keepdims=True)
    grazing = within + unit * np.exp2(-random.uniform(0, 40, (len(normal), 1)))
    direction = np.where(random.random((len(normal), 1)) < 0.3, any_way, grazing)
    direction *= np.exp2(random.integers(-10, 11, (len(normal), 1)))
    direction *= np.where((direction * unit).sum(axis=1, keepdims=True) < 0, -1, 1)
    return direction.astype(np.float32)


def self_hits(side: int) -> tuple[int, str]:
    """How many rays that leave the triangles on a side meet them or the neighbours; the first such ray."""
    random = np.random.default_rng(SEED + 1)
    scene, normal = pairs().scene, pairs().normal * side
    count, found, first = len(normal), 0, ""
    hits = points_of(count, random)
    hits["front"] = side > 0
    surface = surface_at(shapes_of(scene), hits)
    for _ in range(RAYS):
        rays = np.zeros(count, dtype=RAY)
        rays["origin"], rays["t_max"] = surface.start, np.inf
        rays["direction"] = directions_from(normal, random)
        wide = rays["direction"].astype(np.float64)
        # What rounding turned to the other side does not leave.
        slope = (wide * normal).sum(axis=1) / (np.linalg.norm(wide, axis=1) * np.linalg.norm(normal, axis=1))
        leaves = slope > 1e-13
        prepared = ray_setup(rays)
        for part in (scene.triangles[:count], scene.triangles[count:]):
            met = np.flatnonzero(ray_triangle(triangle_tests(prepared, part))["hit"] & leaves)
            found += len(met)
            if len(met) and not first:
                k = met[0]
                first = f"seed {SEED}, triangle {part[k]}, hit {hits[k]}, ray {rays[k]}, slope {slope[k]}"
    return found, first


@pytest.mark.parametrize("side", [1, -1])
def test_no_ray_meets_the_triangle_that_it_leaves_nor_its_coplanar_neighbour(side: int) -> None:
    found, first = self_hits(side)
    assert not found, f"{found} self-hits, first: {first}"


@pytest.mark.parametrize("factor", ["COORDINATE", "SPAN"])
def test_either_factor_is_needed(factor: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ray_offset, factor, np.float32(0))
    assert self_hits(1)[0] > 20, f"seed {SEED}"


def test_rays_start_no_farther_off_than_rounding_makes_necessary() -> None:
    """Walls that are farther apart do not leak: a few units in the last place of the point, and of the span."""
    random = np.random.default_rng(SEED + 2)
    scene = pairs().scene
    surface = surface_at(shapes_of(scene), points_of(len(pairs().normal), random))
    place, wall = surface.place.astype(np.float64), surface.wall.astype(np.float64)
    away = ray_offset.lift(surface.place, surface.wall, surface.span)
    limit = 2 * 2.0**-24 * np.abs(place * wall).sum(axis=1) + 32 * 2.0**-24 * surface.span
    assert (away <= limit * (1 + 1e-6)).all()
    moved = np.abs(surface.start - place)
    assert (moved <= away[:, None] * np.abs(wall) * (1 + 1e-6) + np.abs(surface.start) * 2.0**-24).all()


def test_nothing_else_in_the_scene_counts() -> None:
    """The bits of where rays start are the same beside a quad of a metre that is 100 km away."""
    box = load_scene("cornell-box").corners
    far = np.array([[[1e5, 0, 0], [1e5 + 1, 0, 0], [1e5 + 1, 1, 0]]], dtype=np.float32)
    hits = points_of(len(box), np.random.default_rng(SEED + 3))
    alone, beside = (
        surface_at(shapes_of(scene_of(corners)), hits).start for corners in (box, np.concatenate([box, far]))
    )
    assert alone.tobytes() == beside.tobytes()


def test_a_span_reaches_over_triangles_that_touch() -> None:
    small = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
    large = [[0, -0.0, 0], [0, -40, 0], [30, 0, 0]]
    apart = [[9, 9, 9], [9, 9, 14], [9, 10, 9]]
    found = ray_offset.spans(np.array([small, large, apart], dtype=np.float32))
    assert found.tolist() == [50, 50, pytest.approx(np.sqrt(26))]


@pytest.mark.parametrize(("size", "warned"), [(570, False), (590, True)])
def test_triangles_beside_others_that_are_far_larger_are_said(tmp_path: Path, size: int, warned: bool) -> None:
    """A tile at the corner of a ground whose diagonal is 2**14 texels; a metre away it is not lifted."""
    quad = "[[quad]]\nname='{0}'\ncorners=[[{1},0,0],[{2},0,0],[{2},0,-{3}],[{1},0,-{3}]]\n"
    path = tmp_path / "tile.toml"
    ground = quad.format("ground", 0, size, size)
    path.write_text("texel_size=0.05\n" + quad.format("tile", -1, 0, 1) + ground)
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        load_scene(path)
    off = f"{np.sqrt(2) * size * 2.0**-19:.2g}"
    expected = (
        f"{path}: 1 triangles touch so large ones that rays start up to {off} off them, more than 0.03125 of a texel "
        "(first: of tile); split the large ones"
    )
    assert [str(line.message) for line in said] == [expected] * warned
    path.write_text("texel_size=0.05\n" + quad.format("tile", -2, -1, 1) + ground)
    load_scene(path)


def test_the_lift_by_hand() -> None:
    point, normal = np.array([[3, -5, 7]], dtype=np.float32), np.array([[0, 0.6, -0.8]], dtype=np.float32)
    away = ray_offset.lift(point, normal, np.array([16], dtype=np.float32))
    expected = np.float32(np.float32(np.float32(3) + np.float32(5.6)) * 2.0**-23) + np.float32(16 * 2.0**-19)
    assert away[0].view(np.uint32) == np.float32(expected).view(np.uint32)
    zero = ray_offset.lift(
        np.array([[1e6, 0, -1e6]], np.float32), np.array([[0, 1, 0]], np.float32), np.zeros(1, np.float32)
    )
    assert zero == 0, "a plane through zero does not round"


# --- shadow rays end in front of the light --------------------------------------------------------------------------


def test_no_shadow_ray_meets_the_light_that_it_leads_to() -> None:
    random = np.random.default_rng(SEED + 4)
    rest = load_scene("cornell-box")
    for number in range(60):
        shift = random.uniform(-1, 1, 3) * np.exp2(random.uniform(-10, 17, 3))
        corners = (shift + random.uniform(-1, 1, (1, 3, 3)) * np.exp2(random.uniform(-6, 6))).astype(np.float32)
        lamp = replace(scene_of(corners), albedo=rest.albedo[:1], emission=np.ones((1, 3), dtype=np.float32))
        middle = corners[0].mean(axis=0)
        spread = np.abs(corners[0] - middle).max() * np.exp2(random.uniform(-3, 14, (500, 1)))
        points = (middle + random.normal(size=(500, 3)) * spread).astype(np.float32)
        towards = middle - points
        normal = (towards / np.linalg.norm(towards, axis=1, keepdims=True)).astype(np.float32)
        lights = lights_of(lamp)
        rays, weight = direct_candidates(lights, points, normal, np.arange(500), samples=8)
        # A point nearer to the lamp's plane than rays start off it may be on either side, as far as float32 can tell.
        unit = lights.unit[0].astype(np.float64)
        apart = 2 * ray_offset.lift(corners[0], lights.unit[:1], lights.span).max()
        before = (points - corners[0, 0].astype(np.float64)) @ unit > apart
        rays = rays[before].reshape(-1)[weight[before].reshape(-1, 3).any(axis=1)]
        tests = triangle_tests(ray_setup(rays), np.repeat(lamp.triangles, len(rays)))
        met = np.flatnonzero(ray_triangle(tests)["hit"])
        assert not len(met), f"seed {SEED + 4}, lamp {number}: {corners.tolist()}, ray {rays[met[0]]}"


# --- texels -------------------------------------------------------------------------------------------------------

BODY = """
name = "body"
texel_size = 0.25
[camera]
position = [0, 0, 4]
target = [0, 0, 0]
fov_y_tan = 0.5
[[box]]
center = [{x}, 1, 2]
size = [1, 2, 1.5]
emission = [1, 1, 1]
[[box.path]]
frame = 0
[[box.path]]
frame = 8
translate = [{y}, -3, {y}]
rotate = [1, 0.3, -0.2, 0.7]
"""


@pytest.mark.parametrize(("x", "y"), [(0, 0.5), (0, 9000), (-9000, 9000), (7000, 3)])
def test_no_ray_of_a_moving_bodys_texels_meets_the_body(tmp_path: Path, x: float, y: float) -> None:
    path = tmp_path / "body.toml"
    path.write_text(BODY.format(x=x, y=y))
    scene = load_scene(path)
    lightmaps = unwrap(scene, trace=Structure(scene).trace)
    assert (lightmaps.texels["state"] == VALID).sum() > 200
    for frame in range(9):
        moved = scene_at(scene, frame)
        records = moved_records(lightmaps, moved).texels
        rays = hemisphere_rays(records[records["state"] == VALID], cosine_table()[:64]).reshape(-1)
        hits = partial(trace, build(moved.triangles))(rays)
        met = np.flatnonzero(hits["primitive"] >= 0)
        assert not len(met), f"frame {frame}: {len(met)} of {len(rays)}, first {rays[met[0]]}"
