"""OBJ and MTL files as programs write them: encodings, line ends, names, polygons, materials that are missing."""

import codecs
import re
import warnings
from pathlib import Path

import numpy as np
import pytest

from lightloom.golden_model.host.errors import InputError, InputWarning
from lightloom.golden_model.scene.files.mesh_files import load_mesh
from lightloom.golden_model.scene.mesh import area_vectors
from lightloom.golden_model.scene.parts import DEFAULT_ALBEDO, Part

TRIANGLE = "v 0 5 0\nv -1 0 -1\nv -1 0 1\nv 1 0 1\nf 2 3 4\n"
PAINTED = "mtllib {}\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl a\nf 1 2 3\nusemtl l\nf 1 3 2\n"
GREY = np.array(DEFAULT_ALBEDO, dtype=np.float32).tolist()


def load(folder: Path, text: str | bytes, **materials: str) -> tuple[Part, list[str]]:
    """The only object of mesh.obj with material files NAME.mtl, and what is said of them, without the folder."""
    (folder / "mesh.obj").write_bytes(text.encode() if isinstance(text, str) else text)
    for name, content in materials.items():
        (folder / f"{name}.mtl").write_text(content)
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        (part,) = load_mesh(folder / "mesh.obj")
    assert all(warning.category is InputWarning for warning in said)
    return part, [str(warning.message).replace(f"{folder}/", "") for warning in said]


# --- text ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "data",
    [
        TRIANGLE.encode(),
        codecs.BOM_UTF8 + TRIANGLE.encode(),
        codecs.BOM_UTF16_LE + TRIANGLE.encode("utf-16-le"),
        codecs.BOM_UTF16_BE + TRIANGLE.encode("utf-16-be"),
        TRIANGLE.replace("\n", "\r\n").encode(),
        TRIANGLE.replace("\n", "\r").encode(),
        TRIANGLE.replace("f 2 3 4", "f 2 \\\n3\\\n 4 # and \\").encode(),
        TRIANGLE.replace("f 2 3 4\n", "f 2 3 4 \\").encode(),
        TRIANGLE.replace("f 2 3 4", "f -3 -2 -1").encode(),
        TRIANGLE.replace("f 2 3 4", "fo 2 3 4").encode(),
        TRIANGLE.replace("f 2 3 4", "f -3 -2 -1\nv 9 9 9").encode(),
        b"# \xff\xfe caf\xe9\n" + TRIANGLE.encode() + b"# end",
        TRIANGLE.replace("v 0 5 0", "\tv  0\t5  0 # top").encode(),
    ],
)
def test_text_as_editors_save_it(tmp_path: Path, data: bytes) -> None:
    part, said = load(tmp_path, data)
    assert part.corners.tolist() == [[[-1, 0, -1], [-1, 0, 1], [1, 0, 1]]]
    assert not said


def test_names_differ_where_their_bytes_do(tmp_path: Path) -> None:
    """Numbers after a `#`, and letters in another encoding than UTF-8."""
    (tmp_path / "m.mtl").write_bytes(
        b"newmtl w#1\nKd 1 0 0\nnewmtl w#2\nKd 0 1 0\nnewmtl \xe9\nKd 0 0 1\nnewmtl \xe8\n"
    )
    text = b"mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\n" + b"".join(
        b"usemtl " + name + b"\nf 1 2 3\n" for name in (b"w#1", b"w#2", b"\xe9", b"\xe8")
    )
    part, _ = load(tmp_path, text)
    assert part.albedo[part.material].tolist() == [[1, 0, 0], [0, 1, 0], [0, 0, 1], GREY]


# --- polygons -----------------------------------------------------------------------------------------------------


def test_a_concave_polygon_has_its_area_and_its_front(tmp_path: Path) -> None:
    part, _ = load(tmp_path, "v -1 0 -1\nv 0 0 0.5\nv -1 0 1\nv 1 0 1\nv 1 0 -1\nf 1 2 3 4 5\n")
    assert sorted((area_vectors(part.corners)[:, 1] / 2).tolist()) == [0.5, 1, 1.5]


