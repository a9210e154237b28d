"""Coarser levels: against a plain loop, and what reads in them show of checkers, gradients and charts."""

from dataclasses import replace

import numpy as np
import pytest

from lightloom.golden_model.charts.buried import nearest_valid
from lightloom.golden_model.charts.read_levels import deepest_levels
from lightloom.golden_model.charts.unwrap import unwrap
from lightloom.golden_model.engine.publishing.mipmaps import renew_levels
from lightloom.golden_model.engine.publishing.regions import regions_of
from lightloom.golden_model.numerics.floats import half_to_float
from lightloom.golden_model.scene.files.load import load_scene
from lightloom.golden_model.tables.lightmap import (
    EMPTY,
    VALID,
    Lightmaps,
    bilinear,
    filled,
    levels_of,
    lightmap_coordinates,
    sample,
)
from tests.golden_model.charts.test_unwrap import scene_of, surface_points
from tests.golden_model.engine.publishing.test_publisher import maps_of, ragged_maps
from tests.golden_model.meshes import torus

SIZES = [(37, 21), (1, 1), (8, 8), (5, 40), (64, 64)]


def levels(maps: Lightmaps, values: np.ndarray) -> np.ndarray:
    """Values (N, 3) of level 0, `fill` applied, to those of all levels: (texels, 4) float32 with coverage."""
    regions = regions_of(maps)
    rgba = np.zeros((regions.levels.total, 4), dtype=np.float16)
    rgba[: len(values), :3] = filled(maps, values)
    renew_levels(regions, rgba, np.arange(regions.count))
    return half_to_float(rgba)


def level_of(maps: Lightmaps, values: np.ndarray, owner: int, level: int) -> np.ndarray:
    """One level as an image (rows, columns, K)."""
    layout = levels_of(maps)
    width, height = layout.width[owner, level], layout.height[owner, level]
    first = layout.first[owner, level]
    return values[first : first + width * height].reshape(height, width, -1)


def read(maps: Lightmaps, values: np.ndarray, uv: np.ndarray, lod: int) -> np.ndarray:
    return sample(maps, values, np.zeros(len(uv), int), uv.astype(np.float32), np.full(len(uv), lod))


def test_levels_lie_one_after_the_other() -> None:
    maps = maps_of(SIZES)
    layout = levels_of(maps)
    taken = [np.arange(len(maps.texels))]
    for o, (width, height) in enumerate(SIZES):
        assert layout.first[o, 0] == maps.offset[o]
        assert layout.count[o] == int(np.ceil(np.log2(max(width, height))))
        for level in range(1, layout.count[o] + 1):
            width, height = (width + 1) // 2, (height + 1) // 2
            assert (layout.width[o, level], layout.height[o, level]) == (width, height)
            taken.append(layout.first[o, level] + np.arange(width * height))
        assert width == height == 1
    assert np.concatenate(taken).tolist() == list(range(layout.total))


def test_every_texel_is_the_mean_of_the_covered_ones_under_it() -> None:
    maps = ragged_maps(7, SIZES)
    value = np.random.default_rng(7).uniform(1, 9, (len(maps.texels), 3)).astype(np.float16).astype(np.float32)
    values = levels(maps, value)
    covered = maps.fill == np.arange(len(maps.fill))
    layout = levels_of(maps)
    shown = filled(maps, value)
    for o, (width, height) in enumerate(SIZES):
        part = slice(maps.offset[o], maps.offset[o] + width * height)
        under, image = covered[part].reshape(height, width), shown[part].reshape(height, width, 3)
        for level in range(1, int(layout.count[o]) + 1):
            found, side = level_of(maps, values, o, level), 1 << level
            for j, i in np.ndindex(found.shape[:2]):
                block = np.s_[j * side : (j + 1) * side, i * side : (i + 1) * side]
                weight = under[block].astype(float)
                assert found[j, i, 3] == pytest.approx(weight.sum() / side**2, rel=2e-3)
                if weight.any():
                    mean = (image[block] * weight[..., None]).sum(axis=(0, 1)) / weight.sum()
                    assert found[j, i, :3] == pytest.approx(mean, rel=2.0**-11 * (level + 1))
                else:
                    assert (found[j, i, :3] >= 1).all()


def test_empty_texels_darken_nothing_and_nothing_is_black() -> None:
    maps = ragged_maps(8, SIZES)
    values = levels(maps, np.full((len(maps.texels), 3), 3, dtype=np.float32))
    assert (values[:, :3] == 3).all()


def test_reading_at_or_below_level_0_is_bilinear_bit_for_bit() -> None:
    maps = maps_of(SIZES)
    rng = np.random.default_rng(9)
    value = rng.uniform(0, 4, (len(maps.texels), 3)).astype(np.float16).astype(np.float32)
    owner = rng.integers(0, len(SIZES), 999)
    uv = (rng.uniform(-0.1, 1.1, (999, 2)) * np.array(SIZES)[owner]).astype(np.float32)
    expected = bilinear(maps, value, owner, uv)
    # Level 0 alone is enough as long as nothing coarser is asked for.
    assert (sample(maps, value, owner, uv, rng.integers(-999, 1, 999)) == expected).all()
    with pytest.raises(ValueError, match="all levels of these maps have"):
        sample(maps, value, owner, uv, np.ones(999, int))


