"""Objects of scene descriptions: meshes, quads, boxes and spheres with their materials (docs/scenes.md)."""

import difflib
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from lightloom.golden_model.contract.engine_image import DIFFUSE, GLASS, MIRROR
from lightloom.golden_model.host.errors import InputError
from lightloom.golden_model.numerics.affine import determinant, rotation_matrix, transformed
from lightloom.golden_model.numerics.vectors import vector
from lightloom.golden_model.scene.coarse_geometry import decimated
from lightloom.golden_model.scene.files.cornell_box import BLOCKS, PART_NAMES, ROOM, cornell_box_parts
from lightloom.golden_model.scene.files.mesh_files import load_mesh
from lightloom.golden_model.scene.files.named_files import lack
from lightloom.golden_model.scene.files.polygons import triangulated
from lightloom.golden_model.scene.files.texture_files import BUILTIN, checker, load_texture
from lightloom.golden_model.scene.files.toml.paths import PATH, object_path
from lightloom.golden_model.scene.files.toml.tables import Table
from lightloom.golden_model.scene.mesh import check_part, turned_normals, with_area
from lightloom.golden_model.scene.parts import DEFAULT_ALBEDO, DEFAULT_IOR, Part
from lightloom.golden_model.scene.shapes import QUAD_UV, box, icosphere, quad_coordinates

GROUPS = {"cornell-box": PART_NAMES, "cornell-room": list(ROOM), "cornell-blocks": list(BLOCKS)}
"""Built-in parts by the names that `builtin` takes."""

SURFACES = {"diffuse": DIFFUSE, "mirror": MIRROR, "glass": GLASS}

LARGEST_IOR = 10.0
DEFAULT_SUBDIVISIONS = 4
"""Of spheres: 5120 triangles."""
MOST_SUBDIVISIONS = 7
MOST_REPEATS = 1024.0
"""Of a texture along each coordinate."""

_MATERIAL = ("albedo", "emission", "material", "two_sided", "ior", "texture", "emission_texture", "texture_scale")
_COMMON = ("name", *_MATERIAL, *PATH)
MESH = ("file", "builtin", "scale", "rotate", "translate", "coarse", "coarse_ratio", *_COMMON)
QUAD = ("corners", *_COMMON)
BOX = ("center", "size", "rotate", *_COMMON)
SPHERE = ("center", "radius", "subdivisions", "coarse_subdivisions", *_COMMON)


