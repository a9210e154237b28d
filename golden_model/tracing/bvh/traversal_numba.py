"""The compiled twin of `traversal_numpy`, ray by ray: the same nodes, tests and bits. Needs numba."""

from typing import Any

import numpy as np

from lightloom.golden_model.contract.formats import HIT
from lightloom.golden_model.numerics import floats
from lightloom.golden_model.tracing import ray_setup, ray_triangle
from lightloom.golden_model.tracing import recorder as recording
from lightloom.golden_model.tracing.bvh.build import Bvh
from lightloom.golden_model.tracing.compiled import cached, compiled
from lightloom.golden_model.tracing.recorder import TestRecorder

ZERO = np.float32(0)
ONE = np.float32(1)
TINY = floats.TINY
NEXT_AXES = ray_setup.NEXT_AXES
RECIPROCAL_LIMIT = ray_triangle.RECIPROCAL_LIMIT
HALF_WORD = np.uint64(32)

mix = compiled(recording.mix)

KEPT = np.dtype([("ray", np.int64), ("slot", np.int64), ("t_max", np.float32)])
"""A test to be recorded: its ray, the slot of its triangle, and t_max as it was then."""


@compiled
def flush(x: Any) -> Any:
    """`floats.flush`."""
    return x * ZERO if abs(x) < TINY else x


@compiled
def difference_of_products(a: Any, b: Any, c: Any, d: Any) -> Any:
    """`floats.difference_of_products`."""
    p = np.float64(a) * np.float64(b)
    q = -(np.float64(c) * np.float64(d))
    s = p + q
    virtual = s - p
    error = (p - (s - virtual)) + (q - virtual)
    pattern = np.float64(s).view(np.int64)
    step = np.int64(0)
    if error != 0 and np.isfinite(s) and pattern & 1 == 0:
        step = np.int64(1) if (error > 0) == (s > 0) else np.int64(-1)
    odd = pattern + step
    return flush(np.float32(np.int64(odd).view(np.float64)))


@compiled
def sheared(vertices: Any, corner: int, ray: Any, kx: int, ky: int) -> tuple[Any, Any, Any]:
    """A vertex seen from the ray: the same-named part of `ray_triangle`."""
    z = flush(flush(vertices[corner + ray.axis]) - ray.origin[ray.axis])
    x = flush(flush(vertices[corner + kx]) - ray.origin[kx])
    y = flush(flush(vertices[corner + ky]) - ray.origin[ky])
    return flush(x - flush(ray.shear[0] * z)), flush(y - flush(ray.shear[1] * z)), z


@compiled
def intersect_triangle(ray: Any, vertices: Any, t_max: Any) -> tuple[Any, Any, Any, Any, Any]:
    """`ray_triangle.ray_triangle` without culling, for a PREPARED_RAY record and nine coordinates."""
    kx, ky = NEXT_AXES[ray.axis]
    if ray.flip:
        kx, ky = ky, kx
    ax, ay, az = sheared(vertices, 0, ray, kx, ky)
    bx, by, bz = sheared(vertices, 3, ray, kx, ky)
    cx, cy, cz = sheared(vertices, 6, ray, kx, ky)

    edge_a = difference_of_products(cx, by, cy, bx)
    edge_b = difference_of_products(ax, cy, ay, cx)
    edge_c = difference_of_products(bx, ay, by, ax)
    negative = edge_a < ZERO or edge_b < ZERO or edge_c < ZERO
    positive = edge_a > ZERO or edge_b > ZERO or edge_c > ZERO
    if negative and positive:
        return False, ZERO, ZERO, ZERO, False

    reciprocal = flush(ONE / flush(flush(edge_a + edge_b) + edge_c))
    depth = flush(flush(flush(edge_a * az) + flush(edge_b * bz)) + flush(edge_c * cz))
    t = flush(flush(depth * ray.shear[2]) * reciprocal)
    usable = abs(reciprocal) < RECIPROCAL_LIMIT and reciprocal != ZERO
    if not (usable and np.isfinite(t) and ray.t_min < t and t <= t_max):
        return False, ZERO, ZERO, ZERO, False
    return True, t, abs(flush(edge_b * reciprocal)), abs(flush(edge_c * reciprocal)), positive


@compiled
def intersect_box(slabs: Any, lower: Any, upper: Any, t_min: Any, t_max: Any) -> tuple[Any, Any]:
    """`ray_box.ray_box` for one ray and one box."""
    entry, leave = t_min, t_max
    for k in range(3):
        inverse = slabs[6 + k]
        near = (lower[k] - slabs[k]) * inverse
        far = (upper[k] - slabs[3 + k]) * inverse
        if np.signbit(inverse):
            near, far = far, near
        # A NaN changes nothing.
        if near > entry:
            entry = near
        if far < leave:
            leave = far
    return entry, entry <= leave


