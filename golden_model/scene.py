"""A scene in memory: triangles, objects, materials, lights and a camera.

Conventions, everywhere in Lightloom: right-handed world coordinates; a triangle's front is the side from which its
vertices run counter-clockwise, so its normal is (v1 - v0) x (v2 - v0); surfaces are diffuse and reflect on both sides;
area lights shine from their front only. Radiance, irradiance and so on are RGB in W, m and sr as far as the scene's own
unit of length is taken for the metre.
"""

import functools
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from golden_model.errors import InputError
from golden_model.formats import POINT_LIGHT, TRIANGLE

LARGEST, SMALLEST = 2.0**40, 2.0**-40
"""Coordinates lie within +-LARGEST and the scene is larger than SMALLEST: squares of lengths stay normal float32."""


DEFAULT_ALBEDO = (0.7, 0.7, 0.7)
"""Of surfaces whose file names no material."""


@dataclass(frozen=True, kw_only=True)
class Camera:
    """A pinhole camera. To the right of the picture lies forward x up, where forward = target - position."""

    position: np.ndarray
    """The eye, (3,) float32."""
    target: np.ndarray
    """A point in the middle of the picture, (3,) float32."""
    up: np.ndarray
    """Points up in the picture, (3,) float32; need not be perpendicular or of unit length."""
    fov_y_tan: np.float32
    """Tangent of half the vertical field of view."""


@dataclass(frozen=True, kw_only=True)
class Keyframe:
    """A place on the camera's path."""

    frame: int
    """Number of the frame, from 0."""
    position: np.ndarray
    """(3,) float32."""
    target: np.ndarray
    """(3,) float32."""


@dataclass(frozen=True, kw_only=True)
class Part:
    """One object on its way into a scene."""

    name: str
    """Unique in the scene after `assemble`, which numbers equal names."""
    corners: np.ndarray
    """Corners of the triangles, (F, 3, 3) float32."""
    albedo: np.ndarray
    """Of its materials, (M, 3) float32, 0 to 1."""
    emission: np.ndarray
    """Radiance of its materials, (M, 3) float32."""
    material: np.ndarray
    """Material of each triangle, (F,) int32, an index into its own materials."""
    normals: np.ndarray | None = None
    """Unit normals at the corners, (F, 3, 3) float32, or None: derived by `shading_normals`."""


@dataclass(frozen=True, kw_only=True)
class Scene:
    """T triangles in O objects of M materials, P point lights."""

    name: str
    triangles: np.ndarray
    """TRIANGLE (T,)."""
    normals: np.ndarray
    """Unit normals at the corners, for shading, (T, 3, 3) float32."""
    object_id: np.ndarray
    """Object of each triangle, (T,) int32, not falling."""
    object_names: list[str]
    """(O,)."""
    material: np.ndarray
    """Material of each triangle, (T,) int32."""
    albedo: np.ndarray
    """Diffuse reflectance of each material, (M, 3) float32, 0 to 1."""
    emission: np.ndarray
    """Radiance that each material's front side emits, (M, 3) float32."""
    point_lights: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=POINT_LIGHT))
    """POINT_LIGHT (P,)."""
    camera: Camera
    """Where the first frame is seen from, if there is no path."""
    camera_path: tuple[Keyframe, ...] = ()
    """Keyframes, frame numbers rising."""
    texel_size: float
    """Side of a lightmap texel in the scene's unit of length."""

    @property
    def corners(self) -> np.ndarray:
        """Corners of the triangles, (T, 3, 3) float32."""
        return np.stack([self.triangles["v0"], self.triangles["v1"], self.triangles["v2"]], axis=1)

    @functools.cached_property
    def offset(self) -> np.float32:
        """How far off a surface rays start: 2**-17 of the largest coordinate (rounded up to a power of two).

        A point on a triangle, computed in float32, lies within a few units in the last place (2**-24) of the largest
        coordinate of the triangle's plane; so does the plane that the intersection test sees. The offset is 128 such
        units: enough at any scale and anywhere in the scene, and far below anything that can be seen.
        """
        largest = np.abs(self.corners).max()
        return np.float32(np.ldexp(np.float32(2.0**-17), int(np.frexp(largest)[1])))

    def camera_at(self, frame: int) -> Camera:
        """The camera of a frame: on the straight line between the keyframes around it; before and after, at the end."""
        path = self.camera_path
        if not path:
            return self.camera
        after = next((k for k, key in enumerate(path) if key.frame > frame), len(path))
        if after in (0, len(path)):
            key = path[0] if after == 0 else path[-1]
            return replace(self.camera, position=key.position, target=key.target)
        begin, end = path[after - 1], path[after]
        step = np.float32(frame - begin.frame) / np.float32(end.frame - begin.frame)
        return replace(
            self.camera,
            position=begin.position + step * (end.position - begin.position),
            target=begin.target + step * (end.target - begin.target),
        )


