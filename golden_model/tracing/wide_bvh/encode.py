"""The tree in memory: blocks of 64 bytes that hold wide nodes with 8-bit boxes, and triangles (docs/memory_image.md).

A binary tree by the surface area heuristic is made wide (`golden_model.tracing.wide_bvh.collapse`), its boxes are
rounded outwards onto the scene's lattice and then to 8 bits against their node's corner. Nodes and leaves lie depth
first, the children of a node together. The same triangles give the same bytes everywhere.
"""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from lightloom.golden_model.contract.bitpack import pack, unpack
from lightloom.golden_model.contract.formats import (
    BLOCK_BYTES,
    BVH_HEADER,
    BVH_MAGIC,
    BVH_VERSION,
    NODE_BLOCK,
    NODE_EXPONENT_MAX,
    NODE_KIND,
    TRIANGLE,
    TRIANGLE_BLOCK,
    TRIANGLES_KIND,
    WIDTH,
)
from lightloom.golden_model.tracing.bvh.build import Bvh, build
from lightloom.golden_model.tracing.wide_bvh.collapse import TRIANGLE_COST, WideTree, collapse, shared_vertices
from lightloom.golden_model.tracing.wide_bvh.decode import leaf_triangles
from lightloom.golden_model.tracing.wide_bvh.quantization import LEAST_EXPONENT, Lattice, half_areas, lattice_around

MAX_LEVELS = 24
"""Nodes on the longest path of a tree, unless asked for otherwise: what the traversal unit's stacks have room for."""
ROOT = 1
"""The block of the root."""
WORDS = BLOCK_BYTES // 4


@dataclass(frozen=True, eq=False)
class WideBvh:
    """A tree in memory."""

    blocks: np.ndarray
    """(B, 16) uint32, the words of the blocks, the header first."""

    @cached_property
    def header(self) -> np.void:
        """The BVH_HEADER record: width, levels, lattice, and how many blocks, nodes and triangles there are."""
        return unpack(self.blocks[:1], BVH_HEADER)[0]

    @cached_property
    def node_blocks(self) -> np.ndarray:
        """(B,) bool: the block is a node."""
        return self._kinds == NODE_KIND

    @cached_property
    def triangle_blocks(self) -> np.ndarray:
        """(B,) bool: the block holds triangles."""
        return self._kinds == TRIANGLES_KIND

    @cached_property
    def _kinds(self) -> np.ndarray:
        kinds = self.blocks[:, 0] & 15
        kinds[:ROOT] = 0
        return kinds

    @cached_property
    def expected_visits(self) -> tuple[float, float]:
        """Node visits and triangle tests of a random line that meets the root's box (surface area heuristic).

        Of the boxes as they are in memory.
        """
        nodes = unpack(self.blocks[self.node_blocks], NODE_BLOCK)
        used = np.arange(WIDTH) < nodes["count"][:, None]
        if not used[0].any():
            return 1.0, 0.0
        leaf = used & ((nodes["leaf"][:, None] >> np.arange(WIDTH)) & 1 != 0)
        lower, upper = slot_boxes(nodes)
        area = half_areas(lower, upper)
        whole = half_areas(lower[0, used[0]].min(axis=0), upper[0, used[0]].max(axis=0))
        address = nodes["base"][:, None].astype(np.int64) + np.arange(WIDTH)
        tests = area[leaf] * unpack(self.blocks[address[leaf]], TRIANGLE_BLOCK)["count"]
        return 1.0 + math.fsum(area[used & ~leaf]) / float(whole), math.fsum(tests) / float(whole)

    @cached_property
    def sah_cost(self) -> float:
        """Expected cost of a random line that meets the root's box, in node visits."""
        visits, tests = self.expected_visits
        return visits + TRIANGLE_COST * tests


def build_wide(
    triangles: np.ndarray, *, width: int = WIDTH, masks: np.ndarray | None = None, max_levels: int = MAX_LEVELS
) -> WideBvh:
    """TRIANGLE (T,), T < 2**31, to the tree in memory; `width` 2 to 8.

    `masks`: (T,) uint8, a ray sees a triangle where this and the ray's mask have a common bit; without, all bits are
    set. No leaf lies below more than `max_levels` nodes. A triangle with a vertex that is not finite is not in the
    tree.
    """
    return widen(build(triangles, leaf_size=1), width=width, masks=masks, max_levels=max_levels)


