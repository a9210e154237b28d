"""Direct light against analytic truth: point lights, rectangles, and how lights are chosen."""

import math
from collections.abc import Sequence

import numpy as np
import pytest

from lightloom.golden_model.contract.formats import POINT_LIGHT, RAY
from lightloom.golden_model.numerics.directions import cosine_table, tangent_of, to_world
from lightloom.golden_model.rays.light_samples import direct_candidates, met_emission
from lightloom.golden_model.scene.assemble import assemble
from lightloom.golden_model.scene.files.load import load_scene
from lightloom.golden_model.scene.lights import WEIGHT_BITS, lights_of
from lightloom.golden_model.scene.parts import Part
from lightloom.golden_model.scene.scene import Scene
from lightloom.golden_model.tables.lights import POINT, Lights
from lightloom.golden_model.tables.ray_offset import ray_start
from lightloom.golden_model.tracing.brute_force import trace_brute_force

SEED = 20250103
UP = np.array([0, 1, 0], dtype=np.float32)


def quad(name: str, corners: list[list[float]], emission: tuple[float, ...] = (0, 0, 0)) -> Part:
    return Part(
        name=name,
        corners=np.array(corners, dtype=np.float32)[[[0, 1, 2], [0, 2, 3]]],
        albedo=np.full((1, 3), 0.5, dtype=np.float32),
        emission=np.array([emission], dtype=np.float32),
        material=np.zeros(2, dtype=np.int32),
    )


def lamp(width: float, depth: float, height: float, emission: tuple[float, ...] = (3, 2, 1), x: float = 0) -> Part:
    """A rectangle at (x, height, 0) that faces down."""
    w, d = width / 2, depth / 2
    corners = [[x - w, height, -d], [x + w, height, -d], [x + w, height, d], [x - w, height, d]]
    return quad("lamp", corners, emission)


def scene_of(*parts: Part, lamps: Sequence[tuple[Sequence[float], Sequence[float]]] = ()) -> Scene:
    return assemble(name="test", where="test", parts=parts, point_lights=np.array(list(lamps), dtype=POINT_LIGHT))


