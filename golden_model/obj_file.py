"""Wavefront OBJ with its MTL: a strict reader that says which line cannot be used.

(General loaders let NaN, missing materials and indices out of range pass, or fail far from the line at fault.)
Read are `v`, `vn`, `f` (polygons become fans of triangles, negative indices count back), `o` (an object each), `usemtl`
and `mtllib` with `Kd` (albedo) and `Ke` (emission). All else is ignored.
"""

import itertools
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from golden_model.errors import InputError
from golden_model.mesh import dot
from golden_model.scene import DEFAULT_ALBEDO, Part

Colours = tuple[list[float], list[float]]
"""Albedo and emission."""


class _Triangles:
    """The triangles of one object: vertex, normal and texture indices of the corners (-1: none), material, line."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.vertices: list[tuple[int, int, int]] = []
        self.normals: list[tuple[int, int, int]] = []
        self.textures: list[tuple[int, int, int]] = []
        self.material: list[str] = []
        self.line: list[int] = []


def load_obj(path: Path) -> list[Part]:
    """The objects of an OBJ file, in their order; those without faces are left out. Raises InputError."""
    vertices: list[list[float]] = []
    normals: list[list[float]] = []
    coordinates: list[list[float]] = []
    materials: dict[str, Colours] = {"": (list(DEFAULT_ALBEDO), [0.0, 0.0, 0.0])}
    objects = [_Triangles(path.stem)]
    material = ""
    for line, key, values in _lines(path):
        where = f"{path}, line {line}"
        if key == "v":
            vertices.append(_three(where, key, values))
        elif key == "vn":
            normals.append(_three(where, key, values))
        elif key == "vt":
            coordinates.append(_two(where, key, values))
        elif key == "f":
            corners = [_corner(where, word, len(vertices), len(normals), len(coordinates)) for word in values]
            if len(corners) < 3:
                raise InputError(f"{where}: a face needs three or more corners; the file may be cut off")
            for second, third in itertools.pairwise(corners[1:]):
                objects[-1].vertices.append((corners[0][0], second[0], third[0]))
                objects[-1].normals.append((corners[0][1], second[1], third[1]))
                objects[-1].textures.append((corners[0][2], second[2], third[2]))
                objects[-1].material.append(material)
                objects[-1].line.append(line)
        elif key == "o":
            objects.append(_Triangles(" ".join(values) or path.stem))
        elif key == "usemtl":
            material = " ".join(values)
            if material not in materials:
                raise InputError(f"{where}: material {material} is not defined; name its .mtl file in a mtllib line")
        elif key == "mtllib":
            materials.update(_load_mtl(path.parent / " ".join(values), where))
    points = np.array(vertices, dtype=np.float64).reshape(-1, 3)
    directions = np.array(normals, dtype=np.float64).reshape(-1, 3)
    pictured = np.array(coordinates, dtype=np.float64).reshape(-1, 2)
    return [_part(path, item, points, directions, pictured, materials) for item in objects if item.vertices]


def _part(
    path: Path,
    item: _Triangles,
    points: np.ndarray,
    directions: np.ndarray,
    coordinates: np.ndarray,
    materials: dict[str, Colours],
) -> Part:
    index = np.array(item.vertices)
    outside = ((index < 0) | (index >= len(points))).any(axis=1)
    if outside.any():
        raise InputError(
            f"{path}, line {item.line[int(np.argmax(outside))]}: a face names a vertex that does not exist; "
            f"the file has {len(points)}"
        )
    names = list(dict.fromkeys(item.material))
    number = {name: k for k, name in enumerate(names)}
    with np.errstate(over="ignore"):
        corners = points[index].astype(np.float32)
    return Part(
        name=item.name,
        corners=corners,
        normals=_unit_normals(directions, np.array(item.normals)),
        albedo=np.array([materials[name][0] for name in names], dtype=np.float32),
        emission=np.array([materials[name][1] for name in names], dtype=np.float32),
        material=np.array([number[name] for name in item.material], dtype=np.int32),
        texture_uv=_texture_coordinates(coordinates, np.array(item.textures)),
    )


def _unit_normals(directions: np.ndarray, index: np.ndarray) -> np.ndarray | None:
    """Unit normals at the corners, None where a corner has none that can be used: then they are derived."""
    if (index < 0).any() or (index >= len(directions)).any():
        return None
    chosen = directions[index]
    with np.errstate(all="ignore"):
        unit = chosen / np.sqrt(dot(chosen, chosen))[..., None]
    return unit.astype(np.float32) if np.isfinite(unit).all() else None


def _texture_coordinates(coordinates: np.ndarray, index: np.ndarray) -> np.ndarray | None:
    """Texture coordinates at the corners, None where a corner has none that can be used."""
    if (index < 0).any() or (index >= len(coordinates)).any():
        return None
    with np.errstate(over="ignore"):
        chosen = coordinates[index].astype(np.float32)
    return chosen if np.isfinite(chosen).all() else None


def _load_mtl(path: Path, where: str) -> dict[str, Colours]:
    """Materials by name. Raises InputError."""
    if not path.is_file():
        raise InputError(f"{where}: material file {path} is missing; put it there or remove the mtllib line")
    out: dict[str, Colours] = {}
    name = None
    for line, key, values in _lines(path):
        if key == "newmtl":
            name = " ".join(values)
            out[name] = (list(DEFAULT_ALBEDO), [0.0, 0.0, 0.0])
        elif key in ("Kd", "Ke") and name is not None:
            out[name][key == "Ke"][:] = _three(f"{path}, line {line}", key, values)
    return out


def _lines(path: Path) -> Iterator[tuple[int, str, list[str]]]:
    """(line number, first word, other words) of every line that holds something; a backslash joins lines."""
    try:
        text = path.read_text(encoding="utf-8", errors="replace")
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from error
    pending: list[str] = []
    for number, line in enumerate(text.splitlines(), start=1):
        words = line.split("#", 1)[0].split()
        if words and words[-1] == "\\":
            pending += words[:-1]
            continue
        words, pending = pending + words, []
        if words:
            yield number, words[0], words[1:]


def _three(where: str, key: str, values: list[str]) -> list[float]:
    try:
        x, y, z = (float(word) for word in values[:3])
    except ValueError:
        raise InputError(f"{where}: `{key}` needs three numbers; the file may be damaged or cut off") from None
    return [x, y, z]


def _two(where: str, key: str, values: list[str]) -> list[float]:
    try:
        u, v = (float(word) for word in (values + ["0"] * (len(values) == 1))[:2])
    except ValueError:
        raise InputError(f"{where}: `{key}` needs one or two numbers; the file may be damaged or cut off") from None
    return [u, v]


def _corner(where: str, word: str, vertices: int, normals: int, coordinates: int) -> tuple[int, int, int]:
    """`v`, `v/vt`, `v//vn` or `v/vt/vn` to the numbers of vertex, normal and texture point, from 0; -1 for none."""
    parts = word.split("/")
    try:
        vertex = int(parts[0])
        normal = int(parts[2]) if len(parts) > 2 and parts[2] else 0
        texture = int(parts[1]) if len(parts) > 1 and parts[1] else 0
    except ValueError:
        raise InputError(f"{where}: {word!r} is not a corner of a face; the file may be damaged or cut off") from None
    if vertex == 0 or vertex < -vertices or normal < -normals or texture < -coordinates:
        raise InputError(f"{where}: a face names a vertex or normal that does not exist; numbers begin with 1")
    return (
        vertex - 1 if vertex > 0 else vertices + vertex,
        normal - 1 if normal >= 0 else normals + normal,
        texture - 1 if texture >= 0 else coordinates + texture,
    )