def widen(bvh: Bvh, *, width: int = WIDTH, masks: np.ndarray | None = None, max_levels: int = MAX_LEVELS) -> WideBvh:
    """`build_wide` of the triangles of a tree that `build.build` made, with one triangle a leaf."""
    if not 2 <= width <= WIDTH:
        raise ValueError(f"width {width}: must be 2 to {WIDTH}")
    if not 1 <= max_levels <= 255 or width**max_levels < len(bvh.primitive):
        raise ValueError(f"max_levels {max_levels}: must be 1 to 255 and leave room for {len(bvh.primitive)} triangles")
    if masks is None:
        masks = np.full(len(bvh.triangles), 0xFF, dtype=np.uint8)
    if masks.shape != bvh.triangles.shape or masks.dtype != np.uint8:
        raise ValueError(f"masks {masks.dtype} {masks.shape}: must be uint8 {bvh.triangles.shape}")
    if not len(bvh.primitive):
        return _empty(width)

    lattice = lattice_around(bvh.lower[0], bvh.upper[0])
    tree = collapse(bvh, lattice.floor(bvh.lower), lattice.ceil(bvh.upper), width, max_levels)
    address, base = _layout(tree)
    blocks = np.zeros((ROOT + len(tree.leaf), WORDS), dtype=np.uint32)
    blocks[address[~tree.leaf]] = pack(_nodes(tree, base))
    blocks[address[tree.leaf]] = pack(_leaves(tree, bvh.triangles, masks))
    # The items of the last level are all leaves.
    blocks[0] = _header(lattice, width=width, levels=len(tree.levels) - 1, leaf=tree.leaf, triangles=len(bvh.primitive))
    return WideBvh(blocks)


