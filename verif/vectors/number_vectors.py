"""Operand vectors for the number units: corner grids after TestFloat's, and seeded random ones.

`corner_vectors` is the same for every run; `random_vectors` depends on its seed alone. Floats are handled as bits
(uint32), so that signalling NaNs and payloads arrive as they were made.
"""

from collections.abc import Callable, Sequence

import numpy as np

from lightloom.golden_model.contract.interfaces import PURE

Rng = np.random.Generator

# Around: zero and the least normal numbers; the edge of alignment (a significand and its guard bits) beside 1;
# products and quotients that just under- or overflow; the greatest numbers; infinity and NaN.
EXPONENTS = (
    0,
    1,
    2,
    3,
    24,
    25,
    63,
    64,
    101,
    102,
    103,
    104,
    125,
    126,
    127,
    128,
    129,
    150,
    151,
    152,
    190,
    191,
    253,
    254,
    255,
)
# Ones and zeros at either end, a tie, its neighbours, all but one. In a NaN: signalling and quiet, with payloads.
FRACTIONS = (0, 1, 2, 0x2AAAAA, 0x3FFFFF, 0x400000, 0x400001, 0x7FFFFE, 0x7FFFFF)
# A few of everything, small enough for all quadruples of them.
FEW = (0, 1, 0x007FFFFF, 0x00800000, 0x3F800000, 0x3F800001, 0x3FFFFFFF, 0x7F7FFFFF, 0x7F800000, 0x7F800001, 0xFFC12345)
LEAST = 2.0**-126
"""The least normal number."""
BEYOND = 2.0**128 * (1 - 2.0**-25)
"""Halfway between the greatest number and 2**128: the least that rounds to infinity."""


def _floats(exponents: Sequence[int] | np.ndarray, fractions: Sequence[int] | np.ndarray) -> np.ndarray:
    """Every exponent with every fraction, of both signs, as bits."""
    magnitude = np.array(exponents, np.uint32)[:, None] << np.uint32(23) | np.array(fractions, np.uint32)
    return np.concatenate([magnitude.ravel(), magnitude.ravel() | np.uint32(1 << 31)])


VALUES = _floats(EXPONENTS, FRACTIONS)

_WALKING = [1 << k for k in range(23)]
_RUNS = [(1 << k) - 1 for k in range(24)]
MANY = _floats(
    range(256),
    sorted({*_WALKING, *_RUNS, *(0x7FFFFF ^ k for k in _WALKING), *(0x7FFFFF ^ k for k in _RUNS), *FRACTIONS}),
)
"""Every exponent with fractions of one bit, of all but one, and of runs from either end."""


def _records(name: str, *columns: np.ndarray | int) -> np.ndarray:
    """The unit's operands from a column a field, as bits."""
    dtype = PURE[name].input
    columns = np.broadcast_arrays(*columns)
    out = np.zeros(columns[0].size, dtype)
    for field, column in zip(dtype.names or (), columns, strict=True):
        kind = dtype[field]
        raw = column.ravel()
        out[field] = raw.astype(bool) if kind == np.bool_ else raw.astype(f"<u{kind.itemsize}").view(kind)
    return out


# --- corners --------------------------------------------------------------------------------------------------------


def _half_ties() -> np.ndarray:
    """The midpoints between neighbouring binary16 numbers, the numbers themselves, and one ulp to either side."""
    half = np.arange(0x7C00, dtype=np.uint16).view(np.float16).astype(np.float64)
    step = np.append(np.diff(half), 32.0)
    exact = np.concatenate([half, half + step / 2]).astype(np.float32).view(np.uint32)
    return np.concatenate([exact, exact + 1, np.maximum(exact, 1) - 1, exact | np.uint32(1 << 31)])


def _integers(width: int) -> np.ndarray:
    """Sums and differences of two powers of two, and their neighbours, in `width` bits."""
    powers = np.array([0, *(1 << k for k in range(width))], np.uint64)
    both = np.concatenate([(powers[:, None] + powers).ravel(), (powers[:, None] - powers).ravel()])
    near = np.concatenate([both - np.uint64(1), both, both + np.uint64(1)])
    return np.unique(near & np.uint64((1 << width) - 1)).astype(f"<u{width // 8}")


