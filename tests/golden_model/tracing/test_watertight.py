"""No ray passes between triangles that share an edge or a vertex: in the golden model, and in the RTL."""

import numpy as np
import pytest

from lightloom.golden_model.contract.bitpack import equal
from lightloom.golden_model.stimuli.ray_families import points_on
from lightloom.golden_model.tracing.brute_force import trace_brute_force
from lightloom.golden_model.tracing.bvh.build import build
from lightloom.golden_model.tracing.bvh.traversal import trace
from lightloom.golden_model.tracing.ray_triangle import ray_triangle
from lightloom.golden_model.tracing.recorder import TestRecorder
from lightloom.sim.bulk import BulkUnit
from lightloom.verif.vectors import ray_vectors
from tests.golden_model import meshes

SEED = 60
SHAPES = [
    *(("sphere", level) for level in (2, 4, 6)),  # 128, 2048, 32,768 triangles
    *(("torus", size) for size in (16, 64, 256)),  # 256, 4096, 65,536
    *(("height field", size) for size in (8, 64, 256)),  # 64, 4096, 65,536
]
MESHES = pytest.mark.parametrize(
    ("shape", "size", "turned"), [(*s, turned) for s in SHAPES for turned in (False, True)]
)


class Mesh:
    """A mesh of one of the shapes, with triangles of mixed winding in random order, and the rays that must hit it.

    As it is, many coordinates are zero, equal, or dyadic; `turned`, it is also scaled, rotated and shifted.
    """

    def __init__(self, shape: str, size: int, turned: bool):
        self.shape = shape
        rng = self.rng = np.random.default_rng([SEED, size, turned])
        self.inside = np.zeros((1, 3))
        if shape == "sphere":
            corners = meshes.octasphere(size)
        elif shape == "torus":
            corners, self.inside = meshes.torus(size, max(size // 2, 8))
        else:
            corners = meshes.height_field(size, size // 2, rng)
        self.turn, self.shift = np.eye(3), np.zeros(3)
        if turned:
            scale = 10.0 ** rng.uniform(-2, 2)
            self.turn = np.linalg.qr(rng.normal(size=(3, 3)))[0] * scale
            self.shift = rng.normal(size=3) * scale * 3
        self.bvh = build(meshes.mixed_winding(self.place(corners), rng))
        # A ray at the rim of the height field could rightly miss: it has to come out below, within the square.
        inner = (np.abs(corners[:, :, [0, 2]] - 0.5) <= 0.3).all(axis=(1, 2)) | (shape != "height field")
        self.targets = ray_vectors.triangles(self.place(corners[inner]))

    def place(self, points: np.ndarray) -> np.ndarray:
        """Points (..., 3) of the plain shape to float32 points; equal points stay equal."""
        return ((points.astype(np.float64)[..., None, :] * self.turn).sum(axis=-1) + self.shift).astype(np.float32)

    def rays(self, count: int) -> tuple[np.ndarray, np.ndarray]:
        """RAY (N,) at vertices, edges and faces, and the t (N,) by which each has met the mesh unless it leaks.

        That is where it reaches the point that it is aimed at, but infinite where that point may be on a silhouette:
        there a ray that is rounded to the other side rightly goes on.
        """
        rng = self.rng
        target = points_on(self.targets, count, rng)
        if self.shape == "height field":
            origin = self.place(rng.uniform([0.2, 0.5, 0.2], [0.8, 3, 0.8], (count, 3)))
        else:
            ball = rng.normal(size=(count, 3))
            ball *= rng.uniform(0, 0.3, (count, 1)) / np.sqrt((ball**2).sum(axis=1, keepdims=True))
            origin = self.place(self.inside[rng.integers(0, len(self.inside), count)] + ball)
        length = np.exp2(rng.uniform(-2, 2, count)).astype(np.float32)
        by = np.where(self.shape == "sphere", 1 / length, np.float32(np.inf))
        if (self.turn == np.eye(3)).all() and self.shape != "torus":
            # A third of the rays run along an axis, exactly through the point: from above, or from the sphere's inside.
            along = np.flatnonzero(rng.integers(0, 3, count) == 0)
            axis = np.abs(target[along]).argmax(axis=1) if self.shape == "sphere" else np.full(len(along), 1)
            origin[along] = target[along]
            origin[along, axis] = 0 if self.shape == "sphere" else 1
            by[along] = 1 / length[along]
        return ray_vectors.rays(origin, (target - origin) * length[:, None]), by


def assert_all_hit(mesh: Mesh, count: int) -> None:
    rays, by = mesh.rays(count)
    hits = trace(mesh.bvh, rays)
    missed = np.flatnonzero(hits["primitive"] < 0)
    assert not len(missed), f"seed {SEED}: {len(missed)} of {count} rays pass through, the first is {rays[missed[0]]}"
    late = np.flatnonzero(hits["t"] > by * 1.001)
    assert not len(late), f"seed {SEED}: {len(late)} of {count} rays leak, the first is {rays[late[0]]}"


@MESHES
def test_every_ray_hits(shape: str, size: int, turned: bool) -> None:
    """216,000 rays in all."""
    assert_all_hit(Mesh(shape, size, turned), 12_000)


@pytest.mark.long
@MESHES
def test_every_one_of_millions_of_rays_hits(shape: str, size: int, turned: bool) -> None:
    """5,400,000 rays in all."""
    mesh = Mesh(shape, size, turned)
    for _ in range(3):
        assert_all_hit(mesh, 100_000)


@pytest.fixture(scope="module")
def unit() -> BulkUnit:
    return BulkUnit("ray_triangle")


@MESHES
def test_every_ray_hits_in_the_rtl(shape: str, size: int, turned: bool, unit: BulkUnit) -> None:
    """100,800 rays in all: every test that traversal makes for them goes through the Verilated unit."""
    mesh = Mesh(shape, size, turned)
    count = 5600
    rays, _ = mesh.rays(count)
    recorder = TestRecorder(1 << 24, seed=SEED)
    trace(mesh.bvh, rays, recorder=recorder)
    tests, keys = recorder.sample(), recorder.keys()
    assert len(tests) == recorder.total >= count
    results = unit.run(tests)
    wrong = np.flatnonzero(~equal(results, ray_triangle(tests)))
    assert not len(wrong), f"seed {SEED}: {len(wrong)} of {len(tests)} tests differ, the first is {tests[wrong[0]]}"
    missed = np.setdiff1d(np.arange(count), keys["ray"][results["hit"]])
    assert not len(missed), f"seed {SEED}: {len(missed)} rays pass through, the first is {rays[missed[0]]}"


def test_the_meshes_are_closed() -> None:
    """Every edge belongs to two triangles, so a miss above is not the mesh's fault."""
    for corners in (meshes.octasphere(3), meshes.torus(16, 8)[0]):
        edges = np.concatenate([corners[:, [0, 1]], corners[:, [1, 2]], corners[:, [2, 0]]]) + np.float32(0)
        swap = [tuple(map(tuple, edge)) for edge in edges]
        ordered = [tuple(sorted(edge)) for edge in swap]
        assert {ordered.count(edge) for edge in set(ordered)} == {2}


def test_the_rays_would_find_a_leak() -> None:
    """Edges that belong to neither side let hundreds of them through."""

    def without_edges(tests: np.ndarray) -> np.ndarray:
        results = ray_triangle(tests)
        results[(results["u"] == 0) | (results["v"] == 0) | (results["u"] + results["v"] >= 1)] = 0
        return results

    mesh = Mesh("sphere", 2, turned=True)
    hits = trace_brute_force(mesh.bvh.triangles, mesh.rays(2000)[0], intersect=without_edges)
    assert (hits["primitive"] < 0).sum() > 200