def slot_boxes(nodes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """NODE_BLOCK (N,) to the least and greatest lattice coordinates of the slots' boxes, (N, 8, 3) int64 each."""
    exponent = np.minimum(nodes["exponent"], NODE_EXPONENT_MAX).astype(np.int64)[:, None]
    origin = nodes["origin"].astype(np.int64)[:, None]
    lower, upper = (
        origin + (np.stack([nodes[f"{side}_{axis}"] for axis in "xyz"], axis=2).astype(np.int64) << exponent)
        for side in ("lower", "upper")
    )
    return lower, upper


def tree_triangles(tree: WideBvh) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """What is in the leaves, in the order of the blocks: indices (S,) int32, TRIANGLE (S,), masks (S,) uint8."""
    leaves = unpack(tree.blocks[tree.triangle_blocks], TRIANGLE_BLOCK)
    used = np.arange(2) < leaves["count"][:, None]
    return leaves["primitive"][used], leaf_triangles(leaves)[used], leaves["mask"][used]


def _layout(tree: WideTree) -> tuple[np.ndarray, np.ndarray]:
    """Addresses of all items, and of the first child of each, (I,) int64: depth first, a node's children together."""
    parents = [np.repeat(np.arange(begin, end), tree.count[begin:end]) for begin, end in tree.levels]
    below = tree.count.copy()  # blocks below an item
    for parent, (begin, end) in reversed(list(zip(parents, tree.levels[1:], strict=False))):
        np.add.at(below, parent, below[begin:end])
    address, base = np.full(len(below), ROOT), np.full(len(below), ROOT + 1)
    for parent, (begin, end) in zip(parents, tree.levels[1:], strict=False):
        number = np.arange(begin, end) - tree.first[parent]
        address[begin:end] = base[parent] + number
        before = np.cumsum(below[begin:end]) - below[begin:end]  # below the siblings to the left, and all before them
        base[begin:end] = base[parent] + tree.count[parent] + before - before[tree.first[parent] - begin]
    return address, base


def _nodes(tree: WideTree, base: np.ndarray) -> np.ndarray:
    """The NODE_BLOCK of each item that is a node."""
    items = np.flatnonzero(~tree.leaf)
    out = np.zeros(len(items), dtype=NODE_BLOCK)
    out["kind"], out["count"], out["base"] = NODE_KIND, tree.count[items], base[items]
    origin = tree.lower[items]
    exponent = _exponents(tree.upper[items] - origin)
    out["origin"], out["exponent"] = origin, exponent

    row = np.repeat(np.arange(len(items)), tree.count[items])
    child = np.arange(1, len(tree.leaf))
    slot = child - tree.first[items[row]]
    np.bitwise_or.at(out["leaf"], row, (tree.leaf[child] << slot).astype(np.uint8))
    lower = (tree.lower[child] - origin[row]) >> exponent[row]
    upper = -((origin[row] - tree.upper[child]) >> exponent[row])
    for k, axis in enumerate("xyz"):
        out[f"lower_{axis}"][row, slot] = lower[:, k]
        out[f"upper_{axis}"][row, slot] = upper[:, k]
    return out


def _exponents(extent: np.ndarray) -> np.ndarray:
    """The least exponents with which 8 bits reach across extents (N, 3) int64, rounded up."""
    return np.sum([extent > 255 << e for e in range(NODE_EXPONENT_MAX)], axis=0)


def _leaves(tree: WideTree, triangles: np.ndarray, masks: np.ndarray) -> np.ndarray:
    """The TRIANGLE_BLOCK of each item that is a leaf."""
    slots = tree.slots[tree.leaf]
    pair = slots[:, 1] - slots[:, 0] == 2
    out = np.zeros(len(slots), dtype=TRIANGLE_BLOCK)
    out["kind"], out["count"] = TRIANGLES_KIND, 1 + pair
    one, other = np.sort(tree.primitive[np.stack([slots[:, 0], slots[:, 1] - 1])], axis=0)
    out["primitive"][:, 0], out["mask"][:, 0] = one, masks[one]
    first = triangles.take(one)
    vertices = np.zeros((len(slots), 4, 3), dtype=np.float32)
    for k, name in enumerate(TRIANGLE.names or ()):
        vertices[:, k] = first[name]

    out["primitive"][pair, 1], out["mask"][pair, 1] = other[pair], masks[other[pair]]
    second = triangles.take(other[pair])
    order = shared_vertices(first[pair], second)
    fourth = np.zeros((len(order), 3), dtype=np.float32)
    for k, name in enumerate(TRIANGLE.names or ()):
        own = order[:, k] < 0
        fourth[own] = second[name][own]
    vertices[pair, 3] = fourth
    out["order"][pair] = np.where(order < 0, 3, order)
    out["vertices"] = vertices.reshape(-1, 12)
    return out


def _header(lattice: Lattice, *, width: int, levels: int, leaf: np.ndarray, triangles: int) -> np.ndarray:
    """The words (16,) of block 0; `leaf` (I,) is of all items."""
    out = np.zeros(1, dtype=BVH_HEADER)
    out["magic"], out["version"], out["width"], out["levels"] = BVH_MAGIC, BVH_VERSION, width, levels
    out["blocks"], out["root"] = ROOT + len(leaf), ROOT
    out["triangle_blocks"] = leaf.sum()
    out["nodes"] = len(leaf) - leaf.sum()
    out["triangles"] = triangles
    out["lattice_exponent"], out["lattice_origin"] = lattice.exponent, lattice.origin
    words = pack(out)
    words[0, -1] = np.bitwise_xor.reduce(words[0])
    return words[0]


def _empty(width: int) -> WideBvh:
    """The tree of no triangles: a root without children."""
    lattice = Lattice(origin=np.zeros(3, dtype=np.float32), exponent=LEAST_EXPONENT)
    root = np.zeros(1, dtype=NODE_BLOCK)
    root["kind"], root["base"] = NODE_KIND, ROOT + 1
    header = _header(lattice, width=width, levels=1, leaf=np.zeros(1, dtype=bool), triangles=0)
    return WideBvh(np.stack([header, pack(root)[0]]))
