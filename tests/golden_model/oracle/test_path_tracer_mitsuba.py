"""Converged irradiance against analytic truth and against Mitsuba 3, which nobody here wrote."""

from functools import partial

import numpy as np
import pytest
import trimesh

from lightloom.golden_model.contract.formats import POINT_LIGHT, RAY
from lightloom.golden_model.oracle.path_tracer import irradiance
from lightloom.golden_model.scene.assemble import assemble
from lightloom.golden_model.scene.files.load import load_scene
from lightloom.golden_model.scene.parts import Part
from lightloom.golden_model.scene.scene import Scene
from lightloom.golden_model.tracing.bvh import build, traversal
from lightloom.golden_model.tracing.trace_protocol import Trace
from tests.golden_model.mitsuba_scenes import mitsuba, mitsuba_irradiance

SEED = 20250104


def tracer(scene: Scene) -> Trace:
    return partial(traversal.trace, build.build(scene.triangles))


def room(albedo: float, emission: float, inward: bool = True, lamp: float = 0) -> Scene:
    """A closed box of side 2, seen from within."""
    corners = np.asarray(trimesh.creation.box(extents=(2, 2, 2)).triangles, dtype=np.float32)
    part = Part(
        name="room",
        corners=corners[:, ::-1] if inward else corners,
        albedo=np.full((1, 3), albedo, dtype=np.float32),
        emission=np.full((1, 3), emission, dtype=np.float32),
        material=np.zeros(12, dtype=np.int32),
    )
    lamps = [((0.1, 0.2, -0.1), (lamp, lamp, lamp))] if lamp else []
    return assemble(name="room", where="room", parts=[part], point_lights=np.array(lamps, dtype=POINT_LIGHT))


def wall_points() -> tuple[np.ndarray, np.ndarray]:
    """Points on the floor of the room, with normals."""
    position = np.array([[0, -1, 0], [0.5, -1, 0.3], [-0.8, -1, 0.1], [0.9, -1, -0.9]], dtype=np.float32)
    return position, np.broadcast_to(np.array([0, 1, 0], dtype=np.float32), position.shape)


@pytest.mark.parametrize("albedo", [0.0, 0.5, 0.8])
def test_furnace(albedo: float) -> None:
    """In a closed room whose walls all emit L the irradiance is pi L / (1 - albedo), everywhere.

    Hard for light samples alone, because everywhere a wall is close to its neighbours' light; at these counts the
    standard deviation of the mean is at most 0.3 %.
    """
    scene = room(albedo, 1.0)
    position = np.random.default_rng(SEED).uniform(-0.98, 0.98, (64, 3)).astype(np.float32)
    position[:, 1] = -1
    normal = np.broadcast_to(np.array([0, 1, 0], dtype=np.float32), position.shape)
    found = irradiance(scene, tracer(scene), position, normal, samples=1024, seed=SEED).astype(np.float64)
    assert found.mean() == pytest.approx(np.pi / (1 - albedo), rel=0.01), f"seed {SEED}"
    assert np.median(found) == pytest.approx(np.pi / (1 - albedo), rel=0.01), f"seed {SEED}"


def test_surfaces_reflect_on_both_sides() -> None:
    """A lamp in a box of outward faces lights it as one in a box of inward faces."""
    position, normal = wall_points()
    both = []
    for inward in (True, False):
        scene = room(0.6, 0.0, inward, lamp=1.0)
        both.append(irradiance(scene, tracer(scene), position, normal, samples=4096, seed=SEED))
    assert np.allclose(both[0], both[1], rtol=0.02), both
    direct = 1.2 / (0.1**2 + 1.2**2 + 0.1**2) ** 1.5
    assert (both[0][0] > 1.5 * direct).all()


def test_the_same_seed_gives_the_same_bits_and_progress_reaches_the_end() -> None:
    scene = load_scene("cornell-box")
    trace = tracer(scene)
    position, normal = floor_points(scene, trace, 40)
    seen: list[tuple[int, int]] = []
    first = irradiance(scene, trace, position, normal, 64, SEED, lambda done, total: seen.append((done, total)))
    assert first.dtype == np.float32
    assert seen[-1] == (40 * 64, 40 * 64)
    assert first.tobytes() == irradiance(scene, trace, position, normal, 64, SEED).tobytes()
    assert first.tobytes() != irradiance(scene, trace, position, normal, 64, SEED + 1).tobytes()
    in_numpy = partial(traversal.trace, build.build(scene.triangles), backend="numpy")
    some = irradiance(scene, in_numpy, position[:5], normal[:5], 64, SEED)
    assert some.tobytes() == first[:5].tobytes(), "neither the backend nor the other points matter"
    assert irradiance(scene, trace, position[:0], normal[:0], 64).shape == (0, 3)


def floor_points(scene: Scene, trace: Trace, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Random points on the floor of the Cornell box that no block covers, with normals."""
    random = np.random.default_rng(SEED)
    place = np.zeros((2 * count, 3), dtype=np.float32)
    place[:, 0], place[:, 2] = random.uniform(5, 545, 2 * count), random.uniform(5, 550, 2 * count)
    rays = np.zeros(len(place), dtype=RAY)
    rays["origin"], rays["direction"], rays["t_max"] = place, (0, 1, 0), np.inf
    rays["t_min"] = 0.01
    # Upwards a covered point sees a block's top from behind; the lamp and the ceiling turn their fronts to the floor.
    place = place[trace(rays)["front"]][:count]
    assert len(place) == count
    normal = np.zeros_like(place)
    normal[:, 1] = 1
    return place, normal


def test_cornell_floor_against_mitsuba() -> None:
    """Median ratio within 1 % (noise of the median at these counts: 0.2 %), and energy ratio within 1 %."""
    mi = mitsuba()
    scene = load_scene("cornell-box")
    trace = tracer(scene)
    position, normal = floor_points(scene, trace, 300)
    ours = irradiance(scene, trace, position, normal, 2048, SEED).astype(np.float64)
    floor = scene.material[scene.object_id == scene.object_names.index("floor")][0]
    theirs = mitsuba_irradiance(mi, scene, position, normal, np.full(len(position), floor), 2048, SEED)
    ratio = ours / theirs
    median = np.median(ratio, axis=0)
    energy = ours.sum(axis=0) / theirs.sum(axis=0)
    print(f"Cornell floor, {len(position)} points, ours / Mitsuba {mi.__version__}:")
    print(f"  median ratio RGB {median.round(4)}, all {np.median(ratio):.4f}; energy ratio RGB {energy.round(4)}")
    assert (np.abs(median - 1) < 0.01).all(), f"seed {SEED}: {median}"
    assert (np.abs(energy - 1) < 0.01).all(), f"seed {SEED}: {energy}"
