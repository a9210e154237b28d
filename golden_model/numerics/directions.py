"""Tables of directions, and how a table entry becomes a ray's direction in the world.

No sine or cosine of the host is used: the tables come from sums, products, quotients and square roots in float64,
rounded once to float32, so they have the same bits everywhere (their checksums are held by a test).
"""

import functools

import numpy as np

from lightloom.golden_model.numerics.floats import flush
from lightloom.golden_model.numerics.vectors import add, cross, dot, normalize, scale, subtract

COUNT = 4096
"""Entries of the cosine table, a power of two."""

ROTATIONS = 1024
"""Entries of the rotation table, a power of two."""

RUN = 16
"""Aligned runs of this many entries of the cosine table are stratified over the whole hemisphere."""

_PI = 3.141592653589793
# Direction numbers of the second Sobol' dimension (primitive polynomial x + 1): row k is the Pascal matrix modulo 2.
_SOBOL_Y = np.array([0x80000000 >> k for k in range(32)], dtype=np.uint32)
for _k in range(1, 32):
    _SOBOL_Y[_k] = _SOBOL_Y[_k - 1] ^ (_SOBOL_Y[_k - 1] >> np.uint32(1))


def sobol(index: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points of the two-dimensional Sobol' sequence as uint32 fractions of 2**32.

    Every aligned run of 2**k points has one point in each box of area 2**-k whose sides are powers of two: a
    (0, 2)-sequence, so every beginning of it is well spread too.
    """
    index = np.asarray(index).astype(np.uint32)
    x = np.zeros_like(index)
    y = np.zeros_like(index)
    for k in range(int(index.max(initial=0)).bit_length()):
        chosen = ((index >> np.uint32(k)) & np.uint32(1)).astype(bool)
        x = np.where(chosen, x ^ np.uint32(0x80000000 >> k), x)
        y = np.where(chosen, y ^ _SOBOL_Y[k], y)
    return x, y


def sine_cosine(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """float64 (sin x, cos x) for |x| <= pi/4 by their Taylor polynomials, exact to about one unit in the last place."""
    square = x * x
    sine, cosine = np.ones_like(x), np.ones_like(x)
    for k in range(9, 0, -1):
        sine = 1.0 - square * sine / float(2 * k * (2 * k + 1))
        cosine = 1.0 - square * cosine / float(2 * k * (2 * k - 1))
    return x * sine, cosine


def sine_cosine_of(angle: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """float64 (sin, cos) of angles (N,) float64 of a few turns at most: of what is left of them beside quarters."""
    quarters = np.rint(angle / (_PI / 2))
    sine, cosine = sine_cosine(angle - quarters * (_PI / 2))
    quarter = quarters.astype(np.int64) % 4
    return (
        np.choose(quarter, [sine, cosine, -sine, -cosine]),
        np.choose(quarter, [cosine, -sine, -cosine, sine]),
    )


@functools.cache
def cosine_table() -> np.ndarray:
    """(COUNT, 3) float32 unit directions about +z, distributed with density cos/pi; read-only.

    The entries 4i to 4i+3 are one direction turned by quarters of a turn, so x and y of every aligned run of four sum
    to zero exactly, and hardware needs to store a quarter of the table. The quarter comes from the Sobol' sequence,
    taken to the quarter disc by the concentric map (Shirley and Chiu 1997) and up to the hemisphere (Malley), so every
    aligned run of 4**k entries has one in each cell of a 2**k by 2**k grid over the disc's square.
    """
    x_bits, y_bits = sobol(np.arange(COUNT // 4))
    # Three quarters of a cell more: no point lies on an axis or on the horizon, and the mean height, on which the light
    # from above depends, is right to 1e-5. (In the middles of the cells they would stand 6e-4 too steep.)
    a = (x_bits.astype(np.float64) + 0.75 * 2.0**32 / (COUNT // 4)) * 2.0**-32
    b = (y_bits.astype(np.float64) + 0.75 * 2.0**32 / (COUNT // 4)) * 2.0**-32
    radius = np.maximum(a, b)
    sine, cosine = sine_cosine(np.minimum(a, b) / radius * (_PI / 4))
    x = radius * np.where(a >= b, cosine, sine)
    y = radius * np.where(a >= b, sine, cosine)
    z = np.sqrt((1.0 - radius) * (1.0 + radius))
    table = np.stack([x, y, z, -y, x, z, -x, -y, z, y, -x, z], axis=1).reshape(COUNT, 3).astype(np.float32)
    table.setflags(write=False)
    return table


@functools.cache
def rotation_table() -> np.ndarray:
    """(ROTATIONS, 2) float32 (cosine, sine) of the angles (i + 1/2) / ROTATIONS of a turn; read-only."""
    eighth = ROTATIONS // 8
    sine, cosine = sine_cosine((np.arange(eighth) + 0.5) / eighth * (_PI / 4))
    c = np.concatenate([cosine, sine[::-1]])
    s = np.concatenate([sine, cosine[::-1]])
    table = np.concatenate([np.stack(pair, axis=1) for pair in ((c, s), (-s, c), (-c, -s), (s, -c))])
    table = table.astype(np.float32)
    table.setflags(write=False)
    return table


def tangent_of(normal: np.ndarray) -> np.ndarray:
    """Unit normals (N, 3) to unit tangents (N, 3), float32: Duff et al., Building an Orthonormal Basis, JCGT 2017."""
    x, y, z = normal[:, 0], normal[:, 1], normal[:, 2]
    one = np.float32(1)
    sign = np.copysign(one, z)
    a = flush(-one / flush(sign + z))
    b = flush(flush(x * y) * a)
    tangent = np.stack([flush(one + flush(sign * flush(flush(x * x) * a))), flush(sign * b), flush(-sign * x)], axis=1)
    return normalize(subtract(tangent, scale(normal, dot(tangent, normal))))


def to_world(
    local: np.ndarray, normal: np.ndarray, tangent: np.ndarray, rotation: np.ndarray | None = None
) -> np.ndarray:
    """Directions about +z (N, 3) to directions about `normal` (N, 3), all float32.

    First turned about the normal by `rotation` (N, 2), (cosine, sine) entries of `rotation_table`; then
    (x * tangent + y * (normal x tangent)) + z * normal.
    """
    x, y, z = local[:, 0], local[:, 1], local[:, 2]
    if rotation is not None:
        c, s = rotation[:, 0], rotation[:, 1]
        x, y = flush(flush(c * x) - flush(s * y)), flush(flush(s * x) + flush(c * y))
    return add(add(scale(tangent, x), scale(cross(normal, tangent), y)), scale(normal, z))
