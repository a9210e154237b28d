"""A bounding volume hierarchy over triangles, built by the surface area heuristic.

The whole level is built at once: every node of the level sweeps over all positions of all three axes (no bins, so there
is nothing to tune), in array operations over all triangles that are not in a leaf yet. Equal costs go to the most even
split, so that coincident triangles make a balanced tree. Nothing depends on the host: the same triangles give the same
tree everywhere.

For triangles that have moved a tree can keep its shape and get new boxes (`refit`), which takes a fraction of the time.
"""

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from lightloom.golden_model.contract.formats import TRIANGLE

LEAF_SIZE = 4
"""A leaf holds at most this many triangles."""
NODE_COST = 1.0
TRIANGLE_COST = 1.0
"""Relative costs of visiting a node (testing its two children's boxes) and of testing a triangle."""


@dataclass(frozen=True, eq=False)
class Bvh:
    """A binary tree in flat arrays; node 0 is the root. Without any finite triangle there are no nodes."""

    lower: np.ndarray
    """(N, 3) float32, the least coordinates of the node's box."""
    upper: np.ndarray
    """(N, 3) float32, the greatest coordinates."""
    first: np.ndarray
    """(N,) int32: of an inner node the left child (the right one follows it), of a leaf its first slot."""
    count: np.ndarray
    """(N,) int32: triangles in the leaf, 1 to its `leaf_size`; 0 for an inner node."""
    primitive: np.ndarray
    """(S,) int32: the triangle of each slot, an index into `triangles`; a leaf's slots follow each other."""
    triangles: np.ndarray
    """TRIANGLE (T,), as given to `build`. A triangle with a vertex that is not finite has no slot: no ray hits it."""
    depth: int
    """Inner nodes on the longest path from the root, so also the most entries that a traversal stack holds."""

    @cached_property
    def slots(self) -> np.ndarray:
        """TRIANGLE (S,): the triangle of each slot, so that a leaf's triangles lie side by side."""
        return self.triangles.take(self.primitive)  # much faster than an index here

    def corners(self, node: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(3, M) float32 least and greatest coordinates of nodes (M,)."""
        return self._columns[:3].take(node, axis=1), self._columns[3:].take(node, axis=1)

    @cached_property
    def _columns(self) -> np.ndarray:
        return np.concatenate([self.lower.T, self.upper.T])

    @cached_property
    def sah_cost(self) -> float:
        """Expected cost of a random line that meets the root's box, in triangle tests (surface area heuristic)."""
        if not len(self.count):
            return 0.0
        area = _half_area(self.lower.T, self.upper.T)
        cost = np.where(self.count > 0, TRIANGLE_COST * self.count, NODE_COST)
        return math.fsum(area * cost) / area[0] if area[0] > 0 else math.fsum(cost)


def build(triangles: np.ndarray, leaf_size: int = LEAF_SIZE) -> Bvh:
    """TRIANGLE (T,), T < 2**31, to its tree. Time grows as T log T; bunny (69,666 triangles) takes about a second.

    A leaf holds at most `leaf_size` triangles, 1 or more.
    """
    corners = np.stack([triangles["v0"], triangles["v1"], triangles["v2"]])
    used = np.flatnonzero(np.isfinite(corners).all(axis=(0, 2)))
    lower, upper = corners[:, used].min(axis=0).T, corners[:, used].max(axis=0).T

    nodes = max(2 * len(used) - 1, 0)
    node_lower, node_upper = np.zeros((2, nodes, 3), dtype=np.float32)
    first, count = np.zeros((2, nodes), dtype=np.int32)
    slots = np.zeros(len(used), dtype=np.int32)
    node_end, slot_end, depth = 1, 0, 0

    # Greatest corner and negated least corner as integers of the same order, all to be maximised: (T, 6), because the
    # sweeps gather whole triangles.
    bounds = np.stack([*_ordered(upper), *-_ordered(lower)], axis=1)
    orders = [np.argsort(centre, kind="stable") for centre in lower.astype(np.float64) + upper]
    node = np.arange(min(len(used), 1))  # the nodes of this level, and how many triangles each holds
    sizes = np.full(len(node), len(used))
    while len(node):
        sweeps = [_Sweep(np.ascontiguousarray(bounds[order].T), sizes) for order in orders]
        node_lower[node], node_upper[node] = sweeps[0].boxes()
        axis, left, cost = _best_split(sweeps, sizes)

        whole = _half_area(node_lower[node].T, node_upper[node].T)
        leaf = (sizes <= leaf_size) & (NODE_COST * whole + TRIANGLE_COST * cost >= TRIANGLE_COST * whole * sizes)
        leaf |= sizes == 1
        segment = np.repeat(np.arange(len(node)), sizes)
        starts = np.cumsum(sizes) - sizes

        in_leaf = leaf[segment]
        chosen = orders[0][in_leaf]
        slots[slot_end : slot_end + len(chosen)] = chosen
        count[node[leaf]] = sizes[leaf]
        first[node[leaf]] = slot_end + np.cumsum(sizes[leaf]) - sizes[leaf]
        slot_end += len(chosen)

        split = np.flatnonzero(~leaf)
        first[node[split]] = node_end + 2 * np.arange(len(split))
        rank = np.arange(len(segment)) - starts[segment]
        on_right = np.zeros(len(used), dtype=bool)
        for k, order in enumerate(orders):
            mine = axis[segment] == k
            on_right[order[mine]] = rank[mine] >= left[segment[mine]]
        orders = [_partition(order[~in_leaf], on_right, sizes[split], left[split]) for order in orders]

        node = node_end + np.arange(2 * len(split))
        node_end += len(node)
        sizes = np.stack([left[split], sizes[split] - left[split]], axis=1).ravel()
        depth += bool(len(split))

    return Bvh(
        lower=node_lower[:node_end].copy(),
        upper=node_upper[:node_end].copy(),
        first=first[:node_end].copy(),
        count=count[:node_end].copy(),
        primitive=used[slots].astype(np.int32),
        triangles=triangles,
        depth=depth,
    )


def refit(bvh: Bvh, triangles: np.ndarray) -> Bvh:
    """The tree of the same shape over the same triangles elsewhere: TRIANGLE (T,) as given to `build`.

    Triangles that had slots must be finite still. Boxes are found from the leaves upwards, level by level; nodes lie in
    the order of their levels. Hits do not depend on the shape of a tree, only the time to find them does: `sah_cost`
    tells when it is time to build anew.
    """
    slots = triangles.take(bvh.primitive)
    corners = np.stack([slots[name] for name in TRIANGLE.names or ()])
    leaves = np.flatnonzero(bvh.count)
    leaves = leaves[np.argsort(bvh.first[leaves], kind="stable")]
    lower, upper = np.empty_like(bvh.lower), np.empty_like(bvh.upper)
    lower[leaves] = np.minimum.reduceat(corners.min(axis=0), bvh.first[leaves], axis=0)
    upper[leaves] = np.maximum.reduceat(corners.max(axis=0), bvh.first[leaves], axis=0)
    for begin, end in reversed(levels(bvh)):
        inner = begin + np.flatnonzero(bvh.count[begin:end] == 0)
        left = bvh.first[inner]
        lower[inner] = np.minimum(lower[left], lower[left + 1])
        upper[inner] = np.maximum(upper[left], upper[left + 1])
    return replace(bvh, lower=lower, upper=upper, triangles=triangles)


def levels(bvh: Bvh) -> list[tuple[int, int]]:
    """First and last node (exclusive) of each level, from the root down, of a tree that `build` made."""
    children = np.concatenate([[0], np.cumsum(2 * (bvh.count == 0))])
    found = []
    begin, end = 0, min(len(bvh.count), 1)
    while begin < end:
        found.append((begin, end))
        begin, end = end, end + int(children[end] - children[begin])
    return found


class _Sweep:
    """The boxes left and right of every split position, for all nodes of a level sorted along one axis.

    `bounds` is (6, n) ordered integers, node after node; a node's number above them keeps the running maxima apart.
    """

    def __init__(self, bounds: np.ndarray, sizes: np.ndarray):
        self.ends = np.cumsum(sizes)
        segment = np.repeat(np.arange(len(sizes)), sizes) << 34
        self.prefix = np.maximum.accumulate(bounds + segment, axis=1) - segment
        segment = segment[-1] - segment[::-1]
        self.suffix = (np.maximum.accumulate(bounds[:, ::-1] + segment, axis=1) - segment)[:, ::-1]

    def boxes(self) -> tuple[np.ndarray, np.ndarray]:
        """Least and greatest corners of the nodes, (S, 3) float32 each."""
        whole = self.prefix[:, self.ends - 1]
        return _float(-whole[3:]).T, _float(whole[:3]).T

    def costs(self, rank: np.ndarray, rest: np.ndarray) -> np.ndarray:
        """(n,) sum of area times triangles of both sides, where `rank` triangles stand left and `rest` right.

        A position is named by its first triangle on the right; at a node's first triangle the cost is infinite. The
        areas have 24 bits, so that their products with counts are exact and equal boxes have exactly equal costs.
        """
        left = _half_area(_float(-self.prefix[3:, :-1]), _float(self.prefix[:3, :-1]))
        right = _half_area(_float(-self.suffix[3:, 1:]), _float(self.suffix[:3, 1:]))
        cost = np.full(len(rank), np.inf)
        cost[1:] = _short(left) * rank[1:] + _short(right) * rest[1:]
        cost[rank == 0] = np.inf
        return cost


def _best_split(sweeps: list[_Sweep], sizes: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """For each node of the level: the axis, the number of triangles on the left, and the cost of the best split.

    Of equal costs the most even split, then the lowest axis, then the fewest on the left. Nodes of one triangle have an
    infinite cost.
    """
    starts = np.cumsum(sizes) - sizes
    segment = np.repeat(np.arange(len(sizes)), sizes)
    rank = np.arange(len(segment)) - starts[segment]
    rest = sizes[segment] - rank
    unevenness = np.abs(rank - rest)

    costs = [sweep.costs(rank, rest) for sweep in sweeps]
    best = np.min([np.minimum.reduceat(cost, starts) for cost in costs], axis=0)
    uneven = [np.where(cost == best[segment], unevenness, len(segment) + 1) for cost in costs]
    least = np.array([np.minimum.reduceat(u, starts) for u in uneven])
    axis = np.argmin(least, axis=0)

    at = [np.flatnonzero((axis[segment] == k) & (u == least[k][segment])) for k, u in enumerate(uneven)]
    positions = np.concatenate(at)[::-1]
    left = np.zeros(len(sizes), dtype=np.int64)
    positions = positions[np.argsort(-positions, kind="stable")]  # the lowest is written last and stays
    left[segment[positions]] = rank[positions]
    return axis, left, best


def _partition(order: np.ndarray, on_right: np.ndarray, sizes: np.ndarray, left: np.ndarray) -> np.ndarray:
    """Splits each node's run of `order` into its left and its right triangles, both in the order they had."""
    starts = np.cumsum(sizes) - sizes
    right = on_right[order]
    rights = np.cumsum(right) - right  # triangles on the right before this one, in all nodes
    before = np.repeat(rights[starts] if len(starts) else rights, sizes)
    start = np.repeat(starts, sizes)
    rank_right = rights - before
    rank_left = np.arange(len(order)) - start - rank_right
    out = np.empty_like(order)
    out[start + np.where(right, np.repeat(left, sizes) + rank_right, rank_left)] = order
    return out


def _half_area(lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
    """Half the surface of boxes with corners (3, N) float32, in float64."""
    x, y, z = upper.astype(np.float64) - lower
    return x * y + y * z + z * x


def _short(x: np.ndarray) -> np.ndarray:
    """float64 cut to 24 significant bits."""
    return (x.view(np.int64) & ~np.int64((1 << 29) - 1)).view(np.float64)


def _ordered(x: np.ndarray) -> np.ndarray:
    """Finite float32 to int32 in the same order (-0 below +0)."""
    pattern = np.ascontiguousarray(x).view(np.int32)
    return pattern ^ ((pattern >> 31) & 0x7FFFFFFF)


def _float(ordered: np.ndarray) -> np.ndarray:
    """Inverse of `_ordered`."""
    pattern = ordered.astype(np.int32)
    return (pattern ^ ((pattern >> 31) & 0x7FFFFFFF)).view(np.float32)
