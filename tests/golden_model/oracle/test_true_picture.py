"""Path-traced pictures against a closed form, and what they refuse."""

from pathlib import Path

import numpy as np
import pytest

from lightloom.golden_model.host.errors import InputError
from lightloom.golden_model.oracle.true_picture import require_path_traced, true_picture
from lightloom.golden_model.renderer import Renderer
from lightloom.golden_model.scene.files.load import load_scene
from lightloom.golden_model.structures.structure import Structure

FLOOR = """
[camera]
position = [0, 3, 4]
target = [0, 0, 0]
fov_y_tan = 0.5
[[point_light]]
position = [0.5, 2, 0.25]
intensity = [9, 6, 3]
[[quad]]
corners = [[-1, 0, 1], [1, 0, 1], [1, 0, -1], [-1, 0, -1]]
albedo = [0.5, 0.25, 1.0]
[[quad]]
name = "back"
corners = [[2, 0, 1], [2, 0, -1], [3, 0, -1], [3, 0, 1]]
"""


def test_a_floor_under_a_point_light(tmp_path: Path) -> None:
    """Radiance is albedo / pi * intensity * cosine / distance**2 at the pixel's own point, once."""
    path = tmp_path / "floor.toml"
    path.write_text("texel_size = 0.5\n" + FLOOR)
    scene = load_scene(path)
    renderer = Renderer(scene, width=64, height=48, budget=400)
    gbuffer = renderer.frame().gbuffer
    told: list[tuple[int, int]] = []
    found = true_picture(scene, gbuffer, Structure(scene, "numpy").trace, 2, 0, lambda *done: told.append(done))
    seen = (gbuffer["primitive"] >= 0) & (gbuffer["primitive"] < 2)
    assert seen.sum() > 100
    triangle = scene.triangles[gbuffer["primitive"][seen]]
    u, v = (gbuffer[name][seen][:, None].astype(np.float64) for name in ("u", "v"))
    point = triangle["v0"] * (1 - u - v) + triangle["v1"] * u + triangle["v2"] * v
    way = np.array([0.5, 2, 0.25]) - point
    square = (way**2).sum(axis=1)
    arriving = (way[:, 1] / square**1.5)[:, None] * np.array([9, 6, 3])
    np.testing.assert_allclose(found[seen], np.array([0.5, 0.25, 1.0]) / np.pi * arriving, rtol=1e-4)
    assert not found[~seen].any(), "the back of the other quad, and where nothing is"
    assert told[-1][0] == told[-1][1] == 2 * seen.sum()


@pytest.mark.parametrize("material", ["mirror", "glass"])
def test_mirrors_and_glass_are_refused(tmp_path: Path, material: str) -> None:
    path = tmp_path / "mirror.toml"
    path.write_text(FLOOR + f'material = "{material}"\n')
    with pytest.raises(InputError, match="--true: the scene has mirrors or glass"):
        require_path_traced(load_scene(path))
