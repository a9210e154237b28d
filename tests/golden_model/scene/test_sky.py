"""Skies: where a picture's pixels lie, what a map and a table keep of it, and how light samples choose from them."""

import numpy as np
import pytest

from lightloom.golden_model.numerics.affine import rotation_matrix
from lightloom.golden_model.scene.environment import Environment, Sky, Sun
from lightloom.golden_model.tables.octahedral import folded, on_octahedron, unfolded
from lightloom.golden_model.tables.sky import TABLE_BITS, SkyTable, chosen, luminance

SEED = 20250711


def directions(count: int) -> np.ndarray:
    """Even over all directions, (N, 3) float32 of any length."""
    random = np.random.default_rng(SEED)
    return (random.normal(size=(count, 3)) * random.uniform(1e-3, 1e3, (count, 1))).astype(np.float32)


def unit(direction: np.ndarray) -> np.ndarray:
    wide = direction.astype(np.float64)
    return np.asarray(wide / np.linalg.norm(wide, axis=1)[:, None])


def centres(height: int) -> np.ndarray:
    """Directions of the pixels of a picture, (H, 2 H, 3) float64, as docs/scenes.md has them."""
    down = (np.arange(height)[:, None] + 0.5) * (np.pi / height)
    right = (np.arange(2 * height) + 0.5) * (np.pi / height) - np.pi
    return np.stack([np.sin(down) * np.sin(right), np.cos(down) + 0 * right, -np.sin(down) * np.cos(right)], axis=-1)


def sky_of(picture: np.ndarray, quaternion: tuple[float, ...] = (1, 0, 0, 0)) -> Sky:
    return Sky(radiance=picture.astype(np.float32), rotation=rotation_matrix(*quaternion).astype(np.float32))


def with_spot(height: int = 64) -> Sky:
    """A dim sky with a round spot a thousand times as bright, some ten degrees wide, and a black ground."""
    away = centres(height)
    spot = away @ unit(np.array([[1.0, 1.0, 0.3]]))[0] > np.cos(np.radians(5))
    return sky_of(np.where(spot, 1000.0, 1.0)[..., None] * np.array([1, 0.9, 0.7]) * (away[..., 1:2] > 0))


def test_the_octahedron_and_the_square_are_each_other() -> None:
    direction = directions(20_000)
    point = on_octahedron(direction)
    assert np.abs(point).sum(axis=1) == pytest.approx(1, abs=3e-7)
    assert (point * direction >= 0).all()
    place = folded(point)
    assert np.abs(place).max() <= 1
    np.testing.assert_allclose(unfolded(place), point, atol=3e-7)


@pytest.mark.parametrize("quaternion", [(1, 0, 0, 0), (1, 0, 1, 0), (3, -1, 2, 1)])
def test_a_map_has_what_the_picture_has_there(quaternion: tuple[float, ...]) -> None:
    """Of a picture without steps, read between texels: in every direction, over the folds as elsewhere."""
    turn = rotation_matrix(*quaternion)
    shade = np.stack([1 + 0.9 * centres(64)[..., k] for k in range(3)], axis=-1)
    sky = sky_of(shade, quaternion)
    direction = directions(20_000)
    expected = 1 + 0.9 * unit(direction) @ turn  # what comes from rotation d is what the picture has in d
    np.testing.assert_allclose(sky.map.between(on_octahedron(direction)), expected, atol=0.03)


def test_a_picture_begins_at_the_top_and_looks_along_minus_z() -> None:
    picture = np.zeros((16, 32, 3))
    picture[0, :, 0] = picture[:, 16, 1] = picture[:, 24, 2] = 1
    up, ahead, right = sky_of(picture).map.between(
        on_octahedron(np.array([[0, 1, 0], [0.05, 0, -1], [1, 0, 0.05]], dtype=np.float32))
    )
    assert up[0] > 0.9
    assert ahead.tolist() == pytest.approx([0, 1, 0], abs=0.01)
    assert right.tolist() == pytest.approx([0, 0, 1], abs=0.01)


def solid_angles(table: SkyTable) -> np.ndarray:
    """Of all cells by their middles, (S, S)."""
    step = (np.arange(table.map.side) + 0.5) * (2 / table.map.side) - 1
    point = unfolded(np.stack(np.broadcast_arrays(step[None], step[:, None]), axis=-1))
    return np.asarray((2 / table.map.side) ** 2 / (point**2).sum(axis=-1) ** 1.5)


