"""Light stays on its side of shelves and walls, from the first frame on; rims and feet have the light that is there."""

from collections.abc import Callable

import numpy as np
import pytest

from lightloom.golden_model.oracle.path_tracer import irradiance
from lightloom.golden_model.rays.surface_shading import readable
from lightloom.golden_model.renderer import Renderer
from lightloom.golden_model.scene.mesh import area_vectors
from lightloom.golden_model.scene.scene import Scene
from lightloom.golden_model.tables.lightmap import bilinear, lightmap_coordinates
from tests.golden_model.leak_scenes import block_through_table, sealed_room, shelf, thin_wall

SEED = 20261130


class Points:
    """Random points of a scene's surface, and what reads there find."""

    def __init__(self, scene: Scene, count: int):
        random = np.random.default_rng(SEED)
        corner = scene.corners.astype(np.float64)
        area = np.sqrt((area_vectors(corner) ** 2).sum(axis=1))
        self.scene = scene
        self.triangle = random.choice(len(area), count, p=area / area.sum())
        self.u, self.v = random.random((2, count), dtype=np.float32)
        fold = self.u + self.v > 1
        self.u[fold], self.v[fold] = 1 - self.u[fold], 1 - self.v[fold]
        a, b, c = (corner[self.triangle, k] for k in range(3))
        self.place = a + self.u[:, None] * (b - a) + self.v[:, None] * (c - a)
        self.normal = (area_vectors(corner) / area[:, None])[self.triangle]
        self.name = np.array(scene.object_names)[scene.object_id[self.triangle]]

    def read(self, renderer: Renderer) -> np.ndarray:
        """Irradiance, mean of the colours."""
        uv = lightmap_coordinates(renderer.lightmaps, self.triangle, self.u, self.v)
        values = readable(renderer.published)
        found = bilinear(renderer.lightmaps, values, self.scene.object_id[self.triangle], uv)
        return np.asarray(found.mean(axis=1).astype(np.float64))


def below_the_shelf(points: Points) -> tuple[np.ndarray, np.ndarray]:
    on_wall = points.name == "wall"
    return on_wall & (points.place[:, 1] < 1.0699), on_wall & (points.place[:, 1] > 1.0901)


def right_of_the_wall(points: Points) -> tuple[np.ndarray, np.ndarray]:
    x, shown = points.place[:, 0], points.name != "lamp"
    return shown & (x > 0.0081), shown & (x < -0.0021)


def in_the_sealed_room(points: Points) -> tuple[np.ndarray, np.ndarray]:
    middle = points.place - [0, 0.6, 0]
    inside = (np.abs(middle) < 0.6001).all(axis=1) & ((middle * points.normal).sum(axis=1) < 0)
    return inside, np.char.startswith(points.name, "outer")


@pytest.mark.parametrize(
    ("scene", "zones"),
    [
        pytest.param(shelf, below_the_shelf, id="shelf"),
        pytest.param(thin_wall, right_of_the_wall, id="thin wall"),
        pytest.param(sealed_room, in_the_sealed_room, id="sealed room"),
    ],
)
def test_no_light_comes_through(scene: Callable[..., Scene], zones: Callable[[Points], tuple]) -> None:
    """At most a hundredth of the lit side's, at every point, while the maps are still noisy."""
    made = scene(0.15)
    renderer = Renderer(made, width=32, height=32, budget=20_000, seed=SEED)
    points = Points(made, 20_000)
    dark, lit = zones(points)
    assert dark.sum() > 500
    for frame in range(9):
        found = points.read(renderer)
        assert found[dark].max() <= 0.01 * np.median(found[lit]), frame
        renderer.frame()


def test_the_rim_under_a_table_and_the_foot_of_a_block_have_their_own_light() -> None:
    made = block_through_table()
    renderer = Renderer(made, width=32, height=32, budget=40_000, seed=SEED)
    for _ in range(8):
        renderer.frame()
    points = Points(made, 200_000)
    side = (points.name == "block") & (np.abs(points.normal[:, 1]) < 0.1)
    found = points.read(renderer)
    height = points.place[:, 1]
    for low, high in ((1.0, 1.0599), (0.0001, 0.06)):
        here = np.flatnonzero(side & (height > low) & (height < high))[:300]
        assert len(here) == 300
        place, normal = points.place[here].astype(np.float32), points.normal[here].astype(np.float32)
        true = irradiance(made, renderer.structure.trace, place, normal, 256, SEED).mean()
        assert found[here].mean() == pytest.approx(true, rel=0.1), (low, high)
