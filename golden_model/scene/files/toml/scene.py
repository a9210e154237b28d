"""Scene descriptions in TOML (docs/scenes.md describes the format)."""

import math
import tomllib
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np

from lightloom.golden_model.contract.formats import CONE, POINT_LIGHT
from lightloom.golden_model.host.errors import InputError
from lightloom.golden_model.numerics.directions import sine_cosine_of
from lightloom.golden_model.numerics.vectors import vector
from lightloom.golden_model.scene.assemble import assemble
from lightloom.golden_model.scene.files.cornell_box import CAMERA, PATH
from lightloom.golden_model.scene.files.toml.objects import BOX, MESH, QUAD, SPHERE, Objects
from lightloom.golden_model.scene.files.toml.paths import key_frame, light_path
from lightloom.golden_model.scene.files.toml.surroundings import direction, environment
from lightloom.golden_model.scene.files.toml.tables import Table
from lightloom.golden_model.scene.keyframes import LightPath, segment
from lightloom.golden_model.scene.mesh import cross, dot
from lightloom.golden_model.scene.scene import Camera, Keyframe, RenderDefaults, Scene
from lightloom.golden_model.tables.pinhole import LARGEST_SIDE

_OBJECTS = ("mesh", "quad", "box", "sphere")
_LIGHTS = ("point_light", "spot_light", "sky", "sun")
SMALLEST = 1e-300
"""Divides what is 0 by no 0."""


