"""The tree in memory: every triangle once and exactly, boxes that hold what is below them, no shape that breaks it."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lightloom.golden_model.contract.bitpack import pack, unpack
from lightloom.golden_model.contract.formats import (
    BVH_HEADER,
    BVH_MAGIC,
    LATTICE_BITS,
    NODE_BLOCK,
    NODE_KIND,
    TRIANGLE,
    TRIANGLE_BLOCK,
    TRIANGLES_KIND,
)
from lightloom.golden_model.tracing.bvh.build import build
from lightloom.golden_model.tracing.wide_bvh.collapse import NODE_COST, TRIANGLE_COST, collapse, shared_vertices
from lightloom.golden_model.tracing.wide_bvh.encode import WideBvh, build_wide, tree_triangles, widen
from lightloom.golden_model.tracing.wide_bvh.quantization import LAST, lattice_around
from lightloom.golden_model.tracing.wide_bvh.validate import node_levels, validate_tree
from lightloom.verif.vectors import ray_vectors
from tests.golden_model import meshes
from tests.golden_model.tracing_cases import random_soup

WIDTHS = (2, 4, 8)
LEAST = 2.0**-126
"""The least normal float32."""


def exact(x: float) -> Fraction:
    """A float32 coordinate as the contract reads it: subnormals are zero."""
    return Fraction(float(x)) if abs(float(x)) >= LEAST else Fraction(0)


def check(tree: WideBvh, triangles: np.ndarray, seed: object = "") -> None:
    """The triangles of the tree are those that are finite, bit for bit, and its structure is valid."""
    validate_tree(tree.blocks)
    corners = np.stack([triangles[name] for name in TRIANGLE.names or ()])
    finite = np.flatnonzero(np.isfinite(corners).all(axis=(0, 2)))
    primitive, held, _ = tree_triangles(tree)
    order = np.argsort(primitive)
    assert np.array_equal(primitive[order], finite), f"seed {seed}: every finite triangle is in one leaf"
    assert held[order].tobytes() == triangles[finite].tobytes(), f"seed {seed}: vertices keep their bits and order"


def check_by_fractions(tree: WideBvh) -> None:
    """Walks the tree block by block in exact arithmetic, with nothing of the model's but the formats."""
    header = tree.header
    unit = Fraction(2) ** int(header["lattice_exponent"])
    corner = [Fraction(float(x)) for x in header["lattice_origin"]]
    seen = []

    def walk(address: int, depth: int) -> list[tuple[Fraction, ...]]:
        """All vertices below a block."""
        seen.append(address)
        if tree.blocks[address, 0] & 15 == TRIANGLES_KIND:
            leaf = unpack(tree.blocks[address : address + 1], TRIANGLE_BLOCK)[0]
            points = leaf["vertices"].reshape(4, 3)
            used = {0, 1, 2, *(leaf["order"] if leaf["count"] == 2 else ())}
            return [tuple(exact(x) for x in points[k]) for k in used]
        assert depth < header["levels"]
        assert tree.blocks[address, 0] & 15 == NODE_KIND
        node = unpack(tree.blocks[address : address + 1], NODE_BLOCK)[0]
        assert node["count"] <= header["width"]
        assert node["base"] > address
        inside = []
        for slot in range(node["count"]):
            points = walk(int(node["base"]) + slot, depth + 1)
            inside += points
            for k, axis in enumerate("xyz"):
                step = unit * 2 ** int(node["exponent"][k])
                origin = corner[k] + unit * int(node["origin"][k])
                low = origin + step * int(node[f"lower_{axis}"][slot])
                high = origin + step * int(node[f"upper_{axis}"][slot])
                assert all(low <= point[k] <= high for point in points), (address, slot, axis)
                # No looser than rounding makes it.
                assert min(point[k] for point in points) < low + step
                assert max(point[k] for point in points) > high - step
        return inside

    walk(int(header["root"]), 0)
    assert sorted(seen) == list(range(1, len(tree.blocks)))


def wild(rng: np.random.Generator, count: int, span: int, centre: int) -> np.ndarray:
    """TRIANGLE (N,) with coordinates of all magnitudes from 2**(centre - span) to 2**(centre + span), both signs."""
    shape = (count, 3, 3)
    values = np.ldexp(rng.uniform(1, 2, shape), rng.integers(centre - span, centre + span + 1, shape))
    return ray_vectors.triangles((values * rng.choice([-1, 1, 1], shape)).astype(np.float32))


@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("count", [0, 1, 2, 3, 8, 9, 100])
def test_every_triangle_is_in_one_leaf(count: int, width: int) -> None:
    for seed in range(2):
        triangles = random_soup(np.random.default_rng([seed, count]), count)
        tree = build_wide(triangles, width=width)
        check(tree, triangles, seed)
        check_by_fractions(tree)


