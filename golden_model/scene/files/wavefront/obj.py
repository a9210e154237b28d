"""Wavefront OBJ: a strict reader that says which line cannot be used.

(General loaders let NaN, missing materials and indices out of range pass, or fail far from the line at fault.)
Read are `v`, `vn`, `vt`, `f` and its old form `fo` (polygons become triangles, negative indices count back), `o` (an
object each), `usemtl` and `mtllib`. All else is said to be left out, but for groups, smoothing and the like (UNSEEN).
"""

from pathlib import Path

import numpy as np

from lightloom.golden_model.host.errors import InputError
from lightloom.golden_model.scene.files.plain_text import differs, real, whole
from lightloom.golden_model.scene.files.polygons import triangulated
from lightloom.golden_model.scene.files.remarks import Remarks
from lightloom.golden_model.scene.files.wavefront.lines import LONGEST_WORD, lines
from lightloom.golden_model.scene.files.wavefront.mtl import Colours, Materials
from lightloom.golden_model.scene.mesh import unit_normals
from lightloom.golden_model.scene.parts import Part

OF_CURVES = frozenset(
    ("vp", "cstype", "deg", "bmat", "step", "parm", "trim", "hole", "scrv", "sp", "end", "con", "ctech", "stech")
)
"""Words for parts of curves and curved surfaces, which are said by what they belong to."""

UNSEEN = frozenset(("g", "s", "mg", "bevel", "c_interp", "d_interp", "lod", "maplib")) | OF_CURVES
"""Words that would not be seen, or not by themselves. What is not known may be: points, lines, other files."""

MOST = 2**31
"""Numbers of vertices that a face may name before they are known; no file holds so many."""


class _Faces:
    """The faces of one object."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.corners: list[tuple[int, int, int]] = []
        """Numbers of vertex, normal and texture point, -1 for none, of all faces' corners."""
        self.sizes: list[int] = []
        """Corners of each face; the rest is of each face too."""
        self.material: list[str] = []
        self.line: list[int] = []


def load_obj(path: Path) -> list[Part]:
    """The objects of an OBJ file, in their order; those without faces are left out. Raises InputError."""
    vertices: list[list[float]] = []
    normals: list[list[float]] = []
    coordinates: list[list[float]] = []
    remarks = Remarks(path)
    materials = Materials(path)
    objects = [_Faces(path.stem)]
    short: list[int] = []
    line = 0
    material = ""
    for line, key, text in lines(path):
        where = f"{path}, line {line}"
        values = text.split()
        if key == "v":
            vertices.append(_three(where, key, values))
            if len(values) >= 6:
                remarks.leave_out("colours of vertices")
            elif differs(values[3:], 1):
                remarks.leave_out("weights of vertices")
        elif key == "vn":
            normals.append(_three(where, key, values))
        elif key == "vt":
            coordinates.append(_two(where, key, values))
            if differs(values[2:], 0):
                remarks.leave_out("third coordinates of `vt`")
        elif key in ("f", "fo") and len(values) < 3:
            short.append(line)
        elif key in ("f", "fo"):
            faces = objects[-1]
            faces.corners += [_corner(where, word, len(vertices), len(normals), len(coordinates)) for word in values]
            faces.sizes.append(len(values))
            faces.material.append(material)
            faces.line.append(line)
        elif key == "o":
            objects.append(_Faces(text or path.stem))
        elif key == "usemtl":
            material = text
            materials.use(material, line)
        elif key == "mtllib":
            materials.load(text, line)
        elif key not in UNSEEN:
            remarks.leave_out(f"`{key[:LONGEST_WORD]}`")
    if short[-1:] == [line]:
        raise InputError(f"{path}, line {line}: a face needs three or more corners; the file may be cut off")
    if short:
        remarks.leave_out(f"{len(short)} faces of fewer than three corners (first: line {short[0]})")
    colours = materials.colours()
    points = np.array(vertices, dtype=np.float64).reshape(-1, 3)
    directions = np.array(normals, dtype=np.float64).reshape(-1, 3)
    pictured = np.array(coordinates, dtype=np.float64).reshape(-1, 2)
    crossing: list[int] = []
    parts = [_part(remarks, item, points, directions, pictured, colours, crossing) for item in objects if item.sizes]
    remarks.crossing(len(crossing), f"line {min(crossing, default=0)}")
    if parts:  # else the file is refused, and may be of another kind, with other words
        remarks.say()
    return parts


