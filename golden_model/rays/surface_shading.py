"""From published lightmaps to radiance: fragment shading ([0041], [0056] to [0058], claim 10) and diffuse hits of rays.

What fragment shading finds at a pixel is what does not take a ray: reflected light from the lightmap, filtered with the
level of detail, times albedo and texture, plus emission. Mirrors and glass ask for rays;
`golden_model.rays.hit_shading` makes them.
"""

from dataclasses import dataclass

import numpy as np

from lightloom.golden_model.contract.engine_image import DIFFUSE, MIRROR
from lightloom.golden_model.numerics.floats import flush, half_to_float, quiet
from lightloom.golden_model.numerics.structured import take
from lightloom.golden_model.numerics.vectors import interpolate
from lightloom.golden_model.tables.geometry import Geometry
from lightloom.golden_model.tables.lightmap import Lightmaps, bilinear, on_side, sample
from lightloom.golden_model.tables.textures import Textures, sample_textures

INVERSE_PI = np.float32(0.31830987)


@dataclass(frozen=True, kw_only=True)
class CoarseSurfaces:
    """The same objects with fewer triangles, C of them ([0055]), which have no lightmaps of their own."""

    geometry: Geometry
    links: np.ndarray
    """Texels at the corners, (C, 3) int32, -1: none."""
    fine: np.ndarray | None = None
    """The triangle of the full geometry that each is, (C,) int32; -1: it is a reduced one. None: all are reduced."""


@dataclass(frozen=True, kw_only=True)
class Surfaces:
    """All that the shading of one frame reads: the same for fragments and for hits of rays, and for every emitter."""

    geometry: Geometry
    """Of the frame."""
    lightmaps: Lightmaps
    """Records are not read here: those of the scene at rest will do."""
    irradiance: np.ndarray
    """The published maps as `readable` gives them, (N, 3) float32; mip texels, if there are any, after the maps."""
    textures: Textures | None = None
    """Of `scene.textures`; `build_textures` makes them, once for a sequence."""
    coarse: CoarseSurfaces | None = None
    """For hits of coarse geometry; None: there is none."""
    filtered: bool = False
    """Whether fragments read the lightmaps with their level of detail; else always the finest level."""
    ray_texture_lod: int = 0
    """Level of detail of textures where rays hit them, in 1/256ths."""

    def met(self, coarse: bool) -> Geometry:
        """The triangles that a ray met: with `coarse` the reduced ones, if there are any."""
        return self.coarse.geometry if coarse and self.coarse is not None else self.geometry


def readable(published: np.ndarray) -> np.ndarray:
    """PUBLISHED_TEXEL (N,) to the irradiance that lookups read, (N, 3) float32."""
    return half_to_float(published["rgba"][:, :3])


@quiet
def textured(
    surfaces: Surfaces, geometry: Geometry, primitive: np.ndarray, place: np.ndarray | None, lod: np.ndarray | None
) -> np.ndarray:
    """Albedo times texture of triangles (N,), (N, 3) float32, read at `place` (N, 2) with `lod` (N,)."""
    material = geometry.material(primitive)
    return _times_texture(surfaces, material["albedo"], material["texture"], place, lod)


@quiet
def _times_texture(
    surfaces: Surfaces, colour: np.ndarray, texture: np.ndarray, place: np.ndarray | None, lod: np.ndarray | None
) -> np.ndarray:
    """Colours (N, 3) float32 times textures (N,), -1: none, read at `place` (N, 2) with `lod` (N,)."""
    if surfaces.textures is None or place is None or lod is None:
        return colour
    some = np.flatnonzero(texture >= 0)
    colour = colour.copy()
    colour[some] = flush(colour[some] * sample_textures(surfaces.textures, texture[some], place[some], lod[some]))
    return colour


def _places(surfaces: Surfaces, geometry: Geometry, hits: np.ndarray) -> tuple[np.ndarray | None, np.ndarray | None]:
    """Where textures are read at HIT (N,) that met a triangle of `geometry`, and with which level of detail."""
    if surfaces.textures is None:
        return None, None
    place = _between(geometry.surfaces["texture_uv"][hits["primitive"]], hits)
    return place, np.full(len(hits), surfaces.ray_texture_lod)


def _between(corner: np.ndarray, hits: np.ndarray) -> np.ndarray:
    """Values (N, 3, K) at the corners of triangles to those at HIT (N,) of them, (N, K) float32."""
    return interpolate(corner[:, 0], corner[:, 1], corner[:, 2], hits["u"], hits["v"])


def albedo_at(surfaces: Surfaces, geometry: Geometry, hits: np.ndarray) -> np.ndarray:
    """Albedo times texture of HIT (N,) that met a triangle of `geometry`, (N, 3) float32."""
    return textured(surfaces, geometry, hits["primitive"], *_places(surfaces, geometry, hits))


def emitted_at(surfaces: Surfaces, geometry: Geometry, hits: np.ndarray) -> np.ndarray:
    """Radiance (N, 3) that HIT (N,) sends out by itself, of a triangle of `geometry`."""
    return emitted(surfaces, geometry, hits["primitive"], hits["front"], *_places(surfaces, geometry, hits))


@quiet
def reflected(albedo: np.ndarray, diffuse: np.ndarray, irradiance: np.ndarray) -> np.ndarray:
    """Radiance (N, 3) that surfaces of `albedo` (N, 3) reflect under `irradiance` (N, 3): (albedo * E) * (1/pi).

    Zero where not `diffuse` (N,): for mirrors, glass, and the back of a triangle that has no lightmap there.
    """
    return np.where(diffuse[:, None], flush(flush(albedo * irradiance) * INVERSE_PI), np.float32(0))


