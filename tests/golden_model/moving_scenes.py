"""Scenes that move, for tests: written as scene descriptions, so that reading them is tested along the way."""

from pathlib import Path

import numpy as np

from lightloom.golden_model.contract.formats import RAY
from lightloom.golden_model.scene.files.load import load_scene
from lightloom.golden_model.scene.scene import Scene

ROOM = """
texel_size = 0.25
[[quad]]
name = "floor"
corners = [[-3, 0, 3], [3, 0, 3], [3, 0, -3], [-3, 0, -3]]
[[quad]]
name = "wall"
corners = [[-3, 0, -3], [3, 0, -3], [3, 3, -3], [-3, 3, -3]]
[[quad]]
name = "lamp"
corners = [[-0.5, 2.9, -0.5], [0.5, 2.9, -0.5], [0.5, 2.9, 0.5], [-0.5, 2.9, 0.5]]
emission = [8, 6, 4]
"""

# A ball that shifts and turns, a box that turns about an edge like a door and goes away for a while, a lamp that is
# dimmed where it hangs, and a point light that wanders.
MOVING = (
    ROOM
    + """
[[quad.path]]
frame = 4
[[quad.path]]
frame = 8
emission = 0.25
[[sphere]]
name = "ball"
center = [-1, 1, 0]
radius = 0.7
subdivisions = 3
coarse_subdivisions = 1
loop = 12
[[sphere.path]]
frame = 0
[[sphere.path]]
frame = 6
translate = [1.5, 0.25, 0.5]
rotate = [1, 0.3, 1, 0.2]
[[sphere.path]]
frame = 12
translate = [0, 0, 0]
rotate = [1, 0, 0, 0]
[[box]]
name = "door"
center = [1.5, 1, -1]
size = [1, 2, 0.1]
pivot = [2, 0, -1]
[[box.path]]
frame = 2
[[box.path]]
frame = 6
rotate = [1, 0, 1, 0]
[[box.path]]
frame = 9
present = false
[[box.path]]
frame = 11
present = true
[[point_light]]
position = [0, 2, 2]
intensity = [1, 1, 1]
[[point_light.path]]
frame = 0
[[point_light.path]]
frame = 10
position = [2, 2, 2]
intensity = [0, 2, 4]
"""
)


def scene_of(folder: Path, text: str) -> Scene:
    """The scene that a description describes."""
    path = folder / "scene.toml"
    path.write_text(text, encoding="utf-8")
    return load_scene(path)


def rays_through(scene: Scene, count: int, seed: int) -> np.ndarray:
    """RAY (N,) from anywhere around the scene at rest towards points of its triangles, some of limited length."""
    random = np.random.default_rng(seed)
    corners = scene.corners
    low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
    rays = np.zeros(count, dtype=RAY)
    rays["origin"] = random.uniform(low - 0.2, high + 0.2, (count, 3))
    weight = random.dirichlet((1, 1, 1), count)[..., None]
    target = (corners[random.integers(len(corners), size=count)] * weight).sum(axis=1)
    rays["direction"] = target - rays["origin"] + random.normal(0, 0.05, (count, 3))
    rays["t_max"] = np.where(random.random(count) < 0.3, random.random(count), np.inf)
    return rays
