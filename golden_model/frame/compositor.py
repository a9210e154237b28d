"""The blender: the picture from what rasterization and what rays have found ([0046], [0065])."""

import numpy as np

from lightloom.golden_model.host.errors import InputError
from lightloom.golden_model.numerics.floats import flush, quiet

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
