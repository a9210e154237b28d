"""Textures: mip chains keep their mean, lookups go between texels and levels, minified pictures do not sparkle."""

from fractions import Fraction
from math import floor

import numpy as np
import pytest

from lightloom.golden_model.frame.rasterizer import draw
from lightloom.golden_model.rays.surface_shading import shade_fragments
from lightloom.golden_model.scene.textures import build_textures
from lightloom.golden_model.tables.textures import LOD_ONE, sample_textures
from tests.exact import decode, encode, float_add, float_multiply, float_to_fixed
from tests.golden_model.frame_scenes import flat_light, mesh_of, quad, scene_of, seen_from

ROUNDING = 2.0**-11
"""Of a number to binary16, at most, as a part of it: by so much may texels, and so their means, differ."""


def picture(seed: int, height: int, width: int) -> np.ndarray:
    """Of values that binary16 holds."""
    return np.random.default_rng(seed).uniform(0, 1, (height, width, 3)).astype(np.float16).astype(np.float32)


def level(textures, index: int, number: int) -> np.ndarray:
    width, height = textures.width[index, number], textures.height[index, number]
    first = textures.offset[index, number]
    return textures.texels[first : first + width * height].reshape(height, width, 3)


@pytest.mark.parametrize("size", [(8, 8), (16, 4), (7, 5), (1, 9), (13, 1), (3, 3), (1, 1)])
def test_every_level_has_the_mean_of_the_picture(size: tuple[int, int]) -> None:
    image = picture(0, *size)
    textures = build_textures((picture(1, 4, 4), image))
    assert textures is not None
    count = textures.levels[1]
    assert (level(textures, 1, 0) == image).all()
    assert level(textures, 1, count - 1).shape == (1, 1, 3)
    for number in range(count):
        assert np.allclose(level(textures, 1, number).mean(axis=(0, 1)), image.mean(axis=(0, 1)), rtol=ROUNDING, atol=0)


def test_even_levels_are_means_of_squares_and_odd_ones_of_what_they_cover() -> None:
    image = picture(2, 6, 5)
    textures = build_textures((image,))
    assert textures is not None
    rows = (image[0::2] + image[1::2]) / 2  # 6 rows to 3
    # 5 columns to 2: each covers two and a half.
    columns = [(rows[:, 0] + rows[:, 1] + rows[:, 2] / 2) / 2.5, (rows[:, 2] / 2 + rows[:, 3] + rows[:, 4]) / 2.5]
    assert np.allclose(level(textures, 0, 1), np.stack(columns, axis=1), rtol=ROUNDING, atol=0)


def sample(textures, places: list, lod: int) -> np.ndarray:
    place = np.array(places, dtype=np.float32)
    return sample_textures(textures, np.zeros(len(place), dtype=np.int64), place, np.full(len(place), lod))


def test_lookups_between_texels_repeat_beyond_the_border() -> None:
    image = picture(3, 4, 8)
    textures = build_textures((image,))
    assert textures is not None
    centres = [(x + 0.5, y + 0.5) for y in range(4) for x in range(8)]
    assert (sample(textures, centres, 0) == image.reshape(-1, 3)).all()
    assert (sample(textures, centres, -700) == image.reshape(-1, 3)).all()
    away = [(x + 8 * 3, y - 4 * 5) for x, y in centres]
    assert (sample(textures, away, 0) == image.reshape(-1, 3)).all()
    between = sample(textures, [(8, 0.5), (0, 0.5), (0.5, 4)], 0)
    assert np.allclose(between[:2], (image[0, 7] + image[0, 0]) / 2, rtol=1e-6)
    assert np.allclose(between[2], (image[3, 0] + image[0, 0]) / 2, rtol=1e-6)


def test_lookups_between_levels() -> None:
    image = picture(4, 8, 8)
    textures = build_textures((image,))
    assert textures is not None
    places = [(2.0, 2.0), (5.3, 1.1)]
    one, two = sample(textures, places, LOD_ONE), sample(textures, places, 2 * LOD_ONE)
    # Place (2, 2) of the finest level is (1, 1) of the next: between four texels that are the means of the 4x4 corner.
    assert np.allclose(one[0], image[:4, :4].mean(axis=(0, 1)), rtol=ROUNDING, atol=0)
    assert np.allclose(sample(textures, places, LOD_ONE + 64), one * 0.75 + two * 0.25, rtol=1e-5)
    mean = image.mean(axis=(0, 1))
    for lod in (3 * LOD_ONE, 3 * LOD_ONE + 77, 32000):
        assert np.allclose(sample(textures, places, lod), mean, rtol=ROUNDING, atol=0)


