"""Objects of scene descriptions: shapes, surfaces, textures, keyframes, and every way in which they can be wrong."""

import re
import warnings
from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image

from lightloom.golden_model.contract.engine_image import DIFFUSE, GLASS, MIRROR
from lightloom.golden_model.host.errors import InputError, InputWarning
from lightloom.golden_model.scene.files.load import load_scene
from lightloom.golden_model.scene.files.mesh_files import load_mesh
from lightloom.golden_model.scene.files.texture_files import checker, srgb_table
from lightloom.golden_model.scene.mesh import area_vectors
from lightloom.golden_model.scene.pose import scene_at
from lightloom.golden_model.scene.scene import Scene
from lightloom.golden_model.scene.shapes import icosphere
from tests.golden_model.moving_scenes import ROOM, scene_of
from tests.golden_model.scene.test_scene import QUAD, refusal, write_cube

BOX = "[[box]]\ncenter = [1, 2, 3]\nsize = [2, 4, 6]\n"
SPHERE = "[[sphere]]\ncenter = [1, 2, 3]\nradius = 2\nsubdivisions = 3\n"


def outward(scene: Scene) -> np.ndarray:
    """How much each triangle looks away from the middle of the scene."""
    corners = scene.corners.astype(np.float64)
    middle = (corners.min(axis=(0, 1)) + corners.max(axis=(0, 1))) / 2
    return ((corners.mean(axis=1) - middle) * area_vectors(scene.corners)).sum(axis=1)


# --- shapes -------------------------------------------------------------------------------------------------------


def test_a_box_is_closed_and_faces_outward(tmp_path: Path) -> None:
    scene = scene_of(tmp_path, BOX)
    assert scene.object_names == ["box"]
    assert scene.corners.min(axis=(0, 1)).tolist() == [0, 0, 0]
    assert scene.corners.max(axis=(0, 1)).tolist() == [2, 4, 6]
    assert (outward(scene) > 0).all()
    mesh = trimesh.Trimesh(scene.corners.reshape(-1, 3), np.arange(36).reshape(-1, 3))
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(48)


def test_a_box_can_be_turned(tmp_path: Path) -> None:
    scene = scene_of(tmp_path, BOX + "rotate = [1, 0, 1, 0]\n")
    assert np.allclose(np.ptp(scene.corners.reshape(-1, 3), axis=0), [6, 4, 2])
    assert (outward(scene) > 0).all()


@pytest.mark.parametrize("change", ["scale = 2", "scale = [1, 2, -3]", "rotate = [1, 0, 0.5, 0]\nscale = [1, 4, 1]"])
def test_normals_of_a_file_go_with_the_mesh(tmp_path: Path, change: str) -> None:
    """They stay at right angles to what lay in the surface that they are of, and look to where its front looks."""
    normal, along = np.array([0, 0.6, 0.8]), np.array([[1, 0, 0], [0, 0.8, -0.6]])
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 .6 .8\nf 1//1 2//1 3//1\n")
    mesh = f'[[mesh]]\nfile = "a.obj"\n{change}\n'
    scene = scene_of(tmp_path, mesh)
    tips = "".join("v {} {} {}\n".format(*point) for point in along)
    (tmp_path / "a.obj").write_text(f"v 0 0 0\n{tips}f 1 2 3\n")
    surface = scene_of(tmp_path, mesh).corners[0].astype(np.float64)
    found = scene.normals[0].astype(np.float64)
    assert np.abs(found @ (surface[1:] - surface[0]).T).max() < 1e-6
    assert np.abs(np.linalg.norm(found, axis=1) - 1).max() < 1e-6  # each component is rounded to float32
    flat = area_vectors(surface[None].astype(np.float32))[0]
    assert (found @ flat > 0).all(), normal


