"""Tracing through the tree in memory: against brute force in all bits, one backend against the other, broken trees."""

from collections.abc import Callable
from importlib.util import find_spec

import numpy as np
import pytest

from lightloom.golden_model.contract.bitpack import equal, pack, unpack
from lightloom.golden_model.contract.formats import (
    BVH_HEADER,
    HIT,
    NODE_BLOCK,
    RAY_QUERY,
    RAY_RESULT,
    TRACE_ERRORS,
    TRIANGLE_BLOCK,
)
from lightloom.golden_model.scene.files.load import load_scene
from lightloom.golden_model.stimuli.ray_families import RAY_FAMILIES, aimed, diffuse_rays
from lightloom.golden_model.tracing import brute_force
from lightloom.golden_model.tracing.bvh.build import Bvh, build
from lightloom.golden_model.tracing.bvh.traversal import trace
from lightloom.golden_model.tracing.wide_bvh.encode import WideBvh, build_wide, widen
from lightloom.golden_model.tracing.wide_bvh.traversal import COUNTS, queries_of, trace_tree
from lightloom.verif.vectors import ray_vectors
from tests.golden_model import meshes
from tests.golden_model.tracing.test_watertight import Mesh
from tests.golden_model.tracing_cases import FAMILIES, random_soup
from tests.needs import needs_numba

SEED = 70
NUMBA = find_spec("numba") is not None
BACKENDS = ["numpy", pytest.param("numba", marks=needs_numba)]
Oracle = Callable[..., np.ndarray]
CLOSED = [
    *(("sphere", 2, 128), ("sphere", 4, 2048), ("sphere", 6, 32_768)),
    *(("torus", 16, 256), ("torus", 64, 4096), ("torus", 256, 65_536)),
    *(("height field", 8, 64), ("height field", 64, 4096), ("height field", 256, 65_536)),
]
"""Shapes of `Mesh`, their sizes, and how many triangles that makes."""


@pytest.fixture(scope="module")
def room() -> np.ndarray:
    """TRIANGLE (32,): the Cornell box."""
    return load_scene("cornell-box").triangles


@pytest.fixture(scope="module")
def bunny() -> Bvh:
    """The binary tree of the bunny that wide ones are made of."""
    return build(meshes.bunny(), leaf_size=1)


def all_families(triangles: np.ndarray, count: int, seed: int) -> np.ndarray:
    """RAY (4 * count,): each family in turn."""
    return np.concatenate([family(triangles, count, seed) for family in RAY_FAMILIES.values()])


