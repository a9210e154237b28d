"""From published lightmaps to radiance: fragment shading ([0041], [0056] to [0058], claim 10) and diffuse hits of rays.

What fragment shading finds at a pixel is what does not take a ray: reflected light from the lightmap, filtered with the
level of detail, times albedo and texture, plus emission. Mirrors and glass ask for rays;
`golden_model.rays.hit_shading` makes them.
"""

from dataclasses import dataclass

import numpy as np

from lightloom.golden_model.numerics.floats import flush, half_to_float, quiet
from lightloom.golden_model.numerics.structured import take
from lightloom.golden_model.numerics.vectors import interpolate
from lightloom.golden_model.scene.lightmap import Lightmaps, bilinear, lightmap_coordinates, on_side, sample
from lightloom.golden_model.scene.parts import DIFFUSE, MIRROR
from lightloom.golden_model.scene.scene import Scene
from lightloom.golden_model.scene.textures import Textures, sample_textures, texel_coordinates

INVERSE_PI = np.float32(0.31830987)


@dataclass(frozen=True, kw_only=True)
class Surfaces:
    """All that the shading of one frame reads: the same for fragments and for hits of rays, and for every emitter."""

    scene: Scene
    """Of the frame."""
    lightmaps: Lightmaps
    """Records are not read here: those of the scene at rest will do."""
    irradiance: np.ndarray
    """The published maps as `readable` gives them, (N, 3) float32; mip texels, if there are any, after the maps."""
    textures: Textures | None = None
    """Of `scene.textures`; `build_textures` makes them, once for a sequence."""
    links: np.ndarray | None = None
    """Texels at the corners of the triangles of `scene.coarse`, (T, 3) int32, -1: none; for hits of coarse geometry."""
    fine: np.ndarray | None = None
    """The triangle of `scene` that each of `scene.coarse` is, (T,) int32; -1: it is a reduced one. None: all are."""
    filtered: bool = False
    """Whether fragments read the lightmaps with their level of detail; else always the finest level."""
    ray_texture_lod: int = 0
    """Level of detail of textures where rays hit them, in 1/256ths."""

    def geometry(self, coarse: bool) -> Scene:
        """The scene whose triangles a ray met: with `coarse` the reduced one, if there is one."""
        return self.scene.coarse if coarse and self.scene.coarse is not None else self.scene


def readable(published: np.ndarray) -> np.ndarray:
    """PUBLISHED_TEXEL (N,) to the irradiance that lookups read, (N, 3) float32."""
    return half_to_float(published["rgba"][:, :3])


@quiet
def textured(
    surfaces: Surfaces, scene: Scene, primitive: np.ndarray, place: np.ndarray | None, lod: np.ndarray | None
) -> np.ndarray:
    """Albedo times texture of triangles (N,), (N, 3) float32, read at `place` (N, 2) with `lod` (N,)."""
    material = scene.material[primitive]
    return _times_texture(surfaces, scene.albedo[material], scene.texture[material], place, lod)


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


def _places(surfaces: Surfaces, scene: Scene, hits: np.ndarray) -> tuple[np.ndarray | None, np.ndarray | None]:
    """Where textures are read at HIT (N,) that met a triangle of `scene`, and with which level of detail."""
    if surfaces.textures is None:
        return None, None
    corner = texel_coordinates(scene, hits["primitive"])
    place = interpolate(corner[:, 0], corner[:, 1], corner[:, 2], hits["u"], hits["v"])
    return place, np.full(len(hits), surfaces.ray_texture_lod)


def albedo_at(surfaces: Surfaces, scene: Scene, hits: np.ndarray) -> np.ndarray:
    """Albedo times texture of HIT (N,) that met a triangle of `scene`, (N, 3) float32."""
    return textured(surfaces, scene, hits["primitive"], *_places(surfaces, scene, hits))


def emitted_at(surfaces: Surfaces, scene: Scene, hits: np.ndarray) -> np.ndarray:
    """Radiance (N, 3) that HIT (N,) sends out by itself, of a triangle of `scene`."""
    place, lod = _places(surfaces, scene, hits) if (scene.emission_texture >= 0).any() else (None, None)
    return emitted(surfaces, scene, hits["primitive"], hits["front"], place, lod)


@quiet
def reflected(albedo: np.ndarray, diffuse: np.ndarray, irradiance: np.ndarray) -> np.ndarray:
    """Radiance (N, 3) that surfaces of `albedo` (N, 3) reflect under `irradiance` (N, 3): (albedo * E) * (1/pi).

    Zero where not `diffuse` (N,): for mirrors, glass, and the back of a triangle that has no lightmap there.
    """
    return np.where(diffuse[:, None], flush(flush(albedo * irradiance) * INVERSE_PI), np.float32(0))


