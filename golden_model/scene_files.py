"""Scene descriptions in TOML (docs/scenes.md describes the format)."""

import difflib
import math
import tomllib
from collections.abc import Collection
from pathlib import Path
from typing import Any

import numpy as np

from golden_model.cornell_box import BLOCKS, CAMERA, PART_NAMES, PATH, ROOM, cornell_box_parts
from golden_model.errors import InputError
from golden_model.formats import POINT_LIGHT
from golden_model.mesh_files import determinant, load_mesh, transformed
from golden_model.scene import DEFAULT_ALBEDO, Camera, Keyframe, Part, Scene, assemble, vector

GROUPS = {"cornell-box": PART_NAMES, "cornell-room": list(ROOM), "cornell-blocks": list(BLOCKS)}
"""Built-in parts by the names that `builtin` takes."""


class Table:
    """One TOML table with the words that begin messages about it; every reader raises InputError."""

    def __init__(self, where: str, values: Any, known: Collection[str]) -> None:
        if not isinstance(values, dict):
            raise InputError(f"{where}: must be a table")
        self.where = where
        self.values: dict[str, Any] = values
        for key in values:
            if key not in known:
                close = difflib.get_close_matches(key, known, n=1)
                hint = f"did you mean `{close[0]}`?" if close else f"known are {', '.join(known)}"
                raise InputError(f"{where}: unknown key `{key}`; {hint}")

    def __contains__(self, key: str) -> bool:
        return key in self.values

    def need(self, key: str) -> Any:
        """The value of a key that must be there."""
        if key not in self.values:
            raise InputError(f"{self.where}: `{key}` is missing")
        return self.values[key]

    def numbers(self, key: str, count: int, default: tuple[float, ...] | None = None) -> list[float]:
        """`count` finite numbers."""
        value = self.need(key) if default is None else self.values.get(key, list(default))
        if not (isinstance(value, list) and len(value) == count and all(_is_number(x) for x in value)):
            raise InputError(f"{self.where}: `{key}` must be {count} numbers, not {value!r}")
        return [float(x) for x in value]

    def number(self, key: str, default: float | None = None) -> float:
        """A finite number."""
        value = self.need(key) if default is None else self.values.get(key, default)
        if not _is_number(value):
            raise InputError(f"{self.where}: `{key}` must be a number, not {value!r}")
        return float(value)

    def text(self, key: str, default: str | None = None) -> str:
        """A string."""
        value = self.need(key) if default is None else self.values.get(key, default)
        if not isinstance(value, str):
            raise InputError(f"{self.where}: `{key}` must be text in quotes, not {value!r}")
        return value

    def tables(self, key: str, known: Collection[str]) -> list["Table"]:
        """An array of tables, none if the key is not there."""
        value = self.values.get(key, [])
        if not isinstance(value, list):
            raise InputError(f"{self.where}: write [[{key}]], with double brackets")
        return [Table(f"{self.where}, [[{key}]] {n}", item, known) for n, item in enumerate(value, start=1)]


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def load_toml(path: Path) -> Scene:
    """The scene that a TOML file describes; paths in it are relative to its folder. Raises InputError."""
    try:
        values = tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise InputError(f"{path}: no such file") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from error
    except (UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise InputError(f"{path}: not a TOML file ({' '.join(str(error).split())})") from error
    scene = Table(str(path), values, ("name", "texel_size", "camera", "mesh", "quad", "point_light"))
    parts = [part for table in scene.tables("mesh", _MESH) for part in _mesh(table, path.parent)]
    parts += [_quad(table) for table in scene.tables("quad", _QUAD)]
    lights = scene.tables("point_light", ("position", "intensity"))
    camera, keys = _camera(scene)
    texel_size = None
    if "texel_size" in scene:
        texel_size = scene.number("texel_size")
        if texel_size <= 0:
            raise InputError(f"{path}: `texel_size` must be greater than 0, not {texel_size:g}")
    return assemble(
        name=scene.text("name", path.stem),
        parts=parts,
        where=str(path),
        camera=camera,
        camera_path=keys,
        point_lights=np.array([_point_light(table) for table in lights], dtype=POINT_LIGHT),
        texel_size=texel_size,
    )


_MATERIAL = ("albedo", "emission")
_MESH = ("file", "builtin", "name", "scale", "rotate", "translate", *_MATERIAL)
_QUAD = ("corners", "name", *_MATERIAL)


def _mesh(table: Table, folder: Path) -> list[Part]:
    if ("file" in table) == ("builtin" in table):
        raise InputError(f"{table.where}: give either `file` or `builtin`")
    if "file" in table:
        file = folder / table.text("file")
        if not file.is_file():
            raise InputError(f"{table.where}: no such file: {file}")
        parts = load_mesh(file)
    else:
        name = table.text("builtin")
        known = {**GROUPS, **{part: [part] for part in PART_NAMES}}
        if name not in known:
            close = difflib.get_close_matches(name, known, n=1)
            hint = f"did you mean {close[0]!r}?" if close else f"known are {', '.join(known)}"
            raise InputError(f"{table.where}: no built-in part {name!r}; {hint}")
        parts = cornell_box_parts(known[name])
    matrix, shift = _transform(table)
    out = []
    for part in parts:
        corners = transformed(part.corners.astype(np.float64), matrix, shift)
        mirrored = determinant(matrix) < 0
        plain = (matrix == np.eye(3)).all()
        with np.errstate(over="ignore"):
            rounded = (corners[:, ::-1] if mirrored else corners).astype(np.float32)
        out.append(
            Part(
                name=table.text("name", part.name) if len(parts) == 1 else part.name,
                corners=rounded,
                # Normals of the file would need the inverse transpose; where there is more than a shift, derive them.
                normals=part.normals if plain else None,
                albedo=_colour(table, "albedo", part.albedo),
                emission=_colour(table, "emission", part.emission),
                material=part.material,
            )
        )
    return out


def _transform(table: Table) -> tuple[np.ndarray, np.ndarray]:
    """Scale, then rotation, then translation, as a matrix and a shift."""
    factor = table.values.get("scale", 1)
    scale = table.numbers("scale", 3) if isinstance(factor, list) else [table.number("scale", 1.0)] * 3
    if 0 in scale:
        raise InputError(f"{table.where}: `scale` must not be 0")
    w, x, y, z = table.numbers("rotate", 4, (1, 0, 0, 0))
    square = w * w + x * x + y * y + z * z
    if square == 0:
        raise InputError(f"{table.where}: `rotate` must not be all zero; it is a quaternion [w, x, y, z]")
    rotation = np.array(
        [
            [w * w + x * x - y * y - z * z, 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), w * w - x * x + y * y - z * z, 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z],
        ]
    )
    return rotation / square * np.array(scale), np.array(table.numbers("translate", 3, (0, 0, 0)))