def floor_points(*places: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
    position = np.array([[x, 0, z] for x, z in places], dtype=np.float32)
    return position, np.broadcast_to(UP, position.shape)


def estimate(lights: Lights, position: np.ndarray, normal: np.ndarray, samples: int) -> np.ndarray:
    """Unblocked irradiance (N, 3), float64."""
    _, weight = direct_candidates(lights, position, normal, np.arange(len(position)), samples=samples)
    return weight.astype(np.float64).sum(axis=1)


def rectangle_irradiance(x: float, z: float, half: float, height: float) -> float:
    """At (x, z) on the floor, of a square lamp of radiance 1 around the axis: Lambert's polygon formula."""
    corners = np.array([[-half, -half], [half, -half], [half, half], [-half, half]])
    rays = np.array([[cx - x, height, cz - z] for cx, cz in corners])
    rays /= np.linalg.norm(rays, axis=1)[:, None]
    total = 0.0
    for a, b in zip(rays, np.roll(rays, -1, axis=0), strict=True):
        around = np.cross(a, b)
        total += math.acos(float(a @ b)) * around[1] / float(np.linalg.norm(around))
    return abs(total) / 2


@pytest.mark.parametrize("scale", [1.0, 1e-6, 1e6])
def test_rectangle_light_against_lamberts_formula_at_any_scale(scale: float) -> None:
    places = [(0.0, 0.0), (0.7, -0.2), (3.0, 2.0), (-8.0, 0.5)]
    scene = scene_of(lamp(1 * scale, 1 * scale, 1.5 * scale))
    position, normal = floor_points(*((x * scale, z * scale) for x, z in places))
    truth = np.array([rectangle_irradiance(x, z, 0.5, 1.5) for x, z in places])
    found = estimate(lights_of(scene), position, normal, 4096)
    assert np.allclose(found, truth[:, None] * (3, 2, 1), rtol=2e-3)


def test_balanced_samples_and_met_emission_add_up_close_to_the_light() -> None:
    """A hundredth of the lamp's side below it, where light samples alone are useless."""
    scene = scene_of(lamp(1, 1, 0.01))
    lights = lights_of(scene)
    position, normal = floor_points((0.1, 0.2), (0.49, 0.49), (0.6, 0.0), (2.0, 0.0))
    truth = np.array([rectangle_irradiance(x, z, 0.5, 0.01) for x, _, z in position.tolist()])
    samples, one = 4096, np.float32(1)
    _, weight = direct_candidates(lights, position, normal, np.arange(4), samples=samples, rivals=one)
    found = weight[..., 2].astype(np.float64).sum(axis=1)
    for k in range(4):
        rays = np.zeros(samples, dtype=RAY)
        rays["origin"], rays["t_max"] = position[k], np.inf
        facing = np.broadcast_to(UP, (samples, 3))
        rays["direction"] = to_world(cosine_table()[:samples], facing, tangent_of(facing))
        hits = trace_brute_force(scene.triangles, rays)
        toward = rays["direction"] * hits["t"][:, None]
        met = met_emission(lights, hits["primitive"], hits["front"], toward, facing, one)
        found[k] += np.pi * met[hits["primitive"] >= 0, 2].astype(np.float64).sum() / samples
    assert np.allclose(found, truth, rtol=4e-3, atol=3e-4)
    _, weight = direct_candidates(lights, position, normal, np.arange(4), samples=1, rivals=one)
    assert weight.max() <= 3.1416 * 3, "no sample brings more than a sky full of the light"


def test_sixteen_samples_are_well_spread_over_the_light() -> None:
    """The error of runs of 16 is far below that of 16 independent samples, for every run."""
    lights = lights_of(scene_of(lamp(1, 1, 1.0)))
    position, normal = floor_points(*[(0.3, 0.1)] * 1024)
    truth = rectangle_irradiance(0.3, 0.1, 0.5, 1.0)
    keys = np.arange(1024)
    _, weight = direct_candidates(lights, position, normal, keys, first=16 * (keys % 7), samples=16)
    error = weight[..., 2].astype(np.float64).sum(axis=1) / truth - 1
    _, single = direct_candidates(lights, position, normal, keys, samples=1)
    independent = (single[:, 0, 2].astype(np.float64) / truth).std() / 4
    assert abs(error.mean()) < 4 * error.std() / 32, "unbiased"
    assert error.std() < independent / 2.5


def test_point_light_is_exact() -> None:
    lamps = [((0.0, 2.0, 0.0), (8.0, 4.0, 2.0))]
    scene = scene_of(quad("floor", [[-9, 0, 9], [9, 0, 9], [9, 0, -9], [-9, 0, -9]]), lamps=lamps)
    places = [(0.0, 0.0), (1.0, 0.0), (3.0, -4.0)]
    position, normal = floor_points(*places)
    truth = np.array([2 / (4 + x * x + z * z) ** 1.5 for x, z in places])
    found = estimate(lights_of(scene), position, normal, 1)
    assert np.allclose(found, truth[:, None] * (8, 4, 2), rtol=1e-6)
    rays, _ = direct_candidates(lights_of(scene), position, normal, np.arange(3))
    hits = trace_brute_force(scene.triangles, rays[:, 0], any_hit=True)
    assert (hits["primitive"] < 0).all(), "neither the floor they start on nor anything else is in the way"


def test_light_behind_and_backs_of_lights_bring_nothing() -> None:
    lights = lights_of(scene_of(lamp(1, 1, 1.0), lamps=[((0.0, 1.0, 0.0), (1.0, 1.0, 1.0))]))
    below, normal = floor_points((0.0, 0.0), (0.5, 0.2))
    for position, facing in ((below, -normal), (below + 2 * UP, normal)):
        rays, weight = direct_candidates(lights, position.astype(np.float32), facing, np.arange(2), samples=64)
        assert (weight == 0).all()
        assert (rays["t_max"] == 0).all()
    rays, weight = direct_candidates(lights, (below + 2 * UP).astype(np.float32), -normal, np.arange(2), samples=64)
    lit = weight.any(axis=2)
    assert (rays["t_max"] == lit).all()
    assert 0 < lit.mean() < 1, "the point light shines upwards, the lamp does not"


def test_no_light_and_no_points() -> None:
    dark = lights_of(scene_of(quad("floor", [[0, 0, 0], [1, 0, 0], [1, 0, -1], [0, 0, -1]])))
    assert len(dark) == 0
    position, normal = floor_points((0.1, 0.1))
    rays, weight = direct_candidates(dark, position, normal, np.arange(1), samples=3)
    assert rays.shape == (1, 3)
    assert (rays["t_max"] == 0).all()
    assert (weight == 0).all()
    rays, weight = direct_candidates(dark, position[:0], normal[:0], np.arange(0), samples=3)
    assert weight.shape == (0, 3, 3)


def test_lights_are_chosen_by_power_and_each_at_least_sometimes() -> None:
    parts = [lamp(1, 1, 1.0, (x, x, x), x=3 * k) for k, x in enumerate((1.0, 4.0, 1e-12))]
    lights = lights_of(scene_of(*parts, lamps=[((9.0, 1.0, 0.0), (1.0, 1.0, 1.0))]))
    weight = np.diff(lights.begin.astype(np.int64))
    assert lights.begin[-1] < 2**WEIGHT_BITS
    assert (weight > 0).all()
    assert np.allclose(weight / weight.max(), [0.125, 0.125, 0.5, 0.5, 0, 0, 1], atol=1e-6)
    assert np.allclose((lights.share * weight)[lights.kind == POINT], lights.begin[-1])


def test_many_lights_give_the_sum_of_their_parts() -> None:
    random = np.random.default_rng(SEED)
    parts = [lamp(0.5, 0.5, 2.0, tuple(random.random(3) * 10), x=float(x)) for x in random.integers(-5, 6, size=12)]
    lamps = [((float(x), 1.5, 1.0), (2.0, 1.0, 0.5)) for x in range(-2, 3)]
    position, normal = floor_points((0.0, 0.0), (2.0, 1.0))
    together = estimate(lights_of(scene_of(*parts, lamps=lamps)), position, normal, 1 << 15)
    apart = np.zeros_like(together)
    for part in parts:
        apart += estimate(lights_of(scene_of(part)), position, normal, 1 << 12)
    floor = quad("floor", [[0, -1, 0], [1, -1, 0], [1, -1, -1], [0, -1, -1]])
    for one in lamps:
        apart += estimate(lights_of(scene_of(floor, lamps=[one])), position, normal, 1)
    assert np.allclose(together, apart, rtol=5e-3)


def test_cornell_shadow_rays_reach_the_light_from_everywhere_they_can() -> None:
    """No self-hit at either end: a ray between the empty room's walls and its light is never blocked."""
    scene = load_scene("cornell-box")
    room = scene.triangles[scene.object_id < 6]
    random = np.random.default_rng(SEED)
    count = 4000
    chosen = random.integers(10, size=count)  # the walls, without the light's own two triangles
    u, v = random.random((2, count))
    fold = u + v > 1
    u[fold], v[fold] = 1 - u[fold], 1 - v[fold]
    corners = scene.corners[chosen].astype(np.float64)
    weights = np.stack([1 - u - v, u, v], axis=1)[..., None]
    position = (corners * (0.002 + 0.994 * weights)).sum(axis=1).astype(np.float32)
    start = ray_start(position, scene.normals[chosen, 0], scene.spans[chosen])
    rays, weight = direct_candidates(lights_of(scene), start, scene.normals[chosen, 0], np.arange(count), samples=4)
    wanted = (rays["t_max"] > 0) & weight.any(axis=2)
    assert wanted.mean() > 0.7
    hits = trace_brute_force(room, rays[wanted], any_hit=True)
    blocked = np.flatnonzero(hits["primitive"] >= 0)
    assert not len(blocked), f"seed {SEED}: {len(blocked)} blocked, first from {rays[wanted][blocked[0]]}"


def test_the_same_keys_give_the_same_bits_whatever_is_asked_together() -> None:
    scene = load_scene("cornell-box")
    lights = lights_of(scene)
    position, normal = floor_points(*((float(x), float(x) / 2) for x in range(10, 500, 7)))
    keys = np.arange(len(position)) + 1000
    rays, weight = direct_candidates(lights, position, normal, keys, first=32, samples=16)
    for part, run in ((slice(0, 10), slice(0, 16)), (slice(10, None), slice(4, 9))):
        some, light = direct_candidates(
            lights, position[part], normal[part], keys[part], first=32 + run.start, samples=run.stop - run.start
        )
        assert some.tobytes() == rays[part, run].tobytes()
        ratio = np.float32(run.stop - run.start) / np.float32(16)
        assert np.allclose(light * ratio, weight[part, run], rtol=1e-6)
