"""PLY files, text and binary of both byte orders, to the one part that they hold.

Read are the vertices with their normals and texture coordinates, and the faces, polygons of any number of corners; all
else is said to be left out, but for what scanners note of a vertex (UNSEEN).
"""

import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from lightloom.golden_model.host.errors import InputError
from lightloom.golden_model.scene.files.plain_text import real, whole, without_mark
from lightloom.golden_model.scene.files.polygons import triangulated
from lightloom.golden_model.scene.files.remarks import Remarks
from lightloom.golden_model.scene.mesh import unit_normals
from lightloom.golden_model.scene.parts import DEFAULT_ALBEDO, Part

TYPES = {
    **dict.fromkeys(("char", "int8"), "i1"),
    **dict.fromkeys(("uchar", "uint8"), "u1"),
    **dict.fromkeys(("short", "int16"), "i2"),
    **dict.fromkeys(("ushort", "uint16"), "u2"),
    **dict.fromkeys(("int", "int32"), "i4"),
    **dict.fromkeys(("uint", "uint32"), "u4"),
    **dict.fromkeys(("float", "float32"), "f4"),
    **dict.fromkeys(("double", "float64"), "f8"),
}
"""Types of numbers by their names."""

ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
COORDINATES = (("s", "t"), ("u", "v"), ("texture_u", "texture_v"))
"""Names that programs give to texture coordinates."""

NORMAL = ("nx", "ny", "nz")
FACES = ("vertex_indices", "vertex_index")
"""Names of the list of a face's vertices; the first that is there counts."""

COLOUR = re.compile(r"((ambient|diffuse|specular)_)?(red|green|blue|alpha|r|g|b|a)|(ambient|diffuse|specular)_coeff")
"""Names of colours."""

UNSEEN = frozenset(("confidence", "intensity", "quality", "flags"))
"""What programs note of a vertex or a face that nobody sees."""


@dataclass(frozen=True)
class _Property:
    name: str
    kind: str
    size: str | None
    """Of a list the type of its length; None: one number."""


@dataclass(frozen=True)
class _Element:
    """A kind of thing in the file, and how many of it there are."""

    name: str
    count: int
    properties: list[_Property] = field(default_factory=list)


@dataclass(frozen=True)
class _Lists:
    """The lists of all things of a kind, one after the other."""

    sizes: np.ndarray
    values: np.ndarray


_Values = dict[str, Any]
"""Of all things of a kind by the names of their properties: numbers (count,) float64, or _Lists of such."""


def load_ply(path: Path) -> list[Part]:
    """The part of a PLY file, none if it has no faces. Raises InputError."""
    data = without_mark(path.read_bytes())
    order, elements, comments, start = _header(path, data)
    remarks = Remarks(path)
    if any(line.split()[1:2] == ["TextureFile"] for line in comments):
        remarks.leave_out("TextureFile")
    try:
        source = _Binary(data[start:], order) if order else _Text(data[start:], len(data[:start].splitlines()) + 1)
        found = {element.name: _read(source, element) for element in elements}
    except (ValueError, OverflowError) as error:
        raise _damaged(path, " ".join(str(error).split())[:100]) from error
    if not source.at_end():
        remarks.leave_out("what follows the last element")
    for element in elements:
        if element.name not in ("vertex", "face") and element.count:
            remarks.leave_out(f"`{element.name}`")
        elif element.count:
            _leave_out(remarks, element)
    part = _part(path, remarks, found.get("vertex", {}), found.get("face", {}))
    remarks.say()
    return [] if part is None else [part]


def _leave_out(remarks: Remarks, element: _Element) -> None:
    """What is not read of vertices or faces."""
    names = [prop.name for prop in element.properties]
    if element.name == "vertex":
        read = {"x", "y", "z", *NORMAL, *(name for pair in COORDINATES for name in pair)}
    else:
        read = {"texcoord", *[name for name in FACES if name in names][:1]}
    for name in names:
        if COLOUR.fullmatch(name):
            remarks.leave_out(f"colours of `{element.name}`")
        elif name not in read and name not in UNSEEN:
            remarks.leave_out(f"`{name}` of `{element.name}`")


def _damaged(path: Path, reason: str) -> InputError:
    return InputError(f"{path}: cannot be read as PLY, damaged or cut off ({reason})")