@pytest.mark.parametrize(
    ("span", "centre"), [(0, 0), (12, 0), (40, 0), (126, 0), (3, 120), (3, -122), (0, 127), (2, -140)]
)
def test_boxes_hold_their_triangles_at_any_scale(span: int, centre: int) -> None:
    for seed in range(4):
        triangles = wild(np.random.default_rng([seed, span, centre + 200]), 40, span, centre)
        tree = build_wide(triangles)
        check(tree, triangles, seed)
        check_by_fractions(tree)


@settings(deadline=None, max_examples=60)
@given(st.integers(0, 2**32 - 1), st.integers(-126, 127), st.integers(0, 60), st.integers(0, 40))
def test_boxes_hold_their_triangles(seed: int, centre: int, span: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    triangles = wild(rng, count, min(span, 127 - centre), centre)
    offset = np.ldexp(rng.uniform(-1, 1, 3), centre).astype(np.float32)
    for name in TRIANGLE.names or ():
        with np.errstate(over="ignore"):
            triangles[name] += offset
    check_by_fractions(build_wide(triangles, width=int(rng.integers(2, 9))))


def test_lattice_is_the_finest_that_covers_the_scene() -> None:
    rng = np.random.default_rng(1)
    for _ in range(300):
        ends = np.sort(wild(rng, 1, 126, 0)["v0"][0].repeat(2).reshape(3, 2), axis=1)
        ends[:, 1] += np.abs(wild(rng, 1, 126, 0)["v1"][0]) / 4
        lattice = lattice_around(ends[:, 0], ends[:, 1])
        extent = max(exact(high) - exact(low) for low, high in ends)
        assert extent <= LAST * Fraction(2) ** lattice.exponent
        assert lattice.exponent == -126 or extent > LAST * Fraction(2) ** (lattice.exponent - 1)
        assert -126 <= lattice.exponent <= 110


def test_lattice_coordinates_are_rounded_outwards_and_no_further() -> None:
    rng = np.random.default_rng(2)
    for centre, span in ((0, 20), (0, 120), (-120, 5), (100, 26)):
        points = wild(rng, 100, span, centre)["v0"]
        lattice = lattice_around(points.min(axis=0), points.max(axis=0))
        unit = Fraction(2) ** lattice.exponent
        for point, low, high in zip(points, lattice.floor(points), lattice.ceil(points), strict=True):
            for k in range(3):
                place = (exact(point[k]) - exact(lattice.origin[k])) / unit
                assert (low[k], high[k]) == (place.__floor__(), place.__ceil__())
        assert lattice.floor(points).min() >= 0
        assert lattice.ceil(points).max() < 1 << LATTICE_BITS


def test_a_point_that_is_just_off_the_lattice_counts_as_off() -> None:
    """The difference of these coordinates is no float64 number: only its exact error tells on which side they are."""
    tiny = np.float32(2.0**-100)
    for nudge in (tiny, -tiny):
        ends = np.array([[0, 0, 0], [1, 1, 1]], dtype=np.float32)
        ends[0, 0] = nudge
        lattice = lattice_around(ends[0], ends[1])
        place = (1 - Fraction(float(nudge))) / Fraction(2) ** lattice.exponent
        assert lattice.floor(ends)[1, 0] == place.__floor__()
        assert lattice.ceil(ends)[1, 0] == place.__ceil__()
        assert place.denominator > 2**60


# --- leaves -----------------------------------------------------------------------------------------------------------


def test_two_triangles_in_a_leaf_have_an_edge_in_common() -> None:
    corners = meshes.height_field(12, 12, np.random.default_rng(3))
    triangles = meshes.mixed_winding(corners, np.random.default_rng(4))
    tree = build_wide(triangles)
    check(tree, triangles)
    leaves = unpack(tree.blocks[tree.triangle_blocks], TRIANGLE_BLOCK)
    pairs = leaves[leaves["count"] == 2]
    assert len(pairs) > len(triangles) // 8, "quads of a height field are pairs"
    shared = [
        len({v.tobytes() for v in triangles[a].item()} & {v.tobytes() for v in triangles[b].item()})
        for a, b in pairs["primitive"]
    ]
    assert min(shared) == 2
    assert (pairs["primitive"][:, 0] < pairs["primitive"][:, 1]).all()
    single = leaves[leaves["count"] == 1]
    assert not single["vertices"][:, 9:].any()
    assert not single["primitive"][:, 1].any()
    assert not single["mask"][:, 1].any()


def test_zeros_of_different_sign_are_different_vertices() -> None:
    corners = np.array([[[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[1, 0, -0.0], [0, 0, -0.0], [0, 0, 1]]], dtype=np.float32)
    one, other = ray_vectors.triangles(corners)[:1], ray_vectors.triangles(corners)[1:]
    assert shared_vertices(one, other).tolist() == [[-1, -1, -1]]
    assert shared_vertices(one, one[:]).tolist() == [[0, 1, 2]]
    check(build_wide(np.concatenate([one, other])), np.concatenate([one, other]))


@pytest.mark.parametrize("seed", range(3))
def test_degenerate_and_coincident_triangles(seed: int) -> None:
    rng = np.random.default_rng([5, seed])
    triangles = np.repeat(random_soup(rng, 40), 3)
    names = TRIANGLE.names or ()
    for row in triangles:
        row["v0"], row["v1"], row["v2"] = (row[names[k]].copy() for k in rng.integers(0, 3, 3))
    tree = build_wide(triangles)
    check(tree, triangles, seed)
    check_by_fractions(tree)


def test_masks_go_with_their_triangles() -> None:
    rng = np.random.default_rng(6)
    triangles = meshes.mixed_winding(meshes.height_field(8, 8, rng), rng)
    masks = rng.integers(0, 256, len(triangles), dtype=np.uint8)
    primitive, _, held = tree_triangles(build_wide(triangles, masks=masks))
    assert np.array_equal(held, masks[primitive])
    assert (tree_triangles(build_wide(triangles))[2] == 0xFF).all()


def test_triangles_that_are_not_finite_are_left_out() -> None:
    rng = np.random.default_rng(7)
    triangles = random_soup(rng, 100)
    for name in TRIANGLE.names or ():
        chosen = rng.integers(0, 8, triangles[name].shape) == 0
        triangles[name][chosen] = ray_vectors.specials((int(chosen.sum()),), rng)
    tree = build_wide(triangles)
    check(tree, triangles)
    assert 0 < tree.header["triangles"] < 100
    triangles["v2"][:] = np.nan
    assert build_wide(triangles).blocks.tobytes() == build_wide(triangles[:0]).blocks.tobytes()


# --- shape ------------------------------------------------------------------------------------------------------------


def cheapest(bvh: object, areas: np.ndarray, leaf: np.ndarray, width: int) -> float:
    """The cost of the cheapest wide tree, by trying everything: the root's children, then those of each of them."""
    first, count = bvh.first, bvh.count  # type: ignore[attr-defined]
    memory: dict[tuple[int, int], float] = {}

    def forest(node: int, roots: int) -> float:
        """`node` given way to exactly `roots` descendants."""
        if roots == 1:
            return alone(node)
        if count[node]:
            return np.inf
        return min(forest(first[node], k) + forest(first[node] + 1, roots - k) for k in range(1, roots))

    def alone(node: int) -> float:
        if (node, 1) not in memory:
            kept = np.inf
            if not count[node]:
                kept = NODE_COST * areas[node] + min(forest(node, k) for k in range(2, width + 1))
            memory[node, 1] = min(kept, leaf[node] * TRIANGLE_COST * areas[node] if leaf[node] else np.inf)
        return memory[node, 1]

    return alone(0)


@pytest.mark.parametrize("width", WIDTHS)
def test_collapse_is_the_cheapest_there_is(width: int) -> None:
    rng = np.random.default_rng(8)
    triangles = ray_vectors.triangles(meshes.height_field(3, 4, rng))
    bvh = build(triangles, leaf_size=1)
    lattice = lattice_around(bvh.lower[0], bvh.upper[0])
    lower, upper = lattice.floor(bvh.lower), lattice.ceil(bvh.upper)
    x, y, z = (upper - lower + 1).T
    areas = (x * y + y * z + z * x).astype(np.float64)
    tree = collapse(bvh, lower, upper, width, 24)
    leaf = np.where(bvh.count == 1, 1, 0)
    for node in np.flatnonzero(bvh.count == 0):
        left = bvh.first[node]
        if bvh.count[left] and bvh.count[left + 1]:
            a, b = (triangles[bvh.primitive[bvh.first[left + k]]].item() for k in (0, 1))
            if len({v.tobytes() for v in a} & {v.tobytes() for v in b}) >= 2:
                leaf[node] = 2
    cost = np.where(tree.leaf, TRIANGLE_COST * (tree.slots[:, 1] - tree.slots[:, 0]), NODE_COST) * areas[tree.node]
    assert np.isclose(cost.sum(), cheapest(bvh, areas, leaf, width), rtol=1e-12)


def spiral(count: int) -> np.ndarray:
    """Sizes in powers of two make the heuristic split off one triangle after the other: a chain."""
    return ray_vectors.triangles(np.eye(3) * np.exp2(-np.arange(count)).reshape(-1, 1, 1))


@pytest.mark.parametrize(("width", "max_levels"), [(2, 8), (2, 20), (4, 4), (4, 7), (8, 3), (8, 5)])
def test_trees_that_would_be_too_deep_are_divided_evenly(width: int, max_levels: int) -> None:
    triangles = np.concatenate([spiral(64), random_soup(np.random.default_rng(9), 64)])
    free = build_wide(triangles, width=width, max_levels=255)
    assert free.header["levels"] > max_levels, "otherwise this tests nothing"
    tree = build_wide(triangles, width=width, max_levels=max_levels)
    assert tree.header["levels"] <= max_levels
    check(tree, triangles)
    check_by_fractions(tree)


def test_only_what_is_too_deep_is_divided_evenly() -> None:
    triangles = np.concatenate([spiral(100), random_soup(np.random.default_rng(10), 2000)])
    free = build_wide(triangles, max_levels=255)
    tree = build_wide(triangles, max_levels=int(free.header["levels"]) - 2)
    check(tree, triangles)
    assert tree.header["levels"] == free.header["levels"] - 2
    assert tree.sah_cost < 1.02 * free.sah_cost


def test_levels_that_cannot_be_are_refused() -> None:
    triangles = random_soup(np.random.default_rng(11), 65)
    with pytest.raises(ValueError, match="max_levels"):
        build_wide(triangles, max_levels=2)
    for width in (1, 9):
        with pytest.raises(ValueError, match="width"):
            build_wide(triangles, width=width)
    with pytest.raises(ValueError, match="masks"):
        build_wide(triangles, masks=np.zeros(64, dtype=np.uint8))


def test_flat_scenes_are_wide_too() -> None:
    """Boxes without area cost something still: nodes are filled."""
    points = np.zeros((512, 3, 3), dtype=np.float32)
    points[:, :, 0] = np.arange(512).reshape(-1, 1)
    tree = build_wide(ray_vectors.triangles(points))
    check_by_fractions(tree)
    assert tree.header["levels"] == 3


def test_coincident_triangles_fill_their_nodes() -> None:
    triangles = np.repeat(random_soup(np.random.default_rng(12), 1), 1024)
    tree = build_wide(triangles)
    check(tree, triangles)
    assert tree.header["triangle_blocks"] == 512, "they have three vertices in common"
    assert tree.header["nodes"] <= 80


def test_layout_is_depth_first() -> None:
    tree = build_wide(random_soup(np.random.default_rng(13), 1000))
    expected, stack = 2, [1]
    while stack:
        node = unpack(tree.blocks[stack.pop()][None], NODE_BLOCK)[0]
        base, count = int(node["base"]), int(node["count"])
        assert base == expected
        expected += count
        stack += [base + slot for slot in reversed(range(count)) if not node["leaf"] >> slot & 1]
    assert expected == len(tree.blocks)


def test_header() -> None:
    triangles = random_soup(np.random.default_rng(14), 500)
    tree = build_wide(triangles, width=4)
    header = tree.header
    assert header["magic"].tobytes() == b"LLBV"
    assert header["magic"] == BVH_MAGIC
    assert np.bitwise_xor.reduce(tree.blocks[0]) == 0
    assert header["blocks"] == len(tree.blocks) == 1 + header["nodes"] + header["triangle_blocks"]
    assert header["triangles"] == 500
    assert header["levels"] == len(node_levels(tree))
    assert (header["root"], header["width"]) == (1, 4)
    assert (pack(unpack(tree.blocks[:1], BVH_HEADER)) == tree.blocks[:1]).all()


def test_the_same_triangles_give_the_same_bytes() -> None:
    triangles = random_soup(np.random.default_rng(15), 3000)
    tree = build_wide(triangles)
    assert tree.blocks.tobytes() == build_wide(triangles.copy()).blocks.tobytes()
    assert tree.blocks.tobytes() == widen(build(triangles, leaf_size=1)).blocks.tobytes()


def test_expected_visits() -> None:
    """A line that meets the root's box visits the root, and each other box as often as its share of surface."""
    triangles = random_soup(np.random.default_rng(16), 9)
    visits, tests = build_wide(triangles).expected_visits
    assert 1 <= visits < 3
    assert 0 < tests < 9
    one = build_wide(triangles[:1])
    assert one.expected_visits == (1.0, 1.0)
    assert build_wide(triangles[:0]).expected_visits == (1.0, 0.0)
    assert one.sah_cost == 1 + TRIANGLE_COST


def test_bunny() -> None:
    triangles = meshes.bunny()
    tree = build_wide(triangles)
    check(tree, triangles)
    assert tree.header["levels"] <= 8
    assert tree.header["nodes"] < 9000
    visits, tests = tree.expected_visits
    assert (visits < 9.3, tests < 4.4) == (True, True), (visits, tests)