def test_a_table_keeps_all_light_and_chooses_by_it() -> None:
    sky = with_spot()
    table, random = sky.table, np.random.default_rng(SEED)
    weight = np.diff(table.begin.astype(np.int64), axis=1)
    assert (weight.sum(axis=1) == np.diff(table.row_begin.astype(np.int64))).all()
    assert table.row_begin[-1] < 2**TABLE_BITS
    light = luminance(table.map.radiance.astype(np.float64)) * solid_angles(table)
    assert ((weight > 0) == (light > 0)).all()
    np.testing.assert_allclose(weight / weight.sum(), light / light.sum(), rtol=0.04, atol=1e-9)
    wanted = (sky.radiance.astype(np.float64) * np.sin((np.arange(64) + 0.5) * np.pi / 64)[:, None, None]).sum((0, 1))
    np.testing.assert_allclose(4 * np.pi * table.mean_colour, wanted * np.pi**2 / 64**2, rtol=0.03)

    x, y = random.integers(0, 1 << 32, (2, 1 << 16), dtype=np.uint32)
    point = table.choose(x, y)
    density = 1 / table.share_at(point) * (point.astype(np.float64) ** 2).sum(axis=1) ** 1.5
    brought = table.map.nearest(point).astype(np.float64) / density[:, None]
    np.testing.assert_allclose(brought.mean(axis=0), 4 * np.pi * table.mean_colour, rtol=2e-3)
    assert brought.std(axis=0).max() < 0.2 * brought.mean(), "within a cell nothing but the solid angle varies"
    assert point[:, 1].min() > -0.05, "where it is black none is chosen"


def test_choosing_finds_the_entry_whose_share_the_fraction_falls_in() -> None:
    random = np.random.default_rng(SEED)
    weight = random.integers(0, 4, (5, 16)) * random.integers(0, 1 << 20, (5, 16))
    begin = np.concatenate([np.zeros((5, 1)), np.cumsum(weight, axis=1)], axis=1).astype(np.uint64)
    table = random.integers(0, 5, 4000)
    fraction = np.concatenate([random.integers(0, 1 << 32, 3998), [0, (1 << 32) - 1]]).astype(np.uint32)
    entry, within = chosen(begin, table, fraction)
    for t, f, e, w in zip(table.tolist(), fraction.tolist(), entry.tolist(), within.tolist(), strict=True):
        low, high = int(begin[t, e]), int(begin[t, e + 1])
        place = f * int(begin[t, -1])
        assert low <= place >> 32 < high
        assert w == (place - (low << 32)) // (high - low)


def test_an_even_sky_is_left_to_rays_that_meet_nothing() -> None:
    even = sky_of(np.full((1, 1, 3), 0.5))
    assert even.map.side == 1
    assert even.table.contrast == pytest.approx(1)
    assert not even.table.sampled
    assert with_spot().table.sampled
    black = sky_of(np.zeros((2, 4, 3)))
    assert not black.table.sampled
    assert not Environment(sky=black).shines


@pytest.mark.parametrize("angle", [0.53, 10.0, 90.0])
def test_an_eye_sees_the_sun_as_large_as_it_is(angle: float) -> None:
    towards = unit(np.array([[0.2, 0.7, -0.4]]))[0].astype(np.float32)
    sun = Sun(towards=towards, irradiance=np.array([3, 2, 1], dtype=np.float32), angle=angle)
    random = np.random.default_rng(SEED)
    spread = np.radians(angle) * random.normal(size=(20_000, 3)) + towards
    direction = (spread * random.uniform(0.1, 9, (20_000, 1))).astype(np.float32)
    off = np.degrees(np.arccos(np.clip(unit(direction) @ unit(towards[None])[0], -1, 1)))
    seen = Environment(sun=sun).seen(direction)
    assert (seen.any(axis=1) == (off <= angle / 2))[np.abs(off - angle / 2) > 1e-4 * angle].all()
    assert np.unique(seen, axis=0).shape == (2, 3)
    solid = 2 * np.pi * (1 - np.cos(np.radians(angle / 2)))
    facing = np.pi * np.sin(np.radians(angle / 2)) ** 2
    assert seen.max(axis=0) * facing == pytest.approx([3, 2, 1], rel=1e-5)
    assert solid >= facing
