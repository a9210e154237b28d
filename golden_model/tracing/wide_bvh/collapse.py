"""A binary tree over triangles made wide: which of its nodes stay, and what the leaves hold.

The cheapest choice, by dynamic programming from the leaves upwards (Ylitie, Karras, Laine 2017, "Efficient incoherent
ray traversal on GPUs through compressed wide BVHs", section 3.1). Everything goes level by level in array operations,
and nothing depends on the host.
"""

from dataclasses import dataclass

import numpy as np

from lightloom.golden_model.contract.formats import TRIANGLE
from lightloom.golden_model.tracing.bvh.build import Bvh, levels
from lightloom.golden_model.tracing.wide_bvh.quantization import half_areas

NODE_COST = 1.0
TRIANGLE_COST = 0.8
"""Relative costs of visiting a node and of testing a triangle. Node tests decide how fast a traversal unit is, its
triangle unit has cycles to spare (docs/memory_image.md has the choice in figures)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class WideTree:
    """The nodes and leaves of a wide tree, level by level from the root down; I of them, item 0 is the root, a node."""

    node: np.ndarray
    """(I,) int64, the node of the binary tree that the item is, -1 below one that was divided evenly."""
    leaf: np.ndarray
    """(I,) bool."""
    first: np.ndarray
    """(I,) int64, of a node its first child; the others follow it. 0 for a leaf and for a node without children."""
    count: np.ndarray
    """(I,) int64, of a node its children, at most the tree's width; 0 for a leaf."""
    slots: np.ndarray
    """(I, 2) int64, begin and end of the triangles below the item in `primitive`; a leaf has one or two of them."""
    lower: np.ndarray
    """(I, 3) int64, the least lattice coordinates of the item's box."""
    upper: np.ndarray
    """(I, 3) int64, the greatest lattice coordinates."""
    primitive: np.ndarray
    """(S,) int32, triangles from the left of the tree to its right."""
    levels: list[tuple[int, int]]
    """First and last item (exclusive) of each level; leaves may be on any but the first."""


def collapse(bvh: Bvh, lower: np.ndarray, upper: np.ndarray, width: int, max_levels: int) -> WideTree:
    """A tree of `build.build` with a triangle a leaf to a tree of nodes with up to `width` children.

    `lower` and `upper`: (N, 3) int64 lattice coordinates of the boxes of the tree's nodes. No leaf lies below more than
    `max_levels` nodes: parts of the tree where the cheapest choice would be deeper are divided evenly instead. The tree
    must not be empty, and hold at most width**max_levels triangles.
    """
    spans = _spans(bvh)
    plan = _plan(bvh, spans, half_areas(lower, upper), width)
    even = np.zeros(len(bvh.count), dtype=bool)
    tree = _expand(bvh, plan, even, lower, upper, width)
    # The items of the last level are all leaves.
    if len(tree.levels) - 1 > max_levels:
        _mark_deep(tree, plan, even, width, max_levels)
        tree = _expand(bvh, plan, even, lower, upper, width)
    return tree


@dataclass(frozen=True, kw_only=True, eq=False)
class _Plan:
    """What the dynamic programming has decided for every node of the binary tree."""

    spans: np.ndarray
    """(N, 2) int64, begin and end of the node's triangles from left to right."""
    primitive: np.ndarray
    """(S,) int32, triangles from left to right."""
    leaf: np.ndarray
    """(N,) bool: where the node is kept, it is a leaf."""
    shares: np.ndarray
    """(width + 1, N, 2) uint8. [i]: where the node gives way to up to i of its descendants, how many of these lie in
    its left and in its right half; zeros where the node itself is as good. [0]: the same for the children of the node,
    where it is kept and no leaf."""


def _spans(bvh: Bvh) -> np.ndarray:
    """Begin and end of each node's triangles, counted from the left of the tree, (N, 2) int64."""
    sizes = bvh.count.astype(np.int64)
    order = levels(bvh)
    for begin, end in reversed(order):
        inner = begin + np.flatnonzero(bvh.count[begin:end] == 0)
        sizes[inner] = sizes[bvh.first[inner]] + sizes[bvh.first[inner] + 1]
    start = np.zeros(len(sizes), dtype=np.int64)
    for begin, end in order:
        inner = begin + np.flatnonzero(bvh.count[begin:end] == 0)
        left = bvh.first[inner]
        start[left] = start[inner]
        start[left + 1] = start[inner] + sizes[left]
    return np.stack([start, start + sizes], axis=1)


