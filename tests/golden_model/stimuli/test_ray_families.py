"""Families of rays are what they say, and tracing them equals brute force in all bits."""

import numpy as np
import pytest

from lightloom.golden_model.contract.bitpack import equal
from lightloom.golden_model.contract.formats import RAY
from lightloom.golden_model.host.errors import InputError
from lightloom.golden_model.scene.files.load import load_scene
from lightloom.golden_model.scene.mesh import area_vectors, dot, without_area
from lightloom.golden_model.stimuli.ray_families import (
    ADVERSARIAL_KINDS,
    RAY_FAMILIES,
    TEXEL_RAYS,
    adversarial_rays,
    camera_rays,
    corners_of,
    diffuse_rays,
    shadow_rays,
    texel_rays,
)
from lightloom.golden_model.tracing import brute_force
from lightloom.golden_model.tracing.bvh.build import build
from lightloom.golden_model.tracing.bvh.traversal import trace
from lightloom.golden_model.tracing.recorder import TestRecorder
from lightloom.verif.vectors import ray_vectors
from tests.golden_model import meshes
from tests.golden_model.tracing.bvh.test_traversal import assert_same
from tests.golden_model.tracing_cases import FAMILIES
from tests.needs import needs_numba

SEED = 90


@pytest.fixture(scope="module")
def room() -> np.ndarray:
    """TRIANGLE (32,): the Cornell box; longest side 559.2."""
    return load_scene("cornell-box").triangles


def unit_normals(triangles: np.ndarray) -> np.ndarray:
    area = area_vectors(corners_of(triangles))
    return area / np.sqrt(dot(area, area))[:, None]


def kind_of(kind: str, triangles: np.ndarray, count: int) -> np.ndarray:
    print(f"{kind}, seed {SEED}")
    return ADVERSARIAL_KINDS[kind](triangles, count, np.random.default_rng(SEED))


@pytest.mark.parametrize("family", RAY_FAMILIES)
def test_a_seed_says_which_rays(room: np.ndarray, family: str) -> None:
    make = RAY_FAMILIES[family]
    assert make(room, 1000, 5).dtype == RAY
    for count in (0, 1, 7, 1000):
        assert len(make(room, count, 5)) == count
    assert make(room, 1000, 5).tobytes() == make(room, 1000, 5).tobytes()
    assert not equal(make(room, 1000, 5), make(room, 1000, 6)).all()


# --- what renderers trace -----------------------------------------------------------------------------------------


def test_diffuse_rays_start_uniformly_on_fronts_in_cosine_directions(room: np.ndarray) -> None:
    count = 40_000
    rays = diffuse_rays(room, count, SEED)
    normals, origin = unit_normals(room), rays["origin"].astype(np.float64)
    # Each origin lies in some triangle's plane and within it: that triangle's share of them is its share of the area.
    height = np.abs(dot(origin[:, None] - corners_of(room)[None, :, 0], normals[None]))
    assert (height.min(axis=1) < 1e-4).all(), "origins leave the surface"
    back = ray_vectors.rays(origin + 0.5 * normals[height.argmin(axis=1)], -normals[height.argmin(axis=1)])
    under = trace(build(room), back)["primitive"]
    area = np.sqrt(dot(area_vectors(corners_of(room)), area_vectors(corners_of(room))))
    expected = area / area.sum() * count
    found = np.bincount(under[under >= 0], minlength=len(room))
    assert (np.abs(found - expected) < 6 * np.sqrt(expected) + 20).all()

    cosine = dot(rays["direction"].astype(np.float64), normals[under])
    assert (cosine > 0).mean() > 0.999
    assert abs(cosine.mean() - 2 / 3) < 0.01
    sideways = rays["direction"].astype(np.float64) - normals[under] * cosine[:, None]
    assert np.abs(sideways.mean(axis=0)).max() < 0.01, "they lean to one side"
    length = np.sqrt(dot(rays["direction"].astype(np.float64), rays["direction"].astype(np.float64)))
    assert np.abs(length - 1).max() < 1e-6
    assert np.unique(rays["t_min"]) == np.float32(1e-4 * np.ptp(corners_of(room).reshape(-1, 3), axis=0).max())
    assert np.isinf(rays["t_max"]).all()


def test_diffuse_rays_do_not_find_where_they_start(room: np.ndarray) -> None:
    """A single wall: nothing else is there to be hit."""
    wall = room[:2]
    assert (trace(build(wall), diffuse_rays(wall, 5000, SEED))["primitive"] < 0).all()


