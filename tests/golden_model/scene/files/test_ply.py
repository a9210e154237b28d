"""PLY files as programs write them: text and binary, polygons, names of properties, what is left out, damage."""

import codecs
import struct
import warnings
from pathlib import Path

import numpy as np
import pytest

from lightloom.golden_model.host.errors import InputError, InputWarning
from lightloom.golden_model.scene.files.mesh_files import load_mesh
from lightloom.golden_model.scene.mesh import area_vectors
from lightloom.golden_model.scene.parts import Part

POINTS: list[list[float]] = [[0, 0, 0], [2, 1, 0], [0, 4, 0], [1, 1, 0], [5, 0, 0.5]]
FACES = [[0, 4, 1], [0, 1, 2, 3], [1, 4, 2]]
TRIANGLES = [[0, 4, 1], [1, 2, 3], [1, 3, 0], [1, 4, 2]]
"""The second face is concave: a fan around its dent."""

HEADER = (
    "ply\nformat {}\ncomment by a program\nelement vertex 5\nproperty float x\nproperty double y\nproperty float z\n"
)
LIST = "element face 3\nproperty list uchar {} {}\nend_header\n"


def written(kind: str, name: str = "vertex_indices", index: str = "int", end: str = "\n") -> bytes:
    """The mesh in a format of PLY."""
    header = (HEADER.format(f"{kind} 1.0") + LIST.format(index, name)).replace("\n", end).encode()
    if kind == "ascii":
        rows = [" ".join(map(str, point)) for point in POINTS] + [f"{len(f)} {' '.join(map(str, f))}" for f in FACES]
        return header + (end.join(rows) + end).encode()
    order = "<" if "little" in kind else ">"
    code = {"int": "i", "uint": "I", "ushort": "H", "uchar": "B"}[index]
    data = b"".join(struct.pack(f"{order}fdf", *point) for point in POINTS)
    return header + data + b"".join(struct.pack(f"{order}B{len(f)}{code}", len(f), *f) for f in FACES)


def load(folder: Path, data: bytes) -> tuple[Part, list[str]]:
    path = folder / "mesh.ply"
    path.write_bytes(data)
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        (part,) = load_mesh(path)
    assert all(warning.category is InputWarning for warning in said)
    return part, [str(warning.message).removeprefix(f"{path}: ") for warning in said]


@pytest.mark.parametrize("kind", ["ascii", "binary_little_endian", "binary_big_endian"])
@pytest.mark.parametrize(
    ("name", "index"), [("vertex_indices", "int"), ("vertex_index", "uchar"), ("vertex_index", "uint")]
)
def test_polygons_of_several_sizes(tmp_path: Path, kind: str, name: str, index: str) -> None:
    part, said = load(tmp_path, written(kind, name, index))
    assert part.corners.tolist() == np.array(POINTS)[TRIANGLES].tolist()
    assert (area_vectors(part.corners)[:, 2] > 0).all()
    assert part.name == "mesh"
    assert not said


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_line_ends(tmp_path: Path, end: str) -> None:
    part, _ = load(tmp_path, written("ascii", end=end))
    assert part.corners.tolist() == np.array(POINTS)[TRIANGLES].tolist()


@pytest.mark.parametrize("kind", ["ascii", "binary_little_endian"])
def test_what_follows_the_last_element_is_said_to_be_left_out(tmp_path: Path, kind: str) -> None:
    part, said = load(tmp_path, written(kind) + b"3 0 4 1\n")
    assert part.corners.tolist() == np.array(POINTS)[TRIANGLES].tolist()
    assert said == ["left out: what follows the last element"]


def test_the_header_ends_with_a_line_of_its_own(tmp_path: Path) -> None:
    data = written("binary_little_endian").replace(b"format", b"comment up to end_header\nformat", 1)
    part, _ = load(tmp_path, data)
    assert part.corners.tolist() == np.array(POINTS)[TRIANGLES].tolist()


def test_faces_without_lists_are_refused(tmp_path: Path) -> None:
    text = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\n"
    text += "element face 1\nproperty int vertex_indices\nend_header\n0 0 0\n0\n"
    with pytest.raises(InputError, match="the vertices of its faces are no lists"):
        load(tmp_path, text.encode())


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16"])
def test_byte_order_marks(tmp_path: Path, encoding: str) -> None:
    part, said = load(tmp_path, written("ascii").decode().encode(encoding))
    assert part.corners.tolist() == np.array(POINTS)[TRIANGLES].tolist()
    assert not said
    assert load(tmp_path, codecs.BOM_UTF8 + written("binary_big_endian"))[0].corners.tolist() == part.corners.tolist()