def test_between_levels_is_a_straight_line_and_the_last_level_is_the_end() -> None:
    maps = maps_of([(32, 32)])
    rng = np.random.default_rng(10)
    values = levels(maps, rng.uniform(1, 2, (1024, 3)).astype(np.float32))[:, :3]
    uv = rng.uniform(0, 32, (200, 2))
    for level in range(5):
        fine, coarse = read(maps, values, uv, 256 * level), read(maps, values, uv, 256 * level + 256)
        middle = read(maps, values, uv, 256 * level + 64)
        assert middle == pytest.approx(0.75 * fine + 0.25 * coarse, rel=1e-6)
    last = read(maps, values, uv, 5 * 256)
    assert last == pytest.approx(np.tile(values[-1], (200, 1)), rel=1e-6)
    assert (read(maps, values, uv, 32767) == last).all()


def test_a_gradient_stays_where_it_is_in_every_level() -> None:
    """Coarser texels lie over the texels that they stand for: a ramp has the same values in all levels."""
    maps = maps_of([(64, 64)])
    row, column = np.divmod(np.arange(4096), 64)
    values = levels(maps, np.stack([column, row, row + column], axis=1).astype(np.float32))[:, :3]
    uv = np.random.default_rng(11).uniform(16, 48, (300, 2))
    for lod in (0, 100, 256, 600, 768, 1000):
        found = read(maps, values, uv, lod)
        expected = np.stack([uv[:, 0], uv[:, 1], uv.sum(axis=1)], axis=1) - [0.5, 0.5, 1]
        # Values are binary16; places are rounded to 1/256 of a texel of the coarser level, on both axes.
        assert found == pytest.approx(expected, abs=0.04 + 2 ** -(-lod // 256) / 256)


def test_a_minified_checker_is_grey_and_does_not_flicker() -> None:
    """Squares of 2 texels at 16 texels a pixel: the picture's mean is right, and its noise under motion falls away."""
    maps = maps_of([(256, 256)])
    row, column = np.divmod(np.arange(256 * 256), 256)
    checker = np.repeat((((row >> 1) + (column >> 1)) & 1).astype(np.float32)[:, None], 3, axis=1)
    values = levels(maps, checker)[:, :3]
    grid = np.stack(np.meshgrid(np.arange(8, 248, 16.0), np.arange(8, 248, 16.0)), axis=-1).reshape(-1, 2)
    spread = {}
    for lod in (0, 4 * 256):
        pictures = np.array([read(maps, values, grid + shift, lod) for shift in np.linspace(0, 4, 9)])
        spread[lod] = pictures.std()
        assert lod == 0 or pictures.mean() == pytest.approx(0.5, abs=1e-3)
    assert spread[0] > 0.2
    assert spread[4 * 256] < 1e-3


@pytest.mark.parametrize("name", ["cornell-box", "torus"])
def test_charts_have_no_black_seams_and_colours_of_their_place(name: str) -> None:
    """A colour that is a straight function of the position, 1 to 2, read on the surface of an unwrapped mesh, much at
    its edges and corners: everywhere and in every level it is off by less than a texel of that level makes."""
    scene = load_scene(name) if name == "cornell-box" else scene_of({"torus": torus(48, 20)[0]}, 0.02)
    maps = unwrap(scene)
    corners = scene.corners.reshape(-1, 3).astype(np.float32)
    low, size = corners.min(axis=0), np.ptp(corners, axis=0)

    def colour(position: np.ndarray) -> np.ndarray:
        return (1 + (position - low) / size).astype(np.float32)

    values = levels(maps, colour(maps.texels["position"]))[:, :3]
    primitive, u, v, position = surface_points(scene, 4000)
    uv = lightmap_coordinates(maps, primitive, u, v)
    error = {}
    for level in (0, 1, 2, 3, 4):
        found = sample(maps, values, scene.object_id[primitive], uv, np.full(len(uv), 256 * level))
        error[level] = np.abs(found - colour(position)).max()
        assert found.min() >= 1 - 2.0**-10
        assert error[level] < scene.texel_size * 2**level / size.min()
    assert error[4] > 2 * error[1]  # the levels were read indeed
    # Without the limit charts that lie side by side in the map mix.
    mixed = sample(replace(maps, deepest=None), values, scene.object_id[primitive], uv, np.full(len(uv), 3 * 256))
    assert np.abs(mixed - colour(position)).max() > 2 * error[3]


def test_reads_stay_in_levels_that_hold_their_chart_alone() -> None:
    """Two charts of 16 columns, two empty ones between: painted 1 and 2, every read gives one of the two."""
    maps = maps_of([(34, 16)])
    column = np.arange(34 * 16) % 34
    maps.chart[:] = np.where(column < 16, 0, np.where(column < 18, -1, 1))
    maps.texels["state"] = np.where(maps.chart >= 0, VALID, EMPTY)
    maps.fill[:] = nearest_valid(maps, maps.texels["state"])
    deepest = deepest_levels(maps)
    maps = replace(maps, deepest=deepest)
    paint = np.repeat(np.where(column < 16, 1, 2).astype(np.float32)[:, None], 3, axis=1)
    values = levels(maps, paint)[:, :3]
    left = np.random.default_rng(12).uniform([0.5, 0.5], [15.5, 15.5], (500, 2))
    for lod in (0, 200, 256, 500, 1000, 2000):
        for shift, colour in ((0, 1), (18, 2)):
            found = read(maps, values, left + np.array([shift, 0]), lod)
            assert found == pytest.approx(np.full_like(found, colour), abs=1e-6)
    row = deepest.reshape(16, 34)[8]
    assert (np.diff(row[:16].astype(int)) <= 0).all()
    assert row[15] == 0
    assert row[0] == 4