def test_camera_rays_come_from_one_point_and_mostly_meet_the_scene(room: np.ndarray) -> None:
    rays = camera_rays(room, 5000, SEED)
    corners = corners_of(room).reshape(-1, 3)
    eye = np.unique(rays["origin"], axis=0)
    assert len(eye) == 1
    assert ((eye < corners.min(axis=0)) | (eye > corners.max(axis=0))).any(), "the eye is in the scene"
    hit = trace(build(room), rays)["primitive"] >= 0
    assert hit.mean() > 0.6
    forward = rays["direction"].mean(axis=0)
    for axis in ((-forward[2], 0, forward[0]), (0, 1, 0)):
        place = dot(rays["direction"], np.array(axis))
        assert np.ptp(place[hit]) > 0.95 * np.ptp(place), "the window is too wide"
    steps = np.abs(np.diff(rays["direction"].astype(np.float64), axis=0)).max(axis=1)
    assert np.median(steps) < 0.1 * np.ptp(rays["direction"], axis=0).max(), "neighbours are far apart"


def test_shadow_rays_end_at_the_lamp(room: np.ndarray) -> None:
    rays = shadow_rays(room, 5000, SEED)
    corners = corners_of(room).reshape(-1, 3).astype(np.float64)
    low, high = corners.min(axis=0), corners.max(axis=0)
    end = rays["origin"].astype(np.float64) + rays["direction"]
    extent, middle = (high - low).max(), (low + high) / 2
    assert (rays["t_max"] == 1).all()
    assert (np.abs(end - middle)[:, [0, 2]] <= (high - low)[[0, 2]] / 4 + 1e-3).all()
    assert end[:, 1].min() > high[1] - extent / 4 - 1e-3
    assert end[:, 1].max() < high[1] + extent * 0.75 + 1e-3
    dark = trace(build(room), rays, any_hit=True)["primitive"] == 0
    assert 0.5 < dark.mean() < 0.95, "a quarter of the lamp hangs in the room"


# --- what attacks traversal -------------------------------------------------------------------------------------------


def test_adversarial_rays_have_an_equal_part_of_each_kind(room: np.ndarray) -> None:
    rays = adversarial_rays(room, 12_000, SEED)
    bad = ~np.isfinite(rays["direction"]).all(axis=1) | ~np.isfinite(rays["origin"]).all(axis=1)
    bad |= ~(rays["t_min"] < rays["t_max"])
    assert 600 < bad.sum() < 1100, "invalid rays are a twelfth; a few of them are so only by length"
    assert 0.6 < (trace(build(room), rays)["primitive"] >= 0).mean() < 0.95


@pytest.mark.parametrize("kind", sorted(set(ADVERSARIAL_KINDS) - {"invalid"}))
def test_kinds_hit_and_mind(kind: str, room: np.ndarray) -> None:
    rays = kind_of(kind, room, 2000)
    assert (trace(build(room), rays)["primitive"] >= 0).mean() > 0.4


def test_invalid_rays_miss_for_every_reason(room: np.ndarray) -> None:
    rays = kind_of("invalid", room, 2000)
    assert (trace(build(room), rays)["primitive"] < 0).all()
    direction = rays["direction"]
    for name, reason in {
        "NaN direction": np.isnan(direction).any(axis=1),
        "infinite direction": np.isinf(direction).any(axis=1),
        "zero or subnormal direction": (np.abs(direction) < 2.0**-126).all(axis=1),
        "too long": (np.abs(direction) > 2.0**126).any(axis=1) & np.isfinite(direction).all(axis=1),
        "NaN t_min": np.isnan(rays["t_min"]),
        "NaN t_max": np.isnan(rays["t_max"]),
        "t_min = t_max": rays["t_min"] == rays["t_max"],
        "t_min > t_max": rays["t_min"] > rays["t_max"],
        "origin": ~np.isfinite(rays["origin"]).all(axis=1),
    }.items():
        assert reason.sum() > 100, name
    sound = kind_of("at_vertices", room, 2000)
    assert (trace(build(room), sound)["primitive"] >= 0).mean() > 0.9, "the faults are not why they miss"


