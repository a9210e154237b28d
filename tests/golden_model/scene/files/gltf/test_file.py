"""glTF files: all ways of saying where triangles are, what is left out, and files that contradict themselves."""

import json
import re
import struct
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pygltflib import (
    AccessorSparseIndices,
    AccessorSparseValues,
    Animation,
    Camera,
    Image,
    Perspective,
    Scene,
    Sparse,
    Texture,
    TextureInfo,
)

from lightloom.golden_model.host.errors import InputError, InputWarning
from lightloom.golden_model.scene.files.gltf import file
from lightloom.golden_model.scene.files.load import load_scene
from lightloom.golden_model.scene.files.mesh_files import load_mesh
from lightloom.golden_model.scene.parts import DEFAULT_ALBEDO, Part
from tests.golden_model.gltf_files import FLOOR, LAMP, QUAD, Writer, primitive, room

FLOOR_TRIANGLES = np.array(FLOOR)[QUAD].reshape(-1, 3, 3).tolist()
LAMP_TRIANGLES = np.array(LAMP)[QUAD].reshape(-1, 3, 3).tolist()


def load(path: Path) -> tuple[list[Part], list[str]]:
    """The parts of a file and what is said of it, without its name."""
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        parts = load_mesh(path)
    assert all(warning.category is InputWarning for warning in said)
    return parts, [str(warning.message).removeprefix(f"{path}: ") for warning in said]


def one(writer: Writer, folder: Path) -> Part:
    """The only part of a file of which nothing is left out."""
    (part,), said = load(writer.save(folder / "mesh.glb"))
    assert not said
    return part


def check_room(path: Path, *expected: str) -> None:
    """The floor and the lamp of `room` with their materials, and what is said."""
    (floor, lamp), said = load(path)
    assert (floor.name, lamp.name) == ("floor", "lamp")
    assert floor.corners.tolist() == FLOOR_TRIANGLES
    assert lamp.corners.tolist() == LAMP_TRIANGLES
    assert floor.albedo.tolist() == np.array([[0.9, 0.1, 0.1]], dtype=np.float32).tolist()
    assert lamp.albedo.tolist() == np.array([[0.1, 0.1, 0.9]], dtype=np.float32).tolist()
    assert floor.emission.tolist() == [[0, 0, 0]]
    assert lamp.emission.tolist() == [[1, 1, 1]]
    assert said == list(expected)


# --- materials ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("names", [("Mat", "Mat"), (None, None), ("", ""), ("lamp", "floor")])
def test_materials_go_by_their_numbers(tmp_path: Path, names: tuple[str | None, str | None]) -> None:
    check_room(room(names=names).save(tmp_path / "room.glb"))


def test_several_materials_in_one_mesh(tmp_path: Path) -> None:
    out = Writer()
    points = out.array(FLOOR)
    for colour in ((1, 0, 0), (0, 1, 0)):
        out.material(colour)
    pieces = [primitive(points, out.array(o, "u1"), m) for o, m in (([0, 1, 2], 1), ([0, 2, 3], 0), ([3, 2, 0], 1))]
    out.node(mesh=out.mesh(*pieces, primitive(points, out.array([2, 1, 0], "u1"))))
    part = one(out, tmp_path)
    grey = np.array(DEFAULT_ALBEDO, dtype=np.float32).tolist()
    assert part.albedo[part.material].tolist() == [[0, 1, 0], [1, 0, 0], [0, 1, 0], grey]
    assert len(part.albedo) == 3
    assert part.corners.tolist() == np.array(FLOOR)[[[0, 1, 2], [0, 2, 3], [3, 2, 0], [2, 1, 0]]].tolist()


def test_emission_and_colours_out_of_range(tmp_path: Path) -> None:
    out = room(colours=((1.00001, -0.5, 0.5), (0, 0, 0)))
    out.gltf.materials[1].emissiveFactor = [1, 0.5, -1]
    out.gltf.materials[1].extensions = {"KHR_materials_emissive_strength": {"emissiveStrength": 8.0}}
    (floor, lamp), said = load(out.save(tmp_path / "room.glb"))
    assert floor.albedo.tolist() == [[1, 0, 0.5]]
    assert lamp.emission.tolist() == [[8, 4, 0]]
    assert said == ["2 colours out of range (first: baseColorFactor of material 0) brought to the nearest that can be"]