def text(vertex: str, face: str, rows: str) -> bytes:
    return f"ply\nformat ascii 1.0\nelement vertex 3\n{vertex}\n{face}\nend_header\n{rows}\n".encode()


XYZ = "property float x\nproperty float y\nproperty float z"
ONE = "element face 1\nproperty list uchar int vertex_indices"


@pytest.mark.parametrize("names", ["s t", "u v", "texture_u texture_v"])
def test_normals_and_texture_coordinates_of_vertices(tmp_path: Path, names: str) -> None:
    more = "".join(f"\nproperty float {name}" for name in ("nx", "ny", "nz", *names.split()))
    rows = "0 0 0 0 0 2 0 0\n1 0 0 0 3 0 1 0\n0 1 0 1 0 0 0 0.5\n3 0 1 2"
    part, said = load(tmp_path, text(XYZ + more, ONE, rows))
    assert part.normals is not None
    assert part.normals.tolist() == [[[0, 0, 1], [0, 1, 0], [1, 0, 0]]]
    assert part.texture_uv is not None
    assert part.texture_uv.tolist() == [[[0, 0], [1, 0], [0, 0.5]]]
    assert not said


def test_texture_coordinates_of_faces(tmp_path: Path) -> None:
    """They follow the corners of their face, whatever becomes of the others."""
    face = ONE.replace("face 1", "face 2") + "\nproperty list uchar float texcoord"
    part, said = load(tmp_path, text(XYZ, face, "0 0 0\n1 0 0\n0 1 0\n2 0 1 4 9 9 9 9\n3 0 1 2 6 0 0 1 0 0 0.5"))
    assert part.texture_uv is not None
    assert part.texture_uv.tolist() == [[[0, 0], [1, 0], [0, 0.5]]]
    assert said == ["left out: 1 faces of fewer than three corners"]


def test_what_would_be_seen_is_said_to_be_left_out(tmp_path: Path) -> None:
    colours = "\nproperty uchar red\nproperty uchar green\nproperty uchar blue"
    face = ONE + "\nelement edge 1\nproperty int vertex1\nproperty int vertex2\ncomment TextureFile a.png"
    rows = "0 0 0 1 2 3\n1 0 0 1 2 3\n0 1 0 1 2 3\n3 0 1 2\n0 1"
    _, said = load(tmp_path, text(XYZ + colours, face, rows))
    assert said == ["left out: TextureFile, colours of `vertex`, `edge`"]


@pytest.mark.parametrize(
    ("more", "face", "row", "left_out"),
    [
        ("uchar r\nproperty uchar g\nproperty uchar b", ONE, "3 0 1 2", "colours of `vertex`"),
        ("uchar diffuse_red", ONE, "3 0 1 2", "colours of `vertex`"),
        ("uchar alpha", ONE, "3 0 1 2", "colours of `vertex`"),
        ("float radius", ONE, "3 0 1 2", "`radius` of `vertex`"),
        ("float confidence\nproperty float intensity", ONE, "3 0 1 2", None),
        ("float nx\nproperty float ny", ONE, "3 0 1 2", "normals of objects in which one is missing or cannot be used"),
        ("float s", ONE, "3 0 1 2", "texture coordinates of objects in which one is missing or cannot be used"),
        (None, ONE + "\nproperty uchar red", "3 0 1 2 255", "colours of `face`"),
        (None, ONE + "\nproperty int material_index", "3 0 1 2 1", "`material_index` of `face`"),
        (None, ONE + "\nproperty list uchar int vertex_index", "3 0 1 2 3 2 1 0", "`vertex_index` of `face`"),
        (
            None,
            ONE + "\nproperty list uchar float texcoord",
            "3 0 1 2 2 0 0",
            "texture coordinates of objects in which one is missing or cannot be used",
        ),
    ],
)
def test_properties_that_are_not_read_are_said(
    tmp_path: Path, more: str | None, face: str, row: str, left_out: str | None
) -> None:
    vertex = XYZ + ("" if more is None else f"\nproperty {more}")
    extra = " 0" * (0 if more is None else more.count("property") + 1)
    rows = "".join(f"{point}{extra}\n" for point in ("0 0 0", "1 0 0", "0 1 0"))
    part, said = load(tmp_path, text(vertex, face, f"{rows}{row}\n"))
    assert part.corners.tolist() == [[[0, 0, 0], [1, 0, 0], [0, 1, 0]]]
    assert said == ([] if left_out is None else [f"left out: {left_out}"])


