"""A scene in memory: triangles, objects, materials, lights and a camera.

Conventions, everywhere in Lightloom: right-handed world coordinates; a triangle's front is the side from which its
vertices run counter-clockwise, so its normal is (v1 - v0) x (v2 - v0); diffuse surfaces have lightmaps on their front,
on both sides if they are two-sided, mirrors and glass have none; area lights shine from their front only. Radiance,
irradiance and so on are RGB in W, m and sr as far as the scene's own unit of length is taken for the metre.

A scene as loaded is at *rest*: every object where its file puts it. `pose.scene_at` gives the scene of a frame, in
which objects, lights and camera are moved along their paths (golden_model/scene/keyframes.py); it is a function of
both.
"""

import functools
from dataclasses import dataclass, field, replace

import numpy as np

from lightloom.golden_model.contract.engine_image import DIFFUSE
from lightloom.golden_model.contract.formats import CONE, POINT_LIGHT
from lightloom.golden_model.host.errors import InputError
from lightloom.golden_model.scene.environment import Environment
from lightloom.golden_model.scene.keyframes import LightPath, ObjectPath, segment
from lightloom.golden_model.scene.texture_means import mean_over
from lightloom.golden_model.tables.ray_offset import spans


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
    two_sided: np.ndarray
    """Which materials reflect on both sides, (M,) bool: diffuse ones of objects whose backs can be seen."""
    ior: np.ndarray
    """Index of refraction of each material, (M,) float32; of use for GLASS."""
    texture: np.ndarray
    """Texture of each material, (M,) int32, an index into `textures`; -1: none."""
    emission_texture: np.ndarray
    """The same for what multiplies the emission; of the same size as the other where a material has both."""
    textures: tuple[np.ndarray, ...] = ()
    """Linear RGB, (H, W, 3) float32 each; row 0 is at the bottom, v = 0. Albedo and emission multiply them."""
    section: np.ndarray
    """Chart of each triangle in its object's map, (T,) int32, of an object that has been cut (`cuts`); -1 of others."""
    texture_uv: np.ndarray
    """Texture coordinates at the corners, (T, 3, 2) float32; 1 is the whole picture, which repeats."""
    material_object: np.ndarray
    """Object of each material, (M,) int32: every object has materials of its own."""
    point_lights: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=POINT_LIGHT))
    """POINT_LIGHT (P,)."""
    cones: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=CONE))
    """What each point light shines into, CONE (P,); empty where none is a spot light."""
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
    environment: Environment = field(default_factory=Environment)
    """What it lies in."""
    render: RenderDefaults = field(default_factory=RenderDefaults)
    """How it is meant to be rendered."""
    coarse: "Scene | None" = None
    """The same objects and materials with fewer triangles ([0055]); None: no object has another form."""
    rest: "Scene | None" = field(default=None, repr=False)
    """The scene at rest that this one is a frame of; None: this one is it."""
    frame: int | None = None
    """The frame of which this is the scene; None: it is at rest."""
    frames: "dict[int, Scene]" = field(init=False, repr=False, default_factory=dict)
    """Of a scene at rest the scenes of frames, as far as `pose.scene_at` keeps them."""

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

    @functools.cached_property
    def lightmapped(self) -> np.ndarray:
        """Which objects have lightmaps: those with a diffuse material, (O,) bool."""
        out = np.zeros(len(self.object_names), dtype=bool)
        out[self.material_object[self.surface == DIFFUSE]] = True
        return out

    def reflects(self, primitive: np.ndarray, front: np.ndarray) -> np.ndarray:
        """Whether triangles (N,) are diffuse, and reflect on the side that is seen, their front or not (N,): bool."""
        material = self.material[primitive]
        return np.asarray((self.surface[material] == DIFFUSE) & (front | self.two_sided[material]))

    @functools.cached_property
    def emission_share(self) -> np.ndarray | None:
        """The mean of the emission's texture over each triangle, 1 without one: (T, 3) float32; None: none has one."""
        if self.rest is not None:
            return self.rest.emission_share
        texture = self.emission_texture[self.material]
        if not (texture >= 0).any():
            return None
        out = np.ones((len(texture), 3), dtype=np.float32)
        for number in np.flatnonzero(texture >= 0):
            out[number] = mean_over(self.textures[texture[number]], self.texture_uv[number])
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
    def half_extent(self) -> float:
        """Half of the longest side of the box around all triangles at rest."""
        if self.rest is not None:
            return self.rest.half_extent
        corners = self.corners.reshape(-1, 3)
        return float((corners.max(axis=0) - corners.min(axis=0)).max()) / 2

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
    if not (scene.brightest or scene.brightest_lights or scene.environment.shines):
        raise InputError(
            f"{scene.name}: the scene has no light; give a material emission (MTL: Ke, glTF: emissiveFactor) "
            "or write a scene file (TOML) with a [[point_light]] or a [sky]"
        )
