"""A scene in memory: triangles, objects, materials, lights and a camera.

Conventions, everywhere in Lightloom: right-handed world coordinates; a triangle's front is the side from which its
vertices run counter-clockwise, so its normal is (v1 - v0) x (v2 - v0); diffuse surfaces reflect on both sides, mirrors
and glass have no lightmap; area lights shine from their front only. Radiance, irradiance and so on are RGB in W, m and
sr as far as the scene's own unit of length is taken for the metre.

A scene as loaded is at *rest*: every object where its file puts it. `Scene.at` gives the scene of a frame, in which
objects, lights and camera are moved along their paths (golden_model/paths.py); it is a function of scene and frame.
"""

import functools
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from golden_model.errors import InputError
from golden_model.formats import POINT_LIGHT, TRIANGLE
from golden_model.paths import REST, LightPath, ObjectPath, segment
from golden_model.ray_offset import spans

LARGEST, SMALLEST = 2.0**40, 2.0**-40
"""Coordinates lie within +-LARGEST and the scene is larger than SMALLEST: squares of lengths stay normal float32."""

DIFFUSE, MIRROR, GLASS = 0, 1, 2
"""Kinds of surface: diffuse ones have lightmaps; mirrors reflect, glass reflects and refracts, both without blur."""

KEPT_FRAMES = 4
"""Scenes of frames that a scene at rest keeps: a frame, those in flight beside it, and the one before."""