def test_normals_textures_and_materials_follow_their_polygons(tmp_path: Path) -> None:
    """Convex ones keep the fan around their first corner, others do not; all keep their place in the file."""
    text = (
        "mtllib m.mtl\nv 0 0 0\nv 2 1 0\nv 0 4 0\nv 1 1 0\nv 5 0 0\n"
        "vt 0 0\nvt 0.2 0.1\nvt 0 0.4\nvt 0.1 0.1\nvt 0.5 0\nvn 0 0 1\nvn 1 0 0\nvn 0 1 0\nvn 0 0 -1\nvn -1 0 0\n"
        "usemtl a\nf 1/1/1 5/5/5 2/2/2\nusemtl b\nf 1/1/1 2/2/2 3/3/3 4/4/4\nusemtl a\nf 1/1/1 5/5/5 2/2/2 4/4/4\n"
    )
    part, said = load(tmp_path, text, m="newmtl a\nKd 1 0 0\nnewmtl b\nKd 0 1 0\n")
    point = {(0, 0): 1, (2, 1): 2, (0, 4): 3, (1, 1): 4, (5, 0): 5}
    order = [[point[(x, y)] for x, y, _ in triangle] for triangle in part.corners.tolist()]
    assert order == [[1, 5, 2], [2, 3, 4], [2, 4, 1], [1, 5, 2], [1, 2, 4]]
    assert part.albedo[part.material].tolist() == [[1, 0, 0], [0, 1, 0], [0, 1, 0], [1, 0, 0], [1, 0, 0]]
    assert part.texture_uv is not None
    assert np.array_equal(part.texture_uv, (part.corners[..., :2].astype(np.float64) / 10).astype(np.float32))
    given = np.array([[0, 0, 1], [1, 0, 0], [0, 1, 0], [0, 0, -1], [-1, 0, 0]])
    assert part.normals is not None
    assert (part.normals == given[np.array(order) - 1]).all()
    assert not said


def test_negative_indices_count_back_from_the_last_of_their_kind(tmp_path: Path) -> None:
    """Of which there are not as many as vertices."""
    text = "v 9 9 9\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 0.5 0\nvn 0 0 1\nf -3/-2/-1 -2/-1/-1 -1/-2/-1\n"
    part, _ = load(tmp_path, text)
    assert part.corners.tolist() == [[[0, 0, 0], [1, 0, 0], [0, 1, 0]]]
    assert part.texture_uv is not None
    assert part.texture_uv.tolist() == [[[0, 0], [0.5, 0], [0, 0]]]
    assert part.normals is not None
    assert part.normals.tolist() == [[[0, 0, 1]] * 3]


def test_faces_that_cross_themselves_are_told(tmp_path: Path) -> None:
    _, said = load(tmp_path, "v 0 0 0\nv 2 2 0\nv 3 0 0\nv 0 1 0\nf 1 2 3\n\nf 1 2 3 4\n")
    assert said == [
        "mesh.obj: faces that cross themselves, 1 in all (first: line 7), are cut into triangles as well as can be"
    ]


# --- materials ----------------------------------------------------------------------------------------------------


def test_a_grey_may_be_one_number(tmp_path: Path) -> None:
    part, said = load(tmp_path, PAINTED.format("m.mtl"), m="newmtl a\nKd 0.5\nnewmtl l\nKe 5\n")
    assert part.albedo.tolist() == [[0.5] * 3, GREY]
    assert part.emission.tolist() == [[0] * 3, [5] * 3]
    assert not said


@pytest.mark.parametrize(
    "named",
    [
        "one.mtl two.mtl",
        "my paint.mtl",
        "my paint.mtl one.mtl",
        "one.mtl my paint.MTL",
        ".\\sub\\my paint.mtl",
        "late",
    ],
)
def test_names_of_material_files(tmp_path: Path, named: str) -> None:
    """Several in a line, blanks in a name, both, another system's folders, and one that is named after its use."""
    red, light = "newmtl a\nKd 1 0 0\n", "newmtl l\nKe 1 1 1\n"
    both = red + light
    text = PAINTED.format(named)
    if named == "late":
        text = text.replace("mtllib late\n", "") + "mtllib both.mtl\n"
    (tmp_path / "sub").mkdir()
    for name, content in {
        "one.mtl": red if "two" in named else light,
        "two.mtl": light,
        "my paint.mtl": red if "one" in named else both,
        "my paint.MTL": red,
        "sub/my paint.mtl": both,
        "both.mtl": both,
    }.items():
        (tmp_path / name).write_text(content)
    part, said = load(tmp_path, text)
    assert part.albedo.tolist() == [[1, 0, 0], GREY]
    assert part.emission.tolist() == [[0] * 3, [1] * 3]
    assert not said


