"""The compiled twin of `traversal_numpy`, ray by ray: the same visits, tests and bits. Needs numba."""

from typing import Any

import numpy as np

from lightloom.golden_model.contract.formats import (
    NODE_KIND,
    SCALE_BIAS,
    TIME_BIAS,
    TIME_BITS,
    TRACE_ERRORS,
    TRIANGLES_KIND,
    WIDTH,
)
from lightloom.golden_model.tracing.bvh.traversal_numba import flush, intersect_triangle
from lightloom.golden_model.tracing.compiled import cached, compiled
from lightloom.golden_model.tracing.wide_bvh.decode import UNREADABLE, TreeBlocks
from lightloom.golden_model.tracing.wide_bvh.node_test_numba import COMPILED_RAY, node_hits
from lightloom.golden_model.tracing.wide_bvh.ray_time import ABOVE, SIGNIFICAND, TIME_MAX

LIMITS = np.dtype([("blocks", np.int64), ("root", np.int64), ("levels", np.int64), ("stack", np.int64)])
"""Of the header what traversal needs, and the entries that a stack has room for."""

MOST = TIME_BITS - 1 - SIGNIFICAND
"""Shifted left by more than this, a significand has more bits than a distance."""
NO_ERROR = np.int64(TRACE_ERRORS["none"])
MEMORY = np.int64(TRACE_ERRORS["memory"])
OUTSIDE = np.int64(TRACE_ERRORS["outside"])
KIND = np.int64(TRACE_ERRORS["kind"])
ORDER = np.int64(TRACE_ERRORS["order"])
HEADER = np.int64(TRACE_ERRORS["header"])


@compiled
def distance_of(t: Any, rate: Any, scale: Any) -> Any:
    """`ray_time.ray_time`: `high` alone."""
    product = flush(flush(t) * flush(rate))
    if not np.isfinite(product):
        return np.int64(TIME_MAX)
    pattern = np.int64(np.float32(product).view(np.int32))
    exponent = (pattern >> 23) & 0xFF
    significand = (pattern & 0x7FFFFF) | 0x800000 if exponent > 0 else np.int64(0)
    shift = exponent - 150 + np.int64(scale) - SCALE_BIAS
    if significand > 0 and shift > MOST:
        distance = np.int64(-TIME_BIAS if pattern < 0 else TIME_BIAS - 1)
    else:
        signed = -significand if pattern < 0 else significand
        distance = signed >> min(max(-shift, np.int64(0)), np.int64(31))
    return min(distance + TIME_BIAS + ABOVE, np.int64(TIME_MAX))


@compiled
def kind_error(found: Any, wanted: int) -> Any:
    """What is wrong with a block of the kind `found` where one of the kind `wanted` should be."""
    if found == wanted:
        return NO_ERROR
    return MEMORY if found == UNREADABLE else KIND


@cached
def trace_rays(
    sources: Any,  # left out by callers: `cached` says why
    rays: Any,  # int64 (M,): which rays to trace, as indices into the next five
    queries: Any,  # RAY_QUERY (N,)
    prepared: Any,  # PREPARED_RAY (N,)
    boxes: Any,  # COMPILED_RAY (N,)
    results: Any,  # RAY_RESULT (N,), all misses
    counts: Any,  # COUNTS (N,), all zero
    limits: Any,  # LIMITS (1,)
    kinds: Any,
    places: Any,
    nodes: Any,
    leaves: Any,
    vertices: Any,  # float32 (L, 2, 9)
) -> None:
    """Traces rays through the blocks of `TreeBlocks`."""
    room, levels = limits[0].stack, limits[0].levels
    stack_entry = np.empty(room, np.int64)
    stack_address = np.empty(room, np.int64)
    stack_leaf = np.empty(room, np.bool_)
    stack_rank = np.empty(room, np.int64)
    slots = np.empty(WIDTH, np.int64)
    entries = np.empty(WIDTH, np.int64)
    for number in rays:
        query, ray, box = queries[number], prepared[number], boxes[number]
        result, count = results[number], counts[number]
        best = ray.t_max
        far = distance_of(best, box.rate, box.scale)
        found = False
        error = NO_ERROR
        height = 0
        address, leaf, rank = limits[0].root, False, np.int64(0)
        while True:
            index = min(address, len(kinds) - 1)
            onward = False
            if leaf:
                error = kind_error(kinds[index], TRIANGLES_KIND)
                if error != NO_ERROR:
                    break
                block = leaves[places[index]]
                count.leaf_visits += np.uint32(1)
                limit = best
                for second in range(block.count):
                    if block.mask[second] & query.mask == 0:
                        continue
                    count.triangle_tests += np.uint32(1)
                    hit, t, u, v, front = intersect_triangle(ray, vertices[places[index], second], limit)
                    if not hit or (query.cull and not front):
                        continue
                    primitive = block.primitive[second]
                    if not found or t < best or (t == best and primitive < result.primitive):
                        found = True
                        best = t
                        far = distance_of(best, box.rate, box.scale)
                        result.primitive, result.t, result.u, result.v, result.front = primitive, t, u, v, front
                if found and query.any_hit:
                    break
            else:
                error = kind_error(kinds[index], NODE_KIND)
                if error != NO_ERROR:
                    break
                node = nodes[places[index]]
                base = np.int64(node.base)
                if node.count > 0 and base <= address:
                    error = ORDER
                    break
                if base + node.count > limits[0].blocks:
                    error = OUTSIDE
                    break
                count.node_tests += np.uint32(1)
                if rank > 0:
                    count.revisits += np.uint32(1)
                listed = node_hits(box, far, node, slots, entries)
                rest = listed - rank - 1
                if rest > 0:
                    if height + rest + levels <= room:
                        for place in range(listed - 1, rank, -1):
                            stack_entry[height] = entries[place]
                            stack_address[height] = base + slots[place]
                            stack_leaf[height] = (node.leaf >> slots[place]) & 1 != 0
                            stack_rank[height] = 0
                            height += 1
                    elif height < room:
                        stack_entry[height] = entries[rank + 1]
                        stack_address[height] = address
                        stack_leaf[height] = False
                        stack_rank[height] = rank + 1
                        height += 1
                    else:
                        error = HEADER
                        break
                if rest >= 0:
                    slot = slots[rank]
                    address, leaf, rank = base + slot, (node.leaf >> slot) & 1 != 0, np.int64(0)
                    continue

            while height > 0 and not onward:
                height -= 1
                if stack_entry[height] <= far:
                    address, leaf, rank = stack_address[height], stack_leaf[height], stack_rank[height]
                    onward = True
            if not onward:
                break

        if error != NO_ERROR:
            result.error = error
            result.block = address
        if found and (query.any_hit or error != NO_ERROR):
            result.primitive = 0 if error == NO_ERROR else -1
            result.t, result.u, result.v, result.front = np.float32(0), np.float32(0), np.float32(0), False


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
    """As `traversal_numpy.trace_chunk`."""
    limits = np.zeros(1, dtype=LIMITS)
    limits["stack"] = stack
    for name in ("blocks", "root", "levels"):
        limits[name] = tree.header[name]
    vertices = tree.triangles.view(np.float32).reshape(-1, 2, 9)
    blocks = (tree.kind, tree.place, tree.nodes, tree.leaves, vertices)
    trace_rays(rays, queries, prepared, boxes.view(COMPILED_RAY), results, counts, limits, *blocks)
