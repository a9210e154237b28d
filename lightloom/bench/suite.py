"""What `lightloom bench` measures: each benchmark is a function that returns rows ready for JSON."""

import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

SEED = 81


@dataclass(frozen=True, kw_only=True)
class Sizes:
    """How much is measured."""

    vectors: int = 1_000_000
    """Operands through a Verilated unit."""
    rays: int = 200_000
    """Rays a scene, backend and kind of hit."""


Row = dict[str, Any]
"""`benchmark`, `what`, `value`, `unit` ("1/s", "s", …)."""


def _row(benchmark: str, what: str, value: float, unit: str) -> Row:
    return {"benchmark": benchmark, "what": what, "value": value, "unit": unit}


def ray_triangle_vectors(sizes: Sizes) -> Iterator[Row]:
    """Ray-triangle tests a second, through the Verilated unit and by the model."""
    from lightloom.golden_model.scene.files.load import load_scene
    from lightloom.golden_model.stimuli.ray_families import diffuse_rays
    from lightloom.golden_model.tracing.ray_setup import ray_setup
    from lightloom.golden_model.tracing.ray_triangle import ray_triangle, triangle_tests
    from lightloom.sim.bulk import BulkUnit

    triangles = load_scene("cornell-box").triangles
    prepared = ray_setup(diffuse_rays(triangles, sizes.vectors, SEED))
    index = np.random.default_rng(SEED).integers(0, len(triangles), sizes.vectors)
    tests = triangle_tests(prepared, triangles[index])
    unit = BulkUnit("ray_triangle")
    unit.run(tests)
    yield _row("ray-triangle", "Verilated, one core", unit.throughput, "tests/s")
    yield _row("ray-triangle", "cycles a test", unit.cycles / sizes.vectors, "cycles")
    started = time.perf_counter()
    ray_triangle(tests)
    yield _row("ray-triangle", "golden model, NumPy", sizes.vectors / (time.perf_counter() - started), "tests/s")


def tracing(sizes: Sizes) -> Iterator[Row]:
    """Golden model on Cornell box and bunny: tree build, rays a second by NumPy and numba."""
    from lightloom.bench.tree import measure

    for scene, figures in measure(sizes.rays).items():
        name = f"{scene} ({figures['triangles']:,} triangles)"
        yield _row("tracing", f"{name}: tree", figures["build_s"], "s")
        for kind in ("closest", "any"):
            for backend in ("numpy", "numba"):
                if backend in figures[kind]:
                    yield _row("tracing", f"{name}: {kind} hit, {backend}", figures[kind][backend], "rays/s")
            yield _row("tracing", f"{name}: {kind} hit, inner nodes", figures[kind]["nodes"], "per ray")
            yield _row("tracing", f"{name}: {kind} hit, triangle tests", figures[kind]["tests"], "per ray")


def frames(sizes: Sizes) -> Iterator[Row]:
    """Stages of a frame of 256x256 with 20,000 maintenance rays: Cornell box, and the turning bunny where it is."""
    from lightloom.bench.frames import measure

    for scene, backends in measure().items():
        for backend, stages in backends.items():
            yield from _stages("frames", f"{scene}, {backend}", stages)


def large_frames(sizes: Sizes) -> Iterator[Row]:
    """Stages of a frame of 1920x1080 with 500,000 rays for 1.5 million texels; takes some minutes."""
    from lightloom.bench.frames import measure_large

    for what, stages in measure_large().items():
        yield from _stages("large-frames", what, stages)


def _stages(benchmark: str, what: str, stages: dict[str, float]) -> Iterator[Row]:
    yield _row(benchmark, f"{what}: together", sum(stages.values()), "s/frame")
    for stage, seconds in sorted(stages.items(), key=lambda item: -item[1]):
        yield _row(benchmark, f"{what}: {stage}", seconds, "s/frame")


def emission(sizes: Sizes) -> Iterator[Row]:
    """Time to emit Verilog and manifests of all units, for each preset."""
    from lightloom.hardware.describe import emit_units
    from lightloom.rtl.catalogue import CATALOGUE
    from lightloom.rtl.config import PRESETS

    with tempfile.TemporaryDirectory(prefix="lightloom-") as scratch:
        for preset in PRESETS:
            started = time.perf_counter()
            emit_units(list(CATALOGUE), preset, Path(scratch) / preset)
            yield _row("emission", f"{len(CATALOGUE)} units, {preset}", time.perf_counter() - started, "s")


BENCHMARKS: dict[str, Callable[[Sizes], Iterator[Row]]] = {
    "ray-triangle": ray_triangle_vectors,
    "tracing": tracing,
    "frames": frames,
    "large-frames": large_frames,
    "emission": emission,
}

LONG = ("large-frames",)
"""Those that are measured only where they are asked for by name."""


def summary(name: str) -> str:
    """A benchmark's line of explanation."""
    return (BENCHMARKS[name].__doc__ or "").splitlines()[0]
