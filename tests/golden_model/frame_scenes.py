"""Small scenes and what a frame's stages need of them, for the tests of the frame pipeline."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lightloom.golden_model.charts.unwrap import unwrap
from lightloom.golden_model.contract.formats import POINT_LIGHT
from lightloom.golden_model.driver.geometry import Geometries
from lightloom.golden_model.frame.rasterizer import Mesh, draw
from lightloom.golden_model.rays.collector import Collector, Packing
from lightloom.golden_model.rays.surface_shading import Surfaces
from lightloom.golden_model.scene.assemble import assemble
from lightloom.golden_model.scene.parts import Part
from lightloom.golden_model.scene.scene import Scene
from lightloom.golden_model.scene.shapes import icosphere, quad_triangles
from lightloom.golden_model.scene.textures import build_textures, texel_coordinates
from lightloom.golden_model.structures.structure import Structure
from lightloom.golden_model.tables.geometry import Geometry
from lightloom.golden_model.tables.lightmap import Lightmaps
from lightloom.golden_model.tables.pinhole import View, look_at

UP = np.array([0, 1, 0], dtype=np.float32)


def part(name: str, corners: np.ndarray, albedo: float | tuple = 0.5, emission: float = 0.0, **more) -> Part:
    """An object of one material."""
    return Part(
        name=name,
        corners=corners.astype(np.float32),
        albedo=np.broadcast_to(np.asarray(albedo, dtype=np.float32), (1, 3)).copy(),
        emission=np.full((1, 3), emission, dtype=np.float32),
        material=np.zeros(len(corners), dtype=np.int32),
        **more,
    )


def quad(name: str, corners: list, albedo: float | tuple = 0.5, emission: float = 0.0, **more) -> Part:
    """A flat four-sided object, counter-clockwise from its front."""
    return part(name, quad_triangles(np.array([corners], dtype=np.float64)), albedo, emission, **more)


def ball(name: str, centre: tuple, radius: float, albedo: float | tuple, surface: int, ior: float = 1.5) -> Part:
    """A sphere of 1280 triangles with smooth normals."""
    unit = icosphere(3)
    corners = unit * radius + np.array(centre)
    return part(name, corners, albedo, normals=unit.astype(np.float32), surface=surface, ior=ior)


def room(albedo: float = 0.5) -> list[Part]:
    """The six walls of the cube from -1 to 1, seen from inside, each an object of its own colour."""
    parts = []
    faces = {"right": (0, 1), "left": (0, -1), "top": (1, 1), "bottom": (1, -1), "near": (2, 1), "far": (2, -1)}
    for number, (name, (axis, side)) in enumerate(faces.items()):
        a, b = (axis + 1) % 3, (axis + 2) % 3
        corners = np.zeros((4, 3))
        corners[:, axis] = side
        corners[:, a], corners[:, b] = [-1, 1, 1, -1], [-1, -1, 1, 1]
        if side > 0:  # the front is the side towards the middle
            corners = corners[::-1]
        colour = tuple(albedo * (0.4 + 0.6 * ((number >> bit) & 1)) for bit in range(3))
        parts.append(quad(name, corners.tolist(), colour))
    return parts


def scene_of(parts: list[Part], lights: Sequence[tuple] = (), texel_size: float = 0.25) -> Scene:
    """Parts and point lights (position, intensity) to a scene."""
    points = np.zeros(len(lights), dtype=POINT_LIGHT)
    for k, (position, intensity) in enumerate(lights):
        points[k] = (position, np.broadcast_to(intensity, 3))
    return assemble(name="test", parts=parts, where="test", point_lights=points, texel_size=texel_size)


def geometry_of(scene: Scene, maps: Lightmaps | None = None) -> Geometry:
    """What rays read of its triangles."""
    return Geometries(scene, maps or unwrap(scene)).at(scene)[0]


@dataclass(frozen=True)
class Frame:
    """A scene seen from somewhere."""

    scene: Scene
    view: View
    gbuffer: np.ndarray
    surfaces: Surfaces
    structure: Structure

    def collector(self, packing: Packing | None = None) -> Collector:
        low, high = np.full(3, -1, dtype=np.float32), np.ones(3, dtype=np.float32)
        return Collector(self.structure.trace, low, high, packing)


def mesh_of(scene: Scene, maps: Lightmaps) -> Mesh:
    """What the rasterizer takes."""
    texture_uv = texel_coordinates(scene, np.arange(len(scene.triangles))) if scene.textures else None
    return Mesh(
        triangles=scene.triangles,
        normals=scene.normals,
        object_id=scene.object_id,
        lightmap_uv=maps.uv,
        texture_uv=texture_uv,
    )


def seen_from(
    scene: Scene, eye: tuple, target: tuple, tan: float = 0.8, size: int = 48, irradiance: np.ndarray | None = None
) -> Frame:
    """A frame of `size` squared pixels; the maps hold `irradiance`, or random light of their own."""
    maps = unwrap(scene)
    if irradiance is None:
        irradiance = np.random.default_rng(5).uniform(0.5, 4, (len(maps.texels), 3)).astype(np.float32)
    view = look_at(np.array(eye), np.array(target), UP, tan, size, size)
    geometry, coarse = Geometries(scene, maps).at(scene)
    surfaces = Surfaces(
        geometry=geometry,
        coarse=coarse,
        lightmaps=maps,
        irradiance=irradiance,
        textures=build_textures(scene.textures),
    )
    return Frame(scene, view, draw(view, mesh_of(scene, maps)).gbuffer, surfaces, Structure(scene))


def flat_light(scene: Scene, value: float | np.floating) -> np.ndarray:
    """The same irradiance in every texel of the scene's maps."""
    return np.full((len(unwrap(scene).texels), 3), value, dtype=np.float32)
