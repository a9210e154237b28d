"""Measures where the time of a frame goes: part of `lightloom bench`."""

from collections import Counter
from pathlib import Path

from lightloom.bench.tree import BUNNY, installed
from lightloom.golden_model.charts.curved import default_cache
from lightloom.golden_model.charts.unwrap import unwrap
from lightloom.golden_model.renderer import Renderer
from lightloom.golden_model.scene.files.load import load_scene
from lightloom.golden_model.tracing.bvh.structure import Structure

TURNTABLE = Path("scenes/bunny-turntable.toml")
SIDE = 256
BUDGET = 20_000
WARM_UP = 2
"""Frames before the measured ones: the first compile, build the trees and fill the maps."""
FRAMES = 8


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
            total: Counter[str] = Counter()
            for number in range(WARM_UP + FRAMES):
                seconds = renderer.frame().seconds
                if number >= WARM_UP:
                    total.update(seconds)
            stages = {stage: value / FRAMES for stage, value in total.items()}
            figures.setdefault(Path(name).stem, {})[backend] = stages
    return figures
