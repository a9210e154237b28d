"""Scenes: the built-in ones, files of every kind, and every way in which a file can be unusable."""

import itertools
import json
import re
import struct
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from lightloom.golden_model.host.errors import InputError
from lightloom.golden_model.scene.files.cornell_box import ROOM
from lightloom.golden_model.scene.files.load import load_scene
from lightloom.golden_model.scene.mesh import CREASE_COSINE, area_vectors, dot, shading_normals
from lightloom.golden_model.scene.pose import scene_at
from lightloom.golden_model.scene.scene import Scene, require_light
from tests import ROOT
from tests.needs import need

SCENES = ROOT / "scenes"
CUBE_OBJ = """# a unit cube of quads
mtllib cube.mtl
v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1
o cube
usemtl paint
f 4 3 2 1\nf 5 6 7 8\nf 1 2 6 5\nf 3 4 8 7\nf 2 3 7 6
o lid
usemtl lamp
f -8 -4 -1 -5
"""
CUBE_MTL = "newmtl paint\nKd 0.725 0.71 0.68\nnewmtl lamp\nKd 0.1 0.2 0.3\nKe 17 12 4\n"


def write_cube(folder: Path, text: str = CUBE_OBJ) -> Path:
    (folder / "cube.mtl").write_text(CUBE_MTL)
    (folder / "cube.obj").write_text(text)
    return folder / "cube.obj"


def refusal(name: str | Path) -> str:
    """The one line with which a scene is refused."""
    with pytest.raises(InputError) as caught:
        load_scene(name)
    message = str(caught.value)
    assert "\n" not in message
    return message


# --- the Cornell box ----------------------------------------------------------------------------------------------


def test_cornell_box_is_the_published_one_and_faces_inward() -> None:
    scene = load_scene("cornell-box")
    assert scene.object_names == [*ROOM, "short block", "tall block"]
    assert len(scene.triangles) == 32
    assert (scene.camera.position == (278, 273, -800)).all()
    assert np.isclose(scene.camera.fov_y_tan, 0.0125 / 0.035)
    assert scene.corners.max(axis=(0, 1)).tolist() == pytest.approx([556.0, 548.8, 559.2])
    assert scene.corners.min() == 0
    area = area_vectors(scene.corners)
    unit = area / np.linalg.norm(area, axis=1)[:, None]
    centre = scene.corners.mean(axis=1)
    middle = np.array([278.0, 274.0, 280.0])
    for number, name in enumerate(scene.object_names):
        mine = scene.object_id == number
        if name in ROOM:
            inward = ((middle - centre[mine]) * unit[mine]).sum(axis=1)
        else:
            # Blocks face outward: away from the point in the middle of their bottom.
            inside = centre[mine].mean(axis=0) * (1, 0, 1)
            inward = ((centre[mine] - inside) * unit[mine]).sum(axis=1)
        assert (inward > 0).all(), name
        assert np.abs(scene.normals[mine] - unit[mine][:, None]).max() < 0.004, name
    lights = scene.emission[scene.material].any(axis=1)
    assert [scene.object_names[k] for k in np.unique(scene.object_id[lights])] == ["light"]
    assert area_vectors(scene.corners[lights])[:, 1].sum() / -2 == pytest.approx(130 * 105)