@dataclass(frozen=True)
class Objects:
    """Reads the objects of one scene description; paths in it are relative to `folder`."""

    folder: Path
    textures: dict[Path, np.ndarray] = field(default_factory=dict)
    """Pictures read so far, so that objects with the same one share it."""

    def mesh(self, table: Table) -> list[Part]:
        """The objects of a [[mesh]]: those of a file or built-in ones, transformed."""
        if ("file" in table) == ("builtin" in table):
            raise InputError(f"{table.where}: give either `file` or `builtin`")
        if "coarse" in table and "coarse_ratio" in table:
            raise InputError(f"{table.where}: give either `coarse` or `coarse_ratio`")
        parts = self._file(table, "file") if "file" in table else _builtin(table)
        matrix, shift = _transform(table)
        path = object_path(table, vector(shift))
        parts = [replace(_placed(part, matrix, shift), path=path) for part in parts]
        if "name" in table and len(parts) > 1:
            raise InputError(f"{table.where}: `name` is for one object, and this mesh has {len(parts)}")
        if len(parts) == 1:
            parts = [replace(parts[0], name=table.text("name", parts[0].name))]
        return self._coarser(table, [self._painted(table, part) for part in parts], matrix, shift)

    def quad(self, table: Table) -> Part:
        """A [[quad]]."""
        value = table.need("corners")
        if not (isinstance(value, list) and len(value) == 4):
            raise InputError(f"{table.where}: `corners` must be four points, counter-clockwise from the visible side")
        points = np.array(
            [
                Table(f"{table.where}, corner {k + 1}", {"point": p}, ("point",)).numbers("point", 3)
                for k, p in enumerate(value)
            ]
        )
        middle = ((points[0] + points[1]) + (points[2] + points[3])) / 4
        cut = triangulated(points, np.arange(4), np.array([4]))
        if len(cut.crossing):
            raise InputError(f"{table.where}: `corners` go across each other; give them in turn, counter-clockwise")
        coordinates = np.array(QUAD_UV, dtype=np.float32)[cut.corner]
        return self._finished(table, _plain("quad", points[cut.corner], coordinates), middle)

    def box(self, table: Table) -> Part:
        """A [[box]]."""
        size = np.array(table.numbers("size", 3))
        if size.min() <= 0:
            raise InputError(f"{table.where}: `size` must be greater than 0, not {size.tolist()}")
        centre = np.array(table.numbers("center", 3))
        corners = transformed(box(size), _rotation(table), centre)
        return self._finished(table, _plain("box", corners, quad_coordinates(6)), centre)

    def sphere(self, table: Table) -> Part:
        """A [[sphere]]: smooth normals, whatever the number of its triangles."""
        centre, radius = np.array(table.numbers("center", 3)), table.positive("radius")
        subdivisions = table.whole("subdivisions", 0, MOST_SUBDIVISIONS, DEFAULT_SUBDIVISIONS)

        def of(level: int) -> Part:
            unit = icosphere(level)
            return replace(_plain("sphere", unit * radius + centre, None), normals=unit.astype(np.float32))

        part = self._finished(table, of(subdivisions), centre)
        if "coarse_subdivisions" not in table:
            return part
        if subdivisions == 0:
            raise InputError(f"{table.where}: `coarse_subdivisions` needs `subdivisions` of 1 or more")
        level = table.whole("coarse_subdivisions", 0, subdivisions - 1)
        return replace(part, coarse=self._finished(table, of(level), centre))

    def _finished(self, table: Table, part: Part, pivot: np.ndarray) -> Part:
        """A part of our own making with what the table says about it."""
        named = replace(part, name=table.text("name", part.name), path=object_path(table, vector(pivot)))
        return self._painted(table, named)

    def _painted(self, table: Table, part: Part) -> Part:
        """A part with the materials of the table, where it names some."""
        surface = SURFACES[table.choice("material", SURFACES, "diffuse")]
        ior = table.number("ior", DEFAULT_IOR)
        if not 1 <= ior <= LARGEST_IOR:
            raise InputError(f"{table.where}: `ior` must lie within 1 to {LARGEST_IOR:g}, not {ior:g}")
        if "ior" in table and surface != GLASS:
            raise InputError(f'{table.where}: `ior` is of use with material = "glass" only')
        part = replace(
            part,
            albedo=_colour(table, "albedo", part.albedo),
            emission=_colour(table, "emission", part.emission),
            surface=surface,
            two_sided=table.flag("two_sided", part.two_sided),
            ior=ior,
        )
        if surface != DIFFUSE and part.two_sided:
            raise InputError(f"{table.where}: mirrors and glass show both sides; leave `two_sided` out")
        if surface != DIFFUSE and part.emission.any():
            raise InputError(f"{table.where}: only diffuse surfaces have an emission")
        return self._textured(table, part)

    def _textured(self, table: Table, part: Part) -> Part:
        found = {key: self._picture(table, part, key) for key in ("texture", "emission_texture") if key in table}
        if not found:
            if "texture_scale" in table:
                raise InputError(f"{table.where}: `texture_scale` is of use with a `texture` only")
            return part
        if "emission_texture" in found and not part.emission.any():
            raise InputError(f"{table.where}: `emission_texture` is of use with an `emission` only")
        if len({picture.shape for picture in found.values()}) > 1:
            raise InputError(f"{table.where}: `texture` and `emission_texture` must have as many pixels as each other")
        several = isinstance(table.values.get("texture_scale"), list)
        repeats = table.numbers("texture_scale", 2) if several else [table.number("texture_scale", 1.0)] * 2
        if not all(0 < abs(x) <= MOST_REPEATS for x in repeats):
            raise InputError(f"{table.where}: `texture_scale` must not be 0, at most {MOST_REPEATS:g}, not {repeats}")
        assert part.texture_uv is not None
        scaled = part.texture_uv.astype(np.float64) * np.array(repeats)
        return replace(
            part,
            texture=found.get("texture"),
            emission_texture=found.get("emission_texture"),
            texture_uv=scaled.astype(np.float32),
        )

    def _picture(self, table: Table, part: Part, key: str) -> np.ndarray:
        """The picture that a key of the table names."""
        if part.texture_uv is None:
            raise InputError(f"{table.where}: {part.name} has no texture coordinates, so it cannot have a `{key}`")
        name = table.text(key)
        if name in BUILTIN:
            return self.textures.setdefault(Path(name), checker())
        file = self.folder / name
        if file not in self.textures:
            self.textures[file] = load_texture(file, table.where)
        return self.textures[file]

    def _file(self, table: Table, key: str) -> list[Part]:
        file = self.folder / table.text(key)
        if lack(file):
            raise InputError(f"{table.where}: no such file: {file}")
        return load_mesh(file)

    def _coarser(self, table: Table, parts: list[Part], matrix: np.ndarray, shift: np.ndarray) -> list[Part]:
        """The parts with their reduced geometry, where the table asks for some."""
        if "coarse" in table:
            coarse = [_placed(part, matrix, shift) for part in self._file(table, "coarse")]
            if [len(part.albedo) for part in coarse] != [len(part.albedo) for part in parts]:
                raise InputError(f"{table.where}: `coarse` must hold as many objects and materials as the fine mesh")
            pairs = zip(parts, coarse, strict=True)
            return [replace(part, coarse=self._like(table, other, part)) for part, other in pairs]
        if "coarse_ratio" in table:
            ratio = table.number("coarse_ratio")
            if not 0 < ratio < 1:
                raise InputError(f"{table.where}: `coarse_ratio` must lie between 0 and 1, not {ratio:g}")
            for part in parts:
                check_part(part, f"{table.where}: {part.name}")  # the reduction is for sound meshes
            return [replace(part, coarse=decimated(with_area(part), ratio)) for part in parts]
        return parts

    def _like(self, table: Table, coarse: Part, fine: Part) -> Part:
        """Reduced geometry with the materials of the fine one."""
        painted = replace(coarse, name=fine.name, albedo=fine.albedo, emission=fine.emission)
        return self._textured(table, painted)


