"""Texels without a sample: a smooth surface through the sampled ones of their side, and of no other."""

from dataclasses import replace

import numpy as np
import pytest

from lightloom.golden_model.engine.publishing.filling import Filler
from lightloom.golden_model.tables.lightmap import BURIED, DOWN, RIGHT, VALID, Lightmaps, joined
from lightloom.golden_model.tables.sides import firsts_first, sides_of
from tests.golden_model.engine.publishing.test_publisher import maps_of, ragged_maps


def pull_push(values: np.ndarray, known: np.ndarray, size: int = 4) -> np.ndarray:
    """Of one image (H, W, K) of whole numbers: what the filler does, as it is written of old (Gortler et al. 1996).

    A pixel at a time, with cells of `size` across in this step and of two in those that follow.
    """
    if known.all() or not known.any():
        return np.where(known[..., None], values, 0)
    rows, columns = (-(-side // size) for side in known.shape)
    coarse = np.zeros((rows, columns, values.shape[2]), dtype=np.int64)
    some = np.zeros((rows, columns), dtype=np.bool_)
    for j, i in np.ndindex(rows, columns):
        cell = slice(j * size, (j + 1) * size), slice(i * size, (i + 1) * size)
        some[j, i] = known[cell].any()
        if some[j, i]:
            coarse[j, i] = values[cell][known[cell]].sum(axis=0) // known[cell].sum()
    if coarse.size > values.shape[2]:
        coarse = pull_push(coarse, some, 2)

    def ends(place: int, count: int) -> list[tuple[int, int]]:
        """The two cells that a place along an axis lies between, with their shares in eighths."""
        eighths = (2 * place + 1) * 8 // (2 * size) - 4  # from the middle of the first cell on
        return [(min(max(eighths // 8 + k, 0), count - 1), (8 - eighths % 8, eighths % 8)[k]) for k in (0, 1)]

    smooth = np.zeros_like(values)
    for j, i in np.ndindex(*known.shape):
        taps = [(y, x, a * b) for y, a in ends(j, rows) for x, b in ends(i, columns)]
        smooth[j, i] = sum(coarse[y, x] * share for y, x, share in taps) // 64
    return np.where(known[..., None], values, smooth)


def walled(maps: Lightmaps, right: np.ndarray, down: np.ndarray) -> Lightmaps:
    """The maps without the links at `right` and `down` (N,) bool."""
    links = [reached & ~wall for reached, wall in zip(joined(maps), (right, down), strict=True)]
    return replace(maps, links=(links[0] * RIGHT + links[1] * DOWN).astype(np.uint8))


@pytest.mark.parametrize("size", [(1, 1), (1, 9), (16, 16), (13, 21), (64, 3)])
def test_a_map_of_one_side_is_filled_as_a_whole_image(size: tuple[int, int]) -> None:
    rng = np.random.default_rng(sum(size))
    width, height = size
    filler, never = Filler(maps_of([size])), np.zeros(width * height, dtype=np.bool_)
    for share in (0, 0.05, 0.3, 1):
        known = rng.random(width * height) < share
        values = rng.uniform(0, 9, (width * height, 3)).astype(np.float32)
        values[rng.random(values.shape) < 0.1] = rng.choice(np.array([0, 1e-8, 3e-6, 65504, 1e9], dtype=np.float32))
        found = filler.fill(0, values, known, never)
        fixed = (np.minimum(values, 65504).astype(np.float16).astype(np.float64) * 2**24).astype(np.int64)
        wanted = pull_push(fixed.reshape(height, width, 3), known.reshape(height, width)).reshape(-1, 3)
        wanted = (wanted / 2.0**24).astype(np.float32).astype(np.float16).astype(np.float32)
        assert (found == np.where(known[:, None], values, wanted)).all(), share


@pytest.mark.parametrize("seed", range(3))
def test_means_and_reads_are_rounded_down(seed: int) -> None:
    """Of light of a few units of 2**-24, all of whose bits binary16 holds."""
    rng = np.random.default_rng(seed)
    width, height = 21, 18
    values = (rng.integers(0, 40, (width * height, 3)) * 2.0**-24).astype(np.float32)
    known = rng.random(width * height) < 0.1
    found = Filler(maps_of([(width, height)])).fill(0, values, known, np.zeros_like(known))
    fixed = (values.astype(np.float64) * 2**24).astype(np.int64).reshape(height, width, 3)
    wanted = pull_push(fixed, known.reshape(height, width)).reshape(-1, 3)
    assert (found.astype(np.float64) * 2**24 == wanted).all(), f"seed {seed}"


def test_what_is_filled_is_rounded_to_float32_and_then_to_binary16() -> None:
    """The mean is 2**-12 above the middle of 32768 and 32800: float32 has the middle, binary16 the even one of them."""
    values, known = np.zeros((16, 3), dtype=np.float32), np.arange(16) < 4
    values[known] = np.array([65504, 65504, 128, 2**-10])[:, None]
    found = Filler(maps_of([(4, 4)])).fill(0, values, known, np.zeros_like(known))
    assert (found[~known] == 32768).all()


def test_what_is_filled_depends_on_its_own_side_alone() -> None:
    """Walls anywhere; every side has something known."""
    for seed in range(6):
        rng = np.random.default_rng(seed)
        maps = ragged_maps(seed, [(29, 18)])
        maps = walled(maps, *(rng.random((2, len(maps.texels))) < 0.35))
        side, valid = sides_of(maps), maps.texels["state"] == VALID
        known = valid & (rng.random(len(side)) < 0.2)
        known[np.unique(side[valid])] = True
        values = rng.uniform(1, 2, (len(side), 3)).astype(np.float32)
        filler, never = Filler(maps), np.zeros(len(side), dtype=np.bool_)
        first = filler.fill(0, values, known, never)
        assert (first[valid] >= 1).all(), seed
        assert (first[valid] <= 2).all(), seed
        for number in rng.choice(np.unique(side[valid]), 5):
            changed = np.where((side == number)[:, None], values, values + np.float32(7))
            again = filler.fill(0, changed, known, never)
            assert (again[side == number] == first[side == number]).all(), seed


def test_a_side_of_which_nothing_is_known_shows_what_its_map_does() -> None:
    maps = maps_of([(8, 4), (4, 4)])
    wall = np.zeros(len(maps.texels), dtype=np.bool_)
    wall[:32].reshape(4, 8)[:, 3] = True
    maps = walled(maps, wall, np.zeros_like(wall))
    known, never = np.zeros((2, 32), dtype=np.bool_)
    known[[0, 1]] = True
    values = np.full((32, 3), np.float32(0.25))
    assert (Filler(maps).fill(0, values, known, never) == np.float32(0.25)).all()
    assert not Filler(maps).fill(1, values[:16], known[16:], never[16:]).any(), "nothing is known of the other map"
    values[4:8] = 7
    once = np.arange(32) % 8 >= 4
    found = Filler(maps).fill(0, values, known, once)
    assert (found == values).all(), "what was known of the other side stays; the first has it from its own"
    assert (Filler(maps).fill(1, values[:16], known[16:], ~never[16:]) == values[:16]).all()


def test_sides_are_what_hangs_together() -> None:
    """Compared with a search from texel to texel."""
    for seed in range(5):
        rng = np.random.default_rng(seed)
        maps = ragged_maps(seed, [(17, 13), (5, 9)])
        maps = walled(maps, *(rng.random((2, len(maps.texels))) < 0.4))
        maps.texels["state"][rng.random(len(maps.texels)) < 0.1] = BURIED
        side, valid = sides_of(maps), maps.texels["state"] == VALID
        right, down = joined(maps)
        for start in np.flatnonzero(valid):
            pending, seen = [int(start)], {int(start)}
            width = int(maps.width[maps.texels["object"][start]])
            while pending:
                p = pending.pop()
                ways = [(p, p + 1, right), (p, p + width, down), (p - 1, p - 1, right), (p - width, p - width, down)]
                for link, other, links in ways:
                    if link >= 0 and links[link] and valid[other] and other not in seen:
                        seen.add(other)
                        pending.append(other)
            assert side[start] == min(seen), f"seed {seed}, texel {start}"
        assert (side[~valid] == np.flatnonzero(~valid)).all()


def test_the_first_of_each_side_comes_first() -> None:
    side = np.array([0, 0, 2, 2, 4, 0])
    assert firsts_first(side, np.array([5, 3, 1, 0, 2, 4])).tolist() == [5, 3, 4, 1, 0, 2]
    assert firsts_first(side, np.zeros(0, dtype=np.int64)).tolist() == []