def test_materials_that_are_missing_become_grey(tmp_path: Path) -> None:
    part, said = load(tmp_path, PAINTED.format("missing.mtl m.mtl"), m="newmtl l\nKd 0 1 0\n")
    assert part.albedo.tolist() == [GREY, [0, 1, 0]]
    assert said == [
        "mesh.obj, line 1: material file missing.mtl is missing; its materials become grey",
        "mesh.obj: material a (line 5) is defined nowhere; it becomes grey",
    ]


def test_faces_without_a_material_stay_grey(tmp_path: Path) -> None:
    """Also where a material has no name."""
    text = "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nusemtl\nf 1 3 2\nusemtl a\nf 1 2 3\n"
    part, said = load(tmp_path, text, m="newmtl\nKd 0 1 0\nnewmtl a\nKd 1 0 0\n")
    assert part.albedo[part.material].tolist() == [GREY, GREY, [1, 0, 0]]
    assert not said


@pytest.mark.parametrize(
    ("line", "albedo", "emission"),
    [
        ("Kd 1.00001 .5 .5", [1, 0.5, 0.5], [0, 0, 0]),
        ("Kd -0.001 0.25 300", [0, 0.25, 1], [0, 0, 0]),
        ("Kd inf 0 0", [1, 0, 0], [0, 0, 0]),
        ("Ke -1 2 3", GREY, [0, 2, 3]),
    ],
)
def test_colours_out_of_range_are_clamped(
    tmp_path: Path, line: str, albedo: list[float], emission: list[float]
) -> None:
    part, said = load(tmp_path, PAINTED.format("m.mtl"), m=f"newmtl a\n{line}\nnewmtl l\nKd 1 1 1\n")
    assert part.albedo[0].tolist() == albedo
    assert part.emission[0].tolist() == emission
    assert said == [
        f"m.mtl: 1 colour out of range (first: line 2: {line} of material a) brought to the nearest that can be"
    ]


def test_a_material_defined_twice(tmp_path: Path) -> None:
    part, said = load(tmp_path, PAINTED.format("m.mtl"), m="newmtl a\nKd 1 1 1\nnewmtl l\nnewmtl a\nKd 0 1 0\n")
    assert part.albedo[0].tolist() == [0, 1, 0]
    assert said == ["m.mtl: material a is defined twice; the last one counts"]


def test_of_a_material_in_two_files_the_first_counts(tmp_path: Path) -> None:
    """In the order of their names, in one line or several; a file that is named again is no second one."""
    red, rest = "newmtl a\nKd 1 0 0\n", "newmtl a\nKd 0 1 0\nnewmtl l\nKd 0 0 1\n"
    for named in ("m.mtl n.mtl", "m.mtl\nmtllib n.mtl\nmtllib m.mtl n.mtl"):
        part, said = load(tmp_path, PAINTED.format(named), m=red, n=rest)
        assert part.albedo.tolist() == [[1, 0, 0], [0, 0, 1]]
        assert said == ["n.mtl: material a is defined twice; that of the first file counts"]


def test_names_that_are_no_files(tmp_path: Path) -> None:
    """Longer than names of files can be, and a folder."""
    (tmp_path / "sub").mkdir()
    for name, state in (("m" * 300, "missing"), ("sub", "a folder")):
        _, said = load(tmp_path, PAINTED.format(name))
        assert said[0] == f"mesh.obj, line 1: material file {name} is {state}; its materials become grey"


# --- what is left out ---------------------------------------------------------------------------------------------


def test_what_would_be_seen_is_said_to_be_left_out(tmp_path: Path) -> None:
    text = PAINTED.format("m.mtl").replace("v 0 0 0", "v 0 0 0 1 0.5 0") + "g wall\ns 1\nl 1 2\np 3\ncurv 0 1 1 2\n"
    material = (
        "newmtl a\nKa 1 1 1\nKs 0 0 0\nNs 10\nNi 1.5\nillum 2\nd 1\nTr 0\nmap_Kd -s 1 1 1 a.png\nbump b.png\n"
        "newmtl l\nKs 0.5 0 0\nd -halo 0.5\nTf 1 1 1\nmap_Kd c.png\n"
    )
    _, said = load(tmp_path, text, m=material)
    assert said == [
        "m.mtl: left out: `map_Kd`, `bump`, `Ks`, `d`",
        "mesh.obj: left out: colours of vertices, `l`, `p`, `curv`",
    ]


