"""Textures: mip chains keep their mean, lookups go between texels and levels, minified pictures do not sparkle."""

import numpy as np
import pytest

from lightloom.golden_model.frame.rasterizer import draw
from lightloom.golden_model.rays.surface_shading import shade_fragments
from lightloom.golden_model.scene.textures import LOD_ONE, build_textures, sample_textures
from tests.golden_model.frame_scenes import flat_light, mesh_of, quad, scene_of, seen_from


def picture(seed: int, height: int, width: int) -> np.ndarray:
    return np.random.default_rng(seed).uniform(0, 1, (height, width, 3)).astype(np.float32)


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
        assert np.allclose(level(textures, 1, number).mean(axis=(0, 1)), image.mean(axis=(0, 1)), rtol=1e-5)


def test_even_levels_are_means_of_squares_and_odd_ones_of_what_they_cover() -> None:
    image = picture(2, 6, 5)
    textures = build_textures((image,))
    assert textures is not None
    rows = (image[0::2] + image[1::2]) / 2  # 6 rows to 3
    # 5 columns to 2: each covers two and a half.
    columns = [(rows[:, 0] + rows[:, 1] + rows[:, 2] / 2) / 2.5, (rows[:, 2] / 2 + rows[:, 3] + rows[:, 4]) / 2.5]
    assert np.allclose(level(textures, 0, 1), np.stack(columns, axis=1), rtol=1e-6)


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
    assert np.allclose(one[0], image[:4, :4].mean(axis=(0, 1)), rtol=1e-6)
    assert np.allclose(sample(textures, places, LOD_ONE + 64), one * 0.75 + two * 0.25, rtol=1e-5)
    mean = image.mean(axis=(0, 1))
    for lod in (3 * LOD_ONE, 3 * LOD_ONE + 77, 32000):
        assert np.allclose(sample(textures, places, lod), mean, rtol=1e-5)


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