def test_camera_path_starts_at_the_published_place_and_is_interpolated() -> None:
    scene = load_scene("cornell-box")
    assert (scene.camera_at(0).position == scene.camera.position).all()
    first, second = scene.camera_path[:2]
    half = scene.camera_at((first.frame + second.frame) // 2)
    assert np.allclose(half.position, (first.position + second.position) / 2)
    assert np.allclose(half.target, (first.target + second.target) / 2)
    assert (scene.camera_at(second.frame).position == second.position).all()
    assert (scene.camera_at(10**6).position == scene.camera_path[-1].position).all()
    for frame in range(0, 130, 5):
        x, y, z = scene.camera_at(frame).position
        assert 0 < x < 552, "in front of the open side"
        assert 0 < y < 548
        assert z < 0


# --- mesh files ---------------------------------------------------------------------------------------------------


def test_obj_objects_materials_polygons_and_negative_indices(tmp_path: Path) -> None:
    scene = load_scene(write_cube(tmp_path))
    assert scene.object_names == ["cube", "lid"]
    assert np.bincount(scene.object_id).tolist() == [10, 2]
    assert scene.albedo[scene.material[0]].tolist() == np.array([0.725, 0.71, 0.68], dtype=np.float32).tolist()
    assert scene.emission[scene.material[-1]].tolist() == [17, 12, 4]
    outward = ((scene.corners.mean(axis=1) - 0.5) * area_vectors(scene.corners)).sum(axis=1)
    assert (outward > 0).all()
    assert np.abs(scene.normals).max(axis=2).min() == 1, "the edges of a cube stay sharp"
    require_light(scene)


def test_obj_normals_are_used(tmp_path: Path) -> None:
    text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 2\nvn 1 0 1\nf 1//1 2//2 3//1\n"
    (tmp_path / "n.obj").write_text(text)
    normals = load_scene(tmp_path / "n.obj").normals[0]
    assert np.allclose(normals, [[0, 0, 1], [0.5**0.5, 0, 0.5**0.5], [0, 0, 1]])


@pytest.mark.parametrize("kind", ["ply", "ply-ascii", "glb", "obj"])
def test_every_kind_of_file_gives_the_same_triangles(tmp_path: Path, kind: str) -> None:
    mesh = trimesh.creation.icosphere(subdivisions=2)
    suffix, *ascii_too = kind.split("-")
    path = tmp_path / f"ball.{suffix}"
    path.write_bytes(_exported(mesh, suffix, "ascii" if ascii_too else "binary"))
    scene = load_scene(path)
    assert np.allclose(scene.corners, mesh.triangles, atol=2e-7)
    assert scene.object_names == ["ball"]
    assert np.allclose(scene.normals, scene.corners, atol=1e-6), "a ball is shaded smoothly"


def test_glb_keeps_materials_places_and_fronts(tmp_path: Path) -> None:
    from trimesh.visual import TextureVisuals
    from trimesh.visual.material import PBRMaterial

    scene = trimesh.Scene()
    material = PBRMaterial(name="glow", baseColorFactor=[0.2, 0.4, 0.6, 1.0], emissiveFactor=[0.5, 0.25, 0.125])
    box = trimesh.creation.box()
    box.visual = TextureVisuals(material=material)
    mirrored = np.diag([-2.0, 1.0, 1.0, 1.0])
    mirrored[:3, 3] = (10, 0, 0)
    scene.add_geometry(box, node_name="box", transform=mirrored)
    path = tmp_path / "box.glb"
    data = _with_json(scene.export(file_type="glb"), _stronger)
    path.write_bytes(data)
    loaded = load_scene(path)
    assert np.allclose(loaded.corners.mean(axis=(0, 1)), [10, 0, 0], atol=1e-6)
    outward = ((loaded.corners.mean(axis=1) - [10, 0, 0]) * area_vectors(loaded.corners)).sum(axis=1)
    assert (outward > 0).all(), "a mirrored node keeps its front in front"
    assert np.allclose(loaded.albedo, [[0.725, 0.4, 0.6]])
    assert np.allclose(loaded.emission, [[5, 2.5, 1.25]])


def _stronger(document: dict) -> None:
    material = document["materials"][0]
    material["pbrMetallicRoughness"]["baseColorFactor"] = [0.725, 0.4, 0.6, 1.0]
    material["pbrMetallicRoughness"]["metallicFactor"] = 0.0
    material["extensions"] = {"KHR_materials_emissive_strength": {"emissiveStrength": 10.0}}


def _with_json(data: bytes, change: Callable[[dict], None]) -> bytes:
    """A GLB file with its JSON changed."""
    length = struct.unpack_from("<I", data, 12)[0]
    document = json.loads(data[20 : 20 + length])
    change(document)
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    rest = data[20 + length :]
    return struct.pack("<4sIIII", b"glTF", 2, 20 + len(text) + len(rest), len(text), 0x4E4F534A) + text + rest


def _exported(mesh: trimesh.Trimesh, suffix: str, encoding: str) -> bytes:
    out: Any = mesh.export(file_type=suffix, **({"encoding": encoding} if suffix == "ply" else {}))
    return out.encode() if isinstance(out, str) else out


def test_a_mesh_gets_a_camera_that_sees_all_of_it(tmp_path: Path) -> None:
    scene = load_scene(write_cube(tmp_path))
    camera = scene.camera
    forward = (camera.target - camera.position).astype(np.float64)
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, camera.up)
    right /= np.linalg.norm(right)
    up = np.cross(right, forward)
    moved = scene.corners.reshape(-1, 3) - camera.position
    depth = moved @ forward
    assert (depth > 0).all()
    assert (np.abs(moved @ right) < depth * camera.fov_y_tan).all()
    assert (np.abs(moved @ up) < depth * camera.fov_y_tan).all()