def _plan(bvh: Bvh, spans: np.ndarray, area: np.ndarray, width: int) -> _Plan:
    """From the leaves upwards, the cheapest way to have each node as one to `width` roots of wide trees."""
    sizes = spans[:, 1] - spans[:, 0]
    primitive = np.zeros(len(bvh.primitive), dtype=np.int32)
    single = np.flatnonzero(bvh.count)
    primitive[spans[single, 0]] = bvh.primitive[bvh.first[single]]

    may_be_leaf = sizes == 1
    two = np.flatnonzero(sizes == 2)
    # In the order in which a leaf holds them: of a triangle with two equal vertices both may be shared by one.
    pairs = np.sort(primitive[np.stack([spans[two, 0], spans[two, 0] + 1])], axis=0)
    may_be_leaf[two] = (shared_vertices(*bvh.triangles.take(pairs)) >= 0).sum(axis=1) >= 2

    leaf = np.zeros(len(area), dtype=bool)
    shares = np.zeros((width + 1, len(area), 2), dtype=np.uint8)
    below, below_begin = np.zeros((width + 1, 0)), 0  # costs of the nodes of the level below, as up to i roots
    for begin, end in reversed(levels(bvh)):
        inner = begin + np.flatnonzero(bvh.count[begin:end] == 0)
        left = bvh.first[inner] - below_begin
        divided = np.full((width + 1, len(inner)), np.inf)
        for roots in range(2, width + 1):
            for on_left in range(1, roots):
                cost = below[on_left, left] + below[roots - on_left, left + 1]
                better = cost < divided[roots]
                divided[roots, better] = cost[better]
                shares[roots, inner[better]] = on_left, roots - on_left
        shares[0, inner] = shares[width, inner]

        cost = np.full((width + 1, end - begin), np.inf)
        as_leaf = np.where(may_be_leaf[begin:end], TRIANGLE_COST * sizes[begin:end] * area[begin:end], np.inf)
        cost[1, inner - begin] = divided[width] + NODE_COST * area[inner]
        leaf[begin:end] = as_leaf <= cost[1]
        cost[1] = np.minimum(cost[1], as_leaf)
        for roots in range(2, width + 1):
            cost[roots] = cost[roots - 1]
            worse = divided[roots] >= cost[roots, inner - begin]
            shares[roots, inner[worse]] = shares[roots - 1, inner[worse]]
            cost[roots, inner[~worse] - begin] = divided[roots, ~worse]
        below, below_begin = cost, begin
    return _Plan(spans=spans, primitive=primitive, leaf=leaf, shares=shares)


