"""Traces rays through a tree: the front of `traversal_numpy` and `traversal_numba`, which do the same.

The result depends on the rays and the triangles alone (docs/traversal.md says why), so both backends, every tree and
brute force agree in all bits. Both backends also visit the same nodes and make the same tests for each ray:

- of two children that the ray enters, the one with the nearer entry is visited first (equal: the left one) and the
  other waits on a stack; when it is taken from the stack it is dropped if its entry lies beyond the best hit by then;
- the triangles of a leaf enter the triangle test together, with the best hit so far as their t_max, as they do in a
  pipeline that has the first one's result only when the last has long been started.
"""

from collections.abc import Callable
from importlib.util import find_spec
from typing import Any

import numpy as np

from lightloom.golden_model.contract.formats import HIT
from lightloom.golden_model.host.errors import InputError
from lightloom.golden_model.tracing.bvh.build import Bvh
from lightloom.golden_model.tracing.bvh.ray_box import box_rays
from lightloom.golden_model.tracing.ray_setup import ray_setup
from lightloom.golden_model.tracing.recorder import TestRecorder

BACKENDS = ("auto", "numpy", "numba")

CHUNK = 16384
"""Rays at a time: enough to hide Python's cost a step, few enough that their state stays in the processor's cache."""


def backend_of(name: str) -> str:
    """The backend that `name` stands for here: "auto" is numba where it is installed and numpy elsewhere.

    Raises InputError for an unknown name and for numba where it is not installed.
    """
    if name not in BACKENDS:
        raise InputError(f"backend {name}: unknown; choose one of {', '.join(BACKENDS)}")
    installed = find_spec("numba") is not None
    if name == "numba" and not installed:
        raise InputError("backend numba: not installed; install lightloom[fast] or choose numpy")
    return ("numba" if installed else "numpy") if name == "auto" else name


def trace(
    bvh: Bvh,
    rays: np.ndarray,
    *,
    any_hit: bool = False,
    backend: str = "auto",
    recorder: TestRecorder | None = None,
) -> np.ndarray:
    """RAY (N,) to HIT (N,): the nearest triangle within t_min < t <= t_max; equal t goes to the lower index.

    With `any_hit` only whether there is such a triangle: `primitive` is 0 or -1 and everything else zero, because which
    triangle is met first depends on the tree. Triangles are two-sided. A ray that `ray_setup` calls invalid misses.
    `recorder` counts and samples the ray-triangle tests.
    """
    chunk = _chunk_tracer(backend)
    hits = np.zeros(len(rays), dtype=HIT)
    hits["primitive"] = -1
    for start in range(0, len(rays) if len(bvh.count) else 0, CHUNK):
        part = rays[start : start + CHUNK]
        prepared = ray_setup(part)
        # The triangle test misses for every other ray, so that none needs to start.
        ready = np.flatnonzero(
            ~np.isnan(prepared["shear"][:, 0])
            & np.isfinite(prepared["origin"].T).all(axis=0)
            & (prepared["t_min"] < prepared["t_max"])
        )
        slabs = box_rays(prepared, part["direction"], bvh.lower[0], bvh.upper[0])
        hits[start : start + CHUNK] = chunk(bvh, prepared, slabs, ready, any_hit, recorder)
        if recorder is not None:
            recorder.rays += len(part)
    return hits


def _chunk_tracer(backend: str) -> Callable[..., Any]:
    """What traces a chunk of rays. Imported when needed: numba takes half a second to load."""
    if backend_of(backend) == "numba":
        from lightloom.golden_model.tracing.bvh import traversal_numba

        return traversal_numba.trace_chunk
    from lightloom.golden_model.tracing.bvh import traversal_numpy

    return traversal_numpy.trace_chunk
