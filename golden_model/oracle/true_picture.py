"""What a picture should show, by path tracing from each pixel's own point: no lightmap is read, on no way.

So it knows what converged maps do not: light that leaks, light that does not fit the maps' range, and the maps'
resolution. Of diffuse surfaces without textures, which is what `golden_model.oracle.path_tracer` knows.
"""

from collections.abc import Callable

import numpy as np

from lightloom.golden_model.contract.engine_image import DIFFUSE
from lightloom.golden_model.contract.formats import HIT
from lightloom.golden_model.driver.geometry import shapes_of
from lightloom.golden_model.host.errors import InputError
from lightloom.golden_model.oracle.path_tracer import irradiance
from lightloom.golden_model.rays.hit_surface import surface_at
from lightloom.golden_model.rays.surface_shading import reflected
from lightloom.golden_model.scene.scene import Scene
from lightloom.golden_model.tracing.trace_protocol import Trace


def require_path_traced(scene: Scene) -> None:
    """Raises InputError for a scene that cannot be path-traced."""
    if (scene.surface[scene.material] != DIFFUSE).any():
        raise InputError("--true: the scene has mirrors or glass, which are not path-traced; leave it out")
    if (np.maximum(scene.texture, scene.emission_texture)[scene.material] >= 0).any():
        raise InputError("--true: the scene has textures, which are not path-traced; leave it out")


def true_picture(
    scene: Scene,
    gbuffer: np.ndarray,
    trace: Trace,
    samples: int,
    seed: int = 0,
    progress: Callable[[int, int], None] | None = None,
) -> np.ndarray:
    """Reflected radiance of the pixels of GBUFFER (H, W), (H, W, 3) float32, from `samples` paths a pixel.

    Of a frame's scene (`scene_at`), which `trace` traces. Emission is left out, and the backs of triangles that are not
    two-sided reflect nothing, as in the frame loop. `progress` as for `irradiance`.
    """
    flat = gbuffer.reshape(-1)
    pixel = np.flatnonzero((flat["primitive"] >= 0) & scene.reflects(np.maximum(flat["primitive"], 0), flat["front"]))
    hits = np.zeros(len(pixel), dtype=HIT)
    for name in ("primitive", "u", "v", "front"):
        hits[name] = flat[name][pixel]
    surface = surface_at(shapes_of(scene), hits)
    arriving = irradiance(scene, trace, surface.place, surface.facing, samples, seed, progress)
    albedo = scene.albedo[scene.material[hits["primitive"]]]
    picture = np.zeros((gbuffer.size, 3), dtype=np.float32)
    picture[pixel] = reflected(albedo, np.ones(len(pixel), dtype=bool), arriving)
    return picture.reshape(*gbuffer.shape, 3)