SIZES = [(5, 7), (8, 8), (1, 1), (3, 40), (33, 2)]
SPECIAL = [0.0, -0.0, 0.5, -1e-9, 1e-40, 8.001953125, 7.0, -40.0, 16777216.0, 3e9, -3e38, np.inf, -np.inf, np.nan]


def exact_read(textures, index: int, number: int, place: np.ndarray) -> list[Fraction]:
    """Of one level, bilinear, by the rational arithmetic of the number units."""
    size = int(textures.width[index, number]), int(textures.height[index, number])
    corner = []
    for coordinate, inverse, length in zip(place, textures.inverse[index], size, strict=True):
        pictures = float_multiply(int(coordinate.view(np.uint32)), int(inverse.view(np.uint32)))
        value = decode(pictures).value
        part = float_add(pictures, pictures if value is None else encode(Fraction(floor(value))), 1)
        at = float_add(float_multiply(part, encode(Fraction(length))), encode(Fraction(1, 2)), 1)
        fixed = float_to_fixed(at, 8)
        corner.append(fixed - ((fixed >> 31) << 32))
    (x, y), total, texels = corner, [Fraction(0)] * 3, level(textures, index, number)
    for dy, wy in ((0, 256 - y % 256), (1, y % 256)):
        for dx, wx in ((0, 256 - x % 256), (1, x % 256)):
            texel = texels[(y // 256 + dy) % size[1], (x // 256 + dx) % size[0]]
            total = [t + Fraction(wx * wy, 65536) * Fraction(float(v)) for t, v in zip(total, texel, strict=True)]
    return total


@pytest.mark.parametrize("seed", [1, 2])
def test_reads_are_exact_and_rounded_once(seed: int) -> None:
    textures = build_textures(tuple(picture(seed + k, *size) for k, size in enumerate(SIZES)))
    assert textures is not None
    rng = np.random.default_rng(seed)
    index = rng.integers(0, len(SIZES), 300)
    place = rng.uniform(-60, 60, (300, 2)).astype(np.float32)
    place[rng.random((300, 2)) < 0.1] = rng.choice(np.array(SPECIAL, dtype=np.float32))
    place[: len(SPECIAL), 0] = SPECIAL
    lod = rng.integers(-100, 7 * LOD_ONE, 300)
    got = sample_textures(textures, index, place, lod)
    for k, (texture, where) in enumerate(zip(index, place, strict=True)):
        last = int(textures.levels[texture]) - 1
        number, f = divmod(max(0, min(int(lod[k]), last * LOD_ONE)), LOD_ONE)
        fine, coarse = (exact_read(textures, texture, min(number + step, last), where) for step in (0, 1))
        wanted = [encode((LOD_ONE - f) * a / LOD_ONE + f * b / LOD_ONE) for a, b in zip(fine, coarse, strict=True)]
        assert got[k].view(np.uint32).tolist() == wanted, f"seed {seed}, read {k}: {texture}, {where}, {lod[k]}"


def test_a_minified_checker_is_grey_and_even() -> None:
    """A floor of fine squares seen from far away: nearly even with its levels, sparkling without."""
    squares = (np.indices((16, 16)).sum(axis=0) % 2).astype(np.float32)
    uv = np.array([[(0, 0), (40, 0), (40, 40)], [(0, 0), (40, 40), (0, 40)]], dtype=np.float32)
    floor = quad(
        "floor",
        [(-1, 0, 1), (1, 0, 1), (1, 0, -1), (-1, 0, -1)],
        1.0,
        texture=np.repeat(squares[..., None], 3, axis=2),
        texture_uv=uv,
    )
    scene = scene_of([floor])
    frame = seen_from(scene, (0, 1.5, 2.5), (0, 0, 0), tan=0.2, irradiance=flat_light(scene, np.float32(np.pi)))
    gbuffer = draw(frame.view, mesh_of(scene, frame.surfaces.lightmaps)).gbuffer
    fragment = gbuffer[gbuffer["primitive"] >= 0]
    assert len(fragment) > 1000
    assert (fragment["texture_lod"] > 3 * LOD_ONE).all()
    image = shade_fragments(frame.surfaces, fragment)
    assert np.abs(image - 0.5).max() < 0.05
    assert image.std() < 0.01
    fragment["texture_lod"] = 0
    assert shade_fragments(frame.surfaces, fragment).std() > 0.15


def test_no_pictures_no_textures() -> None:
    assert build_textures(()) is None
