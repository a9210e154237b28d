"""What the box test needs of a ray, computed once a ray (docs/node_test.md derives the numbers).

All boxes lie on the scene's lattice (`formats.NODE_BLOCK`), so the box test works in integers. The ray's unit is a
quarter of a lattice unit times 2**coarseness, where the coarseness is 0 for a ray that starts inside or near the scene
and grows with the distance of its origin, so that the origin has a fixed number of bits.

Distances are counted along the ray's dominant axis, in the same unit. On another axis, `slope` and `steepness` say how
many units of the dominant axis the ray needs for a unit of that axis: slope / 2**17 * 2**steepness, at least 1.
"""

import numpy as np

from lightloom.golden_model.contract.formats import (
    BOX_FRACTION,
    BOX_RAY,
    LATTICE_BITS,
    POSITION_BIAS,
    POSITION_BITS,
    RAY_TIME,
    SCALE_BIAS,
    SLOPE_BITS,
)
from lightloom.golden_model.numerics.floats import float_add, float_multiply, quiet
from lightloom.golden_model.tracing.wide_bvh.ray_time import SIGNIFICAND, floor_scaled, ray_time

PAD = 21
"""Pad for rounding, in the ray's units: 2**-19 of the greatest reach is 16; 2 for the rounding of the position, 2 for
that of the slopes, 1 for that of the node's corner."""
UNDERFLOW = -26
"""The pad for underflow is 2**UNDERFLOW * (1 + longest component of the direction), in the scene's unit."""
BLIND_SHIFT = 20
"""A pad for underflow of 2**20 units or more exceeds its field: the ray then enters every box."""
INFINITE = 255
"""The exponent of an infinity. Where origin - lattice_origin overflows to one, the ray is blind too."""
STEEPEST = 27
"""From this steepness on every distance that is not zero saturates."""
COARSEST = 31
"""From this coarseness on (in fact from 24 on) the whole lattice lies within one unit of the ray."""


@quiet
def box_setup(rays: np.ndarray) -> np.ndarray:
    """BOX_SETUP (N,), of which origin, inverse, axis and t_min come from `ray_setup`, to BOX_RAY (N,).

    For an invalid ray (`ray_setup`; or an origin that is not finite) the result means nothing.
    """
    out = np.zeros(len(rays), dtype=BOX_RAY)
    row, axis = np.arange(len(rays)), rays["axis"].astype(np.intp) % 3
    lattice = rays["lattice_exponent"].astype(np.int64)

    moved = float_add(rays["origin"], rays["lattice_origin"], subtract=True)
    greatest = _exponent(moved).max(axis=1)
    coarseness = coarseness_of(greatest - 126, lattice, LATTICE_BITS)
    scale = BOX_FRACTION - coarseness - lattice
    for k in range(3):
        out["position"][:, k] = POSITION_BIAS + floor_scaled(
            np.ascontiguousarray(moved[:, k]), scale, POSITION_BITS - 1
        )
    out["coarseness"] = np.minimum(coarseness, COARSEST)
    out["scale"] = np.clip(scale + SCALE_BIAS, 0, 2 * SCALE_BIAS - 1)

    rate = np.abs(float_multiply(rays["direction"][row, axis], np.ones(1, np.float32)))
    out["rate"] = rate
    # 1 + longest is at most 2**(1 + max(0, exponent + 1)).
    shift = UNDERFLOW + 1 + np.maximum(_exponent(rate) - 126, 0) + scale
    blind = (shift >= BLIND_SHIFT) | (greatest == INFINITE)
    out["blind"] = blind
    out["pad"] = np.where(blind, 0, PAD + (1 << np.clip(shift, 0, BLIND_SHIFT - 1)))

    out["backwards"] = np.signbit(rays["direction"])
    for k in range(3):
        ratio = np.abs(float_multiply(rate, rays["inverse"][:, k]))
        pattern = ratio.view(np.int32).astype(np.int64)
        significand, exponent = pattern & 0x7FFFFF | 0x800000, (pattern >> 23) - 127
        slope, steepness = slope_of(significand, exponent, axis == k, SIGNIFICAND, SLOPE_BITS)
        out["slope"][:, k], out["steepness"][:, k] = slope, np.minimum(steepness, STEEPEST)

    times = np.zeros(len(rays), dtype=RAY_TIME)
    times["t"], times["rate"], times["scale"] = rays["t_min"], rate, out["scale"]
    out["t_min"] = ray_time(times)["low"]
    return out


def coarseness_of(end: np.ndarray, lattice_exponent: np.ndarray | int, lattice_bits: int) -> np.ndarray:
    """The coarseness of rays whose distance from the lattice's origin is less than 2**end on every axis."""
    return np.maximum(end - lattice_bits - lattice_exponent, 0)


def slope_of(
    significand: np.ndarray, exponent: np.ndarray, dominant: np.ndarray | bool, significand_bits: int, slope_bits: int
) -> tuple[np.ndarray, np.ndarray]:
    """Slope and steepness, rounded down, of the ratio significand / 2**(significand_bits - 1) * 2**exponent."""
    # The dominant axis is 1 by definition; rounding may have made another ratio a little less.
    level = dominant | (exponent < 0)
    slope = np.where(level, 1 << (slope_bits - 1), significand >> (significand_bits - slope_bits))
    return slope, np.where(level, 0, exponent)


def _exponent(x: np.ndarray) -> np.ndarray:
    """Biased exponents of float32, int64."""
    return (np.ascontiguousarray(x).view(np.int32).astype(np.int64) >> 23) & 0xFF
