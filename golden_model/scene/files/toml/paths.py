"""Keyframes in scene descriptions: the paths of objects and point lights (docs/scenes.md)."""

import numpy as np

from lightloom.golden_model.host.errors import InputError
from lightloom.golden_model.numerics.vectors import vector
from lightloom.golden_model.scene.assemble import LARGEST
from lightloom.golden_model.scene.files.toml.tables import Table
from lightloom.golden_model.scene.keyframes import LightKey, LightPath, ObjectKey, ObjectPath

MOST_FRAMES = 1 << 24
"""Frame numbers lie below this: they and their differences are exact in float32."""

PATH = ("path", "loop", "pivot")
"""Keys of an object that moves."""


def key_frame(key: Table, before: int | None) -> int:
    """The frame number of a keyframe, greater than that of the one before."""
    frame = key.whole("frame", 0, MOST_FRAMES)
    if before is not None and frame <= before:
        raise InputError(f"{key.where}: `frame` must be greater than that before, {before}")
    return frame


def object_path(table: Table, pivot: np.ndarray) -> ObjectPath | None:
    """The path of the object that a table describes, None if it has none; `pivot` (3,) serves where it names none.

    What a keyframe leaves out is as in the keyframe before, in the first one as at rest.
    """
    keys: list[ObjectKey] = []
    now = ObjectKey(frame=-1, translate=vector((0, 0, 0)), rotate=_unit([1, 0, 0, 0]), emission=_ONE, present=True)
    for key in table.tables("path", ("frame", "translate", "rotate", "emission", "present")):
        emission = np.float32(key.number("emission", float(now.emission)))
        if not 0 <= emission <= LARGEST:
            raise InputError(f"{key.where}: `emission` must be a factor of 0 or more, not {emission:g}")
        now = ObjectKey(
            frame=key_frame(key, keys[-1].frame if keys else None),
            translate=vector(key.numbers("translate", 3)) if "translate" in key else now.translate,
            rotate=_unit(key.quaternion("rotate")) if "rotate" in key else now.rotate,
            emission=emission,
            present=key.flag("present", now.present),
        )
        keys.append(now)
    loop = _loop(table, keys[-1].frame if keys else None)
    if not keys:
        if "pivot" in table:
            raise InputError(f"{table.where}: `pivot` is of use with [[...path]] keyframes only")
        return None
    if "pivot" in table:
        pivot = vector(table.numbers("pivot", 3))
    return ObjectPath(keys=tuple(keys), pivot=pivot, loop=loop)


def light_path(table: Table, position: np.ndarray, intensity: np.ndarray) -> LightPath | None:
    """The path of a point light, None if it has none; the first keyframe leaves out what is as in the table itself."""
    keys: list[LightKey] = []
    now = LightKey(frame=-1, position=position, intensity=intensity)
    for key in table.tables("path", ("frame", "position", "intensity")):
        now = LightKey(
            frame=key_frame(key, keys[-1].frame if keys else None),
            position=vector(key.numbers("position", 3)) if "position" in key else now.position,
            intensity=vector(key.not_negative("intensity")) if "intensity" in key else now.intensity,
        )
        keys.append(now)
    loop = _loop(table, keys[-1].frame if keys else None)
    return LightPath(keys=tuple(keys), loop=loop) if keys else None


_ONE = np.float32(1)


def _loop(table: Table, last: int | None) -> int:
    """Frames after which a path begins again, 0 for never; `last` is the frame of its last keyframe."""
    if "loop" not in table:
        return 0
    if last is None:
        raise InputError(f"{table.where}: `loop` is of use with [[...path]] keyframes only")
    return table.whole("loop", max(last, 1), MOST_FRAMES)


def _unit(quaternion: list[float]) -> np.ndarray:
    """Of unit length, (4,) float32. The largest component becomes 1 first, so that no square leaves the range."""
    largest = max(abs(x) for x in quaternion)
    w, x, y, z = (value / largest for value in quaternion)
    length = np.sqrt(w * w + x * x + y * y + z * z)
    return np.array([w / length, x / length, y / length, z / length], dtype=np.float32)