def test_a_sphere_is_round_closed_and_smooth(tmp_path: Path) -> None:
    scene = scene_of(tmp_path, SPHERE)
    away = scene.corners.astype(np.float64) - [1, 2, 3]
    assert len(scene.triangles) == 20 * 4**3
    assert np.allclose(np.linalg.norm(away, axis=2), 2, atol=1e-6)
    assert np.abs(scene.normals - away / 2).max() < 1e-6
    assert (outward(scene) > 0).all()
    mesh = trimesh.Trimesh(scene.corners.reshape(-1, 3), np.arange(3 * len(scene.corners)).reshape(-1, 3))
    assert mesh.is_watertight, "neighbours agree on the bits of their points"
    assert mesh.volume == pytest.approx(4 / 3 * np.pi * 8, rel=0.01)
    edges = np.linalg.norm(icosphere(3) - np.roll(icosphere(3), 1, axis=1), axis=2)
    assert edges.max() < 1.35 * edges.min(), "about equal triangles"


# --- surfaces -----------------------------------------------------------------------------------------------------


def test_surfaces_and_indices_of_refraction(tmp_path: Path) -> None:
    write_cube(tmp_path)
    text = "[[mesh]]\nfile = 'cube.obj'\n" + BOX + 'material = "mirror"\nalbedo = [0.9, 0.8, 0.7]\n'
    scene = scene_of(tmp_path, text + SPHERE + 'material = "glass"\nior = 1.33\n')
    assert scene.object_names == ["cube", "lid", "box", "sphere"]
    assert scene.surface.tolist() == [DIFFUSE, DIFFUSE, MIRROR, GLASS]
    assert scene.material_object.tolist() == [0, 1, 2, 3]
    assert scene.ior[3] == np.float32(1.33)
    assert scene.albedo[2].tolist() == np.array([0.9, 0.8, 0.7], dtype=np.float32).tolist()
    assert scene.lightmapped.tolist() == [True, True, False, False]
    assert scene.surface[scene.material[-1]] == GLASS


# --- textures -----------------------------------------------------------------------------------------------------


def test_srgb_is_decoded_as_the_standard_says() -> None:
    code = np.arange(256) / 255
    expected = np.where(code <= 0.04045, code / 12.92, ((code + 0.055) / 1.055) ** 2.4)
    assert np.abs(srgb_table() / np.maximum(expected, 1e-30) - 1)[1:].max() < 1e-7
    assert srgb_table()[[0, 255]].tolist() == [0, 1]
    assert (np.diff(srgb_table()) > 0).all()


def test_a_texture_has_its_first_row_at_the_bottom(tmp_path: Path) -> None:
    picture = np.zeros((2, 3, 3), dtype=np.uint8)
    picture[0] = (255, 0, 0)  # the top row of the picture
    picture[1, 2] = (0, 0, 188)
    Image.fromarray(picture).save(tmp_path / "flag.png")
    scene = scene_of(tmp_path, QUAD + "texture = 'flag.png'\n" + QUAD + "texture = 'flag.png'\n" + BOX)
    assert len(scene.textures) == 1, "one file, one texture"
    assert scene.texture.tolist() == [0, 0, -1]
    (texture,) = scene.textures
    assert texture.shape == (2, 3, 3)
    assert texture.dtype == np.float32
    assert texture[1, 0].tolist() == [1, 0, 0]
    assert texture[0, 2, 2] == pytest.approx(0.5, abs=0.01)


@pytest.mark.parametrize("first", range(4))
def test_a_quad_may_be_a_dart(tmp_path: Path, first: int) -> None:
    """Covered once, whichever of its corners is named first."""
    dart = [[1, 0, 0], [0.2, 0, -0.2], [0, 0, -1], [0, 0, 0]]
    scene = scene_of(tmp_path, f"[[quad]]\ncorners = {dart[first:] + dart[:first]}\n")
    found = area_vectors(scene.corners)
    assert found.sum(axis=0) / 2 == pytest.approx([0, 0.2, 0])  # of corners rounded to float32
    assert (found[:, 1] > 0).all()