def test_axis_parallel_rays_have_zeros_of_both_signs_and_coordinates_of_vertices(room: np.ndarray) -> None:
    rays = kind_of("axis_parallel", room, 2000)
    zero = rays["direction"] == 0
    assert zero.any(axis=1).mean() > 0.8
    assert (zero.sum(axis=1) == 2).mean() > 0.4
    assert not zero.all(axis=1).any()
    for sign in (False, True):
        assert (zero & (np.signbit(rays["direction"]) == sign)).mean() > 0.1
    vertex = np.isin(rays["origin"], corners_of(room))
    assert (zero & vertex).any(axis=1).mean() > 0.3


def test_rays_in_planes_lie_in_planes_of_vertices(room: np.ndarray) -> None:
    rays = kind_of("in_planes", room, 2000)
    values = [np.unique(corners_of(room)[:, :, k]) for k in range(3)]
    within = [(rays["direction"][:, k] == 0) & np.isin(rays["origin"][:, k], values[k]) for k in range(3)]
    assert np.logical_or.reduce(within).all()


def test_rays_along_edges_and_at_vertices_are_exact(room: np.ndarray) -> None:
    edges = corners_of(room)[:, [1, 2, 0]] - corners_of(room)
    along = kind_of("along_edges", room, 500)["direction"]
    assert (along[:, None] == edges.reshape(-1, 3)).all(axis=2).any(axis=1).all()
    rays = kind_of("at_vertices", room, 500)
    ends = corners_of(room).reshape(-1, 3)
    assert (rays["direction"][:, None] == ends - rays["origin"][:, None]).all(axis=2).any(axis=1).all()


def test_far_and_long_rays_reach_their_limits_but_few_do(room: np.ndarray) -> None:
    extent = float(np.ptp(corners_of(room).reshape(-1, 3), axis=0).max())
    distance = np.abs(kind_of("from_afar", room, 3000)["origin"]).max(axis=1) / extent
    assert distance.max() > 2.0**35
    assert np.median(distance) > 8
    length = np.abs(kind_of("odd_lengths", room, 3000)["direction"]).max(axis=1)
    assert length.max() > 2.0**100
    assert length[length > 0].min() < 2.0**-120
    # Where the pad is wider than the scene every triangle is tested: such rays are rationed.
    many = ray_vectors.triangles(np.tile(corners_of(room), (20_000, 1, 1)))
    assert (np.abs(kind_of("from_afar", many, 3000)["origin"]).max(axis=1) > extent * 2.0**12).sum() <= 1


def test_grazing_rays_are_nearly_in_their_triangles_plane(room: np.ndarray) -> None:
    rays = kind_of("grazing", room, 1000)
    direction = rays["direction"].astype(np.float64)
    slope = np.abs(dot(direction[:, None], unit_normals(room)[None])) / np.sqrt(dot(direction, direction))[:, None]
    assert (slope.min(axis=1) < 0.1).all()


def test_ranges_end_exactly_at_hits(room: np.ndarray) -> None:
    rays = kind_of("at_the_range", room, 3000)
    hits = trace(build(room), rays)
    found = hits["primitive"] >= 0
    assert (found & (hits["t"] == rays["t_max"])).mean() > 0.03
    assert (found & (hits["t"] == np.nextafter(rays["t_min"], np.float32(np.inf)))).mean() > 0.03


def test_rays_of_a_texel_follow_each_other_and_texels_lie_side_by_side(room: np.ndarray) -> None:
    rays = texel_rays(room, 50 * TEXEL_RAYS + 3, SEED)
    assert len(rays) == 50 * TEXEL_RAYS + 3
    origins = rays["origin"][: 50 * TEXEL_RAYS].reshape(50, TEXEL_RAYS, 3)
    assert (origins == origins[:, :1]).all()
    assert len(np.unique(rays["direction"][:TEXEL_RAYS], axis=0)) > TEXEL_RAYS // 2
    mixed = np.random.default_rng(SEED).permutation(origins[:, 0])

    def apart(points: np.ndarray) -> float:
        return float(np.abs(np.diff(points, axis=0)).max(axis=1).mean())

    assert apart(origins[:, 0]) < 0.6 * apart(mixed)


def test_nothing_to_start_from_is_refused(room: np.ndarray) -> None:
    for family in RAY_FAMILIES.values():
        with pytest.raises(InputError, match="no triangles to aim rays at"):
            family(room[:0], 10, SEED)
    line = ray_vectors.triangles(np.array([[[0, 0, 0], [1, 0, 0], [2, 0, 0]]], float))
    for make in (diffuse_rays, texel_rays, shadow_rays):
        with pytest.raises(InputError, match="no triangle has an area"):
            make(line, 10, SEED)


