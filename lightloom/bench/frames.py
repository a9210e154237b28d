"""Measures where the time of a frame goes: part of `lightloom bench`."""

from collections import Counter
from pathlib import Path

import numpy as np

from lightloom.bench.tree import BUNNY, installed
from lightloom.golden_model.charts.curved import default_cache
from lightloom.golden_model.charts.unwrap import unwrap
from lightloom.golden_model.contract.formats import ONE_SAMPLE
from lightloom.golden_model.engine.sampling.settings import Sampling
from lightloom.golden_model.renderer import Renderer
from lightloom.golden_model.scene.files.load import load_scene
from lightloom.golden_model.structures.structure import Structure

TURNTABLE = Path("scenes/bunny-turntable.toml")
SIDE = 256
BUDGET = 20_000
WARM_UP = 2
"""Frames before the measured ones: the first compile, build the trees and fill the maps."""
FRAMES = 8

GALLERY = Path("scenes/moving-viewpoint.toml")
LARGE_TEXEL = 0.0165
"""Side of a texel with which the gallery has a million and a half of them."""
LARGE_SIZE = 1920, 1080
LARGE_BUDGET = 500_000
LARGE_FRAMES = 4
THREADS = 1, 2


def measure() -> dict[str, dict[str, dict[str, float]]]:
    """Seconds a frame by scene, backend and stage, means of `FRAMES`; one thread. numba only where it is installed."""
    scenes = ["cornell-box", *([str(TURNTABLE)] if BUNNY.exists() and TURNTABLE.exists() else [])]
    figures: dict[str, dict[str, dict[str, float]]] = {}
    for name in scenes:
        scene = load_scene(name)
        lightmaps = unwrap(scene, trace=Structure(scene).trace, cache=default_cache())
        # The bunny by NumPy takes a second a frame for its rays; numba says where the rest of the time goes.
        wanted = ("numpy", "numba") if name == "cornell-box" else ("numba",)
        for backend in filter(installed, wanted):
            renderer = Renderer(scene, width=SIDE, height=SIDE, budget=BUDGET, lightmaps=lightmaps, backend=backend)
            figures.setdefault(Path(name).stem, {})[backend] = _means(renderer, FRAMES)
    return figures


def measure_large() -> dict[str, dict[str, float]]:
    """Seconds a frame of the gallery by number of threads and stage, means of `LARGE_FRAMES`; numba, where it is.

    To prime so many texels takes minutes, and how long a frame takes depends little on what they know, so each begins
    with one made-up sample.
    """
    scene = load_scene(GALLERY)
    width, height = LARGE_SIZE
    lightmaps = unwrap(scene, LARGE_TEXEL, trace=Structure(scene).trace)
    unprimed = Sampling(priming=0)
    first = Renderer(scene, width=width, height=height, budget=LARGE_BUDGET, lightmaps=lightmaps, sampling=unprimed)
    order, state = first.maintainer.selector.order, first.state
    state["count"][order], state["number"][order], state["spread"][order] = ONE_SAMPLE, 1, 32
    state["irradiance"][order] = np.random.default_rng(0).uniform(0.5, 1, (len(order), 3))
    figures = {}
    for threads in THREADS:
        renderer = Renderer(
            scene, width=width, height=height, budget=LARGE_BUDGET, lightmaps=lightmaps, threads=threads, like=first
        )
        figures[f"{len(order):,} texels, {threads} thread{'s' * (threads > 1)}"] = _means(renderer, LARGE_FRAMES)
    return figures


def _means(renderer: Renderer, frames: int) -> dict[str, float]:
    """Seconds of so many frames by stage, on average, after those that warm up."""
    total: Counter[str] = Counter()
    for number in range(WARM_UP + frames):
        seconds = renderer.frame().seconds
        if number >= WARM_UP:
            total.update(seconds)
    return {stage: value / frames for stage, value in total.items()}