def test_faces_that_cross_themselves_are_told(tmp_path: Path) -> None:
    _, said = load(tmp_path, written("ascii").replace(b"4 0 1 2 3", b"5 0 1 2 4 3"))
    assert said == ["faces that cross themselves, 1 in all (first: face 1), are cut into triangles as well as can be"]
    _, said = load(tmp_path, written("ascii").replace(b"4 0 1 2 3", b"5 0 1 2 4 3").replace(b"3 0 4 1", b"2 0 4"))
    assert said[-1].startswith("faces that cross themselves, 1 in all (first: face 1)"), "counted with those left out"


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (b"3 0 4 1", b"3 0 4 5", "1 faces name a vertex that does not exist .first: face 0.; the mesh has 5 vertices"),
        (b"3 0 4 1", b"3 0 4 -1", "1 faces name a vertex that does not exist"),
        (b"3 0 4 1", b"3 0 4 0.5", "1 faces name a vertex that does not exist"),
        (b"3 0 4 1", b"3 0 4 nan", "1 faces name a vertex that does not exist"),
        (b"3 0 4 1", b"-3 0 4 1", "a list has -3 members"),
        (b"3 0 4 1", b"1e300 0 4 1", "damaged or cut off"),
        (b"3 0 4 1", b"inf 0 4 1", "damaged or cut off"),
        (b"3 0 4 1", b"3 0 x 1", "line 16: 'x' is not a number"),
        (b"element face 3", b"element face 4", "it has 8 rows of numbers, and needs more"),
        (b"element face 3", b"element face 999999999999999999", "damaged or cut off"),
        (b"element face 3", b"element face -3", "damaged or cut off"),
        (b"element face 3", b"element face 0", "no triangles; a mesh needs at least one"),
        (b"3 0 4 1", b"3 0 4 1 7", "line 16 has too many words, 5 instead of 4"),
        (b"3 0 4 1", b"3 0 4", "line 16 has too few words, 3"),
        (b"2 1 0", b"2 1", "line 12 has too few words, 2"),
        (b"2 1 0", b"2 1 0 0", "line 12 has too many words, 4 instead of 3"),
        (b"2 1 0", b"2 1_0 0", "'1_0' is not a number"),
        (b"2 1 0", "2 \u0661 0".encode(), "is not a number"),
        (b"element face 3", b"element face 0_3", "header line 'element face 0_3'"),
        (b"property float z", b"property float z\nproperty float x", "two properties of `vertex` have the name `x`"),
        (b"element face 3", b"element vertex 3", "two elements have the name `vertex`"),
        (b"property float x", b"property float w", "no x, y, z of its vertices"),
        (b"property float x", b"property half x", "header line 'property half x'"),
        (b"property float x", b"proper", "header line 'proper'"),
        (b"element face 3", b"element lost 9\nelement face 3", "lost has no properties"),
        (b"format ascii 1.0", b"format text 1.0", "header line 'format text 1.0'"),
        (b"format ascii 1.0", b"", "no format"),
        (b"format ascii 1.0", b"format ascii 1.1", "is of PLY 1.1; only 1.0 is read"),
        (b"format ascii 1.0", b"format ascii 1.0\nformat ascii 1.0", "header line 'format ascii 1.0'"),
        (b"end_header", b"", "no header"),
        (b"ply", b"plx", "no header"),
    ],
)
def test_damage_is_refused_in_one_line(tmp_path: Path, old: bytes, new: bytes, message: str) -> None:
    whole = written("ascii")
    assert old in whole
    with pytest.raises(InputError, match=message) as caught:
        load(tmp_path, whole.replace(old, new, 1))
    assert str(caught.value).startswith(f"{tmp_path / 'mesh.ply'}: ")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("kind", ["ascii", "binary_little_endian", "binary_big_endian"])
def test_a_file_that_is_cut_off_is_refused_wherever(tmp_path: Path, kind: str) -> None:
    whole = written(kind)
    for length in range(0, len(whole) - 2, 5):
        with pytest.raises(InputError):
            load(tmp_path, whole[:length])