def around_a_point(directions: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """A triangle for each direction (N, 3), square to it, with its first corner at the origin; (N, 3, 3) float32."""
    across = np.cross(directions, rng.normal(size=directions.shape))
    return np.stack([0 * across, across, np.cross(directions, across)], axis=1).astype(np.float32)


@pytest.mark.parametrize("seed", range(4))
def test_normals_at_a_point_of_very_many_faces_are_the_same_sums(seed: int) -> None:
    """A polygon of hundreds of corners, one with walls, a tip, and faces turned anywhere: as if compared one by one."""
    rng = np.random.default_rng(seed)
    turn = np.linspace(0, 2 * np.pi, 300, endpoint=False)
    up = np.eye(3)[2] + rng.normal(scale=1e-3, size=(300, 3))
    walls = np.concatenate([up, np.eye(3)[[0] * 5] + rng.normal(scale=0.1, size=(5, 3))])
    tip = np.stack([np.cos(turn), np.sin(turn), 0 * turn + 0.5], axis=1)
    for directions in (up, walls, tip, rng.normal(size=(300, 3))):
        corners = around_a_point(rng.permutation(directions), rng)
        wide = corners.astype(np.float64)
        area = area_vectors(corners)
        unit = area / np.sqrt(dot(area, area))[:, None]
        edges = [wide[:, k] - wide[:, 0] for k in (1, 2)]
        weighted = area * (1.0 / (dot(edges[0], edges[0]) * dot(edges[1], edges[1])))[:, None]
        found = shading_normals(corners)[:, 0]
        for k in range(len(corners)):
            total = np.zeros(3)
            for other in np.flatnonzero(dot(unit[k], unit) >= CREASE_COSINE):
                total += weighted[other]
            total /= np.abs(total).max()
            assert found[k].tobytes() == (total / np.sqrt(dot(total, total))).astype(np.float32).tobytes(), (
                f"seed {seed}"
            )


def test_normals_of_a_polygon_of_many_corners_take_no_time() -> None:
    """With walls along its edges; face against face they would take minutes."""
    turn = np.linspace(0, 2 * np.pi, 20_000, endpoint=False)
    low = np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=1)
    high, k = low + np.array([0.3, 0.2, 1.0]), np.arange(20_000)
    fan = low[np.stack([0 * k, k, (k + 1) % 20_000], axis=1)[1:-1]]
    corners = np.concatenate([fan, np.stack([low, high, np.roll(low, -1, axis=0)], axis=1)]).astype(np.float32)
    begun = time.process_time()
    normals = shading_normals(corners)
    assert time.process_time() - begun < 5
    assert (normals[: len(fan)] == [0, 0, 1]).all()


def test_shading_normals_are_smooth_below_the_crease_and_sharp_above() -> None:
    # A strip of three quads: the second bends by 20 degrees, the third by 90 more.
    a, b = np.deg2rad(20), np.deg2rad(110)
    xs = np.cumsum([[0, 0], [1, 0], [np.cos(a), np.sin(a)], [np.cos(b), np.sin(b)]], axis=0)
    strip = [
        [[[x0, y0, 0], [x1, y1, 0], [x1, y1, -1]], [[x0, y0, 0], [x1, y1, -1], [x0, y0, -1]]]
        for (x0, y0), (x1, y1) in itertools.pairwise(xs)
    ]
    normals = shading_normals(np.array(strip, dtype=np.float32).reshape(-1, 3, 3)).reshape(3, 2, 3, 3)
    assert np.allclose(normals[2, 0, 0], [-np.sin(b), np.cos(b), 0], atol=1e-6), "sharp"
    meeting = normals[0, 0, 1]
    assert np.allclose(meeting, normals[1, 0, 0], atol=1e-6), "the same from both sides"
    assert 0 < -meeting[0] < np.sin(a)


# --- scene descriptions -------------------------------------------------------------------------------------------