def _colour(table: Table, key: str, values: np.ndarray) -> np.ndarray:
    """(M, 3): the table's colour for all materials, or `values` where it names none."""
    if key not in table:
        return values
    colour = table.numbers(key, 3)
    if key == "albedo" and not all(0 <= x <= 1 for x in colour):
        raise InputError(f"{table.where}: `albedo` must lie within 0 to 1, not {colour}")
    if min(colour) < 0:
        raise InputError(f"{table.where}: `{key}` must not be negative, not {colour}")
    return np.broadcast_to(np.array(colour, dtype=np.float32), values.shape)


def _quad(table: Table) -> Part:
    value = table.need("corners")
    if not (isinstance(value, list) and len(value) == 4):
        raise InputError(f"{table.where}: `corners` must be four points, counter-clockwise from the visible side")
    points = [
        Table(f"{table.where}, corner {k + 1}", {"point": p}, ("point",)).numbers("point", 3)
        for k, p in enumerate(value)
    ]
    corners = np.array(points, dtype=np.float32)[[[0, 1, 2], [0, 2, 3]]]
    return Part(
        name=table.text("name", "quad"),
        corners=corners,
        albedo=_colour(table, "albedo", np.array([DEFAULT_ALBEDO], dtype=np.float32)),
        emission=_colour(table, "emission", np.zeros((1, 3), dtype=np.float32)),
        material=np.zeros(2, dtype=np.int32),
    )


def _point_light(table: Table) -> tuple[list[float], list[float]]:
    intensity = table.numbers("intensity", 3)
    if min(intensity) < 0:
        raise InputError(f"{table.where}: `intensity` must not be negative, not {intensity}")
    return table.numbers("position", 3), intensity


def _camera(scene: Table) -> tuple[Camera | None, tuple[Keyframe, ...]]:
    """The camera and its path; None where the scene is to get one that frames it."""
    if "camera" not in scene:
        return None, ()
    where = f"{scene.where}, [camera]"
    table = Table(where, scene.values["camera"], ("builtin", "position", "target", "up", "fov_y_tan", "path"))
    if "builtin" in table:
        if table.text("builtin") != "cornell-box" or len(table.values) > 1:
            raise InputError(f'{where}: `builtin` must be "cornell-box", alone')
        return CAMERA, PATH
    keys: list[Keyframe] = []
    for key in table.tables("path", ("frame", "position", "target")):
        frame = key.need("frame")
        if not isinstance(frame, int) or isinstance(frame, bool) or frame < 0:
            raise InputError(f"{key.where}: `frame` must be a whole number from 0, not {frame!r}")
        if keys and frame <= keys[-1].frame:
            raise InputError(f"{key.where}: `frame` must be greater than that before, {keys[-1].frame}")
        position, target = vector(key.numbers("position", 3)), vector(key.numbers("target", 3))
        keys.append(Keyframe(frame=frame, position=position, target=target))
    camera = Camera(
        position=vector(table.numbers("position", 3)),
        target=vector(table.numbers("target", 3)),
        up=vector(table.numbers("up", 3, (0, 1, 0))),
        fov_y_tan=np.float32(table.number("fov_y_tan", 0.4)),
    )
    _check_view(where, camera.position, camera.target, camera.up)
    for key_frame in keys:
        _check_view(f"{where}, frame {key_frame.frame}", key_frame.position, key_frame.target, camera.up)
    if not 0 < camera.fov_y_tan < 1e3:
        raise InputError(f"{where}: `fov_y_tan` must be greater than 0 and less than 1000, not {camera.fov_y_tan:g}")
    return camera, tuple(keys)


def _check_view(where: str, position: np.ndarray, target: np.ndarray, up: np.ndarray) -> None:
    f, u = (target.astype(np.float64) - position).tolist(), up.astype(np.float64).tolist()
    side = [f[1] * u[2] - f[2] * u[1], f[2] * u[0] - f[0] * u[2], f[0] * u[1] - f[1] * u[0]]
    if side == [0, 0, 0]:
        raise InputError(f"{where}: position and target must differ, and `up` must not point along the view")