def test_statements_that_are_not_known_are_said(tmp_path: Path) -> None:
    """By name; those of curves by the curve. Of very many names the first ones."""
    known = "g a\ns off\nmg 1 2\nlod 3\nbevel on\nvp 0 1\ncstype bezier\ndeg 3\nparm u 0 1\nend\n"
    _, said = load(tmp_path, TRIANGLE + known + "F 2 3 4\nbzp 1\nsurf 0 1 0 1 1 2 3 4\nshadow_obj a.obj\n")
    assert said == ["mesh.obj: left out: `F`, `bzp`, `surf`, `shadow_obj`"]
    _, said = load(tmp_path, TRIANGLE + "".join(f"{k}{'x' * 30}\n" for k in range(100, 140)))
    (line,) = said
    assert line.startswith("mesh.obj: left out: `100xxxxxxxxxxxxxxxxx`, `101xxx")
    assert line.endswith("`119xxxxxxxxxxxxxxxxx` and 20 more")


@pytest.mark.parametrize(
    ("text", "left_out"),
    [
        (TRIANGLE.replace("v 0 5 0", "v 0 5 0 2"), "weights of vertices"),
        (TRIANGLE.replace("v 0 5 0", "v 0 5 0 1.0"), None),
        (TRIANGLE + "vt 0 0 0\n", None),
        (TRIANGLE + "vt 0 0 0.5\n", "third coordinates of `vt`"),
        (TRIANGLE + "vn 0 1 0\nf 2//1 3//1 4\n", "`vn` of objects in which one is missing or cannot be used"),
        (TRIANGLE + "vn 0 0 0\no b\nf 2//1 3//1 4//1\n", "`vn` of objects in which one is missing or cannot be used"),
        (TRIANGLE + "vt 0 0\nf 2/1 3/1 4\n", "`vt` of objects in which one is missing or cannot be used"),
    ],
)
def test_numbers_that_are_not_used_are_said(tmp_path: Path, text: str, left_out: str | None) -> None:
    (tmp_path / "mesh.obj").write_text(text)
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        load_mesh(tmp_path / "mesh.obj")
    expected = [] if left_out is None else [f"{tmp_path / 'mesh.obj'}: left out: {left_out}"]
    assert [str(warning.message) for warning in said] == expected


def test_words_of_materials_in_any_case(tmp_path: Path) -> None:
    part, said = load(tmp_path, PAINTED.format("m.mtl"), m="NEWMTL a\nKD 1 0 0\nnewmtl l\nkd 0 1 0\nke 5 5 5\n")
    assert part.albedo.tolist() == [[1, 0, 0], [0, 1, 0]]
    assert part.emission.tolist() == [[0, 0, 0], [5, 5, 5]]
    assert not said


def test_words_of_materials_that_are_not_known_are_said(tmp_path: Path) -> None:
    """Also what belongs to no material, and numbers behind a colour."""
    material = "Kd 1 0 0\nnewmtl a\nKd 0 1 0 1\nKt 1 1 1\nPr 0.5\nnewmtl l\nks 1 1 1\nMap_Kd a.png\n"
    part, said = load(tmp_path, PAINTED.format("m.mtl"), m=material)
    assert part.albedo.tolist() == [[0, 1, 0], GREY]
    assert said == [
        "m.mtl: left out: what stands before the first `newmtl`, what follows the third number of `Kd`, `Kt`, `ks`, "
        "`Map_Kd`"
    ]


def test_names_of_materials_may_hold_a_hash(tmp_path: Path) -> None:
    """As 3ds Max numbers them; elsewhere ` #` begins a comment."""
    (tmp_path / "a.mtl").write_text("newmtl M #1\nKd 1 0 0 # red\nnewmtl M #2\nKd 0 1 0\n")
    path = tmp_path / "mesh.obj"
    path.write_text(
        "mtllib a.mtl\nv 0 0 0 # first\nv 1 0 0\nv 0 1 0\nv 1 1 0\nusemtl M #1\nf 1 2 3\nusemtl M #2\nf 2 4 3\n"
    )
    (part,) = load_mesh(path)
    assert part.albedo[part.material].tolist() == [[1, 0, 0], [0, 1, 0]]


