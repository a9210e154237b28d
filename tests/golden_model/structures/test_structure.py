"""The structure of a moving scene: hits of a new tree in every frame, and no more work than the motion asks for."""

import time
from pathlib import Path

import numpy as np
import pytest

from lightloom.golden_model.contract.formats import RAY, TRIANGLE
from lightloom.golden_model.host.errors import InputError
from lightloom.golden_model.scene.files.cornell_box import cornell_box
from lightloom.golden_model.scene.pose import scene_at
from lightloom.golden_model.scene.scene import Scene
from lightloom.golden_model.structures.forest import Forest, ForestOptions
from lightloom.golden_model.structures.structure import Structure
from lightloom.golden_model.tracing.bvh import traversal
from lightloom.golden_model.tracing.bvh.build import Bvh, build
from lightloom.golden_model.tracing.recorder import TestRecorder
from tests.golden_model import meshes
from tests.golden_model.moving_scenes import MOVING, ROOM, rays_through, scene_of

SEED = 20250311
FRAMES = (0, 3, 8, 10, 11, 5)

POLICIES = {
    "refit": ForestOptions(rebuild_factor=1e9),
    "rebuild": ForestOptions(rebuild_factor=1.0),
    "refit on demand": ForestOptions(demand=True, rebuild_factor=1e9),
    "rebuild on demand": ForestOptions(demand=True, rebuild_factor=1.0),
}