def mixed_queries(rays: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """RAY_QUERY (N,): closest and any hit, culled or not, with all or one of the mask's bits set or none."""
    any_hit, cull = rng.integers(0, 2, (2, len(rays))).astype(bool)
    return queries_of(rays, any_hit, cull, rng.choice([0xFF, 0xFF, 1, 2, 0x80, 0], len(rays)))


def is_invalid(rays: np.ndarray) -> np.ndarray:
    """(N,) bool: direction, origin or range keep the ray from hitting anything."""
    longest = np.abs(rays["direction"]).max(axis=1)
    finite = np.isfinite(rays["origin"]).all(axis=1) & np.isfinite(rays["direction"]).all(axis=1)
    nan = np.isnan(rays["t_min"]) | np.isnan(rays["t_max"])
    return ~(finite & (longest >= 2.0**-126) & (longest <= 2.0**126)) | nan


def expected_of(
    triangles: np.ndarray, queries: np.ndarray, masks: np.ndarray | None, oracle: Oracle = brute_force.trace_brute_force
) -> np.ndarray:
    """The RAY_RESULT (N,) of RAY_QUERY (N,) by brute force."""
    hits = oracle(triangles, queries, cull=queries["cull"], masks=masks, mask=queries["mask"])
    out = np.zeros(len(queries), dtype=RAY_RESULT)
    for name in HIT.names or ():
        out[name] = np.where(queries["any_hit"], 0, hits[name])
    out["primitive"] = np.where(queries["any_hit"] & (hits["primitive"] >= 0), 0, hits["primitive"])
    out["invalid"] = is_invalid(queries)
    return out


def assert_same(got: np.ndarray, expected: np.ndarray, queries: np.ndarray, origin: str) -> None:
    """Equal in all bits; otherwise fails with the first rays that differ. `origin` says how to make them again."""
    wrong = np.flatnonzero(~equal(got, expected))
    shown = [f"ray {k}: {queries[k]}: got {got[k]}, expected {expected[k]}" for k in wrong[:3]]
    assert not len(wrong), "\n".join([f"{origin}: {len(wrong)} of {len(got)} results differ", *shown])


def traced(tree: WideBvh, queries: np.ndarray, origin: str, stack: int = 24) -> tuple[np.ndarray, np.ndarray]:
    """Results and counts by NumPy, and where numba is installed the same by it, in all bits."""
    results, counts = trace_tree(tree.blocks, queries, stack=stack, backend="numpy")
    if NUMBA:
        compiled, compiled_counts = trace_tree(tree.blocks, queries, stack=stack, backend="numba")
        assert_same(compiled, results, queries, f"{origin}, numba")
        assert_same(compiled_counts, counts, queries, f"{origin}, counts of numba")
    return results, counts


# --- against brute force ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("family", FAMILIES)
def test_equals_brute_force(family: str) -> None:
    """With room on the stack and with the least there may be."""
    hit = total = 0
    for seed, width in enumerate((8, 4, 2)):
        rng = np.random.default_rng([SEED, seed])
        triangles, rays = FAMILIES[family](rng)
        queries = mixed_queries(rays, rng)
        masks = rng.choice(np.array([0xFF, 1, 2, 3], dtype=np.uint8), len(triangles))
        expected = expected_of(triangles, queries, masks)
        tree = build_wide(triangles, width=width, masks=masks)
        for stack in (24, int(tree.header["levels"])):
            origin = f"{family}, seed {[SEED, seed]}, width {width}, stack {stack}"
            assert_same(traced(tree, queries, origin, stack)[0], expected, queries, origin)
        hit, total = hit + (expected["primitive"] >= 0).sum(), total + len(rays)
    assert 0.05 < hit / total < 0.95, "the family tests too little"


@needs_numba
@pytest.mark.long
@pytest.mark.parametrize("family", FAMILIES)
def test_equals_brute_force_many_times(family: str) -> None:
    from lightloom.golden_model.tracing.brute_force_numba import trace_brute_force

    for seed in range(3, 200):
        rng = np.random.default_rng([SEED, seed])
        triangles, rays = FAMILIES[family](rng)
        queries = mixed_queries(rays, rng)
        masks = rng.choice(np.array([0xFF, 1, 2, 3], dtype=np.uint8), len(triangles))
        tree = build_wide(triangles, width=int(rng.choice([2, 3, 4, 8])), masks=masks)
        stack = int(tree.header["levels"]) + int(rng.integers(0, 6))
        expected = expected_of(triangles, queries, masks, trace_brute_force)
        results, _ = trace_tree(tree.blocks, queries, stack=stack)
        assert_same(results, expected, queries, f"{family}, seed {[SEED, seed]}")


@pytest.mark.parametrize("width", [4, 8])
def test_equals_brute_force_in_a_room(room: np.ndarray, width: int) -> None:
    rng = np.random.default_rng(SEED)
    queries = mixed_queries(all_families(room, 1500, SEED), rng)
    masks = rng.choice(np.array([0xFF, 1, 2, 3], dtype=np.uint8), len(room))
    tree = build_wide(room, width=width, masks=masks)
    results, counts = traced(tree, queries, f"seed {SEED}")
    assert_same(results, expected_of(room, queries, masks), queries, f"seed {SEED}")
    assert not counts["revisits"].any()


def check_at_size(bvh: Bvh, count: int, seed: int) -> None:
    """Closest and any hit of 4 * count rays, half of them culled, against one brute force; both widths."""
    from lightloom.golden_model.tracing.brute_force_numba import trace_brute_force

    rays = all_families(bvh.triangles, count, seed)
    queries = queries_of(rays, cull=np.arange(len(rays)) % 2 == 1)
    closest = expected_of(bvh.triangles, queries, None, trace_brute_force)
    shadow = closest.copy()
    shadow[["primitive", "t", "u", "v", "front"]] = 0
    shadow["primitive"] = np.where(closest["primitive"] >= 0, 0, -1)
    for width in (4, 8):
        tree = widen(bvh, width=width)
        for any_hit, expected in ((False, closest), (True, shadow)):
            queries["any_hit"] = any_hit
            for stack in (24, int(tree.header["levels"])):
                results, counts = trace_tree(tree.blocks, queries, stack=stack)
                assert_same(results, expected, queries, f"seed {seed}, width {width}, stack {stack}")
                shown = ", ".join(f"{counts[name].mean():.2f} {name}" for name in counts.dtype.names or ())
                print(f"width {width}, stack {stack}, any hit {any_hit}: {len(rays)} rays: {shown}")


@needs_numba
def test_equals_brute_force_on_the_bunny(bunny: Bvh) -> None:
    check_at_size(bunny, 50, SEED)


@needs_numba
@pytest.mark.long
@pytest.mark.parametrize(("scene", "count"), [("room", 50_000), ("bunny", 5_200), ("dragon", 150)])
def test_equals_brute_force_at_size(room: np.ndarray, scene: str, count: int) -> None:
    """200,000 rays of the Cornell box, 20,800 of the bunny, 600 of the dragon."""
    triangles = room if scene == "room" else getattr(meshes, scene)()
    check_at_size(build(triangles, leaf_size=1), count, SEED + 1)


# --- against the binary tree --------------------------------------------------------------------------------------


@needs_numba
@pytest.mark.parametrize("width", [4, 8])
def test_equals_the_binary_tree_on_the_bunny(bunny: Bvh, width: int) -> None:
    rays = all_families(bunny.triangles, 2000, SEED)
    tree = widen(bunny, width=width)
    for any_hit in (False, True):
        results, _ = trace_tree(tree.blocks, queries_of(rays, any_hit))
        hits = np.zeros(len(rays), dtype=HIT)
        for name in HIT.names or ():
            hits[name] = results[name]
        assert_same(hits, trace(bunny, rays, any_hit=any_hit), rays, f"seed {SEED}, any hit {any_hit}")


@pytest.mark.parametrize(
    ("shape", "size", "turned"),
    [
        pytest.param(shape, size, turned, marks=pytest.mark.long if triangles > 5000 else ())
        for shape, size, triangles in CLOSED
        for turned in (False, True)
    ],
)
def test_no_ray_passes_a_watertight_mesh(shape: str, size: int, turned: bool) -> None:
    mesh = Mesh(shape, size, turned)
    rays, by = mesh.rays(100_000 if size > 64 else 3000)
    tree = build_wide(mesh.bvh.triangles, width=4 if turned else 8)
    results, _ = trace_tree(tree.blocks, queries_of(rays))
    assert (results["primitive"] >= 0).all()
    assert (results["t"] <= by * 1.001).all()
    hits = trace(mesh.bvh, rays)
    for name in HIT.names or ():
        assert np.array_equal(results[name], hits[name]), name


# --- counts -------------------------------------------------------------------------------------------------------


def row_of_squares(count: int) -> np.ndarray:
    """Triangles in the planes z = 1, 2, ..., around the z axis; two of them share no edge."""
    corners = [[[-1, -1, z], [3, -1, z], [-1, 3, z]] for z in range(1, count + 1)]
    return ray_vectors.triangles(np.array(corners, dtype=float).reshape(-1, 3, 3))


@pytest.mark.parametrize("backend", BACKENDS)
def test_counts_of_rays_through_a_row(backend: str) -> None:
    """Eight leaves below the root, far apart: a ray that comes to a hit leaves the rest."""
    rays = ray_vectors.rays(np.zeros((4, 3)), np.tile([0, 0, 1], (4, 1)))
    rays["t_min"] = [0, 4.5, 0, 8.5]
    rays["t_max"][2] = 0.5
    tree = build_wide(row_of_squares(8))
    assert tree.header["levels"] == 1
    results, counts = trace_tree(tree.blocks, queries_of(rays), backend=backend)
    assert results["primitive"].tolist() == [0, 4, -1, -1]
    assert results["t"].tolist() == [1, 5, 0, 0]
    assert counts.tolist() == [(1, 0, 1, 1), (1, 0, 1, 1), (1, 0, 0, 0), (1, 0, 0, 0)]


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_stack_without_room_visits_again(backend: str) -> None:
    """The ray does not see the first five triangles. Each time that the list does not fit, one entry leads back."""
    masks = np.array([1] * 5 + [3] * 3, dtype=np.uint8)
    tree = build_wide(row_of_squares(8), masks=masks)
    queries = queries_of(ray_vectors.rays(np.zeros((1, 3)), np.array([[0, 0, 1]])), mask=2)
    for stack, expected in (
        (24, (1, 0, 1, 6)),
        (8, (1, 0, 1, 6)),
        (7, (2, 1, 1, 6)),
        (6, (3, 2, 1, 6)),
        (1, (6, 5, 1, 6)),
    ):
        results, counts = trace_tree(tree.blocks, queries, stack=stack, backend=backend)
        assert (results["primitive"][0], results["t"][0]) == (5, 6)
        assert counts.tolist() == [expected], f"stack {stack}"


@needs_numba
def test_the_least_stack_is_enough_and_costs_only_tests() -> None:
    triangles = random_soup(np.random.default_rng(SEED), 3000)
    tree = build_wide(triangles)
    levels = int(tree.header["levels"])
    queries = queries_of(all_families(triangles, 500, SEED))
    results, counts = trace_tree(tree.blocks, queries, stack=100)
    assert not counts["revisits"].any()
    before = 0
    for stack in (levels + 8, levels + 2, levels):
        again, more = trace_tree(tree.blocks, queries, stack=stack)
        assert_same(again, results, queries, f"seed {SEED}, stack {stack}")
        for name in ("triangle_tests", "leaf_visits"):
            assert np.array_equal(more[name], counts[name])
        assert np.array_equal(more["node_tests"] - more["revisits"], counts["node_tests"])
        assert more["revisits"].sum() > before
        before = int(more["revisits"].sum())


@needs_numba
@pytest.mark.parametrize(("width", "nodes", "tests"), [(8, 9.5, 4.0), (4, 14.0, 4.0)])
def test_what_diffuse_rays_on_the_bunny_cost(bunny: Bvh, width: int, nodes: float, tests: float) -> None:
    tree = widen(bunny, width=width)
    _, counts = trace_tree(tree.blocks, queries_of(diffuse_rays(bunny.triangles, 30_000, SEED)))
    print({name: float(counts[name].mean()) for name in counts.dtype.names or ()})
    assert counts["node_tests"].mean() <= nodes
    assert counts["triangle_tests"].mean() <= tests
    assert not counts["revisits"].any()


# --- what a result says -------------------------------------------------------------------------------------------


def test_queries_of_rays() -> None:
    rays = ray_vectors.rays(np.ones((2, 3)), np.ones((2, 3)))
    assert queries_of(rays).dtype == RAY_QUERY
    assert queries_of(rays)[["any_hit", "cull", "mask"]].tolist() == [(False, False, 0xFF)] * 2
    mixed = queries_of(rays, np.array([True, False]), True, 7)
    assert mixed[["any_hit", "cull", "mask"]].tolist() == [(True, True, 7), (False, True, 7)]
    for name in rays.dtype.names or ():
        assert np.array_equal(mixed[name], rays[name])


@pytest.mark.parametrize("backend", BACKENDS)
def test_masks_and_cull_choose_what_is_seen(backend: str) -> None:
    tree = build_wide(row_of_squares(3), masks=np.array([1, 2, 6], dtype=np.uint8))
    rays = ray_vectors.rays(np.tile([0, 0, 5], (4, 1)), np.tile([0, 0, -1], (4, 1)))
    queries = queries_of(rays, mask=np.array([1, 2, 4, 8]))
    results, counts = trace_tree(tree.blocks, queries, backend=backend)
    assert results["primitive"].tolist() == [0, 2, 2, -1]
    assert len(set(results["front"][:3])) == 1
    assert counts["triangle_tests"].tolist() == [1, 1, 1, 0]
    # The other side is culled, and it alone.
    queries["origin"][:2, 2], queries["direction"][:2, 2] = 0, 1
    fronts = trace_tree(tree.blocks, queries, backend=backend)[0]["front"]
    assert fronts[0] != fronts[2]
    queries["cull"] = True
    culled = trace_tree(tree.blocks, queries, backend=backend)[0]
    assert np.array_equal(culled["primitive"][:3] >= 0, fronts[:3])
    queries["any_hit"] = True
    any_hit = trace_tree(tree.blocks, queries, backend=backend)[0]
    assert any_hit["primitive"].tolist() == [0 if front else -1 for front in fronts[:3]] + [-1]
    assert not any_hit["t"].any()
    assert not any_hit["front"].any()


@pytest.mark.parametrize("backend", BACKENDS)
def test_rays_that_cannot_hit(backend: str) -> None:
    rays = np.tile(ray_vectors.rays(np.zeros((1, 3)), np.array([[0.0, 0, 1]])), 9)
    rays["direction"][0] = 0
    rays["direction"][1, 0] = np.nan
    rays["direction"][2, 1] = np.inf
    rays["direction"][3] = (0, 0, 2.0**127)
    rays["origin"][4, 1] = np.inf
    rays["t_max"][5] = np.nan
    rays["t_min"][6] = np.nan
    rays["t_min"][7], rays["t_max"][7] = 1, 1
    results, counts = trace_tree(build_wide(row_of_squares(3)).blocks, queries_of(rays), backend=backend)
    assert results["invalid"].tolist() == [True] * 7 + [False] * 2
    assert results["primitive"].tolist() == [-1] * 8 + [0]
    assert not results["error"].any()
    assert counts["node_tests"].tolist() == [0] * 8 + [1]


@pytest.mark.parametrize("backend", BACKENDS)
def test_small_scenes(backend: str) -> None:
    ray = queries_of(ray_vectors.rays(np.zeros((1, 3)), np.array([[0, 0, 1]])))
    empty = build_wide(row_of_squares(0))
    results, counts = trace_tree(empty.blocks, ray, backend=backend)
    assert results.tolist() == [(-1, 0, 0, 0, False, False, 0, 0)]
    assert counts.tolist() == [(1, 0, 0, 0)]
    one = build_wide(row_of_squares(1))
    results, counts = trace_tree(one.blocks, ray, backend=backend)
    assert (results["primitive"][0], results["t"][0]) == (0, 1)
    assert counts.tolist() == [(1, 0, 1, 1)]
    assert all(len(part) == 0 for part in trace_tree(one.blocks, ray[:0], backend=backend))


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_leaf_of_one_triangle_has_no_second(backend: str) -> None:
    """Whatever stands in its place."""
    tree = build_wide(row_of_squares(1))
    blocks = edited(tree, 2, TRIANGLE_BLOCK, mask=(0xFF, 0xFF), primitive=(5, 1), order=(0, 1, 2))
    queries = queries_of(ray_vectors.rays(np.zeros((1, 3)), np.array([[0, 0, 1]])))
    results, counts = trace_tree(blocks, queries, backend=backend)
    assert results["primitive"].tolist() == [5]
    assert counts.tolist() == [(1, 0, 1, 1)]
    two = edited(tree, 2, TRIANGLE_BLOCK, count=2, mask=(0xFF, 0xFF), primitive=(5, 1), order=(0, 1, 2))
    results, counts = trace_tree(two, queries, backend=backend)
    assert results["primitive"].tolist() == [1]
    assert counts.tolist() == [(1, 0, 2, 1)]


@pytest.mark.parametrize("swap", [False, True])
def test_a_degenerate_triangle_takes_no_vertex_from_another(swap: bool) -> None:
    """Both its equal vertices are the other's, but only one of the other's is its."""
    corners = np.array([[[0, 0, 1], [9, 9, 1], [0, 0, 1]], [[0, 0, 1], [3, 0, 1], [0, 3, 1]]], dtype=float)
    triangles = ray_vectors.triangles(corners[::-1] if swap else corners)
    for offset in (-10, 10):
        # Either of them may lie left in the binary tree.
        moved = triangles.copy()
        for name in ("v0", "v1", "v2"):
            moved[name][int(swap)] += np.array([offset, 0, 0]) * (triangles[name][int(swap)] == 9)
        tree = build_wide(moved)
        queries = queries_of(ray_vectors.rays(np.array([[1, 1, 0]]), np.array([[0, 0, 1]])))
        results, _ = trace_tree(tree.blocks, queries)
        assert (results["primitive"][0], results["t"][0]) == (int(not swap), 1)


# --- broken trees -------------------------------------------------------------------------------------------------


def edited(tree: WideBvh, address: int, dtype: np.dtype, **fields: object) -> np.ndarray:
    """The tree's blocks with other values in some fields of one of them; a header with the check word that fits."""
    blocks = tree.blocks.copy()
    block = unpack(blocks[address : address + 1], dtype)
    for name, value in fields.items():
        block[name] = value
    blocks[address] = pack(block)
    if dtype is BVH_HEADER and "check" not in fields:
        blocks[0, 15] ^= np.bitwise_xor.reduce(blocks[0])
    return blocks


@pytest.fixture(scope="module")
def deep() -> tuple[WideBvh, np.ndarray]:
    """A tree of several levels, and rays that mostly hit."""
    rng = np.random.default_rng(SEED)
    triangles = random_soup(rng, 300)
    return build_wide(triangles, width=4), queries_of(aimed(triangles, rng.normal(size=(400, 3)) * 2, rng))


def first_inner(tree: WideBvh) -> tuple[int, np.void]:
    """The address of the first child of the root that is a node, and it."""
    root = unpack(tree.blocks[1:2], NODE_BLOCK)[0]
    slot = next(k for k in range(int(root["count"])) if not root["leaf"] >> k & 1)
    address = int(root["base"]) + slot
    return address, unpack(tree.blocks[address : address + 1], NODE_BLOCK)[0]


def check_failures(
    tree: WideBvh, queries: np.ndarray, blocks: np.ndarray, address: int, error: str, **options: object
) -> np.ndarray:
    """Rays that visit the broken block fail and say so, the others are as they were. Returns which failed."""
    sound, _ = trace_tree(tree.blocks, queries, backend="numpy")
    results, counts = trace_tree(blocks, queries, backend="numpy", **options)  # type: ignore[arg-type]
    if NUMBA:
        compiled, compiled_counts = trace_tree(blocks, queries, backend="numba", **options)  # type: ignore[arg-type]
        assert_same(compiled, results, queries, error)
        assert_same(compiled_counts, counts, queries, error)
    failed = results["error"] != 0
    assert 0.05 < failed.mean() < 1
    assert (results["error"][failed] == TRACE_ERRORS[error]).all()
    assert (results["block"][failed] == address).all()
    assert (results["primitive"][failed] == -1).all()
    for name in ("t", "u", "v", "front"):
        assert not results[name][failed].any()
    assert_same(results[~failed], sound[~failed], queries[~failed], error)
    return failed


def test_a_node_that_is_none(deep: tuple[WideBvh, np.ndarray]) -> None:
    tree, queries = deep
    address, _ = first_inner(tree)
    for kind in (0, 2, 3, 15):
        check_failures(tree, queries, edited(tree, address, NODE_BLOCK, kind=kind), address, "kind")
    # Of more children than a unit has box testers.
    count = edited(tree, address, NODE_BLOCK, count=9)
    check_failures(tree, queries, count, address, "kind")
    check_failures(tree, queries, edited(tree, address, NODE_BLOCK, count=5), address, "kind", width=4)


def test_a_leaf_that_is_none(deep: tuple[WideBvh, np.ndarray]) -> None:
    tree, queries = deep
    results, _ = trace_tree(tree.blocks, queries)
    leaves = np.flatnonzero(tree.triangle_blocks)
    primitives = unpack(tree.blocks[leaves], TRIANGLE_BLOCK)["primitive"]
    # The leaf of the triangle that is hit most.
    most = np.bincount(results["primitive"][results["primitive"] >= 0]).argmax()
    address = int(leaves[(primitives == most).any(axis=1)][0])
    for fields in ({"kind": 1}, {"kind": 0}, {"count": 0}, {"count": 3}):
        check_failures(tree, queries, edited(tree, address, TRIANGLE_BLOCK, **fields), address, "kind")


def test_a_cycle(deep: tuple[WideBvh, np.ndarray]) -> None:
    tree, queries = deep
    address, _ = first_inner(tree)
    for base in (0, 1, address - 1, address):
        check_failures(tree, queries, edited(tree, address, NODE_BLOCK, base=base), address, "order")
    root = edited(tree, 1, NODE_BLOCK, base=1)
    results, counts = trace_tree(root, queries)
    assert (results["error"] == TRACE_ERRORS["order"]).all()
    assert (results["block"] == 1).all()
    assert not counts["node_tests"].any()


def test_children_outside_the_image(deep: tuple[WideBvh, np.ndarray]) -> None:
    tree, queries = deep
    address, node = first_inner(tree)
    blocks, count = len(tree.blocks), int(node["count"])
    for base in (blocks - count + 1, blocks, 2**32 - count, 2**32 - 1):
        check_failures(tree, queries, edited(tree, address, NODE_BLOCK, base=base), address, "outside")


def test_the_memory_fails(deep: tuple[WideBvh, np.ndarray]) -> None:
    tree, queries = deep
    address, _ = first_inner(tree)
    check_failures(tree, queries, tree.blocks, address, "memory", bad_blocks=[address, 10**9])
    # What is beyond the array cannot be read; the header says that it is there.
    half = len(tree.blocks) // 2
    results, _ = trace_tree(tree.blocks[:half], queries)
    assert set(results["error"]) == {TRACE_ERRORS["none"], TRACE_ERRORS["memory"]}
    assert (results["block"][results["error"] != 0] >= half).all()


def test_no_tree_is_loaded(deep: tuple[WideBvh, np.ndarray]) -> None:
    tree, queries = deep
    queries = queries.copy()
    queries["direction"][0] = 0
    queries["t_max"][1] = -1
    levels, blocks = int(tree.header["levels"]), int(tree.header["blocks"])
    broken = {
        "magic": edited(tree, 0, BVH_HEADER, magic=0x12345678),
        "version": edited(tree, 0, BVH_HEADER, version=2),
        "check": edited(tree, 0, BVH_HEADER, check=0),
        "too wide": edited(tree, 0, BVH_HEADER, width=9),
        "no levels": edited(tree, 0, BVH_HEADER, levels=0),
        "root is the header": edited(tree, 0, BVH_HEADER, root=0),
        "root outside": edited(tree, 0, BVH_HEADER, root=blocks),
        "one block": edited(tree, 0, BVH_HEADER, blocks=1),
        "nothing": tree.blocks[:0],
        "zeros": np.zeros_like(tree.blocks),
    }
    for name, image in broken.items():
        results, counts = trace_tree(image, queries)
        assert (results["error"] == TRACE_ERRORS["header"]).all(), name
        assert (results["primitive"] == -1).all()
        assert not results["block"].any()
        assert results["invalid"].tolist() == [True] + [False] * (len(queries) - 1)
        assert not counts.view(np.uint32).any()
    for options in ({"stack": levels - 1}, {"width": 3}, {"bad_blocks": [0]}):
        results, _ = trace_tree(tree.blocks, queries, **options)
        assert (results["error"] == TRACE_ERRORS["header"]).all(), options
    results, _ = trace_tree(tree.blocks, queries, stack=levels, width=4)
    assert not results["error"].any()


def test_a_tree_deeper_than_its_header_says(deep: tuple[WideBvh, np.ndarray]) -> None:
    tree, queries = deep
    blocks = edited(tree, 0, BVH_HEADER, levels=1)
    results, counts = trace_tree(blocks, queries, stack=2, backend="numpy")
    assert set(results["error"]) == {TRACE_ERRORS["none"], TRACE_ERRORS["header"]}
    failed = results["error"] != 0
    assert (results["primitive"][failed] == -1).all()
    assert tree.node_blocks[results["block"][failed]].all()
    sound, _ = trace_tree(tree.blocks, queries)
    assert_same(results[~failed], sound[~failed], queries[~failed], f"seed {SEED}")
    if NUMBA:
        compiled, compiled_counts = trace_tree(blocks, queries, stack=2, backend="numba")
        assert_same(compiled, results, queries, f"seed {SEED}")
        assert_same(compiled_counts, counts, queries, f"seed {SEED}")


@needs_numba
def test_any_damage_is_survived_alike(deep: tuple[WideBvh, np.ndarray]) -> None:
    """Random words in random blocks: every ray comes back, and both backends say the same of it."""
    tree, queries = deep
    queries, errors = queries[:100], set()
    for seed in range(20):
        rng = np.random.default_rng([SEED, seed])
        blocks = tree.blocks.copy()
        count = int(rng.integers(1, 20))
        where = rng.integers(1, len(blocks), count), rng.integers(0, 16, count)
        near = rng.integers(0, 2, count).astype(bool)
        blocks[where] = np.where(near, rng.integers(0, len(blocks), count), rng.integers(0, 2**32, count))
        one, two = (trace_tree(blocks, queries, backend=name, stack=12) for name in ("numpy", "numba"))
        assert_same(one[0], two[0], queries, f"seed {[SEED, seed]}")
        assert one[1].dtype == COUNTS
        assert_same(one[1], two[1], queries, f"seed {[SEED, seed]}, counts")
        errors |= set(one[0]["error"])
    assert {TRACE_ERRORS[name] for name in ("none", "kind", "order", "outside")} <= errors
