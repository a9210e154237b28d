"""Measures the golden model's tree and traversal: part of `lightloom bench`."""

import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from lightloom.golden_model.host.errors import InputError
from lightloom.golden_model.scene.files.load import load_scene
from lightloom.golden_model.stimuli.ray_families import diffuse_rays
from lightloom.golden_model.tracing.bvh.build import build
from lightloom.golden_model.tracing.bvh.traversal import backend_of, trace
from lightloom.golden_model.tracing.recorder import TestRecorder

BUNNY = Path("build/meshes/bunny.obj")
SEED = 80


def measure(rays: int = 200_000) -> dict[str, dict[str, Any]]:
    """Figures of the Cornell box and, where `make meshes` has put it, the bunny, by scene name.

    Each has: `triangles`; `build_s`; `sah_cost`; for "closest" and "any" hit, a ray: `nodes` (two boxes tested each)
    and `tests`; and rays/s on one core by backend (numba only where it is installed). The rays are those of
    `diffuse_rays`.
    """
    scenes = ["cornell-box", *([str(BUNNY)] if BUNNY.exists() else [])]
    return {Path(name).stem: _measure_scene(load_scene(name).triangles, rays) for name in scenes}


def _measure_scene(triangles: np.ndarray, count: int) -> dict[str, Any]:
    bvh, seconds = _timed(partial(build, triangles))
    figures: dict[str, Any] = {"triangles": len(triangles), "build_s": seconds, "sah_cost": bvh.sah_cost}
    rays = diffuse_rays(triangles, count, SEED)
    backends = [name for name in ("numpy", "numba") if installed(name)]
    for kind, any_hit in (("closest", False), ("any", True)):
        recorder = TestRecorder(1, seed=SEED)
        trace(bvh, rays, any_hit=any_hit, recorder=recorder)
        figures[kind] = {"nodes": recorder.nodes / count, "tests": recorder.total / count}
        for name in backends:
            # The first call may compile.
            trace(bvh, rays[:1], any_hit=any_hit, backend=name)
            _, seconds = _timed(partial(trace, bvh, rays, any_hit=any_hit, backend=name))
            figures[kind][name] = count / seconds
    return figures


def installed(backend: str) -> bool:
    """Whether a backend of the tracer can be used here."""
    try:
        return backend_of(backend) == backend
    except InputError:
        return False


def _timed(function: Callable[[], Any]) -> tuple[Any, float]:
    """The result, and the processor time: all of this runs on one core, which others may share."""
    start = time.process_time()
    result = function()
    return result, time.process_time() - start