def _plain(name: str, corners: np.ndarray, texture_uv: np.ndarray | None) -> Part:
    """A part of one material with the default colours."""
    with np.errstate(over="ignore"):
        rounded = corners.astype(np.float32)
    return Part(
        name=name,
        corners=rounded,
        albedo=np.array([DEFAULT_ALBEDO], dtype=np.float32),
        emission=np.zeros((1, 3), dtype=np.float32),
        material=np.zeros(len(corners), dtype=np.int32),
        texture_uv=texture_uv,
    )


def _builtin(table: Table) -> list[Part]:
    name = table.text("builtin")
    known = {**GROUPS, **{part: [part] for part in PART_NAMES}}
    if name not in known:
        close = difflib.get_close_matches(name, known, n=1)
        hint = f"did you mean {close[0]!r}?" if close else f"known are {', '.join(known)}"
        raise InputError(f"{table.where}: no built-in part {name!r}; {hint}")
    return cornell_box_parts(known[name])


def _placed(part: Part, matrix: np.ndarray, shift: np.ndarray) -> Part:
    """A part of a mesh at its place in the scene."""
    corners = transformed(part.corners.astype(np.float64), matrix, shift)
    # A mirror image is turned inside out, so that its fronts stay in front.
    mirrored = determinant(matrix) < 0
    order = [2, 1, 0] if mirrored else [0, 1, 2]
    normals = part.normals
    if normals is not None and (matrix != np.eye(3)).any():
        normals = turned_normals(normals[:, order].astype(np.float64), matrix, mirrored)
    with np.errstate(over="ignore"):
        rounded = corners[:, order].astype(np.float32)
    return replace(
        part,
        corners=rounded,
        normals=normals,
        texture_uv=None if part.texture_uv is None else part.texture_uv[:, order],
    )


def _transform(table: Table) -> tuple[np.ndarray, np.ndarray]:
    """Scale, then rotation, then translation, as a matrix and a shift."""
    factor = table.values.get("scale", 1)
    scale = table.numbers("scale", 3) if isinstance(factor, list) else [table.number("scale", 1.0)] * 3
    if 0 in scale:
        raise InputError(f"{table.where}: `scale` must not be 0")
    return _rotation(table) * np.array(scale), np.array(table.numbers("translate", 3, (0, 0, 0)))


def _rotation(table: Table) -> np.ndarray:
    """The matrix (3, 3) float64 of the table's quaternion."""
    return rotation_matrix(*table.quaternion("rotate"))


def _colour(table: Table, key: str, values: np.ndarray) -> np.ndarray:
    """(M, 3): the table's colour for all materials, or `values` where it names none."""
    if key not in table:
        return values
    colour = table.not_negative(key)
    if key == "albedo" and not all(x <= 1 for x in colour):
        raise InputError(f"{table.where}: `albedo` must lie within 0 to 1, not {colour}")
    return np.broadcast_to(np.array(colour, dtype=np.float32), values.shape)