@pytest.mark.parametrize(("emission", "strength"), [(1e39, 1), (1e30, 1e30), (1e200, 1e200), (float("nan"), 1)])
def test_emissions_that_are_no_numbers_of_float32(tmp_path: Path, emission: float, strength: float) -> None:
    out = room()
    out.gltf.materials[1].emissiveFactor = [1, emission, 0]
    out.gltf.materials[1].extensions = {"KHR_materials_emissive_strength": {"emissiveStrength": strength}}
    said = refusal(out.save(tmp_path / "room.glb"))
    assert said == "emissiveFactor of material 1 is NaN, infinite or too large; correct or remove it"


# --- geometry -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("kind", "normalized", "most"),
    [
        ("i1", True, 127),
        ("u1", True, 255),
        ("i2", True, 32767),
        ("u2", True, 65535),
        ("i1", False, 1),
        ("u2", False, 1),
    ],
)
def test_quantized_positions(tmp_path: Path, kind: str, normalized: bool, most: int) -> None:
    """Normalized integers are divided by the largest, and none is below -1; four-byte rows, as the format asks."""
    out = Writer()
    raw = np.array([[0, most, 0], [most // 3, 0, 0], [0, 0, most], [most, most, most]])
    if kind[0] == "i":
        raw[1:3] *= -1
        raw[3, 0] = np.iinfo(kind).min if normalized else -5
    stride = {1: 4, 2: 8}[np.dtype(kind).itemsize]
    out.node(mesh=out.mesh(primitive(out.array(raw, kind, stride, normalized=normalized), out.array(QUAD, "u1"))))
    out.gltf.extensionsUsed = out.gltf.extensionsRequired = ["KHR_mesh_quantization"]
    expected = np.maximum(raw / most, -1) if normalized else raw
    assert one(out, tmp_path).corners.tolist() == expected[QUAD].reshape(-1, 3, 3).astype(np.float32).tolist()


@pytest.mark.parametrize(
    ("mode", "order", "triangles"),
    [
        (4, [0, 1, 2, 2, 3, 0], [[0, 1, 2], [2, 3, 0]]),
        (5, [0, 1, 3, 2], [[0, 1, 3], [1, 2, 3]]),
        (5, [0, 1, 2, 2, 3, 3, 1, 0], [[0, 1, 2], [3, 0, 1]]),  # goes on elsewhere
        (6, [0, 1, 2, 3], [[0, 1, 2], [0, 2, 3]]),
        (5, None, [[0, 1, 2], [1, 3, 2]]),
        (6, None, [[0, 1, 2], [0, 2, 3]]),
    ],
)
@pytest.mark.parametrize("kind", ["u1", "u2", "u4"])
def test_triangles_strips_and_fans(
    tmp_path: Path, mode: int, order: list[int] | None, triangles: list[list[int]], kind: str
) -> None:
    out = Writer()
    indices = None if order is None else out.array(order, kind)
    out.node(mesh=out.mesh(primitive(out.array(FLOOR), indices, mode=mode)))
    assert one(out, tmp_path).corners.tolist() == np.array(FLOOR)[triangles].tolist()


def test_triangles_without_indices(tmp_path: Path) -> None:
    out = Writer()
    out.node(mesh=out.mesh(primitive(out.array(np.array(FLOOR)[QUAD]))))
    assert one(out, tmp_path).corners.tolist() == FLOOR_TRIANGLES


def test_interleaved_attributes_and_offsets(tmp_path: Path) -> None:
    """Position, normal and texture coordinates of a vertex together, in one view, behind other bytes."""
    out = Writer()
    rows = np.zeros(4, dtype=[("p", "<f4", 3), ("n", "i1", 4), ("t", "<u2", 2)])
    rows["p"], rows["n"], rows["t"] = FLOOR, [0, 127, 0, 0], [[0, 65535], [65535, 65535], [65535, 0], [0, 0]]
    view = out.view(b"12345678" + rows.tobytes(), stride=rows.itemsize)
    out.node(
        mesh=out.mesh(
            primitive(
                out.accessor(view, 4, "f4", 3, 8),
                out.array(QUAD, "u2"),
                NORMAL=out.accessor(view, 4, "i1", 3, 20, normalized=True),
                TEXCOORD_0=out.accessor(view, 4, "u2", 2, 24, normalized=True),
            )
        )
    )
    part = one(out, tmp_path)
    assert part.corners.tolist() == FLOOR_TRIANGLES
    assert part.normals is not None
    assert (part.normals == [0, 1, 0]).all()
    assert part.texture_uv is not None
    assert part.texture_uv.tolist() == np.array([[0, 0], [1, 0], [1, 1], [0, 1]])[QUAD].reshape(-1, 3, 2).tolist()


@pytest.mark.parametrize("base", [True, False])
def test_sparse_accessors(tmp_path: Path, base: bool) -> None:
    """Some elements replaced; those without data are zero."""
    out = Writer()
    sparse = Sparse(
        count=2,
        indices=AccessorSparseIndices(bufferView=out.view(bytes([9, 1, 3])), byteOffset=1, componentType=5121),
        values=AccessorSparseValues(
            bufferView=out.view(np.array([5, 5, 5, 7, 8, 9, -1, 0, 2], "<f4").tobytes()), byteOffset=12
        ),
    )
    view = out.view(np.array(FLOOR, "<f4").tobytes()) if base else None
    out.node(mesh=out.mesh(primitive(out.accessor(view, 4, "f4", 3, sparse=sparse), out.array(QUAD, "u1"))))
    points = np.array(FLOOR) if base else np.zeros((4, 3), dtype=int)
    points[1], points[3] = [7, 8, 9], [-1, 0, 2]
    assert one(out, tmp_path).corners.tolist() == points[QUAD].reshape(-1, 3, 3).tolist()


# --- nodes --------------------------------------------------------------------------------------------------------


def test_nodes_place_their_meshes(tmp_path: Path) -> None:
    """Translation after rotation after scale, a matrix column by column, those above last; one mesh three times."""
    out = Writer()
    mesh = out.mesh(primitive(out.array(FLOOR), out.array(QUAD, "u1")), name="tile")
    top = out.node(translation=[10, 0, 0], rotation=[0, 0, 1, 1], scale=[1, 2, 4], name="top")  # a quarter about z
    out.node(below=top, mesh=mesh, translation=[0, 1, 0])
    out.node(mesh=mesh, matrix=[0, 0, -1, 0, 0, 1, 0, 0, 1, 0, 0, 0, 5, 6, 7, 1], name="turned")
    out.node(below=top, mesh=mesh, name="")
    parts, said = load(out.save(tmp_path / "mesh.glb"))
    assert not said
    assert [part.name for part in parts] == ["tile", "tile", "turned"]
    x, y, z = np.moveaxis(np.array(FLOOR_TRIANGLES), -1, 0)
    for part, expected in zip(
        parts,
        ([10 - 2 * (y + 1), x, 4 * z], [10 - 2 * y, x, 4 * z], [z + 5, y + 6, -x + 7]),
        strict=True,
    ):
        assert part.corners.tolist() == np.stack(expected, axis=-1).tolist()


def test_mirrored_and_stretched_nodes_keep_fronts_and_normals(tmp_path: Path) -> None:
    """Normals go with the inverse transpose: of a slope of one half after a stretch by two along it."""
    out = Writer()
    slope = [[0, 0, 0], [2, 1, 0], [0, 0, -2]]
    normal = np.array([[-1, 2, 0]] * 3) / np.sqrt(5)
    mesh = out.mesh(primitive(out.array(slope), NORMAL=out.array(normal)))
    out.node(mesh=mesh, scale=[2, 1, 1])
    out.node(mesh=mesh, scale=[-1, 1, 1])
    out.node(mesh=mesh, scale=[-1, -1, -1])
    (stretched, mirrored, turned), _ = load(out.save(tmp_path / "mesh.glb"))
    assert stretched.corners.tolist() == [[[0, 0, 0], [4, 1, 0], [0, 0, -2]]]
    assert mirrored.corners.tolist() == [[[0, 0, -2], [-2, 1, 0], [0, 0, 0]]]
    for part, expected in ((stretched, [-1, 4, 0]), (mirrored, [1, 2, 0]), (turned, [1, -2, 0])):
        assert part.normals is not None
        assert np.abs(part.normals - np.array(expected) / np.linalg.norm(expected)).max() < 1e-6
        a, b, c = part.corners[0].astype(np.float64)
        assert np.dot(np.cross(b - a, c - a), part.normals[0, 0]) > 0


def test_the_normal_of_a_triangle_stays_its_normal(tmp_path: Path) -> None:
    """After any affine map, mirrored ones among them."""
    rng = np.random.default_rng(20260731)
    out = Writer()
    for _ in range(20):
        triangle = rng.normal(size=(3, 3))
        normal = np.cross(triangle[1] - triangle[0], triangle[2] - triangle[0])
        mesh = out.mesh(primitive(out.array(triangle), NORMAL=out.array([normal / np.linalg.norm(normal)] * 3)))
        place = np.eye(4)
        place[:3] = rng.normal(size=(3, 4))
        out.node(mesh=mesh, matrix=place.T.reshape(-1).tolist())
    parts, _ = load(out.save(tmp_path / "mesh.glb"))
    for part in parts:
        a, b, c = part.corners[0].astype(np.float64)
        normal = np.cross(b - a, c - a)
        assert part.normals is not None
        assert np.abs(part.normals[0] - normal / np.linalg.norm(normal)).max() < 1e-4, "seed 20260731"


def test_normals_without_a_direction_are_derived(tmp_path: Path) -> None:
    out = Writer()
    out.node(mesh=out.mesh(primitive(out.array(FLOOR), out.array(QUAD, "u1"), NORMAL=out.array(np.zeros((4, 3))))))
    (part,), said = load(out.save(tmp_path / "mesh.glb"))
    assert part.normals is None
    assert said == ["left out: NORMAL of objects in which one is missing or cannot be used"]


@pytest.mark.parametrize(("name", "width"), [("NORMAL", 3), ("TEXCOORD_0", 2)])
@pytest.mark.parametrize("broken", [True, False])
def test_attributes_that_not_all_corners_have_are_said(tmp_path: Path, name: str, width: int, broken: bool) -> None:
    """One of them is no number, or one primitive has none."""
    out = Writer()
    points, order = out.array(FLOOR), out.array(QUAD, "u1")
    values = np.ones((4, width))
    if broken:
        values[3, 1] = np.nan
    pieces = [primitive(points, order, **{name: out.array(values)})]
    out.node(mesh=out.mesh(*pieces, *([] if broken else [primitive(points, order)])))
    (part,), said = load(out.save(tmp_path / "mesh.glb"))
    assert part.normals is part.texture_uv is None
    assert said == [f"left out: {name} of objects in which one is missing or cannot be used"]


@pytest.mark.parametrize("scene", [None, 0, 1])
def test_of_several_scenes_the_chosen_one(tmp_path: Path, scene: int | None) -> None:
    out = room()
    out.gltf.scenes = [Scene(nodes=[0]), Scene(nodes=[1])]
    out.gltf.scene = scene
    (part,), said = load(out.save(tmp_path / "room.glb"))
    assert part.name == ("lamp" if scene == 1 else "floor")
    assert said == ["left out: 1 of 2 scenes"]


def test_without_scenes_all_roots(tmp_path: Path) -> None:
    out = room()
    out.gltf.scenes, out.gltf.scene = [], None
    check_room(out.save(tmp_path / "room.glb"))


def test_the_scheme_of_data_in_any_case(tmp_path: Path) -> None:
    path = room().save(tmp_path / "room.gltf", "data")
    path.write_text(path.read_text().replace('"data:', '"DATA:'))
    check_room(path)


@pytest.mark.parametrize("buffer", ["binary", "data", "beside"])
@pytest.mark.parametrize("suffix", [".glb", ".gltf"])
def test_where_buffers_are(tmp_path: Path, suffix: str, buffer: str) -> None:
    if (suffix, buffer) == (".gltf", "binary"):
        return  # a .gltf file has no binary part
    path = room().save(tmp_path / f"a room{suffix}", buffer)
    check_room(path)
    assert load_scene(path).object_names == ["floor", "lamp"]


# --- what is left out ---------------------------------------------------------------------------------------------


def test_everything_that_is_not_read_is_said(tmp_path: Path) -> None:
    out = room()
    gltf = out.gltf
    floor, lamp = gltf.materials
    gltf.images, gltf.textures = [Image(uri="missing.png")], [Texture(source=0)]
    floor.pbrMetallicRoughness.baseColorTexture = TextureInfo(index=0)
    floor.pbrMetallicRoughness.metallicFactor = 0.5
    floor.alphaMode = "BLEND"
    floor.doubleSided = lamp.doubleSided = True
    lamp.emissiveTexture = TextureInfo(index=0)
    lamp.extensions = {"KHR_materials_unlit": {}}
    gltf.animations = [Animation()]
    gltf.cameras = [Camera(type="perspective", perspective=Perspective(yfov=0.7, znear=0.1))]
    gltf.extensionsUsed = ["KHR_lights_punctual", "KHR_materials_emissive_strength", "KHR_materials_unlit"]
    gltf.extensions = {"KHR_lights_punctual": {"lights": [{"type": "point"}]}}
    out.node(camera=0, extensions={"KHR_lights_punctual": {"light": 0}, "EXT_mesh_gpu_instancing": {}})
    more = [primitive(0, mode=mode) for mode in (0, 1, 2, 3)]
    for piece in gltf.meshes[0].primitives:
        piece.attributes.COLOR_0 = piece.attributes.TEXCOORD_1 = 0
        piece.targets = [{"POSITION": 0}]
    gltf.meshes[0].primitives += more
    check_room(
        out.save(tmp_path / "room.glb"),
        "left out: animations, cameras, KHR_lights_punctual, KHR_materials_unlit, TEXCOORD_1, COLOR_0, morph targets, "
        "points, lines, baseColorTexture, metallicFactor, alphaMode BLEND, doubleSided, emissiveTexture, "
        "doubleSided of what shines, EXT_mesh_gpu_instancing",
    )


def test_what_the_format_does_not_have_is_said(tmp_path: Path) -> None:
    """Keys and attributes that nobody knows; not those of a program's own, nor what belongs to skins."""
    path = room().save(tmp_path / "room.gltf", "beside")
    document = json.loads(path.read_text())
    document["nodes"][0]["scael"] = [2, 2, 2]
    document["asset"] |= {"extras": {"anything": 1}, "generatr": "me"}
    attributes = document["meshes"][0]["primitives"][0]["attributes"]
    for name in ("_OWN", "TANGENT", "JOINTS_0", "WEIGHTS_0", "NORMALS", "normal"):
        attributes[name] = attributes["POSITION"]
    path.write_text(json.dumps(document))
    check_room(path, "left out: `generatr`, `normal`, `scael`, NORMALS, normal")


# --- refusals -----------------------------------------------------------------------------------------------------


def refusal(path: Path) -> str:
    with pytest.raises(InputError) as caught:
        load_mesh(path)
    message = str(caught.value)
    assert message.startswith(f"{path}: ")
    assert "\n" not in message
    return message.removeprefix(f"{path}: ")


def changed(path: Path, change: Callable[[dict[str, Any]], Any], data: bytes = b"") -> Path:
    """The room as a .gltf file with its JSON changed, and its data in a file beside it."""
    room().save(path, "beside")
    document = json.loads(path.read_text())
    change(document)
    path.write_text(json.dumps(document))
    return path


def compressed(document: dict[str, Any]) -> None:
    for mesh in document["meshes"]:
        mesh["primitives"][0]["extensions"] = {"KHR_draco_mesh_compression": {"bufferView": 0, "attributes": {}}}
    for accessor in document["accessors"]:
        del accessor["bufferView"]


@pytest.mark.parametrize("required", [True, False])
@pytest.mark.parametrize("extension", ["KHR_draco_mesh_compression", "EXT_meshopt_compression"])
def test_extensions_that_are_needed_are_refused_by_name(tmp_path: Path, extension: str, required: bool) -> None:
    def change(document: dict[str, Any]) -> None:
        document["extensionsUsed"] = [extension]
        if required:
            document["extensionsRequired"] = ["KHR_mesh_quantization", extension]
        if "draco" in extension:
            compressed(document)
        else:
            document["buffers"][0] = {"byteLength": 108, "extensions": {extension: {"fallback": True}}}
            for view in document["bufferViews"]:
                view["extensions"] = {extension: {"buffer": 1}}

    said = refusal(changed(tmp_path / "room.gltf", change))
    assert said == f"needs the glTF extension {extension}, which is not read; save the file without it"


def setting(*path: str | int, value: Any) -> Callable[[dict[str, Any]], None]:
    def change(document: Any) -> None:
        for step in path[:-1]:
            document = document[step]
        document[path[-1]] = value

    return change


def test_names_with_line_breaks_stay_in_one_line(tmp_path: Path) -> None:
    out = room()
    out.gltf.extensionsUsed = ["EXT_line\nbreak"]
    _, said = load(out.save(tmp_path / "room.glb"))
    assert said == ["left out: EXT_line break"]
    out.gltf.extensionsRequired = ["EXT_line\nbreak"]
    assert "needs the glTF extension EXT_line break, which" in refusal(out.save(tmp_path / "room.glb"))


PRIMITIVE = ("meshes", 0, "primitives", 0)
UNIT = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (setting("asset", "version", value="1.0"), "is of glTF 1.0; only 2.0 is read"),
        (setting("asset", "version", value="2.9"), None),
        (setting("asset", "minVersion", value="2.0"), None),
        (setting("asset", "minVersion", value="1.0"), None),
        (setting("asset", "minVersion", value=None), None),
        (setting("asset", "minVersion", value="new"), "damaged or cut off"),
        (setting("asset", "minVersion", value="3.0"), "needs glTF 3.0; only 2.0 is read"),
        (setting("asset", "minVersion", value="2.1"), "needs glTF 2.1; only 2.0 is read"),
        (setting("asset", "minVersion", value=2.1), "needs glTF 2.1; only 2.0 is read"),
        (setting("accessors", 0, "count", value=6.0), "`count` is 6.0, not a whole number"),
        (setting(*PRIMITIVE, "mode", value=4.0), "`mode` is 4.0, not a whole number"),
        (setting(*PRIMITIVE, "mode", value=True), "`mode` is True, not a whole number"),
        (setting("accessors", 1, "normalized", value="no"), "`normalized` is 'no', not true or false"),
        (setting("accessors", 0, "count", value=6.5), "`count` is 6.5, not a whole number"),
        (setting("accessors", 0, "count", value="6"), "`count` is '6', not a whole number"),
        (setting("scenes", 0, "nodes", value=[0, 0.5]), "`nodes` is 0.5, not a whole number"),
        (setting("nodes", 0, "mesh", value=0.5), "`mesh` is 0.5, not a whole number"),
        (setting("extras", value={"count": 0.5}), None),
        (setting("asset", value=3), "damaged or cut off"),
        (setting("scene", value=7), "scene 7 does not exist; the file has 1"),
        (setting("scenes", 0, "nodes", value=[0, -1]), "node -1 does not exist; the file has 2"),
        (setting("scenes", 0, "nodes", value=[0, 0]), "node 0 is in two places, or below itself"),
        (setting("nodes", 0, "children", value=[1]), "node 1 is in two places"),
        (setting("nodes", 1, "children", value=[1]), "node 1 is in two places, or below itself"),
        (setting("nodes", 0, "mesh", value=9), "mesh 9 does not exist; the file has 2"),
        (setting("nodes", 0, "mesh", value=True), "`mesh` is True, not a whole number"),
        (setting("nodes", 0, "matrix", value=[1] * 15), "the matrix of node 0 is not 16 numbers"),
        (setting("nodes", 0, "matrix", value=[1] * 16), "the matrix of node 0 is not affine"),
        (setting("nodes", 0, "rotation", value=[0, 0, 0, 0]), "the rotation of node 0 is"),
        (setting("nodes", 0, "rotation", value=[0, 0, 1e200, 0]), "the rotation of node 0 is"),
        (setting("nodes", 0, "rotation", value=[0, 0, 1e-200, 0]), "the rotation of node 0 is"),
        (setting("nodes", 0, "rotation", value=["0", "0", "0", "1"]), "`rotation` is '0', not a number"),
        (setting("nodes", 0, value={"mesh": 0, "matrix": UNIT, "scale": [1, 1, 1]}), "node 0 has a matrix and a scale"),
        (setting("nodes", 0, "scale", value=[1, "x", 1]), "`scale` is 'x', not a number"),
        (setting("nodes", value="many"), "damaged or cut off"),
        (setting("nodes", 0, value=None), "damaged or cut off"),
        (setting("meshes", 0, value={"primitives": [None]}), "damaged or cut off"),
        (setting("meshes", 0, "primitives", 0, "attributes", value=7), "damaged or cut off"),
        (setting(*PRIMITIVE, "attributes", "POSITION", value=99), "accessor 99 does not exist"),
        (setting(*PRIMITIVE, "attributes", "POSITION", value=0), "accessor 0 is SCALAR, not VEC3"),
        (setting(*PRIMITIVE, "indices", value=1), "accessor 1 is VEC3, not SCALAR"),
        (setting(*PRIMITIVE, "material", value=2), "material 2 does not exist; the file has 2"),
        (setting(*PRIMITIVE, "material", value=[0]), "damaged or cut off"),
        (setting(*PRIMITIVE, "mode", value=7), "a primitive has the mode 7"),
        (setting("accessors", 0, "count", value=5), "5 indices are not three for each triangle"),
        (setting("accessors", 0, "componentType", value=5126), "elements need"),
        (setting("accessors", 0, "componentType", value=5130), "numbers of an unknown type, 5130"),
        (setting("accessors", 1, "count", value=-1), "the count of accessor 1 is -1"),
        (setting("accessors", 1, "count", value=2**62), "elements need"),
        (setting("accessors", 1, "count", value=3), "triangles name a vertex that does not exist .first: triangle 1."),
        (setting("accessors", 1, "byteOffset", value=4), "elements need"),
        (setting("accessors", 1, "byteOffset", value=-4), "the offset of an accessor is -4"),
        (setting("accessors", 1, "normalized", value=True), "accessor 1 is normalized float32"),
        (setting("accessors", 1, "sparse", value={"count": 1}), "is sparse without indices or values"),
        (setting("accessors", 1, value={"count": 2**60, "componentType": 5126, "type": "VEC3"}), "no data for them"),
        (setting("bufferViews", 1, "byteLength", value=2**40), "elements need|whose buffer has"),
        (setting("bufferViews", 1, "byteStride", value=0), "the stride of buffer view 1 is 0"),
        (setting("bufferViews", 1, "buffer", value=1), "buffer 1 does not exist; the file has 1"),
        (setting("buffers", 0, "byteLength", value=2**40), r"buffer 0 has 108 of \d+ bytes"),
        (setting("buffers", 0, "byteLength", value=107), "elements need 108 bytes .* whose buffer has 107"),
        (setting("buffers", 0, "uri", value="gone.bin"), "its file .*gone.bin is missing; put it there"),
        (setting("buffers", 0, "uri", value="data:;base64,***"), "buffer 0 is no base64"),
        (setting("buffers", 0, "uri", value="https://host/room.bin"), "are at an address, https://host/room.bin; put"),
        (setting("buffers", 0, "uri", value="FILE:///room.bin"), "its data are at an address"),
        (setting("buffers", 0, "uri", value="."), "its file .* is a folder; put it there"),
        (setting("buffers", 0, "uri", value="b" * 300), "its file .*b is missing; put it there"),
        (setting("buffers", 0, "uri", value="b%00"), "its file .* is missing; put it there"),
        (setting("buffers", 0, "uri", value="data:;base64,AAA"), "buffer 0 is no base64"),
        (setting("buffers", 0, "uri", value="data:;base64,AAAA"), "buffer 0 has 3 of 108 bytes"),
        (setting("materials", 0, "emissiveFactor", value=[1]), "emissiveFactor of material 0 is not 3 numbers"),
        (setting("materials", 0, "extensions", value=3), "damaged or cut off"),
    ],
)  # fmt: skip
def test_files_that_contradict_themselves(
    tmp_path: Path, change: Callable[[dict[str, Any]], Any], message: str | None
) -> None:
    path = changed(tmp_path / "room.gltf", change)
    if message is None:
        check_room(path)
    else:
        assert re.search(message, refusal(path)), refusal(path)


@pytest.mark.parametrize(("length", "message"), [(109, "has 108 of 109"), (105, "elements need"), (100, "says 100")])
def test_a_binary_part_of_another_length(tmp_path: Path, length: int, message: str) -> None:
    """It may have up to seven bytes more than its buffer says, which are no part of the buffer."""
    path = room().save(tmp_path / "room.glb")
    data = path.read_bytes()
    assert data.count(b'"byteLength": 108}') == 1
    path.write_bytes(data.replace(b'"byteLength": 108}', f'"byteLength": {length}}}'.encode()))
    assert message in refusal(path)


def test_one_mesh_in_many_nodes_is_refused_before_it_fills_the_memory(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = Writer()
    mesh = out.mesh(primitive(out.array(FLOOR), out.array(QUAD, "u1")))
    for _ in range(50):
        out.node(mesh=mesh)
    path = out.save(tmp_path / "many.glb")
    assert len(load_mesh(path)) == 50
    monkeypatch.setattr(file, "MOST_TRIANGLES", 99)
    assert "more than 99 triangles in all nodes" in refusal(path)


def test_not_finite_positions_reach_the_check_of_all_meshes(tmp_path: Path) -> None:
    out = Writer()
    points = np.array(FLOOR, dtype=np.float32)
    points[2, 1] = np.nan
    out.node(mesh=out.mesh(primitive(out.array(points), out.array(QUAD, "u1"))))
    path = out.save(tmp_path / "nan.glb")
    with pytest.raises(InputError, match="2 triangles with a vertex that is NaN"):
        load_scene(path)


@pytest.mark.parametrize(
    "change",
    [
        lambda data: b"",
        lambda data: data[:11],
        lambda data: b"glTF" + struct.pack("<I", 1) + data[8:],
        lambda data: b"glTG" + data[4:],
        lambda data: data[:12] + struct.pack("<I", 2**31) + data[16:],
        lambda data: data[:-1],
        lambda data: data[:400],
        lambda data: data[:20] + b"[" * 200_000 + data[20:],
    ],
)
def test_damaged_containers(tmp_path: Path, change: Callable[[bytes], bytes]) -> None:
    path = room().save(tmp_path / "room.glb")
    path.write_bytes(change(path.read_bytes()))
    refusal(path)


def test_deep_json(tmp_path: Path) -> None:
    path = tmp_path / "deep.gltf"
    path.write_text("[" * 100_000)
    refusal(path)


def test_random_damage_is_refused_in_one_line_or_read(tmp_path: Path) -> None:
    """Bytes of the file exchanged: whatever comes of it, it is no traceback and no other warning."""
    seed = 20261129
    rng = np.random.default_rng(seed)
    whole = room().save(tmp_path / "room.glb").read_bytes()
    path = tmp_path / "damaged.glb"
    outcomes = {"read": 0, "refused": 0}
    for trial in range(500):
        data = np.frombuffer(whole, dtype=np.uint8).copy()
        for place in rng.integers(len(data), size=rng.integers(1, 4)):
            digits = rng.integers(2) and 48 <= data[place] < 58
            data[place] = rng.integers(48, 58) if digits else rng.integers(32, 127)
        path.write_bytes(data.tobytes())
        try:
            load(path)
            outcomes["read"] += 1
        except InputError as error:
            outcomes["refused"] += str(error).count("\n") == 0
        except Exception:
            print(f"seed {seed}, trial {trial}: {data.tobytes()!r}")
            raise
    assert min(outcomes.values()) > 30, outcomes
    assert sum(outcomes.values()) == 500