def _part(
    remarks: Remarks,
    item: _Faces,
    points: np.ndarray,
    directions: np.ndarray,
    coordinates: np.ndarray,
    colours: dict[str, Colours],
    crossing: list[int],
) -> Part:
    """`crossing` gets the lines of faces that cross themselves."""
    corners, sizes = np.array(item.corners), np.array(item.sizes)
    for column, (what, there) in enumerate((("vertex", points), ("normal", directions), ("`vt`", coordinates))):
        # -1 stands for none; a vertex is always named.
        outside = corners[:, column] >= len(there)
        if outside.any():
            face = int(np.repeat(np.arange(len(sizes)), sizes)[np.argmax(outside)])
            where = f"{remarks.path}, line {item.line[face]}"
            raise InputError(f"{where}: a face names a {what} that does not exist; the file has {len(there)}")
    triangles = triangulated(points, corners[:, 0], sizes)
    crossing += [item.line[face] for face in triangles.crossing]
    index = corners[triangles.corner]
    names = list(dict.fromkeys(item.material))
    number = {name: k for k, name in enumerate(names)}
    of_face = np.array([number[name] for name in item.material], dtype=np.int32)
    with np.errstate(over="ignore"):
        rounded = points[index[..., 0]].astype(np.float32)
    unit = _unit_normals(directions, index[..., 1])
    pictured = _texture_coordinates(coordinates, index[..., 2])
    for what, found, column in (("`vn`", unit, 1), ("`vt`", pictured, 2)):
        if found is None and (index[..., column] >= 0).any():
            remarks.leave_out_some(what)
    return Part(
        name=item.name,
        corners=rounded,
        normals=unit,
        albedo=np.array([colours[name][0] for name in names], dtype=np.float32),
        emission=np.array([colours[name][1] for name in names], dtype=np.float32),
        material=of_face[triangles.face],
        texture_uv=pictured,
    )


def _unit_normals(directions: np.ndarray, index: np.ndarray) -> np.ndarray | None:
    """Unit normals at the corners, None where a corner has none that can be used: then they are derived."""
    if (index < 0).any():
        return None
    return unit_normals(directions[index])


def _texture_coordinates(coordinates: np.ndarray, index: np.ndarray) -> np.ndarray | None:
    """Texture coordinates at the corners, None where a corner has none that can be used."""
    if (index < 0).any():
        return None
    with np.errstate(over="ignore"):
        chosen = coordinates[index].astype(np.float32)
    return chosen if np.isfinite(chosen).all() else None


def _three(where: str, key: str, values: list[str]) -> list[float]:
    try:
        x, y, z = (real(word) for word in values[:3])
    except ValueError:
        raise InputError(f"{where}: `{key}` needs three numbers; the file may be damaged or cut off") from None
    return [x, y, z]


def _two(where: str, key: str, values: list[str]) -> list[float]:
    try:
        u, v = (real(word) for word in (values + ["0"] * (len(values) == 1))[:2])
    except ValueError:
        raise InputError(f"{where}: `{key}` needs one or two numbers; the file may be damaged or cut off") from None
    return [u, v]


def _corner(where: str, word: str, vertices: int, normals: int, coordinates: int) -> tuple[int, int, int]:
    """`v`, `v/vt`, `v//vn` or `v/vt/vn` to the numbers of vertex, normal and texture point, from 0; -1 for none."""
    parts = word.split("/")
    try:
        if len(parts) > 3:
            raise ValueError
        given = [whole(parts[0]), *(whole(part) if part else None for part in parts[1:]), None, None]
        vertex, texture, normal = (number or 0 for number in given[:3])
    except ValueError:
        shown = word[:LONGEST_WORD]
        raise InputError(f"{where}: {shown!r} is not a corner of a face; the file may be damaged or cut off") from None
    absent = vertex == 0 or 0 in given or vertex < -vertices or normal < -normals or texture < -coordinates
    if absent or max(vertex, normal, texture) > MOST:
        raise InputError(f"{where}: a face names a vertex, normal or `vt` that does not exist; numbers begin with 1")
    return (
        vertex - 1 if vertex > 0 else vertices + vertex,
        normal - 1 if normal >= 0 else normals + normal,
        texture - 1 if texture >= 0 else coordinates + texture,
    )
