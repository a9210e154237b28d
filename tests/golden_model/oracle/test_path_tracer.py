"""Where the paths of `golden_model.oracle.path_tracer` start: from the triangle that a point lies on."""

from pathlib import Path

import numpy as np
import pytest

from lightloom.golden_model.oracle.path_tracer import irradiance
from lightloom.golden_model.scene.files.load import load_scene
from lightloom.golden_model.structures.structure import Structure

GROUND = """
[camera]
position = [0, 2, 3]
target = [0, 0, 0]
[[point_light]]
position = [-21.21, 17.7365, 11.6423]
intensity = [9000, 9000, 9000]
[[quad]]
name = "ground"
corners = [[-{half}, 0, {half}], [{half}, 0, {half}], [{half}, 0, -{half}], [-{half}, 0, -{half}]]
albedo = [0, 0, 0]
"""
LEAF = """
[[quad]]
name = "leaf {height}"
corners = [[-5e-3, {height}, 5e-3], [5e-3, {height}, 5e-3], [5e-3, {height}, -5e-3], [-5e-3, {height}, -5e-3]]
albedo = [0, 0, 0]
"""


def direct(path: Path, half: float, heights: tuple[float, ...]) -> np.ndarray:
    """Direct irradiance of the ground, 2 * `half` wide, beneath leaves but at their side where light comes in: (N,)."""
    path.write_text(GROUND.format(half=half) + "".join(LEAF.format(height=height) for height in heights))
    scene = load_scene(path)
    x = np.linspace(-4.8e-3, -1.5e-3, 31)
    position = np.stack([x, 0 * x, np.linspace(-4e-3, 4e-3, 31)], axis=1).astype(np.float32)
    normal = np.tile(np.array([0, 1, 0], dtype=np.float32), (31, 1))
    return irradiance(scene, Structure(scene).trace, position, normal, 1)[:, 0]


@pytest.mark.parametrize("half", [1000, 3000])
@pytest.mark.parametrize("heights", [(0.004,), (0.005, 0.004), (0.004, -0.004), (-0.001,)])
def test_a_leaf_near_a_large_ground_is_not_taken_for_the_ground(
    tmp_path: Path, half: float, heights: tuple[float, ...]
) -> None:
    """Rays start 5 mm above the ground that is 2 km wide: a few parts in 10,000 of their way to the lamp."""
    small = direct(tmp_path / "small.toml", 2, heights)
    assert small.min() > 5
    np.testing.assert_allclose(direct(tmp_path / "large.toml", half, heights), small, rtol=2e-3)