DEFAULT_IOR = 1.5
"""Index of refraction of glass whose file names none."""

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
class RenderDefaults:
    """What `lightloom render` takes where its options say nothing; None: the file says nothing either."""

    frames: int | None = None
    """Frames of the film, 1 or more."""
    size: tuple[int, int] | None = None
    """Width and height in pixels, 1 or more each."""
    budget: int | None = None
    """Rays that a frame may spend on the lightmaps, 1 or more."""


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
    surface: int = DIFFUSE
    """DIFFUSE, MIRROR or GLASS, of all its materials."""
    ior: float = DEFAULT_IOR
    """Index of refraction, where it is glass."""
    texture: np.ndarray | None = None
    """Linear RGB, (H, W, 3) float32, of all its materials; multiplies the albedo."""
    texture_uv: np.ndarray | None = None
    """Texture coordinates at the corners, (F, 3, 2) float32; None: (0, 0) everywhere."""
    path: ObjectPath | None = None
    """Its motion; None: it stays."""
    coarse: "Part | None" = None
    """The same object of fewer triangles, with the same materials, for `Scene.coarse`; None: it has no other form."""


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
    """Reflectance of each material, (M, 3) float32, 0 to 1: diffuse, or the tint of a mirror or of glass."""
    emission: np.ndarray
    """Radiance that each material's front side emits, (M, 3) float32, at this frame."""
    surface: np.ndarray
    """DIFFUSE, MIRROR or GLASS of each material, (M,) uint8."""
    ior: np.ndarray
    """Index of refraction of each material, (M,) float32; of use for GLASS."""
    texture: np.ndarray
    """Texture of each material, (M,) int32, an index into `textures`; -1: none."""
    textures: tuple[np.ndarray, ...] = ()
    """Linear RGB, (H, W, 3) float32 each; row 0 is at the bottom, v = 0. The albedo multiplies them."""
    texture_uv: np.ndarray
    """Texture coordinates at the corners, (T, 3, 2) float32; 1 is the whole picture, which repeats."""
    material_object: np.ndarray
    """Object of each material, (M,) int32: every object has materials of its own."""
    point_lights: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=POINT_LIGHT))
    """POINT_LIGHT (P,)."""
    camera: Camera
    """Of a frame's scene its camera; of the scene at rest where it is seen from if there is no path."""
    camera_path: tuple[Keyframe, ...] = ()
    """Keyframes, frame numbers rising."""
    texel_size: float
    """Side of a lightmap texel in the scene's unit of length."""
    object_path: tuple[ObjectPath | None, ...]
    """Motion of each object, (O,); None: it stays. Objects with the same path (one tuple member) move together."""
    light_path: tuple[LightPath | None, ...] = ()
    """Motion of each point light, (P,) or empty."""
    rotation: np.ndarray
    """Pose of each object, (O, 3, 3) float32: a point p at rest is at rotation p + translation."""
    translation: np.ndarray
    """(O, 3) float32."""
    glow: np.ndarray
    """Factor by which `emission` differs from that at rest, of each object, (O,) float32; 0 where it is absent."""
    present: np.ndarray
    """(O,) bool. The triangles of an absent object have NaN vertices: no ray and no pixel meets them."""
    render: RenderDefaults = field(default_factory=RenderDefaults)
    """How it is meant to be rendered."""
    coarse: "Scene | None" = None
    """The same objects and materials with fewer triangles ([0055]); None: no object has another form."""
    rest: "Scene | None" = field(default=None, repr=False)
    """The scene at rest that this one is a frame of; None: this one is it."""
    frame: int | None = None
    """The frame of which this is the scene; None: it is at rest."""

    @functools.cached_property
    def dynamic(self) -> bool:
        """Whether anything but the camera ever changes: an object's place, presence or emission, or a point light."""
        return any(path is not None for path in (*self.object_path, *self.light_path))

    @functools.cached_property
    def bodies(self) -> list[list[int]]:
        """The objects (numbers) that never move against each other: those that stay first, if any, then by their path.

        Objects have the same motion where their files give them one path, which is one `ObjectPath` here.
        """
        still = [k for k, path in enumerate(self.object_path) if path is None or path.stays]
        moving: dict[int, list[int]] = {}
        for k, path in enumerate(self.object_path):
            if path is not None and not path.stays:
                moving.setdefault(id(path), []).append(k)
        return ([still] if still else []) + list(moving.values())

    @property
    def last_frame(self) -> int:
        """The frame after which nothing new happens: the last keyframe, or the end of the longest loop; 0 without."""
        paths = [path for path in (*self.object_path, *self.light_path) if path is not None]
        frames = [path.loop or path.keys[-1].frame for path in paths]
        return max([0, *frames, *(key.frame for key in self.camera_path[-1:])])

    def at(self, frame: int) -> "Scene":
        """The scene of a frame, 0 or more; of any scene of the sequence, at rest or not, the same.

        Arrays that do not change are shared with the scene at rest; where nothing ever changes it is that very scene.
        The last few frames asked for are kept.
        """
        from golden_model.motion import posed  # it takes scenes, so it imports this module

        rest = self if self.rest is None else self.rest
        if frame not in rest._frames:
            while len(rest._frames) >= KEPT_FRAMES:
                del rest._frames[next(iter(rest._frames))]
            rest._frames[frame] = posed(rest, frame)
        return rest._frames[frame]

    @functools.cached_property
    def _frames(self) -> "dict[int, Scene]":
        return {}

    @functools.cached_property
    def lightmapped(self) -> np.ndarray:
        """Which objects have lightmaps: those with a diffuse material, (O,) bool."""
        out = np.zeros(len(self.object_names), dtype=bool)
        out[self.material_object[self.surface == DIFFUSE]] = True
        return out

    @functools.cached_property
    def specular(self) -> bool:
        """Whether any triangle is a mirror or glass."""
        return bool((self.surface[self.material] != DIFFUSE).any())

    @functools.cached_property
    def brightest(self) -> float:
        """The largest radiance that any triangle emits in any frame, of any colour; 0 if none does."""
        scene = self if self.rest is None else self.rest
        most = [max([key.emission for key in path.keys]) if path else 1.0 for path in scene.object_path]
        used = np.unique(scene.material)
        factor = np.array(most, dtype=np.float64)[scene.material_object[used]]
        return float((scene.emission[used] * factor[:, None]).max(initial=0.0))

    @functools.cached_property
    def brightest_lights(self) -> float:
        """No less than the intensities of all point lights together, in any frame, of any colour; 0 without lights."""
        scene = self if self.rest is None else self.rest
        total = np.zeros(3)
        for k, light in enumerate(scene.point_lights):
            path = scene.light_path[k] if scene.light_path else None
            all_frames = [key.intensity for key in path.keys] if path else [light["intensity"]]
            total = total + np.array(all_frames, dtype=np.float64).max(axis=0)
        return float(total.max())

    @property
    def corners(self) -> np.ndarray:
        """Corners of the triangles, (T, 3, 3) float32."""
        return np.stack([self.triangles["v0"], self.triangles["v1"], self.triangles["v2"]], axis=1)

    @property
    def reach(self) -> float:
        """No coordinate of any triangle exceeds this in any frame: found from the paths, so the same for all frames."""
        return float(self.object_reach.max())

    @functools.cached_property
    def object_reach(self) -> np.ndarray:
        """No coordinate of an object's triangles exceeds this in any frame, nor at rest: (O,) float64."""
        if self.rest is not None:
            return self.rest.object_reach
        out = np.zeros(len(self.object_names))
        np.maximum.at(out, self.object_id, np.abs(self.corners).max(axis=(1, 2)))
        for number, path in enumerate(self.object_path):
            if path is not None:
                # Rotated about the pivot a point stays as far from it; the largest component bounds each of the others.
                away = (self.corners[self.object_id == number] - path.pivot).astype(np.float64)
                squares = away * away
                radius = float(np.sqrt((squares[..., 0] + squares[..., 1] + squares[..., 2]).max()))
                centre = max(float(np.abs(path.pivot + key.translate).max()) for key in path.keys)
                out[number] = max(out[number], centre + radius)
        return out

    @functools.cached_property
    def spans(self) -> np.ndarray:
        """What the distance at which rays start goes with, of each triangle: (T,) float32, the same in all frames."""
        return spans(self.corners) if self.rest is None else self.rest.spans

    def camera_at(self, frame: int) -> Camera:
        """The camera of a frame: on the straight line between the keyframes around it; before and after, at the end."""
        path = self.camera_path
        if not path:
            return self.camera
        first, second, step = segment([key.frame for key in path], frame)
        begin, end = path[first], path[second]
        return replace(
            self.camera,
            position=begin.position + step * (end.position - begin.position),
            target=begin.target + step * (end.target - begin.target),
        )