def test_texture_coordinates_of_quads_and_boxes_go_from_corner_to_corner(tmp_path: Path) -> None:
    scene = scene_of(tmp_path, QUAD + "texture = 'checker'\ntexture_scale = [4, 2]\n" + BOX + "texture = 'checker'\n")
    quad = scene.texture_uv[:2]
    assert quad.tolist() == [[[0, 0], [4, 0], [4, 2]], [[0, 0], [4, 2], [0, 2]]]
    assert scene.texture_uv[2:].min() == 0
    assert scene.texture_uv[2:].max() == 1
    assert scene.textures[0] is checker()
    assert checker()[0, 0, 0] > checker()[0, -1, 0] == checker()[-1, 0, 0]


def test_obj_texture_coordinates_follow_their_corners(tmp_path: Path) -> None:
    text = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0 0\nvt 1 1\nvt 0.25 0.75\nf 1/1 2/2 3/3 4/-1\n"
    (tmp_path / "quad.obj").write_text(text)
    (part,) = load_mesh(tmp_path / "quad.obj")
    assert part.texture_uv is not None
    assert part.texture_uv.tolist() == [[[0, 0], [1, 0], [1, 1]], [[0, 0], [1, 1], [0.25, 0.75]]]
    scene = scene_of(tmp_path, "[[mesh]]\nfile = 'quad.obj'\nscale = [-1, 1, 1]\ntexture = 'checker'\n")
    place, uv = scene.corners[..., :2].reshape(-1, 2), scene.texture_uv.reshape(-1, 2)
    mirrored = np.abs(place) * [1, 1]
    known = uv[:, 0] != 0.25
    assert (mirrored[known] == uv[known]).all(), "a mirrored mesh keeps its coordinates"
    (tmp_path / "quad.obj").write_text(text.replace("4/-1", "4"))
    with pytest.warns(InputWarning, match="left out: `vt` of objects in which one is missing"):
        (part,) = load_mesh(tmp_path / "quad.obj")
    assert part.texture_uv is None


def test_glb_texture_coordinates_run_upwards(tmp_path: Path) -> None:
    from trimesh.visual import TextureVisuals

    box = trimesh.creation.box()
    uv = np.asarray(box.vertices)[:, :2] + 0.5
    box.visual = TextureVisuals(uv=uv, image=Image.new("RGB", (2, 2)))
    path = tmp_path / "box.glb"
    path.write_bytes(box.export(file_type="glb"))
    with pytest.warns(InputWarning, match="left out: baseColorTexture, metallicFactor$"):
        (part,) = load_mesh(path)
    assert part.texture_uv is not None
    assert np.allclose(part.texture_uv, part.corners[..., :2] + 0.5, atol=1e-6)


# --- reduced meshes -----------------------------------------------------------------------------------------------


def test_coarse_from_a_file_and_by_a_ratio(tmp_path: Path) -> None:
    for level in (1, 3):
        mesh = trimesh.creation.icosphere(subdivisions=level)
        (tmp_path / f"{level}.ply").write_bytes(mesh.export(file_type="ply"))
    text = "[[mesh]]\nfile = '3.ply'\nscale = 2\nalbedo = [0.1, 0.2, 0.3]\n"
    scene = scene_of(tmp_path, text + "coarse = '1.ply'\n")
    assert scene.coarse is not None
    assert (len(scene.triangles), len(scene.coarse.triangles)) == (1280, 80)
    assert np.allclose(np.linalg.norm(scene.coarse.corners, axis=2), 2, atol=1e-5)
    assert np.allclose(scene.coarse.albedo, [[0.1, 0.2, 0.3]])
    scene = scene_of(tmp_path, text + "coarse_ratio = 0.25\n")
    assert scene.coarse is not None
    assert 200 < len(scene.coarse.triangles) <= 320
    assert scene_of(tmp_path, text).coarse is None


# --- refusals -----------------------------------------------------------------------------------------------------