@cached
def trace_rays(
    sources: Any,  # left out by callers: `cached` says why
    rays: Any,  # int64 (M,): which rays to trace, as indices into the next three
    prepared: Any,  # PREPARED_RAY (N,)
    slabs: Any,  # float32 (N, 9)
    hits: Any,  # HIT (N,), all misses
    lower: Any,
    upper: Any,
    first: Any,
    count: Any,
    primitive: Any,
    vertices: Any,  # float32 (S, 9), the triangle of each slot
    depth: int,
    any_hit: bool,
    kept: Any,  # KEPT (K,), K >= S where tests are recorded, else (0,)
    offset: Any,
    threshold: Any,
) -> tuple[int, int, int, int]:
    """Traces until all rays are done or `kept` has no room for another ray's tests.

    Returns how many rays were traced, how many tests were kept, and how many nodes visited and tests made.
    """
    stack = np.empty(depth + 1, np.int32)
    entries = np.empty(depth + 1, np.float32)
    nodes, total, held = 0, 0, 0
    for index in range(len(rays)):
        number = rays[index]
        ray, slab, hit = prepared[number], slabs[number], hits[number]
        before = nodes, total, held
        best = ray.t_max
        height, node = 0, 0
        while node >= 0:
            if count[node] == 0:
                nodes += 1
                left = first[node]
                entry, enters = intersect_box(slab, lower[left], upper[left], ray.t_min, best)
                entry_right, enters_right = intersect_box(slab, lower[left + 1], upper[left + 1], ray.t_min, best)
                if enters and enters_right:
                    to_right = entry_right < entry
                    node = left + to_right
                    stack[height] = left + (not to_right)
                    entries[height] = entry if to_right else entry_right
                    height += 1
                    continue
                if enters or enters_right:
                    node = left + enters_right
                    continue
            else:
                limit = best
                for slot in range(first[node], first[node] + count[node]):
                    name = (np.uint64(number) << HALF_WORD) + np.uint64(primitive[slot])
                    if len(kept) and mix(name + offset) <= threshold:
                        if held == len(kept):
                            return index, before[2], before[0], before[1]
                        kept[held].ray, kept[held].slot, kept[held].t_max = number, slot, limit
                        held += 1
                    total += 1
                    found, t, u, v, front = intersect_triangle(ray, vertices[slot], limit)
                    if found and any_hit:
                        hit.primitive = 0
                    elif found and (t < best or (t == best and (hit.primitive < 0 or primitive[slot] < hit.primitive))):
                        best = t
                        hit.primitive, hit.t, hit.u, hit.v, hit.front = primitive[slot], t, u, v, front
                if any_hit and hit.primitive >= 0:
                    break
            node = -1
            while height > 0 and node < 0:
                height -= 1
                if entries[height] <= best:
                    node = stack[height]
    return len(rays), held, nodes, total


def trace_chunk(
    bvh: Bvh, prepared: np.ndarray, slabs: np.ndarray, rays: np.ndarray, any_hit: bool, recorder: TestRecorder | None
) -> np.ndarray:
    """As `traversal_numpy.trace_chunk`."""
    hits = np.zeros(len(prepared), dtype=HIT)
    hits["primitive"] = -1
    vertices = bvh.slots.view(np.float32).reshape(-1, 9)
    kept = np.zeros(max(len(vertices), 1 << 14) if recorder else 0, dtype=KEPT)
    tree = (bvh.lower, bvh.upper, bvh.first, bvh.count, bvh.primitive, vertices, bvh.depth)
    slabs = np.ascontiguousarray(slabs.T)
    while len(rays):
        offset, threshold = (
            (recorder.offset_of_call(), recorder.threshold) if recorder else (np.uint64(0), np.uint64(0))
        )
        done, held, nodes, total = trace_rays(rays, prepared, slabs, hits, *tree, any_hit, kept, offset, threshold)
        if recorder:
            recorder.nodes += nodes
            recorder.total += total
            part = kept[:held]
            tests = ray_triangle.triangle_tests(prepared[part["ray"]], bvh.slots[part["slot"]])
            tests["t_max"] = part["t_max"]
            recorder.keep(part["ray"] + recorder.rays, bvh.primitive[part["slot"]], tests)
        rays = rays[done:]
    return hits