def load_toml(path: Path) -> Scene:
    """The scene that a TOML file describes; paths in it are relative to its folder. Raises InputError."""
    try:
        values = tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise InputError(f"{path}: no such file") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from error
    except RecursionError:
        raise InputError(f"{path}: not a TOML file (nested too deeply)") from None
    except (UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise InputError(f"{path}: not a TOML file ({' '.join(str(error).split())})") from error
    known = ("name", "texel_size", "render", "camera", *_OBJECTS, *_LIGHTS)
    scene = Table(str(path), values, known)
    objects = Objects(path.parent)
    parts = [part for table in scene.tables("mesh", MESH) for part in objects.mesh(table)]
    parts += [objects.quad(table) for table in scene.tables("quad", QUAD)]
    parts += [objects.box(table) for table in scene.tables("box", BOX)]
    parts += [objects.sphere(table) for table in scene.tables("sphere", SPHERE)]
    lights, cones, light_paths = _point_lights(scene)
    camera, keys = _camera(scene)
    assembled = assemble(
        name=scene.text("name", path.stem),
        parts=parts,
        where=str(path),
        camera=camera,
        camera_path=keys,
        point_lights=lights,
        light_path=light_paths,
        texel_size=scene.positive("texel_size") if "texel_size" in scene else None,
    )
    return replace(assembled, render=_render_defaults(scene), environment=environment(scene, path.parent), cones=cones)


def _render_defaults(scene: Table) -> RenderDefaults:
    """The [render] table, where there is one."""
    table = Table(f"{scene.where}, [render]", scene.values.get("render", {}), ("frames", "size", "budget"))
    size = None
    if "size" in table:
        wide, high = (int(x) for x in table.numbers("size", 2))
        if [wide, high] != table.values["size"] or not (1 <= wide <= LARGEST_SIDE and 1 <= high <= LARGEST_SIDE):
            raise InputError(f"{table.where}: `size` must be two whole numbers, 1 to {LARGEST_SIDE}")
        size = wide, high
    return RenderDefaults(
        frames=table.whole("frames", 1) if "frames" in table else None,
        size=size,
        budget=table.whole("budget", 1) if "budget" in table else None,
    )


_PI = 3.141592653589793
SHARPEST = 2.0**-16
"""Difference of the cosines at both ends of a spot light's edge, at least."""
_POINT = ("position", "intensity", "path", "loop")
LARGEST_CONE = 180.0
"""Of a spot light, in degrees from edge to edge."""
SOFT = 0.75
"""Where the edge of a spot light begins, as a part of its angle, if its table does not say."""


def _point_lights(scene: Table) -> tuple[np.ndarray, np.ndarray, tuple[LightPath | None, ...]]:
    """POINT_LIGHT (P,) at rest, CONE (P,) or none, and the path of each: point lights, then spot lights."""
    spots = scene.tables("spot_light", (*_POINT, "towards", "angle", "inner_angle"))
    plain = scene.tables("point_light", _POINT)
    tables = plain + spots
    lights = np.zeros(len(tables), dtype=POINT_LIGHT)
    for light, table in zip(lights, tables, strict=True):
        light["position"], light["intensity"] = table.numbers("position", 3), table.not_negative("intensity")
    paths = [light_path(table, row["position"], row["intensity"]) for row, table in zip(lights, tables, strict=True)]
    cones = np.zeros(len(lights) if spots else 0, dtype=CONE)
    cones["outer"], cones["steepness"] = -1, 1
    for number, table in enumerate(spots, len(plain)):
        cones[number] = _cone(table)
    return lights, cones, tuple(paths)


def _cone(table: Table) -> tuple[np.ndarray, float, float]:
    """The CONE of a [[spot_light]]."""
    angle = table.number("angle")
    if not 0 < angle <= LARGEST_CONE:
        raise InputError(f"{table.where}: `angle` must lie within 0 to {LARGEST_CONE:g} degrees, not {angle:g}")
    inner = table.number("inner_angle", SOFT * angle)
    if not 0 <= inner <= angle:
        raise InputError(f"{table.where}: `inner_angle` must lie within 0 to `angle`, {angle:g}, not {inner:g}")
    _, cosine = sine_cosine_of(np.array([angle, inner]) * (_PI / 360))
    return direction(table, "towards"), cosine[0], 1 / max(cosine[1] - cosine[0], SHARPEST)


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
        frame = key_frame(key, keys[-1].frame if keys else None)
        position, target = vector(key.numbers("position", 3)), vector(key.numbers("target", 3))
        keys.append(Keyframe(frame=frame, position=position, target=target))
    camera = Camera(
        position=vector(table.numbers("position", 3)),
        target=vector(table.numbers("target", 3)),
        up=vector(table.numbers("up", 3, (0, 1, 0))),
        fov_y_tan=np.float32(table.number("fov_y_tan", 0.4)),
    )
    _check_view(where, camera.position, camera.target, camera.up)
    for view in keys:
        _check_view(f"{where}, frame {view.frame}", view.position, view.target, camera.up)
    _check_between(where, keys, camera.up)
    if not 0 < camera.fov_y_tan < 1e3:
        raise InputError(f"{where}: `fov_y_tan` must be greater than 0 and less than 1000, not {camera.fov_y_tan:g}")
    return camera, tuple(keys)


def _check_between(where: str, keys: Sequence[Keyframe], up: np.ndarray) -> None:
    """No frame between two keyframes may have a view that they may not have."""
    for begin, end in pairwise(keys):
        first, last = (_aside(key.position, key.target, up) for key in (begin, end))
        change = last - first
        # What points aside moves on a straight line; where it comes nearest to nothing a frame may hit that.
        share = -float(dot(first, change)) / max(float(dot(change, change)), SMALLEST)
        nearest = math.floor(begin.frame + min(max(share, 0), 1) * (end.frame - begin.frame))
        for frame in (nearest, nearest + 1):
            if not begin.frame < frame < end.frame:
                continue
            step = segment([begin.frame, end.frame], frame)[2]
            position = begin.position + step * (end.position - begin.position)
            target = begin.target + step * (end.target - begin.target)
            _check_view(f"{where}, frame {frame}", position, target, up)


def _aside(position: np.ndarray, target: np.ndarray, up: np.ndarray) -> np.ndarray:
    """What points to the right in a view, (3,) float64 of any length."""
    return cross(target.astype(np.float64) - position, up.astype(np.float64))


def _check_view(where: str, position: np.ndarray, target: np.ndarray, up: np.ndarray) -> None:
    if not _aside(position, target, up).any():
        raise InputError(f"{where}: position and target must differ, and `up` must not point along the view")
