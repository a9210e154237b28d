"""Tracing through a tree in memory in NumPy wavefronts: all rays of a chunk make a visit at a time, wherever each is.

This is the definition; docs/wide_traversal.md says it in words.
"""

import numpy as np

from lightloom.golden_model.contract.formats import (
    NODE_BLOCK,
    NODE_KIND,
    NODE_TEST,
    RAY_TIME,
    TIME,
    TRACE_ERRORS,
    TRIANGLES_KIND,
    U4,
    WIDTH,
)
from lightloom.golden_model.numerics.structured import take
from lightloom.golden_model.tracing.ray_triangle import ray_triangle, triangle_tests
from lightloom.golden_model.tracing.wide_bvh.decode import UNREADABLE, TreeBlocks
from lightloom.golden_model.tracing.wide_bvh.node_test import node_test
from lightloom.golden_model.tracing.wide_bvh.ray_time import ray_time

VISIT = np.dtype([("ray", np.int64), ("address", np.int64), ("leaf", np.bool_), ("rank", np.int64)])
"""A ray at a block, which is to be triangles or a node; the first `rank` of the children that it enters are skipped."""

ENTRY = np.dtype([("entry", TIME), ("address", U4), ("leaf", np.bool_), ("rank", np.uint8)])
"""A visit on a ray's stack, with the distance at which the ray enters."""


def trace_chunk(
    tree: TreeBlocks,
    stack: int,
    queries: np.ndarray,
    prepared: np.ndarray,
    boxes: np.ndarray,
    rays: np.ndarray,
    results: np.ndarray,
    counts: np.ndarray,
) -> None:
    """RAY_QUERY, PREPARED_RAY and BOX_RAY (N,) into RAY_RESULT (N,), all misses so far, and COUNTS (N,), all zero.

    Traces only `rays` (M,).
    """
    Wavefront(tree, stack, queries, prepared, boxes, results, counts).run(rays)


