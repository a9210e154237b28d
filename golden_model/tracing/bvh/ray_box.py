"""The box test: conservative towards the computed triangle test (docs/traversal.md derives the pad).

In float32 the triangle test behaves like an exact one on vertices that are moved a little, so a computed hit may lie
outside the box of its triangle. Each ray therefore sees all boxes grown by a pad of its own, which covers that, the
rounding of the box test itself, and underflow in both.
"""

import numpy as np

from lightloom.golden_model.numerics.floats import quiet

PAD_RELATIVE = np.float32(2.0**-19)
"""Pad as a part of the distance (greatest component) from the ray's origin to the farthest corner of the scene."""
PAD_ABSOLUTE = np.float32(2.0**-26)
"""Pad for underflow, in the scene's unit, and once more in units of the direction's greatest component."""
OUTWARDS = np.float32(2.0**-23)
ONE = np.float32(1)


@quiet
def box_rays(prepared: np.ndarray, direction: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
    """What the box test needs of rays: PREPARED_RAY (N,), directions (N, 3) and the scene's box to float32 (9, N).

    Rows: the origin plus the pad (x, y, z); the origin minus the pad; 1/direction. The pad grows by twice the rounding
    of the origin's own component, so that both are rounded outwards.
    """
    origin = np.ascontiguousarray(prepared["origin"].T)
    reach = np.maximum(np.abs(lower[:, None] - origin), np.abs(upper[:, None] - origin)).max(axis=0)
    longest = np.abs(np.ascontiguousarray(direction.T)).max(axis=0)
    pad = PAD_RELATIVE * reach + PAD_ABSOLUTE * (longest + ONE) + OUTWARDS * np.abs(origin)
    return np.concatenate([origin + pad, origin - pad, prepared["inverse"].T])


@quiet
def ray_box(
    rays: np.ndarray, lower: np.ndarray, upper: np.ndarray, t_min: np.ndarray, t_max: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Tests ray against box, column by column: rays (9, N) of `box_rays`, corners (3, N), t range (N,), all float32.

    Returns the entry t (N,) float32, at least t_min, and whether the ray enters the box before it leaves it and before
    t_max (N,) bool. A NaN (zero times infinity: a ray within a face of the padded box) excludes nothing.
    """
    above, below, inverse = rays[:3], rays[3:6], rays[6:]
    at_lower = (lower - above) * inverse
    at_upper = (upper - below) * inverse
    backwards = np.signbit(inverse)
    near = np.where(backwards, at_upper, at_lower)
    far = np.where(backwards, at_lower, at_upper)
    entry = np.fmax(np.fmax(near[0], near[1]), np.fmax(near[2], t_min))
    leave = np.fmin(np.fmin(far[0], far[1]), np.fmin(far[2], t_max))
    return entry, entry <= leave
