"""Ray setup and ray-triangle in exact rational arithmetic, one scalar at a time; see `tests.exact`.

Written against the paper and the documentation, not against the model: scalars, a permutation by a table, edge
functions rounded by a Fraction.
"""

import numpy as np

from lightloom.golden_model.contract import bitpack
from lightloom.golden_model.contract.formats import PREPARED_RAY, TRIANGLE_HIT
from tests import exact

ONE = 0x3F800000
MAGNITUDE = 0x7FFFFFFF
CYCLIC = {0: (1, 2), 1: (2, 0), 2: (0, 1), 3: (1, 2)}
"""(kx, ky) of a dominant axis; 3, which ray setup never gives, stands for 0."""


def scalars(record: np.ndarray) -> dict[str, list[int]]:
    """A record (1,) to the raw bits of each field, a list with one entry a component."""
    whole = sum(int(word) << (32 * k) for k, word in enumerate(bitpack.pack(record)[0]))
    out: dict[str, list[int]] = {}
    for name, _, _, offset, width in bitpack.fields(record.dtype):
        out.setdefault(name, []).append(whole >> offset & (1 << width) - 1)
    return out


def record(dtype: np.dtype, values: dict[str, list[int]]) -> np.ndarray:
    """Inverse of `scalars`."""
    taken = {name: list(bits) for name, bits in values.items()}
    whole = sum(taken[name].pop(0) << offset for name, _, _, offset, _ in bitpack.fields(dtype))
    words = [whole >> (32 * k) & 0xFFFFFFFF for k in range(bitpack.words(dtype))]
    return bitpack.unpack(np.array([words], dtype=np.uint32), dtype)


def add(a: int, b: int) -> int:
    return exact.float_add(a, b, 0)


def subtract(a: int, b: int) -> int:
    return exact.float_add(a, b, 1)


def plain(bits: int) -> int:
    """Canonical NaN, no subnormals."""
    return exact.float_multiply(bits, ONE)


def less(a: int, b: int) -> bool:
    return bool(exact.float_compare(a, b) & 1)


def at_most(a: int, b: int) -> bool:
    return bool(exact.float_compare(a, b) & 3)


def ray_setup(ray: np.ndarray) -> np.ndarray:
    """RAY (1,) to PREPARED_RAY (1,)."""
    r = scalars(ray)
    direction = r["direction"]
    axis = max(range(3), key=lambda k: (direction[k] & MAGNITUDE, -k))
    kx, ky = CYCLIC[axis][:: -1 if direction[axis] >> 31 else 1]
    inverse = [exact.float_divide(ONE, d) for d in direction]
    sz = inverse[axis]
    shear = [exact.float_multiply(direction[kx], sz), exact.float_multiply(direction[ky], sz), sz]
    numbers = [exact.decode(bits) for bits in (*direction, sz)]
    if any(number.value is None for number in numbers) or numbers[-1].value == 0:
        shear = [exact.NAN] * 3
    result = {
        "origin": [plain(o) for o in r["origin"]],
        "shear": shear,
        "t_min": [plain(r["t_min"][0])],
        "t_max": [plain(r["t_max"][0])],
        "axis": [axis],
        "flip": [direction[axis] >> 31],
        "inverse": inverse,
    }
    return record(PREPARED_RAY, result)


def ray_triangle(test: np.ndarray) -> np.ndarray:
    """RAY_TRIANGLE (1,) to TRIANGLE_HIT (1,)."""
    r = scalars(test)
    axis = r["axis"][0]
    kz = axis % 3
    kx, ky = CYCLIC[axis][:: -1 if r["flip"][0] else 1]
    sx, sy, sz = r["shear"]
    xs, ys, zs = [], [], []
    for name in ("v0", "v1", "v2"):
        moved = [subtract(v, o) for v, o in zip(r[name], r["origin"], strict=True)]
        xs.append(subtract(moved[kx], exact.float_multiply(sx, moved[kz])))
        ys.append(subtract(moved[ky], exact.float_multiply(sy, moved[kz])))
        zs.append(moved[kz])

    # The edge function opposite vertex k, from the vertex after the next to the next.
    nexts = ((1, 2), (2, 0), (0, 1))
    edges = [exact.float_difference_of_products(xs[q], ys[p], ys[q], xs[p]) for p, q in nexts]
    determinant = add(add(edges[0], edges[1]), edges[2])
    reciprocal = exact.float_divide(ONE, determinant)
    terms = [exact.float_multiply(edge, z) for edge, z in zip(edges, zs, strict=True)]
    depth = add(add(terms[0], terms[1]), terms[2])
    t = exact.float_multiply(exact.float_multiply(depth, sz), reciprocal)

    negative, positive = any(less(edge, 0) for edge in edges), any(less(0, edge) for edge in edges)
    scale = exact.decode(reciprocal).value
    hit = (
        scale is not None
        and 0 < abs(scale) < 2**97
        and not (negative and positive)
        and not (r["cull"][0] and negative)
        and exact.decode(t).value is not None
        and less(r["t_min"][0], t)
        and at_most(t, r["t_max"][0])
    )
    if not hit:
        return np.zeros(1, dtype=TRIANGLE_HIT)
    u, v = (exact.float_multiply(edge, reciprocal) & MAGNITUDE for edge in edges[1:])
    return record(TRIANGLE_HIT, {"t": [t], "u": [u], "v": [v], "hit": [1], "front": [int(positive)]})