def _header(path: Path, data: bytes) -> tuple[str, list[_Element], list[str], int]:
    """Byte order ("" for text), elements, comments, and where the data begin."""
    first = re.match(rb"ply[ \t]*(\r\n|\n|\r)", data)
    end = re.search(rb"(?<=[\r\n])end_header[ \t]*" + first[1], data) if first else None
    if end is None:
        raise _damaged(path, "no header")
    elements: list[_Element] = []
    comments = []
    order, version = None, ""
    for line in data[: end.start()].decode("ascii", errors="backslashreplace").splitlines()[1:]:
        words = line.split()
        try:
            if words[:1] == ["format"] and order is None:
                order, version = ORDERS[words[1]], words[2]
            elif words[:1] == ["element"]:
                elements.append(_Element(words[1], whole(words[2])))
            elif words[:2] == ["property", "list"]:
                elements[-1].properties.append(_Property(words[4], TYPES[words[3]], TYPES[words[2]]))
            elif words[:1] == ["property"]:
                elements[-1].properties.append(_Property(words[2], TYPES[words[1]], None))
            elif words[:1] in (["comment"], ["obj_info"]):
                comments.append(line)
            elif words:
                raise ValueError
        except (ValueError, IndexError, KeyError):
            raise _damaged(path, f"header line {line.strip()[:60]!r}") from None
    for what, names in [
        ("elements", [element.name for element in elements]),
        *((f"properties of `{element.name}`", [prop.name for prop in element.properties]) for element in elements),
    ]:
        for name in names:
            if names.count(name) > 1:
                raise _damaged(path, f"two {what} have the name `{name}`")
    if order is None or any(element.count < 0 for element in elements):
        raise _damaged(path, "no format, or a negative count in its header")
    if version != "1.0":
        raise InputError(f"{path}: is of PLY {version[:20]}; only 1.0 is read")
    return order, elements, comments, end.end()


class _Text:
    """Rows of words that are numbers: a row is a thing of its kind."""

    def __init__(self, data: bytes, first_line: int) -> None:
        text = data.decode("ascii", errors="backslashreplace")
        every = enumerate(re.split(r"\r\n|\r|\n", text), start=first_line)
        self.rows = [(line, words) for line, row in every if (words := row.split())]
        self.place = 0
        self.word = 0
        """Of the row at `place`, the next one."""

    def take(self, kind: str, count: int) -> np.ndarray:
        """The next numbers of a row, (count,) float64. Raises ValueError where there are none."""
        line, words = self._row()
        if self.word + count > len(words):
            raise ValueError(f"line {line} has too few words, {len(words)}")
        self.word += count
        try:
            return np.array([real(word) for word in words[self.word - count : self.word]], dtype=np.float64)
        except ValueError as error:
            raise ValueError(f"line {line}: {error}") from None

    def end_row(self) -> None:
        """Goes to the next row. Raises ValueError where this one has more words."""
        line, words = self._row()
        if self.word < len(words):
            raise ValueError(f"line {line} has too many words, {len(words)} instead of {self.word}")
        self.place, self.word = self.place + 1, 0

    def block(self, columns: list[tuple[str, int]], rows: int) -> list[np.ndarray]:
        """Rows of numbers: for each column, which holds some, (rows, count) float64."""
        widths = [count for _, count in columns]
        chosen = self.rows[self.place : self.place + rows]
        if len(chosen) < rows or any(len(words) != sum(widths) for _, words in chosen):
            raise ValueError("the rows have other lengths")
        numbers = np.array([real(word) for _, words in chosen for word in words]).reshape(rows, sum(widths))
        self.place += rows
        return np.split(numbers, np.cumsum(widths)[:-1], axis=1)

    def at_end(self) -> bool:
        """Whether everything is read."""
        return self.place == len(self.rows)

    def _row(self) -> tuple[int, list[str]]:
        if self.at_end():
            raise ValueError(f"it has {len(self.rows)} rows of numbers, and needs more")
        return self.rows[self.place]


class _Binary:
    """Bytes in an order, "<" or ">"."""

    def __init__(self, data: bytes, order: str) -> None:
        self.data = data
        self.order = order
        self.place = 0

    def take(self, kind: str, count: int) -> np.ndarray:
        """As `_Text.take`."""
        return self.block([(kind, count)], 1)[0][0]

    def end_row(self) -> None:
        """Rows have no ends here."""

    def at_end(self) -> bool:
        """As `_Text.at_end`."""
        return self.place == len(self.data)

    def block(self, columns: list[tuple[str, int]], rows: int) -> list[np.ndarray]:
        """As `_Text.block`."""
        row = np.dtype([(str(k), self.order + kind, (count,)) for k, (kind, count) in enumerate(columns)])
        end = self.place + row.itemsize * rows
        if end > len(self.data):
            raise ValueError(f"it has {len(self.data)} of {end} bytes or more")
        found = np.frombuffer(self.data, row, rows, self.place) if row.itemsize else np.zeros(rows, dtype=row)
        self.place = end
        return [found[name].astype(np.float64) for name in row.names or ()]


def _read(source: _Text | _Binary, element: _Element) -> _Values:
    """All things of a kind. Raises ValueError where they are not all there."""
    if element.count and not element.properties:
        raise ValueError(f"{element.name} has no properties")
    found = _alike(source, element)
    return _one_by_one(source, element) if found is None else found


