"""From published lightmaps to radiance: of a pixel ([0056] to [0058], claim 10) and of what an indirect ray hits."""

import numpy as np

from golden_model.floats import flush, half_to_float, quiet
from golden_model.lightmap import Lightmaps, bilinear, lightmap_coordinates
from golden_model.scene import Scene

INVERSE_PI = np.float32(0.31830987)


def readable(published: np.ndarray) -> np.ndarray:
    """PUBLISHED_TEXEL (N,) to the irradiance that lookups read, (N, 3) float32."""
    return half_to_float(published["rgba"][:, :3])


@quiet
def reflected(scene: Scene, primitive: np.ndarray, front: np.ndarray, irradiance: np.ndarray) -> np.ndarray:
    """Radiance (N, 3) that triangles (N,) reflect under `irradiance` (N, 3): (albedo * E) * (1/pi), diffuse.

    The back of a triangle has no lightmap and counts as black.
    """
    albedo = scene.albedo[scene.material[primitive]]
    radiance = flush(flush(albedo * irradiance) * INVERSE_PI)
    return np.where(front[:, None], radiance, np.float32(0))


def shade_hits(scene: Scene, lightmaps: Lightmaps, irradiance: np.ndarray, hits: np.ndarray) -> np.ndarray:
    """HIT (N,) to the radiance (N, 3) that comes back along the rays, from maps `irradiance` (texels, 3) float32.

    A miss brings nothing. Nor does the emission of what is hit: lights are sampled by shadow rays, counting them here
    again would count them twice.
    """
    radiance = np.zeros((len(hits), 3), dtype=np.float32)
    struck = np.flatnonzero(hits["primitive"] >= 0)
    hit = hits[struck]
    primitive = hit["primitive"]
    coordinates = lightmap_coordinates(lightmaps, primitive, hit["u"], hit["v"])
    arriving = bilinear(lightmaps, irradiance, scene.object_id[primitive], coordinates)
    radiance[struck] = reflected(scene, primitive, hit["front"], arriving)
    return radiance


@quiet
def shade_pixels(scene: Scene, lightmaps: Lightmaps, irradiance: np.ndarray, gbuffer: np.ndarray) -> np.ndarray:
    """GBUFFER (H, W) to the picture (H, W, 3) float32: reflected plus emitted radiance, zero where nothing is seen."""
    image = np.zeros((*gbuffer.shape, 3), dtype=np.float32)
    seen = gbuffer["primitive"] >= 0
    pixel = gbuffer[seen]
    primitive = pixel["primitive"]
    arriving = bilinear(lightmaps, irradiance, pixel["object"], pixel["lightmap"])
    emitted = np.where(pixel["front"][:, None], scene.emission[scene.material[primitive]], np.float32(0))
    image[seen] = flush(reflected(scene, primitive, pixel["front"], arriving) + emitted)
    return image