@pytest.fixture(scope="module")
def moving(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    return scene_of(tmp_path_factory.mktemp("moving"), MOVING)


def check(bvh: Bvh) -> None:
    """Walks a joined tree: every finite triangle once, boxes that hold what is under them."""
    corners = np.stack([bvh.triangles[name] for name in TRIANGLE.names or ()])
    finite = np.flatnonzero(np.isfinite(corners).all(axis=(0, 2)))
    assert np.array_equal(np.sort(bvh.primitive), finite)
    level, nodes, slots, depth = np.zeros(min(len(bvh.count), 1), dtype=np.int64), 0, 0, 0
    while len(level):
        leaf = bvh.count[level] > 0
        for node in level[leaf]:
            held = corners[:, bvh.primitive[bvh.first[node] : bvh.first[node] + bvh.count[node]]]
            assert (bvh.lower[node] == held.min(axis=(0, 1))).all()
            assert (bvh.upper[node] == held.max(axis=(0, 1))).all()
            slots += int(bvh.count[node])
        inner, left = level[~leaf], bvh.first[level[~leaf]]
        assert (bvh.lower[inner] == np.minimum(bvh.lower[left], bvh.lower[left + 1])).all()
        assert (bvh.upper[inner] == np.maximum(bvh.upper[left], bvh.upper[left + 1])).all()
        nodes += len(level)
        level = np.concatenate([left, left + 1])
        depth += bool(len(level))
    assert (nodes, slots) == (len(bvh.count), len(finite))
    assert depth <= bvh.depth


@pytest.mark.parametrize("backend", ["numpy", "numba"])
@pytest.mark.parametrize("policy", POLICIES)
def test_hits_are_those_of_a_new_tree_in_every_frame(moving: Scene, backend: str, policy: str) -> None:
    structure = Structure(scene_at(moving, 0), backend, options=POLICIES[policy])
    rays = rays_through(moving, 500, SEED)
    hit = 0
    for frame in FRAMES:
        scene = scene_at(moving, frame)
        structure.update(scene)
        fresh, coarse = build(scene.triangles), scene.coarse
        assert coarse is not None
        for any_hit in (False, True):
            expected = traversal.trace(fresh, rays, any_hit=any_hit, backend=backend)
            found = structure.trace(rays, any_hit=any_hit)
            assert found.tobytes() == expected.tobytes(), f"frame {frame}, any_hit {any_hit}, seed {SEED}"
            hit += int((found["primitive"] >= 0).sum())
        expected = traversal.trace(build(coarse.triangles), rays, backend=backend)
        assert structure.trace(rays, coarse=True).tobytes() == expected.tobytes(), f"frame {frame}, seed {SEED}"
        if not structure.options.demand:
            check(structure.bvh())
    assert hit > 2000


def test_two_frames_far_apart_and_back(moving: Scene) -> None:
    """Objects that no ray asked for in between are not left behind."""
    structure = Structure(scene_at(moving, 0), options=ForestOptions(demand=True))
    rays = rays_through(moving, 800, SEED)
    nowhere = np.zeros(1, dtype=RAY)
    nowhere["origin"], nowhere["direction"], nowhere["t_max"] = (0, 50, 0), (0, 1, 0), np.inf
    for frame in (0, 6, 3, 9, 0):
        structure.update(scene_at(moving, frame))
        assert structure.trace(nowhere)["primitive"] == -1
        if frame in (6, 9):
            continue
        expected = traversal.trace(build(scene_at(moving, frame).triangles), rays)
        assert structure.trace(rays).tobytes() == expected.tobytes(), f"frame {frame}, seed {SEED}"


def test_the_box_of_what_is_back_in_its_place_is_back_too(tmp_path: Path) -> None:
    """It takes part in the pad of the box test, also where its detail was never made for the frame in between."""
    away = "[[box]]\ncenter = [0, 20, 0]\nsize = [1, 1, 1]\n[[box.path]]\nframe = 0\n[[box.path]]\nframe = 1\n"
    scene = scene_of(
        tmp_path, ROOM + away + "translate = [0, -19, 0]\n[[box.path]]\nframe = 2\ntranslate = [0, 0, 0]\n"
    )
    forest = Forest(scene_at(scene, 0), ForestOptions(demand=True))
    forest.demand(list(forest.waiting))
    for frame, top in ((0, 20.5), (1, 3.0), (2, 20.5)):
        forest.update(scene_at(scene, frame))
        assert forest.bounds()[1, 1] == top, frame


def test_figures_count_the_work(moving: Scene) -> None:
    structure = Structure(scene_at(moving, 0), options=ForestOptions(rebuild_factor=1e9))
    figures = structure.figures()
    # The floor, the wall and the lamp, which is dimmed in its place, are one body.
    assert (figures.built, figures.built_triangles) == (3, 6 + 1280 + 12)
    structure.update(scene_at(moving, 1))
    figures = structure.figures()
    assert (figures.kept, figures.refitted, figures.built, figures.refitted_triangles) == (2, 1, 0, 1280)
    structure.update(scene_at(moving, 4))
    assert (structure.figures().kept, structure.figures().refitted) == (1, 2)
    structure.update(scene_at(moving, 9))
    assert (structure.figures().absent, structure.figures().refitted) == (1, 1)


def test_trees_are_built_anew_when_refitting_has_made_them_poor(moving: Scene) -> None:
    kept = Structure(scene_at(moving, 0), options=ForestOptions(rebuild_factor=1e9))
    renewed = Structure(scene_at(moving, 0), options=ForestOptions(rebuild_factor=1.05))
    rebuilt = 0
    for frame in range(7):
        kept.update(scene_at(moving, frame))
        renewed.update(scene_at(moving, frame))
        assert kept.figures().rebuilt == 0
        rebuilt += renewed.figures().rebuilt
        assert renewed.figures().rebuilt <= renewed.figures().refitted
    assert rebuilt > 0
    assert renewed.bvh().sah_cost < kept.bvh().sah_cost


def test_detail_waits_for_a_ray(moving: Scene) -> None:
    structure = Structure(scene_at(moving, 0), options=ForestOptions(demand=True))
    assert structure.figures().waiting == 5
    assert structure.figures().built == 0
    down = np.zeros(1, dtype=RAY)
    down["origin"], down["direction"], down["t_max"] = (-2.5, 2, 2), (0, -1, 0), np.inf
    assert structure.trace(down)["primitive"] in (0, 1)
    assert (structure.figures().demanded, structure.figures().waiting) == (1, 4)
    # Through the ball: it and the floor under it; the lamp above and the wall behind are no business of this ray.
    down["origin"] = (-1, 2.5, 0)
    assert structure.trace(down)["primitive"] >= 6
    assert (structure.figures().demanded, structure.figures().waiting) == (2, 3)
    # The next frame moves the ball alone, and nobody looks: no work.
    structure.update(scene_at(moving, 1))
    assert structure.figures().waiting == 4
    down["origin"] = (-2.5, 2, 2)
    structure.trace(down)
    assert (structure.figures().refitted, structure.figures().kept) == (0, 1)


def test_what_is_hidden_is_not_asked_for(tmp_path: Path) -> None:
    """A body behind another one's surface stays without detail, although rays point at it."""
    boxes = "".join(
        f'[[box]]\nname = "{name}"\ncenter = [0, 1, {z}]\nsize = [1, 1, 1]\n' for name, z in (("near", 1), ("far", -1))
    )
    scene = scene_of(tmp_path, ROOM + boxes)
    structure = Structure(scene, options=ForestOptions(demand=True))
    rays = np.zeros(200, dtype=RAY)
    rays["origin"] = np.random.default_rng(SEED).uniform((-0.3, 0.7, 2.5), (0.3, 1.3, 2.9), (200, 3))
    rays["direction"], rays["t_max"] = (0, 0, -1), np.inf
    assert (structure.trace(rays)["t"] < 1.5).all()
    assert (structure.figures().demanded, structure.figures().waiting) == (1, 4)


def test_a_static_scene_has_the_tree_it_always_had() -> None:
    scene = cornell_box()
    bvh, joined = build(scene.triangles), Structure(scene).bvh()
    for name in ("lower", "upper", "first", "count", "primitive"):
        assert np.array_equal(getattr(bvh, name), getattr(joined, name)), name
    assert joined.depth == bvh.depth


def test_coarse_of_a_scene_without_reduced_geometry_is_the_scene() -> None:
    scene = cornell_box()
    rays = rays_through(scene, 500, SEED)
    structure = Structure(scene)
    assert structure.trace(rays, coarse=True).tobytes() == structure.trace(rays).tobytes()


@pytest.mark.parametrize("demand", [False, True])
@pytest.mark.parametrize("backend", ["numpy", "numba"])
def test_threads_change_no_bit(moving: Scene, backend: str, demand: bool) -> None:
    rays = rays_through(moving, 1001, SEED)
    options = ForestOptions(demand=demand)
    one, three = (Structure(scene_at(moving, 5), backend, threads=n, options=options) for n in (1, 3))
    for part in (rays, rays[:2], rays[:0]):
        for any_hit in (False, True):
            assert one.trace(part, any_hit=any_hit).tobytes() == three.trace(part, any_hit=any_hit).tobytes()


@pytest.mark.parametrize("demand", [False, True])
def test_a_recorder_sees_every_ray_once(moving: Scene, demand: bool) -> None:
    rays = rays_through(moving, 300, SEED)
    recorders = [TestRecorder(limit=50, seed=1) for _ in range(2)]
    traversal.trace(build(scene_at(moving, 0).triangles), rays, recorder=recorders[0])
    Structure(scene_at(moving, 0), recorder=recorders[1], threads=2, options=ForestOptions(demand=demand)).trace(rays)
    assert recorders[0].rays == recorders[1].rays == 300
    assert 0 < recorders[1].total < 3 * recorders[0].total


def test_another_scene_is_refused(moving: Scene) -> None:
    with pytest.raises(ValueError, match="one scene"):
        Structure(moving).update(cornell_box())
    with pytest.raises(InputError, match="threads 0: must be 1 to 256"):
        Structure(moving, threads=0)
    with pytest.raises(InputError, match=r"rebuild_factor 0\.5: must be 1 or more"):
        ForestOptions(rebuild_factor=0.5)


def test_a_turning_bunny_is_followed_in_time(tmp_path: Path) -> None:
    meshes.bunny()  # skips where it is missing
    text = f"""
[[mesh]]
file = "{meshes.BUNNY}"
[[mesh.path]]
frame = 0
[[mesh.path]]
frame = 8
rotate = [1, 0, 1, 0]
"""
    scene = scene_of(tmp_path, ROOM + text)
    structure = Structure(scene_at(scene, 0))
    frame = scene_at(scene, 3)
    begin = time.perf_counter()
    structure.update(frame)
    taken = time.perf_counter() - begin
    assert structure.figures().refitted_triangles == 69_666
    assert structure.figures().rebuilt == 0
    assert taken < 1, "0.04 s on an idle processor"
    rays = rays_through(frame, 2000, SEED)
    assert structure.trace(rays).tobytes() == traversal.trace(build(frame.triangles), rays).tobytes()
