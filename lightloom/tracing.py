"""Rays against triangles in whole batches, by the golden model and by the Verilog: the same bits from both."""

from collections.abc import Callable
from typing import Protocol

import numpy as np

from golden_model.formats import HIT
from golden_model.ray_triangle import triangle_tests

BATCH = 1 << 18
"""Rays at a time in the golden model: what the progress bar moves by."""
PAIRS = 1 << 20
"""Ray-triangle pairs at a time in the Verilog: bounds the memory (about 200 bytes a pair)."""


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
    from sim.bulk import BulkUnit

    setup, unit = BulkUnit("ray_setup"), BulkUnit("ray_triangle")
    count = len(triangles)
    step = max(1, PAIRS // count)

    def tracer(rays: np.ndarray, *, any_hit: bool, advance: Callable[[float], None]) -> np.ndarray:
        prepared = setup.run(rays)
        hits = np.zeros(len(rays), dtype=HIT)
        for start in range(0, len(rays), step):
            some = prepared[start : start + step]
            tests = triangle_tests(np.repeat(some, count), np.tile(triangles, len(some)))
            found = unit.run(tests).reshape(len(some), count)
            # The nearest; argmin takes the first of equal ones, which is the lower index.
            nearest = np.argmin(np.where(found["hit"], found["t"], np.inf), axis=1)
            best = found[np.arange(len(some)), nearest]
            part = hits[start : start + step]
            part["primitive"] = np.where(best["hit"], 0 if any_hit else nearest, -1)
            for name in () if any_hit else ("t", "u", "v", "front"):
                part[name] = best[name]
            advance(len(some))
        return hits

    return tracer