# --- brute force ------------------------------------------------------------------------------------------------------


def all_families(triangles: np.ndarray, count: int, seed: int) -> np.ndarray:
    """RAY (4 * count,): each family in turn."""
    return np.concatenate([family(triangles, count, seed) for family in RAY_FAMILIES.values()])


def check_against_brute_force(triangles: np.ndarray, count: int, seed: int) -> None:
    """Closest and any hit of 4 * count rays: one brute force answers both, whose any hit is whether there is one."""
    from lightloom.golden_model.tracing.brute_force_numba import trace_brute_force

    rays, bvh = all_families(triangles, count, seed), build(triangles)
    expected = trace_brute_force(triangles, rays)
    assert_same(trace(bvh, rays), expected, rays, f"seed {seed}")
    shadow = trace(bvh, rays, any_hit=True)
    assert ((shadow["primitive"] == 0) == (expected["primitive"] >= 0)).all(), f"seed {seed}, any hit"
    print(f"{len(triangles)} triangles, {len(rays)} rays, {(expected['primitive'] >= 0).mean():.1%} hit")


@pytest.mark.parametrize("any_hit", [False, True])
@pytest.mark.parametrize("backend", ["numpy", pytest.param("numba", marks=needs_numba)])
def test_tracing_equals_brute_force_in_a_room(room: np.ndarray, backend: str, any_hit: bool) -> None:
    rays, bvh = all_families(room, 4000, SEED), build(room)
    expected = brute_force.trace_brute_force(room, rays, any_hit=any_hit)
    assert_same(trace(bvh, rays, any_hit=any_hit, backend=backend), expected, rays, f"seed {SEED}")


@needs_numba
@pytest.mark.parametrize("family", FAMILIES)
def test_compiled_brute_force_is_brute_force(family: str) -> None:
    from lightloom.golden_model.tracing.brute_force_numba import trace_brute_force

    for seed in range(6):
        triangles, rays = FAMILIES[family](np.random.default_rng(seed))
        for any_hit in (False, True):
            expected = brute_force.trace_brute_force(triangles, rays, any_hit=any_hit)
            assert_same(trace_brute_force(triangles, rays, any_hit=any_hit), expected, rays, f"{family} seed {seed}")


@needs_numba
def test_compiled_brute_force_goes_on_over_blocks(monkeypatch: pytest.MonkeyPatch) -> None:
    """Ties across blocks go to the lower index, nearer hits in later blocks win."""
    from lightloom.golden_model.tracing import brute_force_numba

    monkeypatch.setattr(brute_force_numba, "BLOCK", 7)
    triangles, rays = FAMILIES["duplicates"](np.random.default_rng(3))
    assert len(triangles) > 20
    for any_hit in (False, True):
        expected = brute_force.trace_brute_force(triangles, rays, any_hit=any_hit)
        got = brute_force_numba.trace_brute_force(triangles, rays, any_hit=any_hit)
        assert_same(got, expected, rays, "duplicates seed 3")


@needs_numba
def test_tracing_equals_brute_force_on_the_bunny() -> None:
    check_against_brute_force(meshes.bunny(), 100, SEED)


@needs_numba
@pytest.mark.long
@pytest.mark.parametrize(("scene", "count"), [("room", 50_000), ("bunny", 5_200), ("dragon", 150)])
def test_tracing_equals_brute_force_at_size(room: np.ndarray, scene: str, count: int) -> None:
    triangles = room if scene == "room" else getattr(meshes, scene)()
    check_against_brute_force(triangles, count, SEED + 1)


def test_the_scans_are_whole() -> None:
    for triangles, count in ((meshes.bunny(), 69_666), (meshes.dragon(), 871_414)):
        assert len(triangles) == count
        assert np.isfinite(corners_of(triangles)).all()
        assert not without_area(corners_of(triangles)).any()


def test_adversarial_rays_can_be_afforded() -> None:
    """On average a ray of a large scene needs no more than a few hundred tests, so that hardware can be simulated."""
    triangles = meshes.bunny()
    recorder = TestRecorder(1, seed=SEED)
    trace(build(triangles), adversarial_rays(triangles, 20_000, SEED), recorder=recorder)
    print(f"{recorder.nodes / recorder.rays:.1f} nodes and {recorder.total / recorder.rays:.1f} tests a ray")
    assert recorder.total / recorder.rays < 300
