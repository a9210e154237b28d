"""Reduced geometry: near the fine one, and shaded from the fine one's texels."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

from lightloom.golden_model.charts.unwrap import unwrap
from lightloom.golden_model.contract.formats import RAY
from lightloom.golden_model.driver.geometry import Geometries
from lightloom.golden_model.numerics.vectors import vector
from lightloom.golden_model.rays.surface_shading import Surfaces, diffuse_radiance
from lightloom.golden_model.scene.coarse_geometry import coarse_links, decimated, fine_triangles
from lightloom.golden_model.scene.mesh import area_vectors
from lightloom.golden_model.scene.nearest import nearest
from lightloom.golden_model.scene.parts import Part
from lightloom.golden_model.scene.pose import scene_at
from lightloom.golden_model.scene.scene import Scene
from lightloom.golden_model.structures.structure import Structure
from lightloom.golden_model.tables.lightmap import VALID
from tests.golden_model.moving_scenes import MOVING, ROOM, rays_through, scene_of

SEED = 20250312

BALL = '[[sphere]]\nname = "ball"\ncenter = [0, 1.2, 0]\nradius = 1\nsubdivisions = 4\ncoarse_subdivisions = 2\n'


@pytest.fixture(scope="module")
def ball(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    return scene_of(tmp_path_factory.mktemp("ball"), ROOM + BALL)


def torus(materials: int = 1, texture_uv: np.ndarray | None = None) -> Part:
    corners = np.asarray(trimesh.creation.torus(1, 0.4, major_sections=64, minor_sections=32).triangles)
    return Part(
        name="torus",
        corners=corners.astype(np.float32),
        albedo=np.full((materials, 3), 0.5, dtype=np.float32),
        emission=np.zeros((materials, 3), dtype=np.float32),
        # One material on each side of the plane x = 0.
        material=(corners.mean(axis=1)[:, 0] > 0).astype(np.int32) % materials,
        texture_uv=texture_uv,
    )


def test_a_reduced_mesh_is_smaller_and_near() -> None:
    fine = torus()
    coarse = decimated(fine, 0.1)
    assert coarse is not None
    assert 0.05 < len(coarse.corners) / len(fine.corners) <= 0.11
    # Distance from the ring of a torus about z: all points lie about 0.4 from the circle of radius 1.
    points = coarse.corners.reshape(-1, 3).astype(np.float64)
    around = np.hypot(np.hypot(points[:, 0], points[:, 1]) - 1, points[:, 2])
    assert np.abs(around - 0.4).max() < 0.03
    outward = (area_vectors(coarse.corners) * (coarse.corners.mean(axis=1) - _ring(coarse.corners.mean(axis=1)))).sum(1)
    assert (outward > 0).all()


def _ring(points: np.ndarray) -> np.ndarray:
    """The nearest points of the circle in the middle of the torus."""
    flat = points * (1, 1, 0)
    return flat / np.linalg.norm(flat, axis=1)[:, None]


def test_a_reduced_mesh_keeps_materials_and_texture_coordinates() -> None:
    fine = torus()
    # Coordinates that follow the place, so that they can be told from it.
    coordinates = np.ascontiguousarray(fine.corners[..., :2])
    coarse = decimated(torus(materials=2, texture_uv=coordinates), 0.2)
    assert coarse is not None
    assert coarse.texture_uv is not None
    middle = coarse.corners.mean(axis=1)[:, 0]
    clear = np.abs(middle) > 0.1
    assert (coarse.material[clear] == (middle[clear] > 0)).all()
    assert np.median(np.abs(coarse.texture_uv - coarse.corners[..., :2])) < 0.01


def test_what_cannot_be_reduced_stays_fine() -> None:
    box = np.asarray(trimesh.creation.box().triangles, dtype=np.float32)
    part = Part(
        name="box",
        corners=box[:4],
        albedo=np.ones((1, 3), dtype=np.float32),
        emission=np.zeros((1, 3), dtype=np.float32),
        material=np.zeros(4, dtype=np.int32),
    )
    assert decimated(part, 0.1) is None


def test_coarse_scenes_have_the_same_objects_and_materials(ball: Scene) -> None:
    coarse = ball.coarse
    assert coarse is not None
    assert coarse.object_names == ball.object_names
    assert len(coarse.triangles) == 6 + 320
    assert len(ball.triangles) == 6 + 5120
    for name in ("albedo", "emission", "surface", "texture", "material_object"):
        assert getattr(coarse, name) is getattr(ball, name), name
    assert fine_triangles(ball).tolist() == [0, 1, 2, 3, 4, 5] + [-1] * 320


def test_links_are_near_and_face_the_same_way(ball: Scene) -> None:
    maps, coarse = unwrap(ball), ball.coarse
    assert coarse is not None
    links = coarse_links(maps, ball)
    assert links.shape == (len(coarse.triangles), 3)
    assert (maps.texels["state"][links] == VALID).all()
    assert (maps.texels["object"][links] == coarse.object_id[:, None]).all()
    away = np.linalg.norm(maps.texels["position"][links] - coarse.corners, axis=2)
    assert away.max() < 1.5 * ball.texel_size
    assert (maps.texels["normal"][links] * coarse.normals).sum(axis=2).min() > 0.5


def test_coarse_hits_show_what_fine_ones_do(ball: Scene) -> None:
    """Light that falls off over the scene, seen on the reduced ball and on walls that are not reduced."""
    maps = unwrap(ball)
    # A smooth light from above and one side: what the maps would hold of a far lamp.
    light = np.maximum((maps.texels["normal"] * vector((0.36, 0.8, 0.48))).sum(axis=1), 0) + np.float32(0.5)
    light = np.where(maps.texels["state"] == VALID, light, light[np.maximum(maps.fill, 0)]).astype(np.float32)
    position = maps.texels["position"][np.maximum(maps.fill, 0)]
    values = light[:, None] * (1 + np.abs(position)).astype(np.float32)
    geometry, coarse_surfaces = Geometries(ball, maps).at(ball)
    surfaces = Surfaces(geometry=geometry, coarse=coarse_surfaces, lightmaps=maps, irradiance=values)
    rays = np.zeros(4000, dtype=RAY)
    random = np.random.default_rng(SEED)
    rays["origin"] = random.uniform((-2.5, 0.5, 2.5), (2.5, 2.5, 2.9), (4000, 3))
    rays["direction"] = random.uniform((-1.2, 0, -1.2), (1.2, 2.4, 1.2), (4000, 3)) - rays["origin"]
    rays["t_max"] = np.inf
    structure = Structure(ball)
    fine, coarse = structure.trace(rays), structure.trace(rays, coarse=True)
    for name, least in (("ball", 800), ("floor", 200)):
        number = ball.object_names.index(name)
        both = np.flatnonzero((fine["primitive"] >= 0) & (coarse["primitive"] >= 0))
        assert ball.coarse is not None
        both = both[(ball.object_id[fine["primitive"][both]] == number)]
        both = both[ball.coarse.object_id[coarse["primitive"][both]] == number]
        assert len(both) > least, name
        seen = diffuse_radiance(surfaces, fine[both])
        again = diffuse_radiance(surfaces, coarse[both], coarse=True)
        error = np.abs(again - seen).max(axis=1) / seen.max(axis=1)
        if name == "floor":
            assert error.max() == 0, "what is not reduced is the same in all bits"
        assert np.median(error) < 0.05, name  # a texel is a quarter of the radius
        assert np.quantile(error, 0.99) < 0.25, name


def test_coarse_geometry_moves_along(tmp_path: Path) -> None:
    scene = scene_of(tmp_path, MOVING)
    for frame in (0, 5, 9):
        moved = scene_at(scene, frame)
        assert moved.coarse is not None
        assert moved.coarse.present.tolist() == moved.present.tolist()
        for number in range(len(scene.object_names)):
            fine = moved.corners[moved.object_id == number]
            coarse = moved.coarse.corners[moved.coarse.object_id == number]
            assert np.isnan(fine).any() == np.isnan(coarse).any() == (not moved.present[number])
            if moved.present[number]:
                assert np.allclose(fine.mean(axis=(0, 1)), coarse.mean(axis=(0, 1)), atol=0.01)
        assert (fine_triangles(moved) == fine_triangles(scene)).all()
        assert scene_at(moved.coarse, 3).frame == 3


@pytest.mark.parametrize("faces", [False, True])
def test_nearest_finds_what_looking_at_all_finds(faces: bool) -> None:
    random = np.random.default_rng(SEED)
    points, queries = random.random((300, 3)), random.uniform(-0.5, 1.5, (200, 3))
    way, wanted = random.normal(size=(300, 3)), random.normal(size=(200, 3))
    way, wanted = (v / np.linalg.norm(v, axis=1)[:, None] for v in (way, wanted))
    distance = ((points[None] - queries[:, None]) ** 2).sum(axis=2)
    if faces:
        distance = np.where((wanted[:, None] * way[None]).sum(axis=2) > 0.5, distance, distance + 1e6)
    for cell in (0.01, 0.1, 10.0):
        found = nearest(points, queries, cell, (way, wanted) if faces else None)
        assert (found == distance.argmin(axis=1)).all(), f"cell {cell}, seed {SEED}"


def test_rays_meet_reduced_geometry_at_nearly_the_same_place(ball: Scene) -> None:
    rays = rays_through(ball, 3000, SEED)
    structure = Structure(ball)
    fine, coarse = structure.trace(rays), structure.trace(rays, coarse=True)
    both = (fine["primitive"] >= 6) & (coarse["primitive"] >= 6)
    assert both.sum() > 500
    length = np.linalg.norm(rays["direction"][both], axis=1)
    assert np.median(np.abs(fine["t"][both] - coarse["t"][both]) * length) < 0.03