KEY = "[[box.path]]\nframe = 0\n"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (BOX + "material = 'wood'\n", r"\[\[box\]\] 1: `material` must be one of diffuse, mirror, glass, not 'wood'"),
        (BOX + "material = 3\n", "`material` must be text in quotes"),
        (BOX + "material = 'glass'\nior = 0.9\n", "`ior` must lie within 1 to 10, not 0.9"),
        (BOX + "ior = 1.2\n", '`ior` is of use with material = "glass" only'),
        (BOX + "material = 'mirror'\nemission = [1, 1, 1]\n", "only diffuse surfaces have an emission"),
        (BOX.replace("2, 4, 6", "2, 0, 6"), "`size` must be greater than 0"),
        (BOX.replace("size", "sice"), r"unknown key `sice`; did you mean `size`\?"),
        (SPHERE.replace("radius = 2", "radius = 0"), "`radius` must be greater than 0"),
        (SPHERE.replace("= 3\n", "= 8\n"), "`subdivisions` must be a whole number from 0 to 7, not 8"),
        (SPHERE.replace("= 3\n", "= 1.5\n"), "`subdivisions` must be a whole number"),
        (SPHERE + "coarse_subdivisions = 3\n", "`coarse_subdivisions` must be a whole number from 0 to 2, not 3"),
        (SPHERE + "texture = 'checker'\n", "sphere has no texture coordinates"),
        (f"[[mesh]]\nfile = '{'m' * 300}.obj'\n", r"\[\[mesh\]\] 1: no such file: .*m\.obj"),
        (BOX + "emission = [1e39, 1, 1]\n", r"`emission` must lie within \+-3\.4e\+38"),
        (BOX + f"emission = [1{'0' * 400}, 1, 1]\n", r"`emission` must lie within \+-3\.4e\+38"),
        (BOX + f"texture = '{'t' * 300}.png'\n", r"\[\[box\]\] 1: no such file: .*t\.png"),
        (BOX + "texture = 'nowhere.png'\n", r"\[\[box\]\] 1: no such file: .*nowhere\.png"),
        (BOX + "texture = 'scene.toml'\n", r"scene\.toml cannot be read as a picture, damaged or cut off"),
        (BOX + "texture_scale = 2\n", "`texture_scale` is of use with a `texture` only"),
        ("[[quad]]\ncorners = [[0, 0, 0], [1, 0, -1], [1, 0, 0], [0, 0, -1]]\n", "`corners` go across each other"),
        (BOX + "texture = 'checker'\ntexture_scale = 0\n", "`texture_scale` must not be 0"),
        (BOX + "texture = 'checker'\ntexture_scale = [1, 2, 3]\n", "`texture_scale` must be 2 numbers"),
        (BOX + "pivot = [0, 0, 0]\n", r"`pivot` is of use with \[\[...path\]\] keyframes only"),
        (BOX + "loop = 5\n", r"`loop` is of use with \[\[...path\]\] keyframes only"),
        (BOX + "loop = 5\n" + KEY + "[[box.path]]\nframe = 9\n", "`loop` must be a whole number from 9"),
        (BOX + "path = 3\n", r"write \[\[path\]\], with double brackets"),
        (BOX + "[[box.path]]\n", r"\[\[box\]\] 1, \[\[path\]\] 1: `frame` is missing"),
        (BOX + KEY + KEY, r"\[\[path\]\] 2: `frame` must be greater than that before, 0"),
        (BOX + KEY + "emission = -1\n", "`emission` must be a factor of 0 or more, not -1"),
        (BOX + KEY + "rotate = [0, 0, 0, 0]\n", "`rotate` must not be all zero"),
        (BOX + KEY + "rotate = [1e-200, 0, 0, 0]\n", "`rotate` must not be all zero"),
        (BOX + KEY + "present = 1\n", "`present` must be true or false, not 1"),
        (BOX + KEY + "translate = [1e15, 0, 0]\n", "a path leads beyond"),
        (BOX + KEY + "scale = 2\n", r"unknown key `scale`"),
        (
            BOX + "[[point_light]]\nposition = [0, 0, 0]\nintensity = [1, 1, 1]\n"
            "[[point_light.path]]\nframe = 0\nintensity = [0, 0, -1]\n",
            r"\[\[point_light\]\] 1, \[\[path\]\] 1: `intensity` must not be negative",
        ),
        ("[[mesh]]\nbuiltin = 'floor'\ncoarse_ratio = 1\n", "`coarse_ratio` must lie between 0 and 1, not 1"),
        ("[[mesh]]\nbuiltin = 'floor'\ncoarse = 'nowhere.ply'\n", r"no such file: .*nowhere\.ply"),
        ("[[mesh]]\nbuiltin = 'floor'\ncoarse = 'a'\ncoarse_ratio = 0.5\n", "either `coarse` or `coarse_ratio`"),
        ("[[mesh]]\nbuiltin = 'cornell-box'\ncoarse = 'cube.obj'\n", "as many objects and materials as the fine mesh"),
    ],
)
def test_unusable_objects(tmp_path: Path, text: str, message: str) -> None:
    write_cube(tmp_path)
    path = tmp_path / "scene.toml"
    path.write_text(text)
    said = refusal(path)
    assert said.startswith(str(path))
    assert re.search(message, said), said


