"""The blender: the picture from what rasterization and what rays have found ([0046], [0065])."""

import numpy as np

from lightloom.golden_model.host.errors import InputError
from lightloom.golden_model.numerics.floats import flush, quiet
from lightloom.golden_model.scene.environment import Environment
from lightloom.golden_model.tables.pinhole import View, pixel_rays

MODES = ("both", "raster", "rays")
"""The picture; what fragment shading alone has found; what rays have added to it."""


@quiet
def blend_frame(raster: np.ndarray, rays: np.ndarray, weight: np.ndarray, mode: str = "both") -> np.ndarray:
    """raster + weight * rays, (H, W, 3) float32 each, linear light; or one of the two terms, for inspection.

    `raster` is what `surface_shading.shade_fragments` makes, `rays` the values of the ray buffer, `weight` what the
    surface of each pixel makes of them (`surface_shading.ray_weights`). Raises InputError for an unknown mode.
    """
    if mode not in MODES:
        raise InputError(f"blender mode {mode}: unknown; choose one of {', '.join(MODES)}")
    if mode == "raster":
        return raster
    weighted = flush(rays * weight)
    return weighted if mode == "rays" else flush(raster + weighted)


def show_beyond(raster: np.ndarray, environment: Environment, view: View, gbuffer: np.ndarray) -> None:
    """Puts what lies beyond the scene into the pixels (H, W, 3) of `raster` that see no surface, in place."""
    if environment:
        empty = gbuffer["primitive"] < 0
        raster[empty] = environment.seen(pixel_rays(view)["direction"][empty.reshape(-1)])