def emitted(
    surfaces: Surfaces,
    scene: Scene,
    primitive: np.ndarray,
    front: np.ndarray,
    place: np.ndarray | None,
    lod: np.ndarray | None,
) -> np.ndarray:
    """Radiance (N, 3) that triangles (N,) send out on the side seen, on their front only: emission times texture."""
    material = scene.material[primitive]
    emission = _times_texture(surfaces, scene.emission[material], scene.emission_texture[material], place, lod)
    return np.where(front[:, None], emission, np.float32(0))


@quiet
def diffuse_radiance(surfaces: Surfaces, hits: np.ndarray, *, coarse: bool = False) -> np.ndarray:
    """Radiance (N, 3) that comes back from HIT (N,), each of a triangle, by way of the lightmaps; no emission.

    Reduced triangles have no lightmaps of their own: between their corners they show the texels that these are linked
    to. Triangles of coarse geometry that are the scene's own read its lightmaps.
    """
    scene, primitive, front = surfaces.geometry(coarse), hits["primitive"], hits["front"]
    diffuse = scene.reflects(primitive, front)
    if scene is not surfaces.scene:
        assert surfaces.links is not None, "coarse geometry needs links to texels"
        link = surfaces.links[primitive]
        if (rows := surfaces.lightmaps.back_rows) is not None:
            owner = scene.object_id[primitive]
            link = link + np.where(front, 0, rows[owner] * surfaces.lightmaps.width[owner])[:, None] * (link >= 0)
        corner = np.where(link[..., None] >= 0, surfaces.irradiance[np.maximum(link, 0)], np.float32(0))
        arriving = interpolate(corner[:, 0], corner[:, 1], corner[:, 2], hits["u"], hits["v"])
        own = primitive[:0] if surfaces.fine is None else surfaces.fine[primitive]
        if (same := np.flatnonzero(own >= 0)).size:
            place = lightmap_coordinates(surfaces.lightmaps, own[same], hits["u"][same], hits["v"][same])
            owner = surfaces.scene.object_id[own[same]]
            place = on_side(surfaces.lightmaps, owner, place, front[same])
            arriving[same] = bilinear(surfaces.lightmaps, surfaces.irradiance, owner, place)
    else:
        place = lightmap_coordinates(surfaces.lightmaps, primitive, hits["u"], hits["v"])
        place = on_side(surfaces.lightmaps, scene.object_id[primitive], place, front)
        arriving = bilinear(surfaces.lightmaps, surfaces.irradiance, scene.object_id[primitive], place)
    return reflected(albedo_at(surfaces, scene, hits), diffuse, arriving)


@quiet
def shade_fragments(surfaces: Surfaces, fragment: np.ndarray) -> np.ndarray:
    """GBUFFER (N,), each of a triangle, to what needs no ray: reflected plus emitted radiance, (N, 3) float32."""
    scene, primitive = surfaces.scene, fragment["primitive"]
    if surfaces.filtered:
        arriving = sample(
            surfaces.lightmaps, surfaces.irradiance, fragment["object"], fragment["lightmap"], fragment["lod"]
        )
    else:
        arriving = bilinear(surfaces.lightmaps, surfaces.irradiance, fragment["object"], fragment["lightmap"])
    diffuse = scene.reflects(primitive, fragment["front"])
    albedo = textured(surfaces, scene, primitive, fragment["texture"], fragment["texture_lod"])
    glow = emitted(surfaces, scene, primitive, fragment["front"], fragment["texture"], fragment["texture_lod"])
    return flush(reflected(albedo, diffuse, arriving) + glow)


@quiet
def ray_weights(surfaces: Surfaces, gbuffer: np.ndarray) -> np.ndarray:
    """GBUFFER (H, W) to the weights of the pixels' rays, (H, W, 3) float32: what the blender multiplies them with.

    A diffuse pixel's rays bring irradiance: albedo / pi, on a side that reflects. A mirror's bring radiance: its
    tint. Those of glass, each reflected or refracted, carry their weights with them: 1. 0 where nothing is seen.
    """
    weight = np.zeros((gbuffer.size, 3), dtype=np.float32)
    seen, pixel = _seen(gbuffer)
    scene, primitive = surfaces.scene, pixel["primitive"]
    surface = scene.surface[scene.material[primitive]][:, None]
    albedo = textured(surfaces, scene, primitive, pixel["texture"], pixel["texture_lod"])
    diffuse = np.where(scene.reflects(primitive, pixel["front"])[:, None], flush(albedo * INVERSE_PI), np.float32(0))
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
