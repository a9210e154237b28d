"""Makes the version of the lightmaps that the next frame reads ([0085]: read old, write new)."""

import numpy as np

from golden_model.floats import float_to_half, flush, quiet
from golden_model.formats import PUBLISHED_TEXEL, TEXEL_STATE
from golden_model.lightmap import Lightmaps, filled

LARGEST_HALF = np.float32(65504)


def publish(lightmaps: Lightmaps, state: np.ndarray) -> np.ndarray:
    """TEXEL_STATE (N,) to PUBLISHED_TEXEL (N,): irradiance in binary16, never infinite.

    Texels that have not been sampled yet take a value from the sampled ones around them (`pull_push`), weight 0. Empty
    and buried texels repeat the texel that `fill` names, so that a bilinear read at a chart's border sees no black.
    """
    assert state.dtype == TEXEL_STATE
    sampled = state["count"] > 0
    value = state["irradiance"].copy()
    for width, height, offset in zip(lightmaps.width, lightmaps.height, lightmaps.offset, strict=True):
        part = slice(offset, offset + width * height)
        if not sampled[part][lightmaps.fill[part][lightmaps.fill[part] >= 0] - offset].all():
            known = sampled[part].reshape(height, width)
            value[part] = pull_push(value[part].reshape(height, width, 3), known).reshape(-1, 3)
    rgba = np.concatenate([np.minimum(value, LARGEST_HALF), sampled[:, None].astype(np.float32)], axis=1)
    out = np.zeros(len(state), dtype=PUBLISHED_TEXEL)
    out["rgba"] = filled(lightmaps, float_to_half(rgba))
    return out


@quiet
def pull_push(values: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Fills an image (H, W, K) float32 where not `known` (H, W), smoothly; known pixels stay. All unknown: zero.

    Gortler et al. 1996 with weights 0 and 1: each coarser pixel is the mean of the known ones among its four, and an
    unknown pixel is read bilinearly from the coarser image, which was filled first. Sums run row by row.
    """
    height, width = known.shape
    if known.all() or not known.any():
        return np.where(known[..., None], values, np.float32(0))
    rows, columns = (height + 1) // 2, (width + 1) // 2
    total = np.zeros((rows, columns, values.shape[2]), dtype=np.float32)
    count = np.zeros((rows, columns), dtype=np.float32)
    for j, i in ((0, 0), (0, 1), (1, 0), (1, 1)):
        part = known[j::2, i::2]
        place = slice(part.shape[0]), slice(part.shape[1])
        count[place] += part
        total[place] = flush(total[place] + np.where(part[..., None], values[j::2, i::2], np.float32(0)))
    mean = flush(total / np.maximum(count, np.float32(1))[..., None])
    coarse = pull_push(mean, count > 0)

    def doubled(image: np.ndarray, size: int) -> np.ndarray:
        """Twice as long along the first axis: 3/4 of the pixel above and 1/4 of the nearer neighbour."""
        index = np.arange(size)
        near, far = index // 2, np.clip(index // 2 + np.where(index % 2, 1, -1), 0, len(image) - 1)
        return flush(flush(image[near] * np.float32(0.75)) + flush(image[far] * np.float32(0.25)))

    smooth = doubled(doubled(coarse, height).swapaxes(0, 1), width).swapaxes(0, 1)
    return np.where(known[..., None], values, smooth)