def emitted(
    surfaces: Surfaces,
    geometry: Geometry,
    primitive: np.ndarray,
    front: np.ndarray,
    place: np.ndarray | None,
    lod: np.ndarray | None,
) -> np.ndarray:
    """Radiance (N, 3) that triangles (N,) send out on the side seen, on their front only: emission times texture."""
    material = geometry.material(primitive)
    emission = _times_texture(surfaces, material["emission"], material["emission_texture"], place, lod)
    return np.where(front[:, None], emission, np.float32(0))


@quiet
def diffuse_radiance(surfaces: Surfaces, hits: np.ndarray, *, coarse: bool = False) -> np.ndarray:
    """Radiance (N, 3) that comes back from HIT (N,), each of a triangle, by way of the lightmaps; no emission.

    Reduced triangles have no lightmaps of their own: between their corners they show the texels that these are linked
    to. Triangles of coarse geometry that are the scene's own read its lightmaps.
    """
    geometry, primitive, front = surfaces.met(coarse), hits["primitive"], hits["front"]
    diffuse = geometry.reflects(primitive, front)
    if coarse and surfaces.coarse is not None:
        arriving = _linked(surfaces, surfaces.coarse, hits)
    else:
        arriving = _from_maps(surfaces, primitive, hits)
    return reflected(albedo_at(surfaces, geometry, hits), diffuse, arriving)


def _from_maps(surfaces: Surfaces, primitive: np.ndarray, hits: np.ndarray) -> np.ndarray:
    """Irradiance (N, 3) at HIT (N,), which lie on triangles (N,) of the full geometry."""
    corner, owner = (surfaces.geometry.surfaces[name][primitive] for name in ("lightmap_uv", "object"))
    place = on_side(surfaces.lightmaps, owner, _between(corner, hits), hits["front"])
    return bilinear(surfaces.lightmaps, surfaces.irradiance, owner, place)


def _linked(surfaces: Surfaces, coarse: CoarseSurfaces, hits: np.ndarray) -> np.ndarray:
    """Irradiance (N, 3) at HIT (N,) of coarse geometry."""
    primitive, front = hits["primitive"], hits["front"]
    link = coarse.links[primitive]
    if (rows := surfaces.lightmaps.back_rows) is not None:
        owner = coarse.geometry.surfaces["object"][primitive]
        link = link + np.where(front, 0, rows[owner] * surfaces.lightmaps.width[owner])[:, None] * (link >= 0)
    corner = np.where(link[..., None] >= 0, surfaces.irradiance[np.maximum(link, 0)], np.float32(0))
    arriving = _between(corner, hits)
    own = primitive[:0] if coarse.fine is None else coarse.fine[primitive]
    if (same := np.flatnonzero(own >= 0)).size:
        arriving[same] = _from_maps(surfaces, own[same], take(hits, same))
    return arriving


@quiet
def shade_fragments(surfaces: Surfaces, fragment: np.ndarray) -> np.ndarray:
    """GBUFFER (N,), each of a triangle, to what needs no ray: reflected plus emitted radiance, (N, 3) float32."""
    geometry, primitive = surfaces.geometry, fragment["primitive"]
    if surfaces.filtered:
        arriving = sample(
            surfaces.lightmaps, surfaces.irradiance, fragment["object"], fragment["lightmap"], fragment["lod"]
        )
    else:
        arriving = bilinear(surfaces.lightmaps, surfaces.irradiance, fragment["object"], fragment["lightmap"])
    diffuse = geometry.reflects(primitive, fragment["front"])
    albedo = textured(surfaces, geometry, primitive, fragment["texture"], fragment["texture_lod"])
    glow = emitted(surfaces, geometry, primitive, fragment["front"], fragment["texture"], fragment["texture_lod"])
    return flush(reflected(albedo, diffuse, arriving) + glow)


@quiet
def ray_weights(surfaces: Surfaces, gbuffer: np.ndarray) -> np.ndarray:
    """GBUFFER (H, W) to the weights of the pixels' rays, (H, W, 3) float32: what the blender multiplies them with.

    A diffuse pixel's rays bring irradiance: albedo / pi, on a side that reflects. A mirror's bring radiance: its
    tint. Those of glass, each reflected or refracted, carry their weights with them: 1. 0 where nothing is seen.
    """
    weight = np.zeros((gbuffer.size, 3), dtype=np.float32)
    seen, pixel = _seen(gbuffer)
    geometry, primitive = surfaces.geometry, pixel["primitive"]
    surface = geometry.material(primitive)["surface"][:, None]
    albedo = textured(surfaces, geometry, primitive, pixel["texture"], pixel["texture_lod"])
    diffuse = np.where(geometry.reflects(primitive, pixel["front"])[:, None], flush(albedo * INVERSE_PI), np.float32(0))
    weight[seen] = np.where(surface == DIFFUSE, diffuse, np.where(surface == MIRROR, albedo, np.float32(1)))
    return weight.reshape(*gbuffer.shape, 3)


def shade_pixels(surfaces: Surfaces, gbuffer: np.ndarray) -> np.ndarray:
    """GBUFFER (H, W) to what its fragments' shading makes, (H, W, 3) float32; zero where nothing is seen."""
    image = np.zeros((gbuffer.size, 3), dtype=np.float32)
    seen, fragment = _seen(gbuffer)
    image[seen] = shade_fragments(surfaces, fragment)
    return image.reshape(*gbuffer.shape, 3)


def _seen(gbuffer: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The pixels of GBUFFER (H, W) that see something, row by row, and what they hold: (N,) int64, GBUFFER (N,)."""
    flat = gbuffer.reshape(-1)
    seen = np.flatnonzero(flat["primitive"] >= 0)
    return seen, take(flat, seen)
