"""Rays against triangles in whole batches, by the golden model and by the Verilog: the same bits from both."""

from collections.abc import Callable
from typing import Protocol

import numpy as np

from golden_model.formats import HIT

BATCH = 1 << 18
"""Rays at a time in the golden model: what the progress bar moves by."""


class Tracer(Protocol):
    """RAY (N,) to HIT (N,), as `golden_model.traversal.trace` defines it; `advance` is told of rays that are done."""

    def __call__(self, rays: np.ndarray, *, any_hit: bool, advance: Callable[[float], None]) -> np.ndarray: ...


def golden_tracer(triangles: np.ndarray) -> Tracer:
    """The golden model's traversal of a tree over TRIANGLE (T,)."""
    from golden_model.bvh import build
    from golden_model.traversal import trace

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
    """Every ray against every triangle of TRIANGLE (T,), through the Verilated ray_setup and ray_triangle units."""
    from golden_model.brute_force import trace_brute_force
    from sim.bulk import BulkUnit

    setup, unit = BulkUnit("ray_setup"), BulkUnit("ray_triangle")

    def tracer(rays: np.ndarray, *, any_hit: bool, advance: Callable[[float], None]) -> np.ndarray:
        return trace_brute_force(triangles, rays, any_hit=any_hit, setup=setup.run, intersect=unit.run, advance=advance)

    return tracer
