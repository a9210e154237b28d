"""The second half of texel visibility: whether a texel is what the four pixels around it see ([0069], [0070], FIG. 9).

Its normal and its depth are compared with those of each pixel; by how much depths may differ depends on how the surface
lies. What these cheap tests leave in doubt (a depth slightly off, a silhouette, the border of the picture) is likely to
be seen, and may be decided by a ray from the texel to the eye.
"""

import numpy as np

from lightloom.golden_model.contract.formats import HIDDEN, LIKELY, LOD_BITS, SEEN, SHORTEST, TAPS, TEXEL_MATCHED
from lightloom.golden_model.engine.selection.texel_project import dot_of, vector_of
from lightloom.golden_model.numerics.floats import float_minmax, flush, half_to_float, quiet


@quiet
def texel_match(operands: np.ndarray) -> np.ndarray:
    """TEXEL_MATCH (N,) to TEXEL_MATCHED (N,): the best that one of the pixels says, and the finest level of those that
    see the texel, rounded to whole levels and kept within 0 to `lod_levels`.

    LIKELY is what is in doubt, which is everything where the policy has neither of the two tests.
    """
    tolerance = depth_tolerance(operands)
    best = np.full(len(operands), HIDDEN, dtype=np.uint8)
    level = np.full(len(operands), np.iinfo(np.int16).max, dtype=np.int16)
    for pixel in range(TAPS):
        outcome = _compare(operands, tolerance, pixel)
        best = np.maximum(best, outcome)
        finer = np.minimum(level, operands["pixel_lod"][:, pixel])
        level = np.where(outcome == SEEN, finer, level)
    whole = (level.astype(np.int32) + (1 << LOD_BITS >> 1)) >> LOD_BITS
    out = np.zeros(len(operands), dtype=TEXEL_MATCHED)
    out["degree"] = best
    out["lod"] = np.where(best == SEEN, np.clip(whole, 0, operands["lod_levels"]), 0)
    return out


@quiet
def depth_tolerance(operands: np.ndarray) -> np.ndarray:
    """By how much depths of TEXEL_MATCH (N,) may differ, (N,) float32.

    For rounding, curvature, and how much the surface rises in depth over some pixels.

    Over one it is z*z * (|nx| + |ny|) / (focal * height of the eye over the texel's plane).
    """
    normal, depth = vector_of(operands, "normal"), flush(operands["depth"])
    across, along = (np.abs(dot_of(normal, vector_of(operands, axis))) for axis in ("right", "up"))
    over = float_minmax(flush(flush(operands["focal"]) * np.abs(flush(operands["above"]))), SHORTEST, True)
    steep = flush(flush(flush(across + along) * depth) / over)
    margin = flush(np.float32(1) + flush(operands["outside"]))
    reach = flush(margin * flush(operands["depth_slopes"]))
    slope = float_minmax(flush(steep * reach), operands["depth_limit"])
    part = flush(slope + flush(operands["depth_relative"]))
    return flush(flush(part * depth) + flush(operands["depth_fixed"]))


def _compare(operands: np.ndarray, tolerance: np.ndarray, pixel: int) -> np.ndarray:
    """What one of the pixels (0 to 3) says of each texel (N,): HIDDEN, LIKELY (in doubt) or SEEN."""
    by_normal, by_depth = operands["normal_test"], operands["depth_test"]
    seen_depth = operands["pixel_depth"][:, pixel]
    behind = flush(flush(operands["depth"]) - flush(seen_depth))
    same_depth = np.abs(behind) <= tolerance
    # Nearer than what the pixel sees: a silhouette, or geometry thinner than a pixel.
    not_behind = behind < flush(tolerance * flush(operands["depth_doubt"]))
    same_normal = _cosine(operands, pixel) >= flush(operands["normal_cosine"])
    # Beside an empty pixel may be a silhouette. A crease has the depth but not the normal.
    empty = seen_depth == np.inf
    seen = (by_normal | by_depth) & (same_normal | ~by_normal) & (same_depth | ~by_depth)
    one_of_two = empty | (by_depth & (same_depth | (same_normal & not_behind)))
    doubtful = np.where(by_normal, one_of_two, not_behind | ~by_depth)
    return np.where(seen, SEEN, np.where(doubtful, LIKELY, HIDDEN)).astype(np.uint8)


def _cosine(operands: np.ndarray, pixel: int) -> np.ndarray:
    """Of the angle between a texel's normal and a pixel's, (N,) float32."""
    facing = [half_to_float(operands["pixel_normal"][:, 3 * pixel + k]) for k in range(3)]
    return dot_of(vector_of(operands, "normal"), facing)