def corner_vectors(name: str) -> np.ndarray:
    """The corner operands of a number unit, at least 40,000 of them. The same at every call."""
    match name:
        case "float_add" | "float_minmax":
            return _records(name, VALUES[:, None, None], VALUES[None, :, None], np.arange(2))
        case "float_multiply" | "float_divide" | "float_compare":
            return _records(name, VALUES[:, None], VALUES)
        case "float_difference_of_products":
            few = np.array(FEW, np.uint32)
            grid = np.meshgrid(few, few, few, few, indexing="ij")
            return np.concatenate(
                [_records(name, *grid), _near_products(name, VALUES, 300_000, np.random.default_rng(0))]
            )
        case "float_sqrt":
            return _records(name, MANY)
        case "float_to_half":
            return _records(name, np.concatenate([MANY, _half_ties()]))
        case "half_to_float":
            return _records(name, np.arange(1 << 16))
        case "float_to_fixed" | "float_to_fixed_down":
            spread = _records(name, MANY, np.arange(MANY.size) % 32)
            return np.concatenate([_records(name, VALUES[:, None], np.arange(32)), spread])
        case "fixed_to_float":
            return _records(name, _integers(32)[:, None], np.arange(32))
        case "fixed64_to_float":
            return _records(name, _integers(64)[:, None], np.arange(0, 32, 5))
    raise KeyError(name)


# --- random ---------------------------------------------------------------------------------------------------------


def _bits(rng: Rng, count: int) -> np.ndarray:
    return rng.integers(0, 1 << 32, count, dtype=np.uint32)


def _with_exponent(bits: np.ndarray, exponent: np.ndarray) -> np.ndarray:
    """The bits with another biased exponent, brought into 0 to 255."""
    return bits & np.uint32(0x807FFFFF) | np.clip(exponent, 0, 255).astype(np.uint32) << np.uint32(23)


def _sparse(rng: Rng, bits: np.ndarray) -> np.ndarray:
    """Keeps a random number of fraction bits at the high end, for ties and short products."""
    kept = rng.integers(0, 24, bits.size).astype(np.uint32)
    return bits & ~(np.uint32(0x7FFFFF) >> kept)


def _local(rng: Rng, count: int) -> np.ndarray:
    """Numbers with exponents near 1, some with short fractions."""
    bits = _with_exponent(_bits(rng, count), rng.integers(117, 138, count))
    return np.where(rng.random(count) < 0.3, _sparse(rng, bits), bits)


def _exponents(bits: np.ndarray) -> np.ndarray:
    return (bits >> np.uint32(23) & np.uint32(0xFF)).astype(np.int64)


def _mixed(rng: Rng, count: int) -> np.ndarray:
    """A third each: any bits; exponents near 1; corner values."""
    kind = rng.integers(0, 3, count)
    return np.choose(kind, [_bits(rng, count), _local(rng, count), rng.choice(VALUES, count)]).astype(np.uint32)


def _widened(bits: np.ndarray) -> np.ndarray:
    """The bits of float32 numbers to float64."""
    return bits.view(np.float32).astype(np.float64)


def _narrowed(values: np.ndarray) -> np.ndarray:
    """float64 to the bits of the nearest float32."""
    with np.errstate(all="ignore"):
        return values.astype(np.float32).view(np.uint32)


def _nudged(rng: Rng, bits: np.ndarray, ulps: int) -> np.ndarray:
    """Four in ten moved by up to `ulps` units in the last place."""
    move = rng.integers(-ulps, ulps + 1, bits.size) * (rng.random(bits.size) < 0.4)
    return bits + move.astype(np.uint32)


def _partners(rng: Rng, a: np.ndarray, inverse: Callable[[np.ndarray, np.ndarray], np.ndarray]) -> np.ndarray:
    """A second operand for each `a`: unrelated; a few ulps beside +-a, up to an exponent apart; up to 27 exponents
    apart; or `inverse(result, a)` for a result at the lower or upper end of the normal numbers, in float64.
    """
    count = a.size
    close = a ^ (_bits(rng, count) & np.uint32(1 << 31))
    close = _nudged(rng, close, 3) + (rng.integers(-1, 2, count) << 23).astype(np.uint32)
    apart = _with_exponent(_bits(rng, count), _exponents(a) + rng.integers(-27, 28, count))
    end = np.where(rng.random(count) < 0.7, LEAST, BEYOND) * (1 + rng.integers(-4, 5, count) * 2.0**-25)
    with np.errstate(all="ignore"):
        at_end = _nudged(rng, _narrowed(inverse(end, _widened(a))), 1)
    kind = rng.integers(0, 4, count)
    return np.choose(kind, [_mixed(rng, count), close, apart, at_end]).astype(np.uint32)


