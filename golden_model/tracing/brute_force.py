"""Every ray against every triangle: the oracle of traversal, and the way to trace through a unit in Verilog."""

from collections.abc import Callable

import numpy as np

from lightloom.golden_model.contract.formats import HIT
from lightloom.golden_model.tracing.ray_setup import ray_setup
from lightloom.golden_model.tracing.ray_triangle import ray_triangle, triangle_tests

BATCH = 1 << 18
"""Tests at a time: 20 MB of operands."""


def trace_brute_force(
    triangles: np.ndarray,
    rays: np.ndarray,
    *,
    any_hit: bool = False,
    cull: np.ndarray | bool = False,
    masks: np.ndarray | None = None,
    mask: np.ndarray | int = 0xFF,
    setup: Callable[[np.ndarray], np.ndarray] = ray_setup,
    intersect: Callable[[np.ndarray], np.ndarray] = ray_triangle,
    advance: Callable[[float], None] = lambda rays: None,
) -> np.ndarray:
    """TRIANGLE (T,) and RAY (N,) to HIT (N,), as `traversal.trace` defines it, with all N*T tests made.

    `setup` takes RAY (N,) to PREPARED_RAY (N,), `intersect` RAY_TRIANGLE (M,) to TRIANGLE_HIT (M,): the models, or the
    RTL in a simulator. `advance` is told of rays that are done.

    With `cull`, for all rays or (N,) bool, back faces miss. With `masks`, (T,) uint8, so do triangles whose mask has no
    bit in common with the ray's `mask`, for all rays or (N,) uint8.
    """
    hits = np.zeros(len(rays), dtype=HIT)
    hits["primitive"] = -1
    prepared = setup(rays)
    cull = np.broadcast_to(cull, len(rays))
    mask = np.broadcast_to(np.asarray(mask, dtype=np.uint8), len(rays))
    if masks is None:
        masks = np.full(len(triangles), 0xFF, dtype=np.uint8)
    step = max(BATCH // max(len(triangles), 1), 1)
    for start in range(0, len(rays), step):
        rows = slice(start, start + step)
        for base in range(0, len(triangles), BATCH):
            block = slice(base, base + BATCH)
            seen = (masks[block] & mask[rows, None]) != 0
            _nearest(hits[rows], prepared[rows], cull[rows], triangles[block], seen, base, intersect)
        advance(len(prepared[rows]))
    if any_hit:
        occluded = hits["primitive"] >= 0
        hits[:] = 0
        hits["primitive"] = np.where(occluded, 0, -1)
    return hits


def _nearest(
    best: np.ndarray,
    prepared: np.ndarray,
    cull: np.ndarray,
    triangles: np.ndarray,
    seen: np.ndarray,
    base: int,
    intersect: Callable[[np.ndarray], np.ndarray],
) -> None:
    """Tests PREPARED_RAY (N,) against TRIANGLE (T,), numbered from `base`, and keeps the best HIT (N,) of each ray.

    `cull` (N,) bool; `seen` (N, T) bool says which triangles count.
    """
    rays, count = len(prepared), len(triangles)
    tests = triangle_tests(np.repeat(prepared, count), np.tile(triangles, rays), np.repeat(cull, count))
    results = intersect(tests).reshape(rays, count)
    hit = results["hit"] & seen
    t = np.where(hit, results["t"], np.float32(np.inf))
    row, index = np.arange(rays), np.argmin(t, axis=1)  # of equal ones the first
    found = results[row, index]
    better = hit[row, index] & ((best["primitive"] < 0) | (found["t"] < best["t"]))
    best["primitive"][better] = base + index[better]
    for name in ("t", "u", "v", "front"):
        best[name][better] = found[name][better]
