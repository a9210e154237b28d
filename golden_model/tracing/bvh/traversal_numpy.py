"""Traversal in NumPy wavefronts: all rays of a chunk take a step at a time, whichever node each of them is at."""

import numpy as np

from lightloom.golden_model.contract.formats import HIT
from lightloom.golden_model.tracing.bvh.build import Bvh
from lightloom.golden_model.tracing.bvh.ray_box import ray_box
from lightloom.golden_model.tracing.ray_triangle import ray_triangle, triangle_tests
from lightloom.golden_model.tracing.recorder import TestRecorder


def trace_chunk(
    bvh: Bvh, prepared: np.ndarray, slabs: np.ndarray, rays: np.ndarray, any_hit: bool, recorder: TestRecorder | None
) -> np.ndarray:
    """PREPARED_RAY (N,) with `ray_box.box_rays` (9, N) to HIT (N,); traces only `rays` (M,), the others miss."""
    return Wavefront(bvh, prepared, slabs, any_hit, recorder).run(rays)


class Wavefront:
    """The state of N rays: the best hit so far, and a stack of nodes with the t at which the ray enters them."""

    def __init__(self, bvh: Bvh, prepared: np.ndarray, slabs: np.ndarray, any_hit: bool, recorder: TestRecorder | None):
        self.bvh, self.prepared, self.slabs = bvh, prepared, slabs
        self.any_hit, self.recorder = any_hit, recorder
        count = len(prepared)
        self.t_min = np.ascontiguousarray(prepared["t_min"])
        self.best = np.ascontiguousarray(prepared["t_max"])
        self.hits = np.zeros(count, dtype=HIT)
        self.hits["primitive"] = -1
        self.height = np.zeros(count, dtype=np.int32)
        self.stack = np.zeros((bvh.depth + 1, count), dtype=np.int32)
        self.entries = np.zeros((bvh.depth + 1, count), dtype=np.float32)

    def run(self, ray: np.ndarray) -> np.ndarray:
        """Traces the rays numbered (M,): HIT (N,)."""
        node = np.zeros(len(ray), dtype=np.int32)
        while len(ray):
            leaf = self.bvh.count[node] > 0
            waiting = self._leaf(ray[leaf], node[leaf])
            ray, node, missed = self._inner(ray[~leaf], node[~leaf])
            popped, popped_node = self._pop(np.concatenate([waiting, missed]))
            ray, node = np.concatenate([ray, popped]), np.concatenate([node, popped_node])
        return self.hits

    def _inner(self, ray: np.ndarray, node: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Tests both children; returns the rays that enter one, the node they go to, and the rays that enter none."""
        if self.recorder is not None:
            self.recorder.nodes += len(ray)
        bvh, left = self.bvh, self.bvh.first[node]
        slabs, t_min, best = self.slabs.take(ray, axis=1), self.t_min[ray], self.best[ray]
        entry, enters = ray_box(slabs, *bvh.corners(left), t_min, best)
        entry_right, enters_right = ray_box(slabs, *bvh.corners(left + 1), t_min, best)

        to_right = enters_right & (~enters | (entry_right < entry))
        both = np.flatnonzero(enters & enters_right)
        later, height = ray[both], self.height[ray[both]]
        self.stack[height, later] = left[both] + ~to_right[both]
        self.entries[height, later] = np.where(to_right[both], entry[both], entry_right[both])
        self.height[later] = height + 1

        goes = enters | enters_right
        return ray[goes], (left + to_right)[goes], ray[~goes]

    def _pop(self, ray: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Takes from each ray's stack the next node that may still hold a better hit; drops rays without one."""
        found_ray, found_node = [ray[:0]], [self.stack[:0, 0]]
        while len(ray):
            ray = ray[self.height[ray] > 0]
            height = self.height[ray] - 1
            self.height[ray] = height
            near = self.entries[height, ray] <= self.best[ray]
            found_ray.append(ray[near])
            found_node.append(self.stack[height, ray][near])
            ray = ray[~near]
        return np.concatenate(found_ray), np.concatenate(found_node)

    def _leaf(self, ray: np.ndarray, node: np.ndarray) -> np.ndarray:
        """Tests all triangles of the rays' leaves; returns the rays that go on."""
        if not len(ray):
            return ray
        first, count = self.bvh.first[node], self.bvh.count[node]
        test_ray = np.repeat(ray, count)
        slot = np.arange(len(test_ray)) + np.repeat(first - (np.cumsum(count) - count), count)
        tests = triangle_tests(self.prepared[test_ray], self.bvh.slots[slot])
        tests["t_max"] = self.best[test_ray]
        if self.recorder is not None:
            self.recorder.record(test_ray, self.bvh.primitive[slot], tests)
        results = ray_triangle(tests)

        hit = np.flatnonzero(results["hit"])
        if self.any_hit:
            self.hits["primitive"][test_ray[hit]] = 0
            return ray[self.hits["primitive"][ray] < 0]
        # The best of the leaf: of a ray's hits, the first in the order (t, primitive).
        hit = hit[np.lexsort((self.bvh.primitive[slot[hit]], results["t"][hit], test_ray[hit]))]
        hit = hit[np.diff(test_ray[hit], prepend=-1) != 0]
        self._offer(test_ray[hit], self.bvh.primitive[slot[hit]], results[hit])
        return ray

    def _offer(self, ray: np.ndarray, primitive: np.ndarray, results: np.ndarray) -> None:
        """Takes TRIANGLE_HITs, one a ray, where they are better than the best so far; they have t <= best."""
        known = self.hits["primitive"][ray]
        better = (results["t"] < self.best[ray]) | (known < 0) | (primitive < known)
        ray, primitive, results = ray[better], primitive[better], results[better]
        self.best[ray] = results["t"]
        self.hits["primitive"][ray] = primitive
        for name in ("t", "u", "v", "front"):
            self.hits[name][ray] = results[name]