def _near_products(name: str, values: np.ndarray, count: int, rng: Rng) -> np.ndarray:
    """(a, b, c, d) with c*d close to a*b: built so that the difference cancels, fully or nearly, or straddles."""
    part = -(-count // 6)

    # The same product from other factors, (pq)(rs) and (pr)(qs), then a few ulps beside it.
    p, q, r, s = rng.integers(1, 1 << 12, (4, part))
    scale = 2.0 ** rng.integers(-60, 40, part)
    quads = [(p * q * scale, r * s / scale, p * r * scale, q * s / scale)]
    # The nearest float32 to a*b/c: the difference is about the rounding error of d.
    a, b, c = (_widened(_local(rng, part)) for _ in range(3))
    quads.append((a, b, c, a * b / c))
    # The same factors, swapped.
    quads.append((a, b, b, a))
    # A difference beside the least normal number: 2**-126 or twice it, less a few times 2**-151.
    a, b = 2.0 ** rng.integers(-62, 0, part), 2.0 ** rng.integers(0, 2, part)
    c = 2.0 ** rng.integers(-76, -62, part)
    quads.append((a, b * LEAST / a, c, rng.integers(0, 9, part) * 2.0**-151 / c))
    # A difference that is the greatest number and up to two units in its last place.
    a, c = 2.0 ** rng.integers(1, 127, part), 2.0 ** rng.integers(-20, 100, part)
    quads.append((a, 2.0**128 * (1 - 2.0**-24) / a, c, rng.integers(-8, 9, part) * 2.0**101 / c))
    near = [_nudged(rng, _narrowed(np.concatenate(column)), 2) for column in zip(*quads, strict=True)]

    # Products of exponents up to 80 apart, of any size: straddling the alignment, under- and overflowing.
    a, b, c = (rng.choice(values, part), _bits(rng, part), _bits(rng, part))
    d = _with_exponent(_bits(rng, part), _exponents(a) + _exponents(b) - _exponents(c) + rng.integers(-80, 81, part))
    columns = [np.concatenate([x, y]) for x, y in zip(near, (a, b, c, d), strict=True)]
    signs = _bits(rng, 4 * columns[0].size).reshape(4, -1) & np.uint32(1 << 31)
    return _records(name, *(x ^ s for x, s in zip(columns, signs, strict=True)))


def random_vectors(name: str, count: int, seed: int) -> np.ndarray:
    """`count` random operands of a number unit; the same for the same seed."""
    rng = np.random.default_rng([seed, *name.encode()])
    a, flag = _mixed(rng, count), rng.integers(0, 2, count)
    match name:
        case "float_add" | "float_minmax":
            return _records(name, a, _partners(rng, a, np.subtract), flag)
        case "float_compare":
            return _records(name, a, _partners(rng, a, np.subtract))
        case "float_multiply":
            return _records(name, a, _partners(rng, a, np.divide))
        case "float_divide":
            return _records(name, a, _partners(rng, a, lambda end, a: a / end))
        case "float_difference_of_products":
            free = _records(name, *(_mixed(rng, count // 3) for _ in range(4)))
            return np.concatenate([free, _near_products(name, a, count - len(free), rng)])[:count]
        case "float_sqrt":
            return _records(name, np.where(rng.random(count) < 0.7, a & np.uint32(0x7FFFFFFF), a))
        case "float_to_half":
            scaled = _with_exponent(_bits(rng, count), rng.integers(100, 146, count))
            return _records(name, np.where(rng.random(count) < 0.7, scaled, a))
        case "half_to_float":
            return _records(name, a >> np.uint32(16))
        case "float_to_fixed" | "float_to_fixed_down":
            fraction = rng.integers(0, 32, count)
            scaled = _with_exponent(_bits(rng, count), 127 - fraction + rng.integers(-4, 34, count))
            return _records(name, np.where(rng.random(count) < 0.7, scaled, a), fraction)
        case "fixed_to_float":
            shift = rng.integers(0, 32, count)
            return _records(
                name, (_bits(rng, count).view(np.int32) >> shift).astype(np.uint32), rng.integers(0, 32, count)
            )
        case "fixed64_to_float":
            wide = rng.integers(0, 1 << 64, count, dtype=np.uint64).view(np.int64) >> rng.integers(0, 64, count)
            # A few bits below the significand decide how it is rounded.
            kept = rng.integers(0, 64, count)
            short = np.where(rng.random(count) < 0.3, wide >> kept << kept, wide)
            return _records(name, short.view(np.uint64), rng.integers(0, 32, count))
    raise KeyError(name)
