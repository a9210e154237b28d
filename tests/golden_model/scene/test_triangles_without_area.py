"""Triangles without area, of which real meshes have some: left out, said, and refused where nothing else is there."""

from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from lightloom.golden_model.charts.unwrap import unwrap
from lightloom.golden_model.host.errors import InputWarning
from lightloom.golden_model.scene.files.load import load_scene
from lightloom.golden_model.tables.lightmap import VALID
from lightloom.golden_model.tracing.bvh import build, traversal
from tests.golden_model.scene.test_scene import CUBE_OBJ, QUAD, write_cube


def test_triangles_without_area_are_left_out(tmp_path: Path) -> None:
    """Twice the same corner, three corners on a line, and one that float32 makes flat; all else is kept as it is."""
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [0.5, 0.5, 0], [1e-25, 1, 0]], dtype=np.float32)
    sound = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]
    flat = [[0, 1, 1], [1, 4, 2], [0, 2, 5]]
    faces = np.array([sound[0], flat[0], sound[1], sound[2], flat[1], flat[2], sound[3]])
    path = tmp_path / "tetrahedron.ply"
    data: Any = trimesh.Trimesh(vertices, faces, process=False).export(file_type="ply")
    path.write_bytes(data)
    with pytest.warns(InputWarning) as said:
        scene = load_scene(path)
    assert [str(warning.message) for warning in said] == [
        f"{path}: 3 triangles without area (first: triangle 1 of tetrahedron) left out"
    ]
    assert scene.corners.tobytes() == vertices[np.array(sound)].tobytes()
    lightmaps = unwrap(scene, trace=partial(traversal.trace, build.build(scene.triangles)))
    assert lightmaps.chart.max() == 3, "each side has its chart"
    assert (lightmaps.texels["state"][lightmaps.chart >= 0] == VALID).all()


def test_objects_without_area_are_left_out_with_their_materials_and_normals(tmp_path: Path) -> None:
    top = (
        "o top\nf 5//2 6//2 6//2\nf 5//2 6//2 7//2\nf 5//2 5//2 6//2 7//2\n"
        "usemtl paint\nf 5//1 7//1 8//1\nf 7//1 7//1 8//1\n"
    )
    path = write_cube(tmp_path, CUBE_OBJ.replace("f -8 -4 -1 -5", "vn 0 0 1\nvn 0 1 0\nf -8 -4 -8\n" + top))
    with pytest.warns(
        InputWarning,
        match="3 triangles without area .first: triangle 0 of lid. left out, with which nothing is left of lid$",
    ):
        scene = load_scene(path)
    assert scene.object_names == ["cube", "top"]
    assert scene.emission[scene.material[10:]].any(axis=1).tolist() == [True, True, False]
    assert scene.normals[10:, 0].tolist() == [[0, 1, 0], [0, 1, 0], [0, 0, 1]]
    lower, upper = [[0, 0, 1], [1, 0, 1], [1, 1, 1]], [[0, 0, 1], [1, 1, 1], [0, 1, 1]]
    assert scene.corners[10:].tolist() == [lower, lower, upper]


def test_reduced_meshes_and_motion_without_area(tmp_path: Path) -> None:
    """Objects of a scene description that lose all triangles go with their motion and their reduced form."""
    thin = "[[quad]]\nname = 'thin'\ncorners = [[0,0,0],[1,0,0],[2,0,0],[3,0,0]]\n[[quad.path]]\nframe = 0\n"
    write_cube(tmp_path)
    path = tmp_path / "scene.toml"
    path.write_text(
        thin
        + QUAD
        + "[[quad.path]]\nframe = 0\ntranslate = [1, 0, 0]\n[[mesh]]\nfile = 'cube.obj'\ncoarse = 'thin.obj'\n"
    )
    (tmp_path / "thin.obj").write_text(CUBE_OBJ.replace("f -8 -4 -1 -5", "f -8 -4 -4"))
    with pytest.warns(InputWarning, match="3 triangles .* .first: triangle 0 of lid. left out, .* left of thin$"):
        scene = load_scene(path)
    assert scene.object_names == ["cube", "lid", "quad"]
    assert scene.object_path[2] is not None
    assert scene.object_path[2].keys[0].translate.tolist() == [1, 0, 0]
    assert scene.coarse is not None
    assert np.bincount(scene.coarse.object_id).tolist() == [10, 2, 2], "the lid keeps its own triangles"