@pytest.mark.parametrize("nan", ["nan", "-nan(ind)", "-1.#IND00", "1.#QNAN"])
def test_normals_that_are_no_numbers_are_left_out(tmp_path: Path, nan: str) -> None:
    """As run-time libraries print them."""
    path = tmp_path / "mesh.obj"
    path.write_text(f"v 0 0 0\nv 1 0 0\nv 0 1 0\nvn {nan} 0 0\nf 1//1 2//1 3//1\n")
    with pytest.warns(InputWarning, match="left out: `vn` of objects"):
        (part,) = load_mesh(path)
    assert part.normals is None


def test_faces_of_two_corners_are_left_out(tmp_path: Path) -> None:
    path = tmp_path / "mesh.obj"
    path.write_text(TRIANGLE + "f 1 2\nf 1 2 3\nf 3 1\nf 3 2 1\n")
    with pytest.warns(InputWarning, match=r"left out: 2 faces of fewer than three corners \(first: line 6\)"):
        (part,) = load_mesh(path)
    assert len(part.corners) == 3


def test_a_terminal_obeys_no_name(tmp_path: Path) -> None:
    path = tmp_path / "mesh.obj"
    path.write_bytes(TRIANGLE.encode() + b"\x1b[31mred 1\n\x1a")
    with pytest.warns(InputWarning) as said:
        load_mesh(path)
    assert [str(one.message) for one in said] == [rf"{path}: left out: `\x1b[31mred`"]


# --- refusals -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("f 1 2 99999999999999999999", "line 6: a face names a vertex, normal or `vt` that does not exist"),
        ("f 1/0 2 3", "line 6: a face names a vertex, normal or `vt` that does not exist"),
        ("vn 0 1 0\nf 1//1 2//1 3//2", "line 7: a face names a normal that does not exist; the file has 1"),
        ("f 1//1 2 3", "line 6: a face names a normal that does not exist; the file has 0"),
        ("f 1/1 2/1 3/1", "line 6: a face names a `vt` that does not exist; the file has 0"),
        ("f 1 2 1_0", "line 6: '1_0' is not a corner of a face"),
        ("v 1_0 0 0", "line 6: `v` needs three numbers"),
        ("vt 0 \u0661", "line 6: `vt` needs one or two numbers"),
        ("f 1 2 2000000000", "line 6: a face names a vertex that does not exist; the file has 4"),
        ("f 1 2 3 -5", "line 6: a face names a vertex, normal or `vt` that does not exist"),
        ("f 1 2", "line 6: a face needs three or more corners"),
        ("f 1 2 \\\n", "line 7: a face needs three or more corners"),
        ("f 1/2/3/x 2 y", "line 6: '1/2/3/x' is not a corner of a face"),
        ("f 1 2 y", "line 6: 'y' is not a corner of a face"),
        ("f 1 2 " + "9" * 5000, "line 6: '99999999999999999999' is not a corner of a face"),
        ("vt 0 0\nf 1/00 2 3", "line 7: a face names a vertex, normal or `vt` that does not exist"),
        ("vt", "line 6: `vt` needs one or two numbers"),
    ],
)
def test_refusals_name_the_line(tmp_path: Path, line: str, message: str) -> None:
    path = tmp_path / "mesh.obj"
    path.write_text(TRIANGLE + line + "\n")
    with pytest.raises(InputError, match=rf"^{re.escape(str(path))}, {re.escape(message)}"):
        load_mesh(path)


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("Ke 1e39 .6 .7", ": line 2: Ke 1e39 .6 .7 of material a is NaN, infinite or too large; correct or remove it"),
        ("Ke 0 inf 0", ": line 2: Ke 0 inf 0 of material a is NaN, infinite or too large; correct or remove it"),
        ("Kd nan", ": line 2: Kd nan of material a is NaN, infinite or too large; correct or remove it"),
        ("Kd 1_0", ", line 2: `Kd` of material a needs one or three numbers; the file may be damaged or cut off"),
        ("Kd spectral red.rfl", ", line 2: `Kd` of material a is given as `spectral`, which is not read; give it red"),
        ("Ke xyz 1", ", line 2: `Ke` of material a is given as `xyz`, which is not read; give it red, green and blue"),
    ],
)
def test_colours_that_are_refused(tmp_path: Path, line: str, message: str) -> None:
    with pytest.raises(InputError) as caught:
        load(tmp_path, PAINTED.format("m.mtl"), m=f"newmtl a\n{line}\n")
    assert str(caught.value).startswith(f"{tmp_path / 'm.mtl'}{message}")