def test_damaged_pictures_are_refused(tmp_path: Path) -> None:
    random = np.random.default_rng(5)
    Image.fromarray(random.integers(0, 256, (40, 40, 3), dtype=np.uint8)).save(tmp_path / "noise.png")
    whole = (tmp_path / "noise.png").read_bytes()
    path = tmp_path / "scene.toml"
    path.write_text(QUAD + "texture = 'noise.png'\n")
    load_scene(path)
    for length in (0, 10, 100, len(whole) // 2):
        (tmp_path / "noise.png").write_bytes(whole[:length])
        with pytest.raises(InputError, match=r"noise\.png cannot be read as a picture"):
            load_scene(path)


@pytest.mark.parametrize(("kind", "mode"), [(np.uint16, "I;16"), (np.float32, "F")])
def test_pictures_of_more_bits_are_refused(tmp_path: Path, kind: type, mode: str) -> None:
    """Cut off at 255, as Pillow does it, half of white would be white in 16 bits, and black in float32."""
    half = 0.5 * (65535 if kind is np.uint16 else 1)
    Image.fromarray(np.full((4, 4), half, dtype=kind)).save(tmp_path / "deep.tiff")
    (tmp_path / "scene.toml").write_text(QUAD + "texture = 'deep.tiff'\n")
    assert refusal(tmp_path / "scene.toml").endswith(
        f"deep.tiff has more than 8 bits a channel ({mode}); save it with 8"
    )


def test_alpha_is_said_to_be_left_out(tmp_path: Path) -> None:
    """Unless there is none below the whole."""
    path = tmp_path / "scene.toml"
    path.write_text(QUAD + "texture = 'leaf.png'\n")
    pixels = np.full((4, 4, 4), 255, dtype=np.uint8)
    for alpha in (255, 254):
        pixels[1, 2] = [9, 9, 9, alpha]
        Image.fromarray(pixels).save(tmp_path / "leaf.png")
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always")
            load_scene(path)
        assert [str(line.message).endswith("leaf.png: left out: alpha") for line in said] == [True] * (alpha < 255)


def test_keyframes_keep_what_they_leave_out(tmp_path: Path) -> None:
    keys = (
        "[[box.path]]\nframe = 0\ntranslate = [1, 0, 0]\nemission = 0\n[[box.path]]\nframe = 5\nrotate = [1, 0, 1, 0]\n"
    )
    path = scene_of(tmp_path, ROOM + BOX + keys).object_path[3]
    assert path is not None
    assert path.keys[1].translate.tolist() == [1, 0, 0]
    assert path.keys[1].emission == 0
    assert path.pivot.tolist() == [1, 2, 3], "a box turns about its middle"


def test_meshes_turn_about_their_own_origin(tmp_path: Path) -> None:
    write_cube(tmp_path)
    keys = "[[mesh.path]]\nframe = 0\nrotate = [1, 0, 1, 0]\n"
    scene = scene_of(tmp_path, "[[mesh]]\nfile = 'cube.obj'\ntranslate = [5, 0, 0]\n" + keys)
    assert scene.bodies == [[0, 1]], "the objects of one file move together"
    moved = scene_at(scene, 0)
    assert moved.corners.min(axis=(0, 1)).tolist() == [5, 0, -1]
    assert moved.corners.max(axis=(0, 1)).tolist() == [6, 1, 0]
