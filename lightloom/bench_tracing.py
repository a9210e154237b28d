"""Measures the golden model's tree and traversal: part of `lightloom bench`."""

import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from golden_model.bvh import build
from golden_model.directions import cosine_table, tangent_of, to_world
from golden_model.errors import InputError
from golden_model.formats import RAY
from golden_model.recorder import TestRecorder
from golden_model.scene import load_scene
from golden_model.traversal import backend_of, trace
from golden_model.vectors import cross, interpolate, normalize, subtract

BUNNY = Path("build/meshes/bunny.obj")
SEED = 80


def measure(rays: int = 200_000) -> dict[str, dict[str, Any]]:
    """Figures of the Cornell box and, where `make meshes` has put it, the bunny, by scene name.

    Each has: `triangles`; `build_s`; `sah_cost`; for "closest" and "any" hit, a ray: `nodes` (two boxes tested each)
    and `tests`; and rays/s on one core by backend (numba only where it is installed). The rays start uniformly on the
    surfaces, on their front sides, in cosine-distributed directions.
    """
    scenes = ["cornell-box", *([str(BUNNY)] if BUNNY.exists() else [])]
    return {Path(name).stem: _measure_scene(load_scene(name).triangles, rays) for name in scenes}


def _measure_scene(triangles: np.ndarray, count: int) -> dict[str, Any]:
    bvh, seconds = _timed(partial(build, triangles))
    figures: dict[str, Any] = {"triangles": len(triangles), "build_s": seconds, "sah_cost": bvh.sah_cost}
    rays = surface_rays(triangles, count)
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


def surface_rays(triangles: np.ndarray, count: int) -> np.ndarray:
    """RAY (N,): diffuse rays from points uniform over the surface, lifted by 1e-4 of the scene's size."""
    rng = np.random.default_rng(SEED)
    v0, v1, v2 = triangles["v0"], triangles["v1"], triangles["v2"]
    normal = cross(subtract(v1, v0), subtract(v2, v0))
    area = np.sqrt((normal.astype(np.float64) ** 2).sum(axis=1))
    index = rng.choice(len(triangles), count, p=area / area.sum())
    u, v = rng.random((2, count), dtype=np.float32)
    outside = u + v > 1
    u, v = np.where(outside, 1 - u, u), np.where(outside, 1 - v, v)
    normal = normalize(normal[index])
    local = cosine_table()
    rays = np.zeros(count, dtype=RAY)
    lift = np.float32(1e-4) * np.ptp(np.concatenate([v0, v1, v2]), axis=0).max()
    rays["origin"] = interpolate(v0[index], v1[index], v2[index], u, v) + lift * normal
    rays["direction"] = to_world(local[rng.integers(0, len(local), count)], normal, tangent_of(normal))
    rays["t_max"] = np.inf
    return rays


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