def shared_vertices(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """For each vertex of `other`, TRIANGLE (N,), the first of `one` with the same bits: (N, 3) int64, -1 for none."""
    found = np.full((len(one), 3), -1, dtype=np.int64)
    for k, name in enumerate(TRIANGLE.names or ()):
        wanted = np.ascontiguousarray(other[name]).view(np.uint32)
        for vertex in (2, 1, 0):
            here = np.ascontiguousarray(one[(TRIANGLE.names or ())[vertex]]).view(np.uint32)
            found[(here == wanted).all(axis=1), k] = vertex
    return found


def _expand(bvh: Bvh, plan: _Plan, even: np.ndarray, lower: np.ndarray, upper: np.ndarray, width: int) -> WideTree:
    """The wide tree that the plan comes to, from the root down; kept nodes with `even` (N,) bool are divided evenly."""
    leaves = np.flatnonzero(bvh.count)
    leaves = leaves[np.argsort(plan.spans[leaves, 0])]
    node, slots, leaf = np.zeros(1, dtype=np.int64), plan.spans[:1], np.zeros(1, dtype=bool)
    columns: list[tuple[np.ndarray, ...]] = []
    bounds, end = [], 0
    while len(node):
        bounds.append((end, end + len(node)))
        end += len(node)
        low, high = lower[node], upper[node]
        if len(divided := np.flatnonzero(node < 0)):
            low[divided] = _over_spans(np.minimum, lower[leaves], slots[divided])
            high[divided] = _over_spans(np.maximum, upper[leaves], slots[divided])

        owners = np.flatnonzero(~leaf)
        alike = (node[owners] < 0) | even[node[owners]]
        owner, child, below = (
            np.concatenate(both)
            for both in zip(
                _planned_children(bvh, plan, owners[~alike], node[owners[~alike]]),
                _even_children(owners[alike], slots[owners[alike]], width),
                strict=True,
            )
        )
        order = np.argsort(owner, kind="stable")
        count = np.bincount(owner, minlength=len(node))
        first = np.where(count > 0, end + np.cumsum(count) - count, 0)
        columns.append((node, leaf, first, count, slots, low, high))
        node, slots = child[order], below[order]
        leaf = np.where(node < 0, slots[:, 1] - slots[:, 0] == 1, plan.leaf[node])
    names = ("node", "leaf", "first", "count", "slots", "lower", "upper")
    whole = (np.concatenate(column) for column in zip(*columns, strict=True))
    return WideTree(**dict(zip(names, whole, strict=True)), primitive=plan.primitive, levels=bounds)


_Children = tuple[np.ndarray, np.ndarray, np.ndarray]
"""Of C children: whose they are (C,), which nodes of the binary tree (C,), their spans (C, 2)."""


def _planned_children(bvh: Bvh, plan: _Plan, owner: np.ndarray, node: np.ndarray) -> _Children:
    """The children of kept nodes (M,), from left to right."""
    # A tree that is a single leaf is the only child of its root.
    roots = plan.leaf[node].astype(np.uint8)
    while (divided := plan.shares[roots, node, 0] > 0).any():
        copies = np.repeat(np.arange(len(node)), 1 + divided)
        right = np.zeros(len(copies), dtype=np.int64)
        right[1:] = copies[1:] == copies[:-1]
        shares = plan.shares[roots[copies], node[copies], right]
        roots = np.where(divided[copies], shares, np.uint8(1))
        node = np.where(divided[copies], bvh.first[node[copies]] + right, node[copies])
        owner = owner[copies]
    return owner, node, plan.spans[node]


def _even_children(owner: np.ndarray, slots: np.ndarray, width: int) -> _Children:
    """Spans (M, 2) of two triangles or more divided into `width` parts each, of the same length but for one."""
    size = slots[:, 1] - slots[:, 0]
    count = np.minimum(size, width)
    copies = np.repeat(np.arange(len(owner)), count)
    number = np.arange(len(copies)) - np.repeat(np.cumsum(count) - count, count)
    edges = [slots[copies, 0] + size[copies] * (number + k) // count[copies] for k in (0, 1)]
    return owner[copies], np.full(len(copies), -1), np.stack(edges, axis=1)


def _over_spans(function: np.ufunc, values: np.ndarray, spans: np.ndarray) -> np.ndarray:
    """The minimum or maximum of values (S, 3) over each of the spans (M, 2), none of them empty."""
    # Every second result is of what lies between a span and the next. The last row makes room for the end.
    return function.reduceat(np.concatenate([values, values[-1:]]), spans.ravel(), axis=0)[::2]


def _mark_deep(tree: WideTree, plan: _Plan, even: np.ndarray, width: int, max_levels: int) -> None:
    """Sets `even` of the lowest nodes from which even division brings all leaves below up to `max_levels` nodes."""
    size = tree.slots[:, 1] - tree.slots[:, 0]
    needed = np.ones(len(size), dtype=np.int64)
    reach = width
    while reach < len(plan.primitive):
        needed += size > reach
        reach *= width
    height = (~tree.leaf).astype(np.int64)
    parents = [np.repeat(np.arange(begin, end), tree.count[begin:end]) for begin, end in tree.levels]
    for parent, (begin, end) in reversed(list(zip(parents, tree.levels[1:], strict=False))):
        np.maximum.at(height, parent, 1 + height[begin:end])

    opened = np.ones(len(size), dtype=bool)
    for level, (parent, (begin, end)) in enumerate(zip(parents, tree.levels[1:], strict=False), start=2):
        deep = level + height[begin:end] - 1 > max_levels
        hopeless = deep & (level + needed[begin:end] - 1 > max_levels)
        chosen = np.unique(parent[hopeless & opened[parent]])
        even[tree.node[chosen]] = True
        opened[chosen] = False
        opened[begin:end] = deep & opened[parent]
