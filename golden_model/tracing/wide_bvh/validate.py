"""Whether blocks are a tree that can be traced: what the hardware relies on, and what makes its answers right."""

import numpy as np

from lightloom.golden_model.contract.bitpack import unpack
from lightloom.golden_model.contract.formats import (
    BVH_HEADER,
    BVH_MAGIC,
    BVH_VERSION,
    NODE_BLOCK,
    TRIANGLE_BLOCK,
    WIDTH,
)
from lightloom.golden_model.host.errors import InputError
from lightloom.golden_model.numerics.floats import flush
from lightloom.golden_model.tracing.wide_bvh.encode import ROOT, WideBvh, slot_boxes, tree_triangles
from lightloom.golden_model.tracing.wide_bvh.quantization import Lattice

EXPONENTS = range(-126, 111)
"""Of the lattice."""


def validate_tree(blocks: np.ndarray, name: str = "tree") -> None:
    """Raises InputError unless blocks (B, 16) uint32 are a tree that can be traced. `name`, a file, is for the error.

    Every block but the header is reached from the root in exactly one way, which only leads to higher addresses; kinds,
    counts and levels are those that nodes and header tell; every box holds all triangles below it; no triangle is there
    twice.
    """
    problem = _header_problem(blocks)
    tree = WideBvh(blocks)
    for problems in (_node_problem, _leaf_problem, _box_problem):
        problem = problem or problems(tree)
    if problem:
        raise InputError(f"{name}: the tree is damaged: {problem}; pack the scene again")


def _header_problem(blocks: np.ndarray) -> str:
    """What is wrong with block 0, '' if nothing."""
    if len(blocks) <= ROOT:
        return "it has no blocks"
    header = unpack(blocks[:1], BVH_HEADER)[0]
    if header["magic"] != BVH_MAGIC:
        return "its header does not begin with LLBV"
    if np.bitwise_xor.reduce(blocks[0]):
        return "its header's check is wrong"
    if header["version"] != BVH_VERSION:
        return f"its version is {header['version']}, not {BVH_VERSION}"
    if not 1 <= header["width"] <= WIDTH:
        return f"its width is {header['width']}, not 1 to {WIDTH}"
    if header["blocks"] != len(blocks):
        return f"its header tells of {header['blocks']} blocks, and there are {len(blocks)}"
    if header["lattice_exponent"] not in EXPONENTS:
        return f"its lattice exponent is {header['lattice_exponent']}, not {EXPONENTS[0]} to {EXPONENTS[-1]}"
    if not np.isfinite(header["lattice_origin"]).all():
        return "its lattice has no finite origin"
    return ""


def _node_problem(tree: WideBvh) -> str:
    """What is wrong with the tree's shape: kinds, addresses, counts, levels; '' if nothing."""
    header, blocks = tree.header, len(tree.blocks)
    # One question after the other: each relies on the answers before.
    address = np.flatnonzero(tree.node_blocks)
    if len(address) + tree.triangle_blocks.sum() != blocks - ROOT:
        other = np.flatnonzero(~tree.node_blocks & ~tree.triangle_blocks)[ROOT]
        return f"block {other} is neither a node nor triangles"
    if header["root"] != ROOT or not tree.node_blocks[ROOT]:
        return f"its root is block {header['root']}, not the node {ROOT}"
    if header["nodes"] != len(address) or header["triangle_blocks"] != blocks - ROOT - len(address):
        return "its header tells of another number of nodes or triangles"
    nodes = unpack(tree.blocks[address], NODE_BLOCK)
    count, base = nodes["count"].astype(np.int64), nodes["base"].astype(np.int64)
    if (wide := count > header["width"]).any():
        return f"node {address[wide][0]} has more children than the tree is wide"
    if (wrong := (count == 0) & (address != ROOT)).any():
        return f"node {address[wrong][0]} has no children"
    if (wrong := (count > 0) & ((base <= address) | (base + count > blocks))).any():
        return f"the children of node {address[wrong][0]} do not lie behind it"
    used = np.arange(WIDTH) < count[:, None]
    child = (base[:, None] + np.arange(WIDTH))[used]
    owner = np.repeat(address, count)
    if (wrong := (((nodes["leaf"][:, None] >> np.arange(WIDTH)) & 1)[used] != 0) != tree.triangle_blocks[child]).any():
        return f"node {owner[wrong][0]} takes triangles for a node, or a node for triangles"
    parents = np.bincount(child, minlength=blocks)
    parents[[0, ROOT]] += [1, 1]
    if (wrong := parents != 1).any():
        return f"block {np.flatnonzero(wrong)[0]} has {parents[wrong][0]} parents"
    if (levels := len(node_levels(tree))) != header["levels"]:
        return f"its header tells of {header['levels']} levels, and there are {levels}"
    return ""