def test_the_documented_motion_loads(tmp_path: Path) -> None:
    text = (SCENES.parent / "docs" / "scenes.md").read_text(encoding="utf-8")
    path = tmp_path / "motion.toml"
    path.write_text(re.findall(r"```toml\n(.*?)```", text, flags=re.DOTALL)[-1], encoding="utf-8")
    scene = load_scene(path)
    assert scene.dynamic
    assert scene.last_frame == 120, "that of the camera"
    assert scene.coarse is not None
    ball, door = scene.object_names.index("ball"), scene.object_names.index("door")
    assert [bool(scene_at(scene, frame).present[ball]) for frame in (0, 19, 20)] == [False, False, True]
    assert [scene_at(scene, frame).point_lights["intensity"][0, 0] for frame in (49, 50)] == [20000, 0]
    hinge = scene_at(scene, 40).corners[scene.object_id == door].reshape(-1, 3)
    assert np.allclose(hinge.max(axis=0), [347, 220, 110], atol=1e-3), "open: along z at the hinge"
    assert scene_at(scene, 90).triangles.tobytes() == scene_at(scene, 180).triangles.tobytes()


@pytest.mark.parametrize("path", sorted(SCENES.glob("*.toml")), ids=lambda path: path.stem)
def test_committed_scenes_load(path: Path) -> None:
    needed = re.findall(r'^file = "(.*)"', path.read_text(), flags=re.MULTILINE)
    missing = [name for name in needed if not (path.parent / name).is_file()]
    need(not missing, f"{', '.join(missing)}: make meshes")
    scene = load_scene(path)
    assert scene.name == path.stem
    require_light(scene)


def test_the_documented_scene_loads(tmp_path: Path) -> None:
    text = (SCENES.parent / "docs" / "scenes.md").read_text(encoding="utf-8")
    example = re.findall(r"```toml\n(.*?)```", text, flags=re.DOTALL)
    assert len(example) == 3, "a scene, its sky and sun, its motion"
    path = tmp_path / "example.toml"
    path.write_text(example[0], encoding="utf-8")
    scene = load_scene(path)
    assert scene.name == "example"
    assert scene.object_names == ["short block", "floor", "lamp"]
    assert len(scene.camera_path) == 2
    assert len(scene.point_lights) == 1
    assert scene.texel_size == 0.125
    require_light(scene)


def test_transforms_are_scale_then_rotation_then_translation(tmp_path: Path) -> None:
    write_cube(tmp_path)
    scene = _toml(tmp_path, "file='cube.obj'\nscale=[1, 2, 3]\nrotate=[1, 0, 0, 1]\ntranslate=[10, 0, 0]")
    # A quarter turn about z takes (x, y, z) to (-y, x, z).
    assert scene.corners.min(axis=(0, 1)).tolist() == [8, 0, 0]
    assert scene.corners.max(axis=(0, 1)).tolist() == [10, 1, 3]


def test_a_mirroring_scale_keeps_the_front_in_front(tmp_path: Path) -> None:
    write_cube(tmp_path)
    for scale in ("[-1, 1, 1]", "-1"):
        scene = _toml(tmp_path, f"file='cube.obj'\nscale={scale}")
        centre = scene.corners.mean(axis=(0, 1))
        assert (((scene.corners.mean(axis=1) - centre) * area_vectors(scene.corners)).sum(axis=1) > 0).all()


def test_equal_names_are_numbered(tmp_path: Path) -> None:
    write_cube(tmp_path)
    scene = _toml(tmp_path, "file='cube.obj'\n[[mesh]]\nfile='cube.obj'\ntranslate=[3,0,0]")
    assert scene.object_names == ["cube", "lid", "cube.2", "lid.2"]


def _toml(folder: Path, mesh: str) -> Scene:
    path = folder / "scene.toml"
    path.write_text(f"[[mesh]]\n{mesh}\n")
    return load_scene(path)


QUAD = "[[quad]]\ncorners = [[0,0,0],[1,0,0],[1,1,0],[0,1,0]]\n"
CAMERA = QUAD + "[camera]\nposition=[0,0,5]\ntarget=[0,0,0]\n"


