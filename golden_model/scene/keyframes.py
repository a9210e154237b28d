"""Keyframed paths of objects and point lights, and where they are at a frame.

Between two keyframes positions, intensities and emission factors go in straight lines, orientations by normalized
linear interpolation of quaternions along the shorter way, and presence keeps the value of the keyframe before. Before
the first and after the last keyframe the end's value holds, unless the path repeats itself (`loop`). Everything is
float32 under the numeric contract, and a function of path and frame alone: frames can be asked for in any order.
"""

import functools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from lightloom.golden_model.numerics.floats import flush, quiet
from lightloom.golden_model.numerics.vectors import add, dot, subtract


@dataclass(frozen=True, kw_only=True)
class ObjectKey:
    """An object's pose at one frame, relative to the place where the scene file puts it (its rest)."""

    frame: int
    """Number of the frame, from 0."""
    translate: np.ndarray
    """Shift after the rotation, (3,) float32."""
    rotate: np.ndarray
    """Unit quaternion (w, x, y, z) of the rotation about the path's pivot, (4,) float32."""
    emission: np.float32
    """Factor to the emission of the object's materials, 0 or more."""
    present: bool
    """Whether the object is there, from this frame on until the next keyframe."""


@dataclass(frozen=True, kw_only=True)
class ObjectPath:
    """The motion of an object; objects of one path move together as one rigid body."""

    keys: tuple[ObjectKey, ...]
    """At least one, frame numbers rising."""
    pivot: np.ndarray
    """The point that rotations leave where it is, (3,) float32, in world coordinates at rest."""
    loop: int = 0
    """Frames after which the path begins again; 0: never."""

    @functools.cached_property
    def stays(self) -> bool:
        """Whether the object is at its rest place in every frame: its emission alone may change."""
        return all(key.present and not key.translate.any() and not key.rotate[1:].any() for key in self.keys)


@dataclass(frozen=True, kw_only=True)
class LightKey:
    """A point light at one frame."""

    frame: int
    """Number of the frame, from 0."""
    position: np.ndarray
    """(3,) float32."""
    intensity: np.ndarray
    """Radiant intensity RGB, (3,) float32."""


@dataclass(frozen=True, kw_only=True)
class LightPath:
    """The motion of a point light."""

    keys: tuple[LightKey, ...]
    """At least one, frame numbers rising."""
    loop: int = 0
    """Frames after which the path begins again; 0: never."""


@dataclass(frozen=True, kw_only=True)
class Pose:
    """An object at one frame: a point p of the object at rest is at rotation p + translation."""

    rotation: np.ndarray
    """(3, 3) float32, orthonormal to within rounding; exact for quarter turns about the axes."""
    translation: np.ndarray
    """(3,) float32."""
    emission: np.float32
    """Factor to the object's emission; 0 while it is absent."""
    present: bool
    """An absent object is seen by no ray and no camera."""


REST = Pose(
    rotation=np.eye(3, dtype=np.float32),
    translation=np.zeros(3, dtype=np.float32),
    emission=np.float32(1),
    present=True,
)
"""The pose of objects without a path."""


def segment(frames: Sequence[int], frame: int, loop: int = 0) -> tuple[int, int, np.float32]:
    """The keyframes around a frame, as indices into the rising `frames`, and how far between them it lies, 0 to 1.

    A frame that is a keyframe gives that keyframe twice and 0, as do the frames beyond either end.
    """
    frame = frame % loop if loop else frame
    after = next((k for k, key in enumerate(frames) if key > frame), len(frames))
    if after == 0:
        return 0, 0, np.float32(0)
    before = after - 1
    if after == len(frames) or frames[before] == frame:
        return before, before, np.float32(0)
    return before, after, np.float32(frame - frames[before]) / np.float32(frames[after] - frames[before])


def between(a: Any, b: Any, step: np.float32) -> np.ndarray:
    """a + step (b - a), float32 arrays or scalars."""
    return add(a, flush(step * subtract(b, a)))


@quiet
def rotation_of(quaternion: np.ndarray) -> np.ndarray:
    """The rotation (3, 3) float32 of a quaternion (w, x, y, z) of any length, (4,) float32.

    Every element is divided by the squared length, so that none has to be normalized before, and turns whose products
    are exact (quarter and half turns about an axis, whole numbers) are exact.
    """
    q = flush(np.asarray(quaternion, dtype=np.float32))
    products = flush(q[:, None] * q[None, :])
    w, x, y, z = range(4)
    square = flush(flush(flush(products[w, w] + products[x, x]) + products[y, y]) + products[z, z])

    def along(a: int, b: int, c: int) -> np.ndarray:
        """w w + a a - b b - c c."""
        return flush(flush(flush(products[w, w] + products[a, a]) - products[b, b]) - products[c, c])

    def across(a: int, b: int, c: int, sign: int) -> np.ndarray:
        """2 (a b +- w c)."""
        turned = products[w, c] if sign > 0 else -products[w, c]
        return flush(np.float32(2) * flush(products[a, b] + turned))

    rows = [
        [along(x, y, z), across(x, y, z, -1), across(x, z, y, 1)],
        [across(x, y, z, 1), along(y, z, x), across(y, z, x, -1)],
        [across(x, z, y, -1), across(y, z, x, 1), along(z, x, y)],
    ]
    return flush(np.array(rows, dtype=np.float32) / square)


def rotated(rotation: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Points (..., 3) by a rotation (3, 3): (row 0 . p, row 1 . p, row 2 . p), float32."""
    return np.stack([dot(row, points) for row in rotation], axis=-1)


@quiet
def object_pose(path: ObjectPath, frame: int) -> Pose:
    """Where an object is at a frame."""
    first, second, step = segment([key.frame for key in path.keys], frame, path.loop)
    a, b = path.keys[first], path.keys[second]
    # q and -q are the same rotation; the one nearer to the other end is the shorter way.
    products = flush(a.rotate * b.rotate)
    near = flush(flush(flush(products[0] + products[1]) + products[2]) + products[3]) >= 0
    rotation = rotation_of(between(a.rotate, b.rotate if near else -b.rotate, step))
    stays = subtract(path.pivot, rotated(rotation, path.pivot))
    return Pose(
        rotation=rotation,
        translation=add(stays, between(a.translate, b.translate, step)),
        emission=np.float32(between(a.emission, b.emission, step)) if a.present else np.float32(0),
        present=a.present,
    )


def light_at(path: LightPath, frame: int) -> tuple[np.ndarray, np.ndarray]:
    """Position and intensity of a point light at a frame, (3,) float32 each."""
    first, second, step = segment([key.frame for key in path.keys], frame, path.loop)
    a, b = path.keys[first], path.keys[second]
    return between(a.position, b.position, step), between(a.intensity, b.intensity, step)
