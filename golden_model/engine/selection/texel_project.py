"""The first half of texel visibility: from a texel to its surface point, and from there to the screen ([0068], FIG. 8).

What is found is where on the screen the texel lies, how deep, and how much it is turned towards the eye.
"""

import numpy as np

from lightloom.golden_model.contract.formats import PIXEL_BITS, SCREEN_BITS, TEXEL_PLACE
from lightloom.golden_model.numerics.floats import fixed_to_float, float_to_fixed_down, flush, quiet

Vector = list[np.ndarray]
"""Three float32 arrays (N,), flushed, each of its own: a third of the time of one array (N, 3)."""


@quiet
def texel_project(operands: np.ndarray) -> np.ndarray:
    """TEXEL_PROJECT (N,) to TEXEL_PLACE (N,).

    A texel is visible if it lies beyond the near plane, faces the eye down to 2**-facing_shift below its horizon, and
    is on the screen or off it by less than a texel: pixels at the border may read the texel all the same. Where it lies
    on the screen is a fixed-point number.
    """
    out = np.zeros(len(operands), dtype=TEXEL_PLACE)
    moved = [flush(a - b) for a, b in zip(vector_of(operands, "position"), vector_of(operands, "eye"), strict=True)]
    # The distance of the eye from the texel's plane, against a part of the distance along the view axis.
    above = -dot_of(vector_of(operands, "normal"), moved)
    depth = dot_of(moved, vector_of(operands, "forward"))
    slack = np.ldexp(np.float32(1), -operands["facing_shift"].astype(np.int32))
    below = -flush(slack * depth)
    facing = np.flatnonzero((depth > _scalar(operands, "near")) & (above > below))

    operands, depth, above = operands[facing], depth[facing], above[facing]
    moved = [each[facing] for each in moved]
    enlarged = flush(_scalar(operands, "focal") / depth)  # pixels a unit of length, at this depth
    x = _on_axis(flush(dot_of(moved, vector_of(operands, "right")) * enlarged), operands["width"])
    y = _on_axis(-flush(dot_of(moved, vector_of(operands, "up")) * enlarged), operands["height"])
    farther = np.maximum(_beyond(x, operands["width"]), _beyond(y, operands["height"]))
    outside = fixed_to_float(farther.astype(np.int32), PIXEL_BITS)
    near = (farther == 0) | (outside < flush(enlarged * _scalar(operands, "texel_size")))

    visible = facing[near]
    out["visible"][visible] = True
    out["depth"][visible], out["above"][visible], out["outside"][visible] = depth[near], above[near], outside[near]
    out["column"][visible] = _taps(x[near], operands["width"][near])
    out["row"][visible] = _taps(y[near], operands["height"][near])
    return out


def _on_axis(moved: np.ndarray, size: np.ndarray) -> np.ndarray:
    """Places on an axis of the screen (N,) int64, from where they lie from its middle in pixels (N,) float32.

    In 1/2**PIXEL_BITS pixels from the first end, rounded down.
    """
    return float_to_fixed_down(moved, PIXEL_BITS).astype(np.int64) + (size.astype(np.int64) << PIXEL_BITS - 1)


def _beyond(place: np.ndarray, size: np.ndarray) -> np.ndarray:
    """How far places (N,) are beyond either end, (N,) int64 of 31 bits, saturating; 0 between them."""
    after = place - (size.astype(np.int64) << PIXEL_BITS)
    return np.clip(np.maximum(-place, after), 0, (1 << 31) - 1)


def _taps(place: np.ndarray, size: np.ndarray) -> np.ndarray:
    """The two pixels (of a row or column) whose centres lie around places (N,), kept on the screen: (N, 2).

    The first is the greatest integer that is not more than the place less a half. The second is the next one where both
    are on the screen, else the same.
    """
    first, last = (place - (1 << PIXEL_BITS - 1)) >> PIXEL_BITS, size.astype(np.int64) - 1
    kept = np.where(first < 0, 0, np.minimum(first, last))
    second = kept + ((first >= 0) & (first < last))
    return np.stack([kept, second], axis=1) & ((1 << SCREEN_BITS) - 1)


def _scalar(operands: np.ndarray, name: str) -> np.ndarray:
    return flush(operands[name])


def vector_of(operands: np.ndarray, name: str) -> Vector:
    """A field (N, 3) of operands, flushed."""
    return [flush(np.ascontiguousarray(operands[name][:, k])) for k in range(3)]


def dot_of(a: Vector, b: Vector) -> np.ndarray:
    """(x + y) + z of the products."""
    x, y, z = (flush(p * q) for p, q in zip(a, b, strict=True))
    return flush(flush(x + y) + z)
