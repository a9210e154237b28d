"""Ray setup: what is computed once a ray, before any box or triangle test (Woop, Benthin, Wald 2013, section 3.1)."""

import numpy as np

from lightloom.golden_model.contract.formats import PREPARED_RAY
from lightloom.golden_model.numerics.floats import NAN, canonical, flush, quiet

# (kx, ky) for each dominant axis kz, before the winding flip.
NEXT_AXES = np.array([[1, 2], [2, 0], [0, 1]])


@quiet
def ray_setup(rays: np.ndarray) -> np.ndarray:
    """RAY (N,) to PREPARED_RAY (N,).

    The dominant axis kz is the one with the greatest |direction| (a NaN counts as greater than infinity); of equal ones
    the lowest. kx and ky follow it cyclically and are swapped where direction[kz] is negative. `inverse` is 1/direction
    a component (of zero: infinity of its sign). `shear` is (d[kx] * inverse[kz], d[ky] * inverse[kz], inverse[kz]).

    A ray whose direction is zero, has a component that is not finite, or is so long that 1/d[kz] is flushed to zero
    (|d[kz]| > 2**126) gets a NaN for its whole shear, so that every triangle test misses. So does one with a NaN
    t_min or t_max, or an origin that is not finite, by the comparisons of the triangle test itself.
    """
    direction = canonical(rays["direction"])
    inverse = canonical(np.float32(1) / direction)

    # Without its sign, a float32's bit pattern orders like its magnitude.
    magnitude = np.ascontiguousarray(rays["direction"]).view(np.uint32) & 0x7FFFFFFF
    x, y, z = magnitude[:, 0], magnitude[:, 1], magnitude[:, 2]
    axis = np.where((x >= y) & (x >= z), 0, np.where(y >= z, 1, 2))
    row = np.arange(len(rays))
    flip = np.signbit(rays["direction"][row, axis])
    kx, ky = NEXT_AXES[axis].T
    kx, ky = np.where(flip, ky, kx), np.where(flip, kx, ky)

    sz = inverse[row, axis]
    valid = np.isfinite(direction).all(axis=1) & np.isfinite(sz) & (sz != 0)
    shear = np.stack([flush(direction[row, kx] * sz), flush(direction[row, ky] * sz), sz], axis=1)

    out = np.zeros(len(rays), dtype=PREPARED_RAY)
    out["origin"] = canonical(rays["origin"])
    out["inverse"] = inverse
    out["shear"] = np.where(valid[:, None], shear, NAN)
    out["axis"] = axis
    out["flip"] = flip
    out["t_min"] = canonical(rays["t_min"])
    out["t_max"] = canonical(rays["t_max"])
    return out