def path_of(first: str, last: str) -> str:
    """A camera that goes from one place to another in four frames, and looks at the origin."""
    return "".join(
        f"[[camera.path]]\nframe={frame}\nposition={place}\ntarget=[0,0,0]\n"
        for frame, place in ((0, first), (4, last))
    )


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[[mesh\n", "not a TOML file"),
        ("", "no triangles"),
        ("texel_sise = 3\n" + QUAD, r"unknown key `texel_sise`; did you mean `texel_size`\?"),
        ("texel_size = 0\n" + QUAD, "`texel_size` must be greater than 0, not 0"),
        ("texel_size = nan\n" + QUAD, "`texel_size` must be a number, not nan"),
        ("mesh = 3\n", r"write \[\[mesh\]\], with double brackets"),
        ("[[mesh]]\n", r"\[\[mesh\]\] 1: give either `file` or `builtin`"),
        ("[[mesh]]\nfile='nowhere.obj'\n", r"\[\[mesh\]\] 1: no such file: .*nowhere\.obj"),
        ("[[mesh]]\nfile=7\n", "`file` must be text in quotes, not 7"),
        ("[[mesh]]\nbuiltin='cornel-room'\n", "no built-in part 'cornel-room'; did you mean 'cornell-room'"),
        ("[[mesh]]\nbuiltin='floor'\nalbdo=[1,1,1]\n", r"unknown key `albdo`; did you mean `albedo`\?"),
        ("[[mesh]]\nbuiltin='floor'\nalbedo=[1,1,1.5]\n", "`albedo` must lie within 0 to 1"),
        ("[[mesh]]\nbuiltin='floor'\nalbedo=[1,1]\n", "`albedo` must be 3 numbers"),
        ("[[mesh]]\nbuiltin='floor'\nalbedo=[1,1,'a']\n", "`albedo` must be 3 numbers"),
        ("[[mesh]]\nbuiltin='floor'\nemission=[1,-1,1]\n", "`emission` must not be negative"),
        ("[[mesh]]\nbuiltin='floor'\nscale=0\n", "`scale` must not be 0"),
        ("[[mesh]]\nbuiltin='floor'\nscale=1e30\n", "coordinates must lie within"),
        ("[[mesh]]\nbuiltin='floor'\nscale=1e300\n", r"`scale` must lie within \+-3\.4e\+38"),
        ("[[mesh]]\nbuiltin='floor'\nscale=1e-30\n", "coordinates must lie within"),
        ("[[mesh]]\nbuiltin='floor'\nrotate=[0,0,0,0]\n", "`rotate` must not be all zero"),
        (QUAD.replace("[0,1,0]]", "[0,1]]"), r"\[\[quad\]\] 1, corner 4: `point` must be 3 numbers"),
        ("[[quad]]\ncorners=[[0,0,0]]\n", "`corners` must be four points"),
        ("[[quad]]\ncorners=[[0,0,0],[1,0,0],[2,0,0],[3,0,0]]\n", "2 triangles without area .* and no other; a scene"),
        (QUAD + "[[point_light]]\nposition=[0,0,1]\n", r"\[\[point_light\]\] 1: `intensity` is missing"),
        (QUAD + "[[point_light]]\nposition=[0,0,1]\nintensity=[0,-1,0]\n", "`intensity` must not be negative"),
        (QUAD + "[camera]\nposition=[0,0,1]\n", r"\[camera\]: `target` is missing"),
        (CAMERA + path_of("[0,0,2]", "[0,0,-2]"), r"\[camera\], frame 2: position and target must differ"),
        (CAMERA + path_of("[0,1,2]", "[0,1,-2]"), r"\[camera\], frame 2: .* `up` must not point along the view"),
        ("a = " + 3000 * "[" + 3000 * "]", "nested too deeply"),
        ('[[mesh]]\nbuiltin = "cornell-blocks"\nname = "x"\n', "`name` is for one object, and this mesh has 2"),
        (QUAD + "[camera]\nposition=[0,0,1]\ntarget=[0,0,1]\n", "position and target must differ"),
        (QUAD + "[camera]\nposition=[0,1,0]\ntarget=[0,0,0]\n", "`up` must not point along the view"),
        (QUAD + "camera=3\n", None),
        ("camera=3\n" + QUAD, r"\[camera\]: must be a table"),
        (QUAD + "[camera]\nbuiltin='sponza'\n", '`builtin` must be "cornell-box"'),
        (CAMERA + "fov_y_tan=0\n", "`fov_y_tan` must be greater than 0"),
        (CAMERA + "[[camera.path]]\nframe=-1\nposition=[0,0,1]\ntarget=[0,0,0]\n", "`frame` must be a whole number"),
        (
            CAMERA + 2 * "[[camera.path]]\nframe=1\nposition=[0,0,1]\ntarget=[0,0,0]\n",
            "must be greater than that before",
        ),
        (CAMERA + "[[camera.path]]\nframe=1\nposition=[0,0,1]\ntarget=[0,0,1]\n", "frame 1: position and target"),
    ],
)
def test_unusable_scene_descriptions(tmp_path: Path, text: str, message: str | None) -> None:
    path = tmp_path / "scene.toml"
    path.write_text(text)
    said = refusal(path)
    assert said.startswith(str(path))
    if message is not None:
        assert re.search(message, said), said


# --- unusable files -----------------------------------------------------------------------------------------------


