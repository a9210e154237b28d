"""Reads between texels and between levels, against exact rational arithmetic that knows no floating point."""

from fractions import Fraction

import numpy as np
import pytest

from lightloom.golden_model.tables.lightmap import Levels, Lightmaps, bilinear, bilinear_taps, levels_of, sample
from tests.exact import Number, decode, encode
from tests.golden_model.engine.publishing.test_publisher import maps_of

SIZES = [(37, 21), (1, 1), (8, 8), (1, 40)]
SPECIAL = [0.0, -0.0, 0.5, 1e-40, -1e-3, 8.001953125, 8.005859375, 16384.0, 3e9, -3e9, np.inf, -np.inf, np.nan]
"""Coordinates: at the centre of a texel, subnormal, halfway between two 256ths, beyond every map, no numbers."""


def bits(value: np.float32) -> int:
    return int(np.float32(value).view(np.uint32))


def as_single(value: Fraction) -> Fraction:
    """Rounded to float32, which is no smaller than its least normal number here."""
    return finite(decode(encode(value)))


def finite(number: Number) -> Fraction:
    assert number.value is not None
    return number.value


def place_of(coordinate: np.float32, level: int) -> int:
    """Of a coordinate in a level, from the middle of its first texel on, in 256ths, to nearest even and saturated."""
    number = decode(bits(coordinate))
    if number.value is None:
        return 0 if number.nan else (-(2**31) if number.negative else 2**31 - 1)
    flushed = number.value if abs(number.value) >= Fraction(1, 2**126) else Fraction(0)
    moved = as_single(as_single(flushed / 2**level) - Fraction(1, 2))
    return max(-(2**31), min(round(moved * 256), 2**31 - 1))


def exact(
    values: list[list[Fraction]], size: tuple[int, int], first: int, uv: np.ndarray, level: int
) -> list[Fraction]:
    """Bilinear, in one level of `size` that begins at texel `first`."""
    (x, y), (width, height) = (place_of(c, level) for c in uv), size
    total = [Fraction(0)] * 3
    for dy, wy in ((0, 256 - y % 256), (1, y % 256)):
        for dx, wx in ((0, 256 - x % 256), (1, x % 256)):
            column, row = (max(0, min(p // 256 + d, n - 1)) for p, d, n in ((x, dx, width), (y, dy, height)))
            texel = values[first + row * width + column]
            total = [t + Fraction(wx * wy, 65536) * v for t, v in zip(total, texel, strict=True)]
    return total


def case(seed: int, count: int) -> tuple[Lightmaps, Levels, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Maps, values of random finite bits of binary16, 0 or more, owners, coordinates and levels of detail."""
    maps, rng = maps_of(SIZES), np.random.default_rng(seed)
    layout = levels_of(maps)
    half = rng.integers(0, 0x7C00, (layout.total, 3)).astype(np.uint16)
    half[rng.random(len(half)) < 0.1] = rng.choice([0, 1, 0x3FF, 0x400, 0x7BFF])
    owner = rng.integers(0, len(SIZES), count)
    uv = (rng.uniform(-0.2, 1.2, (count, 2)) * np.array(SIZES)[owner]).astype(np.float32)
    uv[rng.random((count, 2)) < 0.1] = rng.choice(np.array(SPECIAL, dtype=np.float32))
    uv[: len(SPECIAL), 0] = SPECIAL
    lod = rng.integers(-100, 6 * 256, count)
    return maps, layout, half, owner, uv, lod


@pytest.mark.parametrize("seed", [1, 2])
def test_reads_are_exact_and_rounded_once(seed: int) -> None:
    maps, layout, half, owner, uv, lod = case(seed, 400)
    values = half.view(np.float16).astype(np.float32)
    fractions = [[finite(decode(int(b), 10, 5)) for b in row] for row in half]
    flat, deep = bilinear(maps, values, owner, uv), sample(maps, values, owner, uv, lod)
    for k, (o, place) in enumerate(zip(owner, uv, strict=True)):

        def read(level: int, o: int = o, place: np.ndarray = place) -> list[Fraction]:
            size = int(layout.width[o, level]), int(layout.height[o, level])
            return exact(fractions, size, int(layout.first[o, level]), place, level)

        wanted = [encode(v) for v in read(0)]
        assert [bits(v) for v in flat[k]] == wanted, f"seed {seed}, read {k}"
        level, fraction = divmod(max(0, min(int(lod[k]), int(layout.count[o]) << 8)), 256)
        coarse = read(min(level + 1, int(layout.count[o])))
        mixed = [(256 - fraction) * a / 256 + fraction * b / 256 for a, b in zip(read(level), coarse, strict=True)]
        assert [bits(v) for v in deep[k]] == [encode(v) for v in mixed], f"seed {seed}, read {k}, lod {lod[k]}"


def test_weights_are_whole_and_add_up() -> None:
    maps, _, _, owner, uv, _ = case(3, 2000)
    texel, weight = bilinear_taps(maps, owner, uv)
    assert (weight >= 0).all()
    assert (weight.sum(axis=1) == 1 << 16).all()
    first = maps.offset[owner][:, None]
    assert ((texel >= first) & (texel < first + (maps.width * maps.height)[owner][:, None])).all()


def test_equal_values_are_read_as_they_are() -> None:
    """Where all texels agree so does every read, at any place and level: no light is lost or gained by rounding."""
    maps, layout, _, owner, uv, lod = case(4, 1000)
    for value in (2.0**-24, 0.3, 1.0, 65504.0):
        values = np.full((layout.total, 3), np.float16(value), dtype=np.float32)
        assert (bilinear(maps, values, owner, uv) == np.float32(np.float16(value))).all()
        assert (sample(maps, values, owner, uv, lod) == np.float32(np.float16(value))).all()