def node_levels(tree: WideBvh) -> list[np.ndarray]:
    """The addresses of the nodes of each level, from the root down, of a tree whose children lie behind their nodes."""
    found, level = [], np.array([ROOT])
    while len(level):
        found.append(level)
        nodes = unpack(tree.blocks[level], NODE_BLOCK)
        used = np.arange(WIDTH) < nodes["count"][:, None]
        child = (nodes["base"][:, None].astype(np.int64) + np.arange(WIDTH))[used]
        level = child[tree.node_blocks[child]]
    return found


def _leaf_problem(tree: WideBvh) -> str:
    """What is wrong with the triangles but for their place, '' if nothing."""
    address = np.flatnonzero(tree.triangle_blocks)
    count = unpack(tree.blocks[address], TRIANGLE_BLOCK)["count"]
    if (wrong := (count < 1) | (count > 2)).any():
        return f"block {address[wrong][0]} has {count[wrong][0]} triangles"
    primitive, triangles, _ = tree_triangles(tree)
    if len(primitive) != tree.header["triangles"]:
        return f"its header tells of {tree.header['triangles']} triangles, and there are {len(primitive)}"
    if (primitive < 0).any() or len(np.unique(primitive)) < len(primitive):
        return "a triangle is in it twice, or has a number below 0"
    finite = [np.isfinite(triangles[name]).all(axis=1) for name in triangles.dtype.names or ()]
    if not (ok := np.logical_and.reduce(finite)).all():
        return f"triangle {primitive[~ok][0]} has a vertex that is not finite"
    return ""


def _box_problem(tree: WideBvh) -> str:
    """The first box that does not hold its triangles, '' if all do."""
    lower, upper = triangle_bounds(tree)
    for level in reversed(node_levels(tree)):
        nodes = unpack(tree.blocks[level], NODE_BLOCK)
        used = np.arange(WIDTH) < nodes["count"][:, None]
        child = (nodes["base"][:, None].astype(np.int64) + np.arange(WIDTH))[used]
        box = slot_boxes(nodes)
        inside = (box[0][used] <= lower[child]).all(axis=1) & (box[1][used] >= upper[child]).all(axis=1)
        if not inside.all():
            return f"block {child[~inside][0]} reaches out of its box"
        if len(child):  # otherwise it is a root without children
            starts = np.cumsum(nodes["count"], dtype=np.int64) - nodes["count"]
            lower[level] = np.minimum.reduceat(lower[child], starts)
            upper[level] = np.maximum.reduceat(upper[child], starts)
    return ""


def triangle_bounds(tree: WideBvh) -> tuple[np.ndarray, np.ndarray]:
    """The least and greatest lattice coordinates of the triangles in each block, rounded outwards, (B, 3) int64.

    Of other blocks, coordinates that any others are less, and greater, than.
    """
    header = tree.header
    lattice = Lattice(origin=header["lattice_origin"], exponent=int(header["lattice_exponent"]))
    lower, upper = (np.full((len(tree.blocks), 3), side) for side in (np.iinfo(np.int64).max, np.iinfo(np.int64).min))
    _, triangles, _ = tree_triangles(tree)
    corners = np.stack([triangles[name] for name in triangles.dtype.names or ()])
    leaves = np.flatnonzero(tree.triangle_blocks)
    if len(leaves):
        count = unpack(tree.blocks[leaves], TRIANGLE_BLOCK)["count"]
        starts = np.cumsum(count, dtype=np.int64) - count
        lower[leaves] = np.minimum.reduceat(lattice.floor(flush(corners).min(axis=0)), starts)
        upper[leaves] = np.maximum.reduceat(lattice.ceil(flush(corners).max(axis=0)), starts)
    return lower, upper