def test_unknown_scenes_and_files() -> None:
    said = refusal("cornel-box")
    assert "cornell-box" in said
    assert ".obj" in said
    assert "not a scene" in refusal("model.stl")
    for name in ("nowhere.obj", "nowhere.ply", "nowhere.glb", "nowhere.toml"):
        assert refusal(name) == f"{name}: no such file"


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("v 1 1 0", "v nan 1 0"), r"\d triangles with a vertex that is NaN or infinite"),
        (("v 1 1 0", "v 1e39 1 0"), r"\d triangles with a vertex that is NaN or infinite"),
        (("v 1 1 0", "v 1 1"), "line 5: `v` needs three numbers"),
        (("v 1 1 0", "v 1 x 0"), "line 5: `v` needs three numbers"),
        (("f 4 3 2 1", "f 4 3 2 9"), "line 13: a face names a vertex that does not exist; the file has 8"),
        (("f 4 3 2 1", "f 4 3 2 0"), "line 13: a face names a vertex, normal or `vt` that does not exist"),
        (("f 4 3 2 1", "f 4 3 2 -9"), "line 13: a face names a vertex, normal or `vt` that does not exist"),
        (("f 4 3 2 1", "f 4 3 /"), "line 13: '/' is not a corner of a face"),
        (("f 4 3 2 1", "f 4 3 2 99999999999999999999"), "line 13: a face names a vertex, normal or `vt` that does not"),
        (("f ", "g "), "no triangles"),
    ],
)
def test_unusable_obj_files(tmp_path: Path, change: tuple[str, str], message: str) -> None:
    path = write_cube(tmp_path, CUBE_OBJ.replace(*change))
    said = refusal(path)
    assert said.startswith(str(path))
    assert re.search(message, said), said


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("Kd 0.1 0.2 0.3", "Kd 0.1 0.2 nan"), "Kd 0.1 0.2 nan of material lamp is NaN, infinite or too large"),
        (("Ke 17 12 4", "Ke 17 inf 4"), r"Ke 17 inf 4 of material \w+ is NaN, infinite or too large"),
        (("Ke 17 12 4", "Ke 17 12"), "cube.mtl, line 5: `Ke` of material lamp needs one or three numbers"),
        (
            ("Kd 0.1 0.2 0.3", "Kd spectral grey.rfl"),
            "cube.mtl, line 4: `Kd` of material lamp is given as `spectral`, which is not read",
        ),
    ],
)
def test_unusable_materials(tmp_path: Path, change: tuple[str, str], message: str) -> None:
    path = write_cube(tmp_path)
    (tmp_path / "cube.mtl").write_text(CUBE_MTL.replace(*change))
    assert re.search(message, refusal(path))


def test_a_scene_without_light_is_fine_until_light_is_needed(tmp_path: Path) -> None:
    path = tmp_path / "dark.toml"
    path.write_text(QUAD)
    scene = load_scene(path)
    with pytest.raises(InputError, match=r"dark: the scene has no light; give .*emission.*\[\[point_light\]\]"):
        require_light(scene)


@pytest.mark.parametrize("kind", ["ply-binary", "ply-ascii", "glb", "obj"])
def test_cut_and_garbled_files_never_pass_for_whole_ones(tmp_path: Path, kind: str) -> None:
    """Refused with one line; OBJ says nowhere how long it is, so a cut between two lines goes unseen there."""
    suffix, _, encoding = kind.partition("-")
    whole = _exported(trimesh.creation.icosphere(subdivisions=1), suffix, encoding)
    path = tmp_path / f"ball.{suffix}"
    for length in [*range(0, len(whole) - 40, len(whole) // 40), len(whole) - 40]:
        cut = whole[:length]
        if suffix == "obj":
            cut = cut[: cut.rfind(b"\n") + 1] + b"f 1 2"
        path.write_bytes(cut)
        assert str(path) in refusal(path)
    random = np.random.default_rng(11)
    for size in (0, 1, 100, 5000):
        path.write_bytes(random.bytes(size))
        assert str(path) in refusal(path)


def test_nan_in_binary_files(tmp_path: Path) -> None:
    mesh = trimesh.creation.icosphere(subdivisions=1)
    vertices = np.array(mesh.vertices)
    vertices[3, 1] = np.nan
    path = tmp_path / "ball.ply"
    path.write_bytes(_exported(trimesh.Trimesh(vertices, mesh.faces, process=False), "ply", "binary"))
    assert re.match(rf"{re.escape(str(path))}: \d triangles with a vertex that is NaN", refusal(path))
