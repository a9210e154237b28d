"""Traces rays through a tree in memory, visit by visit as the traversal unit does when a ray makes one at a time.

The front of `traversal_numpy` and `traversal_numba`, which do the same. docs/wide_traversal.md has the rules.
The hits depend on rays and triangles alone, like those of `traversal.trace`; the counts depend on the tree, and a unit
that lets a ray make one visit at a time has the same ones.
"""

from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from lightloom.golden_model.contract.formats import BOX_SETUP, RAY, RAY_QUERY, RAY_RESULT, TRACE_ERRORS, U4, WIDTH
from lightloom.golden_model.tracing.bvh.traversal import backend_of
from lightloom.golden_model.tracing.ray_setup import ray_setup
from lightloom.golden_model.tracing.wide_bvh.box_setup import box_setup
from lightloom.golden_model.tracing.wide_bvh.decode import tree_blocks

COUNTS = np.dtype([("node_tests", U4), ("revisits", U4), ("triangle_tests", U4), ("leaf_visits", U4)])
"""What a ray has cost: tests of a node's children; those of them that were made again because the stack was short of
room; triangle tests; blocks of triangles visited. A visit that makes the ray fail does not count."""

STACK = 24
"""Entries that a ray's stack has room for."""

CHUNK = 16384
"""Rays at a time, as in `traversal`."""


def queries_of(
    rays: np.ndarray,
    any_hit: np.ndarray | bool = False,
    cull: np.ndarray | bool = False,
    mask: np.ndarray | int = 0xFF,
) -> np.ndarray:
    """RAY (N,) to RAY_QUERY (N,); the other fields for all rays or (N,)."""
    queries = np.zeros(len(rays), dtype=RAY_QUERY)
    for name in RAY.names or ():
        queries[name] = rays[name]
    queries["any_hit"], queries["cull"], queries["mask"] = any_hit, cull, mask
    return queries


def trace_tree(
    blocks: np.ndarray,
    queries: np.ndarray,
    *,
    width: int = WIDTH,
    stack: int = STACK,
    bad_blocks: Iterable[int] = (),
    backend: str = "auto",
) -> tuple[np.ndarray, np.ndarray]:
    """Tree uint32 (B, 16), block after block, and RAY_QUERY (N,) to RAY_RESULT (N,) and COUNTS (N,).

    `width` and `stack` are those of the unit: it refuses a tree that is wider, or has more levels than the stack has
    entries, and then all rays fail. For `bad_blocks`, as for all beyond the last, the memory answers with an error.
    Whatever the blocks hold, every ray comes back: with its hit, or failed.
    """
    chunk = _chunk_tracer(backend)
    tree = tree_blocks(blocks, width=width, stack=stack, unreadable=bad_blocks)
    results = np.zeros(len(queries), dtype=RAY_RESULT)
    counts = np.zeros(len(queries), dtype=COUNTS)
    results["primitive"] = -1
    if not tree.usable:
        results["error"] = TRACE_ERRORS["header"]
    for start in range(0, len(queries), CHUNK):
        part = queries[start : start + CHUNK]
        prepared = ray_setup(part)
        invalid = is_invalid(prepared)
        results["invalid"][start : start + CHUNK] = invalid
        if tree.usable:
            ready = np.flatnonzero(~invalid & (prepared["t_min"] < prepared["t_max"]))
            boxes = box_setup(_box_setups(part, prepared, tree.header))
            rows = slice(start, start + CHUNK)
            chunk(tree, stack, part, prepared, boxes, ready, results[rows], counts[rows])
    return results, counts


def is_invalid(prepared: np.ndarray) -> np.ndarray:
    """PREPARED_RAY (N,) to bool (N,): rays that cannot hit anything, wherever triangles are.

    Their direction is one of those that `ray_setup` refuses, their origin is not finite, or t_min or t_max is a NaN.
    """
    finite = np.isfinite(prepared["origin"]).all(axis=1)
    return np.isnan(prepared["shear"][:, 0]) | ~finite | np.isnan(prepared["t_min"]) | np.isnan(prepared["t_max"])


def _box_setups(queries: np.ndarray, prepared: np.ndarray, header: np.ndarray) -> np.ndarray:
    """RAY_QUERY (N,) and PREPARED_RAY (N,) to BOX_SETUP (N,)."""
    setups = np.zeros(len(queries), dtype=BOX_SETUP)
    for name in ("origin", "inverse", "axis", "t_min"):
        setups[name] = prepared[name]
    setups["direction"] = queries["direction"]
    setups["lattice_origin"], setups["lattice_exponent"] = header["lattice_origin"], header["lattice_exponent"]
    return setups


def _chunk_tracer(backend: str) -> Callable[..., Any]:
    """What traces a chunk of rays. Imported when needed: numba takes half a second to load."""
    if backend_of(backend) == "numba":
        from lightloom.golden_model.tracing.wide_bvh import traversal_numba

        return traversal_numba.trace_chunk
    from lightloom.golden_model.tracing.wide_bvh import traversal_numpy

    return traversal_numpy.trace_chunk
