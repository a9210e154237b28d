"""Tables of the triangles and materials of a frame for what rays read, and the cells that rays are collected in."""

import numpy as np

from lightloom.golden_model.contract.engine_image import MATERIAL, SHAPE, SURFACE
from lightloom.golden_model.rays.collector import Collector, KindTrace, Packing
from lightloom.golden_model.rays.surface_shading import CoarseSurfaces
from lightloom.golden_model.scene.coarse_geometry import coarse_links, fine_triangles
from lightloom.golden_model.scene.scene import Scene
from lightloom.golden_model.scene.textures import texel_coordinates
from lightloom.golden_model.tables.geometry import Geometry
from lightloom.golden_model.tables.lightmap import Lightmaps


class Geometries:
    """Of one scene over a sequence of frames: what does not change is made once."""

    def __init__(self, scene: Scene, lightmaps: Lightmaps):
        """Any scene of the sequence, and its lightmaps."""
        self._latest: tuple[Scene, Geometry, CoarseSurfaces | None] | None = None
        self._surfaces = surfaces_of(scene, lightmaps.uv)
        self._coarse = None
        if scene.coarse is not None:
            self._coarse = surfaces_of(scene.coarse, None), coarse_links(lightmaps, scene), fine_triangles(scene)

    def at(self, scene: Scene) -> tuple[Geometry, CoarseSurfaces | None]:
        """In a frame: all triangles, and the form with fewer, None where the scene has none."""
        if self._latest is None or self._latest[0] is not scene:
            materials, coarse = materials_of(scene), None
            geometry = Geometry(surfaces=self._surfaces, shapes=shapes_of(scene), materials=materials)
            if self._coarse is not None and scene.coarse is not None:
                surfaces, links, fine = self._coarse
                reduced = Geometry(surfaces=surfaces, shapes=shapes_of(scene.coarse), materials=materials)
                coarse = CoarseSurfaces(geometry=reduced, links=links, fine=fine)
            self._latest = scene, geometry, coarse
        return self._latest[1:]


def surfaces_of(scene: Scene, uv: np.ndarray | None) -> np.ndarray:
    """SURFACE (T,) of a scene's triangles, with their lightmap coordinates (T, 3, 2); `light` is -1."""
    out = np.zeros(len(scene.triangles), dtype=SURFACE)
    if uv is not None:
        out["lightmap_uv"] = uv
    out["texture_uv"] = texel_coordinates(scene, np.arange(len(out)))
    out["material"], out["object"], out["light"] = scene.material, scene.object_id, -1
    return out


def shapes_of(scene: Scene) -> np.ndarray:
    """SHAPE (T,) of a scene's triangles."""
    out = np.zeros(len(scene.triangles), dtype=SHAPE)
    out["corner"], out["normal"], out["span"] = scene.corners, scene.normals, scene.spans
    return out


def materials_of(scene: Scene) -> np.ndarray:
    """MATERIAL (M,) of a scene."""
    out = np.zeros(len(scene.albedo), dtype=MATERIAL)
    for name in ("albedo", "emission", "ior", "texture", "emission_texture", "surface", "two_sided"):
        out[name] = getattr(scene, name)
    return out


def collector_of(scene: Scene, trace: KindTrace, packing: Packing | None = None) -> Collector:
    """A collector whose cells divide the box around what is there in a frame's scene."""
    corners = scene.corners[scene.present[scene.object_id]]
    return Collector(trace, corners.min(axis=(0, 1)), corners.max(axis=(0, 1)), packing)