class Wavefront:
    """The state of N rays: the best hit so far and the stack."""

    def __init__(
        self,
        tree: TreeBlocks,
        stack: int,
        queries: np.ndarray,
        prepared: np.ndarray,
        boxes: np.ndarray,
        results: np.ndarray,
        counts: np.ndarray,
    ):
        self.tree, self.queries, self.prepared, self.boxes = tree, queries, prepared, boxes
        self.results, self.counts = results, counts
        self.blocks, self.levels = int(tree.header["blocks"]), int(tree.header["levels"])
        count = len(queries)
        self.best = prepared["t_max"].copy()
        self.far = self._distance(np.arange(count))
        self.found = np.zeros(count, dtype=bool)
        self.height = np.zeros(count, dtype=np.int64)
        self.stack = np.zeros((stack, count), dtype=ENTRY)

    def run(self, rays: np.ndarray) -> None:
        """Traces the rays numbered (M,)."""
        visits = _visits(rays, np.full(len(rays), int(self.tree.header["root"])), False, 0)
        while len(visits):
            leaf = visits["leaf"]
            waiting = self._leaves(visits[leaf])
            onward, missed = self._nodes(visits[~leaf])
            visits = np.concatenate([onward, self._pop(np.concatenate([waiting, missed]))])

    # --- visits -------------------------------------------------------------------------------------------------------

    def _nodes(self, visits: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """VISIT (M,) of nodes: the visits that rays go on to directly, and the rays that take from their stacks."""
        visits, place = self._sound(visits, NODE_KIND)
        nodes = take(self.tree.nodes, place)
        base, count = nodes["base"].astype(np.int64), nodes["count"].astype(np.int64)
        disordered = (count > 0) & (base <= visits["address"])
        beyond = base + count > self.blocks
        self._fail(visits[disordered], "order")
        self._fail(visits[beyond & ~disordered], "outside")
        sound = ~(disordered | beyond)
        visits, nodes, base = visits[sound], nodes[sound], base[sound]

        ray, rank = visits["ray"], visits["rank"]
        self.counts["node_tests"][ray] += 1
        self.counts["revisits"][ray[rank > 0]] += 1
        hits = node_test(self._node_tests(ray, nodes))

        goes = hits["count"] > rank
        row = np.flatnonzero(goes)
        slot = hits["slot"][row, rank[row]]
        leaf = (nodes["leaf"][row] >> slot & 1).astype(bool)
        onward = _visits(ray[row], base[row] + slot, leaf, 0)
        failed = self._push(visits[row], nodes["leaf"][row], base[row], hits[row])
        return onward[~failed], ray[~goes]

    def _push(self, visits: np.ndarray, leaf: np.ndarray, base: np.ndarray, hits: np.ndarray) -> np.ndarray:
        """Puts what comes after the first child of each list on the stacks; (M,) bool, rays that had no room."""
        ray, height = visits["ray"], self.height[visits["ray"]]
        first = visits["rank"] + 1
        rest = hits["count"] - first
        whole = height + rest + self.levels <= len(self.stack)
        for place in range(1, WIDTH):
            # The nearest of the rest comes to lie on top.
            row = np.flatnonzero(whole & (place >= first) & (place < hits["count"]))
            slot = hits["slot"][row, place]
            entry = np.zeros(len(row), dtype=ENTRY)
            entry["entry"] = hits["entry"][row, place]
            entry["address"] = base[row] + slot
            entry["leaf"] = leaf[row] >> slot & 1
            self.stack[height[row] + hits["count"][row] - 1 - place, ray[row]] = entry
        self.height[ray[whole]] += rest[whole]

        again = ~whole & (rest > 0)
        # Only a tree with more levels than its header says can fill the stack.
        full = again & (height == len(self.stack))
        self._fail(visits[full], "header")
        row = np.flatnonzero(again & ~full)
        entry = np.zeros(len(row), dtype=ENTRY)
        entry["entry"] = hits["entry"][row, first[row]]
        entry["address"], entry["rank"] = visits["address"][row], first[row]
        self.stack[height[row], ray[row]] = entry
        self.height[ray[row]] += 1
        return full

    def _leaves(self, visits: np.ndarray) -> np.ndarray:
        """VISIT (M,) of blocks of triangles: the rays that take from their stacks."""
        visits, place = self._sound(visits, TRIANGLES_KIND)
        ray, leaves = visits["ray"], take(self.tree.leaves, place)
        self.counts["leaf_visits"][ray] += 1
        wanted = (leaves["mask"] & self.queries["mask"][ray][:, None]) != 0
        wanted &= np.arange(2) < leaves["count"][:, None]
        self.counts["triangle_tests"][ray] += wanted.sum(axis=1).astype(np.uint32)

        row, second = np.nonzero(wanted)
        test_ray = ray[row]
        triangles = self.tree.triangles[place[row], second]
        tests = triangle_tests(take(self.prepared, test_ray), triangles, self.queries["cull"][test_ray])
        tests["t_max"] = self.best[test_ray]
        hits = ray_triangle(tests)
        for number in (0, 1):
            taken = hits["hit"] & (second == number)
            self._offer(test_ray[taken], leaves["primitive"][row[taken], number], hits[taken])
        return ray[~(self.queries["any_hit"][ray] & self.found[ray])]

    def _sound(self, visits: np.ndarray, kind: int) -> tuple[np.ndarray, np.ndarray]:
        """The visits whose blocks are of this kind, and their places among the blocks of it; other rays fail."""
        index = np.minimum(visits["address"], len(self.tree.kind) - 1)
        found = self.tree.kind[index]
        self._fail(visits[found == UNREADABLE], "memory")
        self._fail(visits[(found != UNREADABLE) & (found != kind)], "kind")
        return visits[found == kind], self.tree.place[index[found == kind]]

    def _fail(self, visits: np.ndarray, error: str) -> None:
        """The rays end, failed: what they have found is forgotten."""
        ray = visits["ray"]
        for name in ("t", "u", "v", "front"):
            self.results[name][ray] = 0
        self.results["primitive"][ray] = -1
        self.results["error"][ray] = TRACE_ERRORS[error]
        self.results["block"][ray] = visits["address"]

    # --- a ray's state ------------------------------------------------------------------------------------------------

    def _pop(self, ray: np.ndarray) -> np.ndarray:
        """Takes from each ray's stack the next visit that may still find a better hit: VISIT (M,); others are done."""
        found = [_visits(ray[:0], ray[:0], False, 0)]
        while len(ray):
            ray = ray[self.height[ray] > 0]
            self.height[ray] -= 1
            top = self.stack[self.height[ray], ray]
            near = top["entry"] <= self.far[ray]
            kept = top[near]
            found.append(_visits(ray[near], kept["address"], kept["leaf"], kept["rank"]))
            ray = ray[~near]
        return np.concatenate(found)

    def _offer(self, ray: np.ndarray, primitive: np.ndarray, hits: np.ndarray) -> None:
        """Takes TRIANGLE_HITs, one a ray, where they are better than the best so far."""
        lower = (hits["t"] == self.best[ray]) & (primitive < self.results["primitive"][ray])
        better = ~self.found[ray] | (hits["t"] < self.best[ray]) | lower
        ray, primitive, hits = ray[better], primitive[better], hits[better]
        self.found[ray] = True
        self.best[ray] = hits["t"]
        self.far[ray] = self._distance(ray)
        any_hit = self.queries["any_hit"][ray]
        self.results["primitive"][ray] = np.where(any_hit, 0, primitive)
        for name in ("t", "u", "v", "front"):
            self.results[name][ray] = np.where(any_hit, 0, hits[name])

    def _distance(self, ray: np.ndarray) -> np.ndarray:
        """The best t of rays (M,) as the box test's distance, rounded up: (M,) int64."""
        times = np.zeros(len(ray), dtype=RAY_TIME)
        times["t"] = self.best[ray]
        times["rate"], times["scale"] = self.boxes["rate"][ray], self.boxes["scale"][ray]
        return ray_time(times)["high"].astype(np.int64)

    def _node_tests(self, ray: np.ndarray, nodes: np.ndarray) -> np.ndarray:
        """Rays (M,) and NODE_BLOCK (M,) to NODE_TEST (M,)."""
        tests = np.zeros(len(ray), dtype=NODE_TEST)
        boxes = take(self.boxes, ray)
        for name in NODE_TEST.names or ():
            if name != "t_max":
                tests[name] = nodes[name] if name in NODE_NAMES else boxes[name]
        tests["t_max"] = self.far[ray]
        return tests


NODE_NAMES = frozenset(NODE_BLOCK.names or ()) & frozenset(NODE_TEST.names or ())


def _visits(ray: np.ndarray, address: np.ndarray, leaf: np.ndarray | bool, rank: np.ndarray | int) -> np.ndarray:
    """VISIT (M,)."""
    visits = np.zeros(len(ray), dtype=VISIT)
    visits["ray"], visits["address"], visits["leaf"], visits["rank"] = ray, address, leaf, rank
    return visits