def require_light(scene: Scene) -> None:
    """Raises InputError where nothing in the scene shines."""
    if not (scene.emission[scene.material].any() or scene.point_lights["intensity"].any()):
        raise InputError(
            f"{scene.name}: the scene has no light; give a material emission (MTL: Ke, GLB: emissiveFactor) "
            "or write a scene file (TOML) with a [[point_light]]"
        )


def vector(values: Sequence[float] | np.ndarray) -> np.ndarray:
    """(3,) float32."""
    return np.array(values, dtype=np.float32)


def load_scene(name_or_path: str | Path) -> Scene:
    """A built-in scene by its name, a scene description (.toml) or a mesh file (.obj, .ply, .glb).

    A mesh file gets a camera that frames it. Raises InputError, one line, for everything that cannot be used.
    """
    # These modules make scenes, so they import this one.
    from golden_model.cornell_box import cornell_box
    from golden_model.mesh_files import MESH_SUFFIXES, load_mesh
    from golden_model.scene_files import load_toml

    builtin = {"cornell-box": cornell_box}
    if str(name_or_path) in builtin:
        return builtin[str(name_or_path)]()
    path = Path(name_or_path)
    suffix = path.suffix.lower()
    if suffix != ".toml" and suffix not in MESH_SUFFIXES:
        raise InputError(
            f"{name_or_path}: not a scene; known are the built-in {', '.join(builtin)} "
            f"and files ending in .toml, {', '.join(MESH_SUFFIXES)}"
        )
    if suffix == ".toml":
        return load_toml(path)
    return assemble(name=path.stem, parts=load_mesh(path), where=str(path))


def assemble(
    *,
    name: str,
    parts: Sequence[Part],
    where: str,
    camera: Camera | None = None,
    camera_path: tuple[Keyframe, ...] = (),
    point_lights: np.ndarray | None = None,
    texel_size: float | None = None,
) -> Scene:
    """Parts to a scene, each part one object. `where` (a file, an option) begins the message of every InputError.

    Without `camera` the scene gets one that frames it, without `texel_size` a 64th of its longest side.
    """
    from golden_model.mesh import check_part, shading_normals

    if not any(len(part.corners) for part in parts):
        raise InputError(f"{where}: no triangles; a scene needs at least one")
    for part in parts:
        check_part(part, f"{where}: {part.name}" if len(parts) > 1 else where)
    corners = np.concatenate([part.corners for part in parts]).astype(np.float32)
    low, high = corners.min(axis=(0, 1)).astype(np.float64), corners.max(axis=(0, 1)).astype(np.float64)
    if np.abs(corners).max() > LARGEST or (high - low).max() < SMALLEST:
        raise InputError(
            f"{where}: coordinates must lie within +-{LARGEST:.0e} and span {SMALLEST:.0e}; scale the scene"
        )

    names: list[str] = []
    for part in parts:
        same = sum(part.name == other.name for other in parts[: len(names)])
        names.append(part.name if same == 0 else f"{part.name}.{same + 1}")
    first_material = np.cumsum([0, *(len(part.albedo) for part in parts)])
    triangles = np.zeros(len(corners), dtype=TRIANGLE)
    for k in range(3):
        triangles[f"v{k}"] = corners[:, k]
    return Scene(
        name=name,
        triangles=triangles,
        normals=np.concatenate([shading_normals(p.corners) if p.normals is None else p.normals for p in parts]),
        object_id=np.repeat(np.arange(len(parts)), [len(p.corners) for p in parts]).astype(np.int32),
        object_names=names,
        material=np.concatenate([p.material + first for p, first in zip(parts, first_material, strict=False)]).astype(
            np.int32
        ),
        albedo=np.concatenate([p.albedo for p in parts]),
        emission=np.concatenate([p.emission for p in parts]),
        point_lights=np.zeros(0, dtype=POINT_LIGHT) if point_lights is None else point_lights,
        camera=framing_camera(low, high) if camera is None else camera,
        camera_path=camera_path,
        texel_size=float((high - low).max()) / 64 if texel_size is None else texel_size,
    )


def framing_camera(low: np.ndarray, high: np.ndarray) -> Camera:
    """A camera that looks at the box between the corners `low` and `high` ((3,) float64 each), from the front above."""
    half_tan = 0.4
    middle = (low + high) * 0.5
    half = (high - low) * 0.5
    radius = np.sqrt(half[0] * half[0] + half[1] * half[1] + half[2] * half[2])
    # The sphere around the box touches the field of view at radius / sin; a little more leaves a margin.
    distance = radius * np.sqrt(1 + half_tan * half_tan) / half_tan * 1.05
    toward = np.array([4.0, 4.0, 7.0]) / 9.0  # a Pythagorean quadruple: unit length
    return Camera(
        position=vector(middle + distance * toward),
        target=vector(middle),
        up=vector((0, 1, 0)),
        fov_y_tan=np.float32(half_tan),
    )