def _alike(source: _Text | _Binary, element: _Element) -> _Values | None:
    """In one go, where lists of a property have all the same length, as most have; None where they have not."""
    start = source.place
    first = _row(source, element) if element.count else [np.zeros(0)] * len(element.properties)
    columns, sizes = [], []
    for prop, values in zip(element.properties, first, strict=True):
        sizes.append(1 if prop.size is None else len(values))
        columns += [] if prop.size is None else [(prop.size, 1)]
        columns.append((prop.kind, sizes[-1]))
    source.place = start
    try:
        blocks = iter(source.block(columns, element.count))
    except ValueError:
        return None  # there may be shorter ones
    out: _Values = {}
    for prop, size in zip(element.properties, sizes, strict=True):
        if prop.size is None:
            out[prop.name] = next(blocks)[:, 0]
            continue
        if (next(blocks) != size).any():
            source.place = start
            return None
        out[prop.name] = _Lists(np.full(element.count, size), next(blocks).reshape(-1))
    return out


def _one_by_one(source: _Text | _Binary, element: _Element) -> _Values:
    rows: list[list[np.ndarray]] = [[] for _ in element.properties]
    for _ in range(element.count):
        for row, values in zip(rows, _row(source, element), strict=True):
            row.append(values)
    out: _Values = {}
    for prop, row in zip(element.properties, rows, strict=True):
        values = np.concatenate(row)
        out[prop.name] = values if prop.size is None else _Lists(np.array([len(one) for one in row]), values)
    return out


def _row(source: _Text | _Binary, element: _Element) -> list[np.ndarray]:
    """The numbers of each property of the next thing."""
    found = [
        source.take(prop.kind, 1 if prop.size is None else _length(source.take(prop.size, 1)))
        for prop in element.properties
    ]
    source.end_row()
    return found


def _length(found: np.ndarray) -> int:
    number = float(found[0])
    if not (number >= 0 and number == int(number)):
        raise ValueError(f"a list has {number:g} members")
    return int(number)


def _part(path: Path, remarks: Remarks, vertex: _Values, face: _Values) -> Part | None:
    faces = next((face[name] for name in FACES if name in face), None)
    if faces is not None and not isinstance(faces, _Lists):
        raise _damaged(path, "the vertices of its faces are no lists")
    if faces is None or not len(faces.sizes):
        return None
    points = _columns(vertex, ("x", "y", "z"))
    if points is None:
        raise _damaged(path, "no x, y, z of its vertices")
    named = np.repeat(np.arange(len(faces.sizes)), faces.sizes)
    outside = ~((faces.values >= 0) & (faces.values < len(points)) & (faces.values == np.floor(faces.values)))
    if outside.any():
        wrong = np.unique(named[outside])
        raise InputError(
            f"{path}: {len(wrong)} faces name a vertex that does not exist (first: face {wrong[0]}); the mesh has "
            f"{len(points)} vertices"
        )
    keep = faces.sizes >= 3
    if not keep.all():
        remarks.leave_out(f"{int((~keep).sum())} faces of fewer than three corners")
    corners = faces.values.astype(np.int64)[keep[named]]
    if not len(corners):
        return None
    triangles = triangulated(points, corners, faces.sizes[keep])
    crossing = np.flatnonzero(keep)[triangles.crossing]
    remarks.crossing(len(crossing), f"face {crossing.min(initial=len(keep))}")
    index = corners[triangles.corner]
    with np.errstate(over="ignore"):
        rounded = points[index].astype(np.float32)
    normals = _normals(vertex, index)
    uv = _texture_coordinates(vertex, face, faces, keep[named], index, triangles.corner)
    if normals is None and any(name in vertex for name in NORMAL):
        remarks.leave_out_some("normals")
    if uv is None and ("texcoord" in face or any(name in vertex for pair in COORDINATES for name in pair)):
        remarks.leave_out_some("texture coordinates")
    return Part(
        name=path.stem,
        corners=rounded,
        normals=normals,
        albedo=np.array([DEFAULT_ALBEDO], dtype=np.float32),
        emission=np.zeros((1, 3), dtype=np.float32),
        material=np.zeros(len(index), dtype=np.int32),
        texture_uv=uv,
    )


def _columns(vertex: _Values, names: tuple[str, ...]) -> np.ndarray | None:
    """Some properties side by side, (count, K); None where one is missing."""
    if any(not isinstance(vertex.get(name), np.ndarray) for name in names):
        return None
    return np.stack([vertex[name] for name in names], axis=1)


def _normals(vertex: _Values, index: np.ndarray) -> np.ndarray | None:
    """Unit normals at the corners, None where there are none, or one that has no direction: then they are derived."""
    given = _columns(vertex, NORMAL)
    if given is None:
        return None
    return unit_normals(given[index])


def _texture_coordinates(
    vertex: _Values, face: _Values, faces: _Lists, kept: np.ndarray, index: np.ndarray, corner: np.ndarray
) -> np.ndarray | None:
    """At the corners: those of the faces, where they have some, else of the vertices; None without."""
    of_faces = face.get("texcoord")
    if isinstance(of_faces, _Lists) and (of_faces.sizes == 2 * faces.sizes).all():
        found = of_faces.values.reshape(-1, 2)[kept][corner]
    else:
        given = next((uv for names in COORDINATES if (uv := _columns(vertex, names)) is not None), None)
        if given is None:
            return None
        found = given[index]
    with np.errstate(over="ignore"):
        rounded = found.astype(np.float32)
    return rounded if np.isfinite(rounded).all() else None