def require_light(scene: Scene) -> None:
    """Raises InputError where nothing in the scene shines in any frame."""
    if not (scene.brightest or scene.brightest_lights):
        raise InputError(
            f"{scene.name}: the scene has no light; give a material emission (MTL: Ke, glTF: emissiveFactor) "
            "or write a scene file (TOML) with a [[point_light]]"
        )


def vector(values: Sequence[float] | np.ndarray) -> np.ndarray:
    """(3,) float32."""
    return np.array(values, dtype=np.float32)


def load_scene(name_or_path: str | Path) -> Scene:
    """A built-in scene by its name, a scene description (.toml) or a mesh file (.obj, .ply, .glb, .gltf).

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
    light_path: tuple[LightPath | None, ...] = (),
    texel_size: float | None = None,
) -> Scene:
    """Parts to a scene at rest, each part one object. `where` (a file, an option) begins every InputError.

    Without `camera` the scene gets one that frames it, without `texel_size` a 64th of its longest side. Triangles
    without area are left out, with an InputWarning.
    """
    from golden_model.mesh import usable_parts

    if not any(len(part.corners) for part in parts):
        raise InputError(f"{where}: no triangles; a scene needs at least one")
    parts = usable_parts(parts, where)
    corners = np.concatenate([part.corners for part in parts]).astype(np.float32)
    low, high = corners.min(axis=(0, 1)).astype(np.float64), corners.max(axis=(0, 1)).astype(np.float64)
    if np.abs(corners).max() > LARGEST or (high - low).max() < SMALLEST:
        raise InputError(
            f"{where}: coordinates must lie within +-{LARGEST:.0e} and span {SMALLEST:.0e}; scale the scene"
        )

    fine = _assembled(
        parts,
        name=name,
        point_lights=np.zeros(0, dtype=POINT_LIGHT) if point_lights is None else point_lights,
        camera=framing_camera(low, high) if camera is None else camera,
        camera_path=camera_path,
        light_path=light_path,
        texel_size=float((high - low).max()) / 64 if texel_size is None else texel_size,
    )
    if fine.reach > LARGEST:
        raise InputError(f"{where}: a path leads beyond +-{LARGEST:.0e}; shorten it")
    if all(part.coarse is None for part in parts):
        return fine
    return replace(fine, coarse=_with_triangles(fine, [part.coarse or part for part in parts]))


def _assembled(parts: Sequence[Part], **rest: Any) -> Scene:
    """Checked parts to a scene; `rest` are the fields that no part has."""
    names: list[str] = []
    for part in parts:
        same = sum(part.name == other.name for other in parts[: len(names)])
        names.append(part.name if same == 0 else f"{part.name}.{same + 1}")
    materials = [len(part.albedo) for part in parts]
    textures: list[np.ndarray] = []
    texture = [_index(textures, part.texture) for part in parts]
    return Scene(
        object_names=names,
        albedo=np.concatenate([p.albedo for p in parts]),
        emission=np.concatenate([p.emission for p in parts]),
        surface=np.repeat([p.surface for p in parts], materials).astype(np.uint8),
        ior=np.repeat([p.ior for p in parts], materials).astype(np.float32),
        texture=np.repeat(texture, materials).astype(np.int32),
        textures=tuple(textures),
        material_object=np.repeat(np.arange(len(parts)), materials).astype(np.int32),
        object_path=tuple(part.path for part in parts),
        rotation=np.repeat(REST.rotation[None], len(parts), axis=0),
        translation=np.repeat(REST.translation[None], len(parts), axis=0),
        glow=np.ones(len(parts), dtype=np.float32),
        present=np.ones(len(parts), dtype=bool),
        **_triangles(parts),
        **rest,
    )


def _with_triangles(scene: Scene, parts: Sequence[Part]) -> Scene:
    """The scene with the triangles of other parts for the same objects."""
    return replace(scene, **_triangles(parts))


def _triangles(parts: Sequence[Part]) -> dict[str, Any]:
    """What a scene has for each triangle."""
    from golden_model.mesh import shading_normals

    first_material = np.cumsum([0, *(len(part.albedo) for part in parts)])
    triangles = np.zeros(sum(len(p.corners) for p in parts), dtype=TRIANGLE)
    corners = np.concatenate([p.corners for p in parts]).astype(np.float32)
    for k in range(3):
        triangles[f"v{k}"] = corners[:, k]
    none = [np.zeros((len(p.corners), 3, 2), dtype=np.float32) for p in parts]
    return {
        "triangles": triangles,
        "normals": np.concatenate([shading_normals(p.corners) if p.normals is None else p.normals for p in parts]),
        "object_id": np.repeat(np.arange(len(parts)), [len(p.corners) for p in parts]).astype(np.int32),
        "material": np.concatenate(
            [p.material + first for p, first in zip(parts, first_material, strict=False)]
        ).astype(np.int32),
        "texture_uv": np.concatenate(
            [empty if p.texture_uv is None else p.texture_uv for p, empty in zip(parts, none, strict=True)]
        ),
    }


def _index(textures: list[np.ndarray], texture: np.ndarray | None) -> int:
    """The number of a texture in the list, where it is put if it is not there; -1 for None."""
    if texture is None:
        return -1
    for number, known in enumerate(textures):
        if known is texture:
            return number
    textures.append(texture)
    return len(textures) - 1


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
