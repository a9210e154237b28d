"""The compiled twin of `brute_force`, for scenes too large for it: every ray against every triangle. Needs numba.

The triangle test is the compiled one of `traversal_numba`; NumPy's `trace_brute_force` remains the definition.
"""

from typing import Any

import numpy as np

from lightloom.golden_model.contract.formats import HIT
from lightloom.golden_model.tracing.bvh.traversal_numba import intersect_triangle
from lightloom.golden_model.tracing.compiled import compiled
from lightloom.golden_model.tracing.ray_setup import ray_setup

BLOCK = 4096
"""Triangles at a time: they stay in the processor's cache while all rays meet them."""


@compiled
def trace_block(
    prepared: Any, cull: Any, mask: Any, vertices: Any, masks: Any, base: int, hits: Any, best: Any, any_hit: bool
) -> None:
    """PREPARED_RAY (N,) against triangles (T, 9), numbered from `base`: betters HIT (N,) and its t `best` (N,).

    `cull` (N,) bool, `mask` (N,) and `masks` (T,) uint8.
    """
    for number in range(len(prepared)):
        ray, hit = prepared[number], hits[number]
        if any_hit and hit.primitive >= 0:
            continue
        for index in range(len(vertices)):
            if masks[index] & mask[number] == 0:
                continue
            found, t, u, v, front = intersect_triangle(ray, vertices[index], ray.t_max)
            if cull[number] and not front:
                continue
            if found and any_hit:
                hit.primitive = 0
                break
            # The first of equal ones stays: it has the lowest index.
            if found and (hit.primitive < 0 or t < best[number]):
                best[number] = t
                hit.primitive, hit.t, hit.u, hit.v, hit.front = base + index, t, u, v, front


def trace_brute_force(
    triangles: np.ndarray,
    rays: np.ndarray,
    *,
    any_hit: bool = False,
    cull: np.ndarray | bool = False,
    masks: np.ndarray | None = None,
    mask: np.ndarray | int = 0xFF,
) -> np.ndarray:
    """As `brute_force.trace_brute_force`, in all bits: TRIANGLE (T,) and RAY (N,) to HIT (N,), all N*T tests.

    With `any_hit` a ray is done at its first hit.
    """
    hits = np.zeros(len(rays), dtype=HIT)
    hits["primitive"] = -1
    best = np.zeros(len(rays), dtype=np.float32)
    prepared = ray_setup(rays)
    vertices = np.ascontiguousarray(triangles).view(np.float32).reshape(-1, 9)
    cull = np.broadcast_to(cull, len(rays)).astype(bool)
    mask = np.broadcast_to(np.asarray(mask, dtype=np.uint8), len(rays)).copy()
    if masks is None:
        masks = np.full(len(triangles), 0xFF, dtype=np.uint8)
    for base in range(0, len(vertices), BLOCK):
        block = slice(base, base + BLOCK)
        trace_block(prepared, cull, mask, vertices[block], masks[block], base, hits, best, any_hit)
    return hits
