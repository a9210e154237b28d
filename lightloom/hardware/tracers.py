"""Rays against triangles in whole batches, by the golden model and by the Verilog: the same bits from both."""

from collections.abc import Callable
from typing import Protocol

import numpy as np

from lightloom.golden_model.contract.formats import HIT

BATCH = 1 << 18
"""Rays at a time in the golden model: what the progress bar moves by."""
RTL_BATCH = 1 << 15
"""Rays at a time in the Verilog, for the same reason."""


class Tracer(Protocol):
    """RAY (N,) to HIT (N,), as `traversal.trace` defines it; `advance` is told of rays that are done."""

    def __call__(self, rays: np.ndarray, *, any_hit: bool, advance: Callable[[float], None]) -> np.ndarray: ...


def golden_tracer(triangles: np.ndarray) -> Tracer:
    """The golden model's traversal of a tree over TRIANGLE (T,)."""
    from lightloom.golden_model.tracing.bvh.build import build
    from lightloom.golden_model.tracing.bvh.traversal import trace

    tree = build(triangles)

    def tracer(rays: np.ndarray, *, any_hit: bool, advance: Callable[[float], None]) -> np.ndarray:
        hits = np.zeros(len(rays), dtype=HIT)
        for start in range(0, len(rays), BATCH):
            part = rays[start : start + BATCH]
            hits[start : start + BATCH] = trace(tree, part, any_hit=any_hit)
            advance(len(part))
        return hits

    return tracer


def rtl_tracer(triangles: np.ndarray) -> Tracer:
    """The Verilated traversal unit on a tree over TRIANGLE (T,) in its memory."""
    from lightloom.golden_model.tracing.wide_bvh.encode import build_wide
    from lightloom.golden_model.tracing.wide_bvh.traversal import queries_of
    from lightloom.rtl.config import PRESETS
    from lightloom.sim.traversal import TraversalError, TraversalUnit, memory_bits

    config = PRESETS["base"]
    blocks = build_wide(triangles, width=config.tree.width, max_levels=config.traversal.stack).blocks
    unit = TraversalUnit(config, memory_bits=memory_bits(blocks))

    def tracer(rays: np.ndarray, *, any_hit: bool, advance: Callable[[float], None]) -> np.ndarray:
        hits = np.zeros(len(rays), dtype=HIT)
        for start in range(0, len(rays), RTL_BATCH):
            part = rays[start : start + RTL_BATCH]
            results = unit.run(blocks, queries_of(part, any_hit=any_hit)).results
            if results["error"].any():
                raise TraversalError(f"traversal: a ray failed: {results[results['error'] != 0][0]}")
            for name in HIT.names or ():
                hits[name][start : start + RTL_BATCH] = results[name]
            advance(len(part))
        return hits

    return tracer
