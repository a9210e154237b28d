"""Smoothing of what is read of the maps: against a scalar twin, and for what it promises."""

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest

from lightloom.golden_model.contract.formats import COUNT_MAX, ONE_SAMPLE, TEXEL_STATE
from lightloom.golden_model.engine import kernels
from lightloom.golden_model.engine.publishing.publisher import Publisher, apply
from lightloom.golden_model.engine.publishing.smoothing import REACH, Smoother
from lightloom.golden_model.numerics.floats import LARGEST_HALF
from lightloom.golden_model.tables.lightmap import BURIED, DOWN, RIGHT, VALID, Lightmaps, joined
from tests.exact import encode, float_divide
from tests.golden_model.engine.publishing.test_publisher import maps_of, ragged_maps
from tests.needs import needs_numba

SIZES = [(19, 13), (1, 1), (8, 8), (3, 40)]
TABLE = {-2: 8, -1: 8, 0: 7, 1: 6, 2: 4, 3: 2}


def known(maps: Lightmaps, seed: int, holes: float = 0.2) -> tuple[np.ndarray, np.ndarray]:
    """Maps with charts and normals of their own, a state for them, and what they show: (state, (N, 3) float32)."""
    rng = np.random.default_rng(seed)
    count = len(maps.texels)
    # Of cosines from 1 down to 0.8 to each other: those above 0.95 are alike.
    turned = rng.choice([0.0, 0.28, 0.3676, 0.6], count, p=[0.8, 0.08, 0.06, 0.06])
    maps.texels["normal"] = np.stack([turned, np.zeros(count), np.sqrt(1 - turned**2)], axis=1)
    state = np.zeros(count, dtype=TEXEL_STATE)
    counts = [1, 3, 4, 15, 16, 32, 40, 48, 64, 80, 128, 239, 240, 241, 255, 272, 1024, 4095]
    state["count"] = rng.choice(counts, count) * (rng.random(count) >= holes)
    state["spread"], state["deviation"] = rng.integers(0, 600, count), rng.integers(0, 300, count)
    value = rng.choice([1e-6, 0.1, 1.0, 1.1, 50.0, 60000.0], (count, 1)) * rng.uniform(0.9, 1.1, (count, 3))
    return state, np.minimum(value, 65504).astype(np.float16).astype(np.float32)


def half_octaves(number: int) -> int:
    number = max(number, 1)
    top = number.bit_length() - 1
    return 2 * top + (number * 256 >= 362 << top)


class Twin:
    """One texel after the other, in Python's integers."""

    def __init__(self, maps: Lightmaps, state: np.ndarray, value: np.ndarray):
        self.maps, self.state = maps, state
        self.light = [[int(Fraction(float(v)) * 2**24) for v in texel] for texel in value]

    def bright(self, light: list[list[int]], p: int) -> int:
        r, g, b = light[p]
        return (r + 2 * g + b) // 4

    def noise_of(self, p: int) -> int:
        n, dev = int(self.state["count"][p]), int(self.state["deviation"][p]) * 5 // 4
        spread = int(self.state["spread"][p]) * 5 // 8
        relative = 128 if n == 0 else spread if n < 32 else max(dev, spread) if n < 80 else dev
        own = half_octaves(self.bright(self.light, p))
        less = ((half_octaves(min(n, 63 * 16)) - 8) // 2 if n else 0) + (2 if n >= 15 * 16 else 0)
        return half_octaves(relative) - 16 + own - less

    def mass(self, p: int) -> int:
        n = int(self.state["count"][p])
        return min(n, 16 * 16).bit_length() - 5 if n else -2

    def straight(self, p: int, dy: int, dx: int) -> int | None:
        """The texel beside it in its row or column, if it is joined to that one."""
        maps = self.maps
        o = int(maps.texels["object"][p])
        row, column = divmod(p - int(maps.offset[o]), int(maps.width[o]))
        if not (0 <= row + dy < maps.height[o] and 0 <= column + dx < maps.width[o]):
            return None
        q = p + dy * int(maps.width[o]) + dx
        valid = (maps.texels["state"][[p, q]] == VALID).all() and maps.chart[p] == maps.chart[q]
        linked = maps.links is None or bool(maps.links[min(p, q)] & (2 if dy else 1))
        return q if valid and linked else None

    def beside(self, p: int, dy: int, dx: int) -> int | None:
        q = None
        for way in ([(dy, 0), (0, dx)], [(0, dx), (dy, 0)]) if dy and dx else [[(dy, dx)]]:
            end: int | None = p
            for step in way:
                end = None if end is None else self.straight(end, *step)
            q = end if q is None else q
        if q is None:
            return None
        normal = self.maps.texels["normal"].astype(float)
        return q if float(np.dot(normal[p], normal[q])) > 0.95 else None

    def around(self, p: int, step: int) -> list[tuple[int, int]]:
        """Neighbours and their sixteenths; those two away by way of the one between."""
        found = []
        for dy, dx in ((dy, dx) for dy in (-1, 0, 1) for dx in (-1, 0, 1) if dy or dx):
            q: int | None = p
            for _ in range(step):
                q = None if q is None else self.beside(q, dy, dx)
            found.append((p if q is None else q, 4 >> (abs(dy) + abs(dx))))
        return found

    def mean(self, what: list[int], p: int) -> int:
        return (4 * what[p] + sum(share * what[q] for q, share in self.around(p, 1))) // 16

    def swept(self, light: list[list[int]], level: list[int], noise: list[int], step: int) -> tuple[list, list[int]]:
        out, taken = [], []
        for p in range(len(light)):
            total, sum_of = [c << 13 for c in light[p]], 0
            for q, share in self.around(p, step):
                over = half_octaves(abs(level[p] - level[q])) - max(noise[p], noise[q])
                weight = TABLE.get(max(over, -2), 0) * share * 64 >> max(self.mass(p) - self.mass(q), 0)
                if q != p:
                    total = [t + weight * (b - a) for t, a, b in zip(total, light[p], light[q], strict=True)]
                    sum_of += weight
            out.append([rounded(t) for t in total])
            taken.append((15 * sum_of + 2**14) // 2**15)
        return out, taken

    def refreshed(self, p: int) -> list[int]:
        """The light of a texel; if it is stale, within that of what is fresh one away, or two away; or their mean."""
        count = int(self.state["count"][p])
        for step in (1, 2) if count < 4 else ():
            fresh = [(q, share) for q, share in self.around(p, step) if q != p and self.state["count"][q] >= 16]
            if fresh:
                if count:
                    seen = [[self.light[q][c] for q, _ in fresh] for c in range(3)]
                    return [min(max(own, min(all_)), max(all_)) for own, all_ in zip(self.light[p], seen, strict=True)]
                weights = [(q, share * 2 ** min(self.mass(q), 2)) for q, share in fresh]
                whole = encode(Fraction(sum(weight for _, weight in weights)))
                total = [sum(weight * self.light[q][c] for q, weight in weights) for c in range(3)]
                mean = [float_divide(encode(Fraction(each, 2**24)), whole) for each in total]
                return [int(Fraction(float(np.float16(np.uint32(m).view(np.float32)))) * 2**24) for m in mean]
        return self.light[p]

    def smoothed(self) -> list[list[int]]:
        self.light = [self.refreshed(p) for p in range(len(self.light))]
        self.noise = [self.noise_of(p) for p in range(len(self.light))]
        every = range(len(self.light))
        bright = [self.bright(self.light, p) for p in every]
        level, spread = [self.mean(bright, p) for p in every], [self.mean(self.noise, p) for p in every]
        light, taken = self.swept(self.light, level, spread, 1)
        noise = [n - t for n, t in zip(self.noise, taken, strict=True)]
        return self.swept(light, [self.bright(light, p) for p in every], noise, 2)[0]


def rounded(total: int) -> int:
    """In 2**-37 to float32, to binary16, and that in 2**-24."""
    single = np.uint32(encode(Fraction(total, 2**37))).view(np.float32)
    return int(Fraction(float(np.float16(single))) * 2**24)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_it_is_what_a_scalar_twin_computes(seed: int) -> None:
    maps = ragged_maps(seed, SIZES)
    if seed > 1:  # walls anywhere
        some = np.random.default_rng(seed).random((2, len(maps.texels))) < 0.8
        right, down = (a & b for a, b in zip(joined(maps), some, strict=True))
        maps = replace(maps, links=(right * RIGHT + down * DOWN).astype(np.uint8))
    state, value = known(maps, seed)
    found = Smoother(maps).smoothed(value, state, np.arange(len(state)))
    wanted = Twin(maps, state, value).smoothed()
    for p, (a, b) in enumerate(zip(found, wanted, strict=True)):
        assert [int(Fraction(float(v)) * 2**24) for v in a] == b, f"seed {seed}, texel {p}"


@needs_numba
def test_the_compiled_twin_has_the_same_bits(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of all texels and of some, in any order; light from nothing to the largest that binary16 holds."""
    monkeypatch.setattr(kernels, "PORTION", 50)
    twins = [kernels.Kernels("numba", threads).smoother for threads in (1, 2)]
    for seed in range(40):
        rng = np.random.default_rng(seed)
        maps = ragged_maps(seed, SIZES)
        state, value = known(maps, seed)
        value *= rng.choice([0, 2.0**-24, 2.0**-12, 1, 2.0**10], value.shape).astype(np.float32)
        value = np.minimum(value, LARGEST_HALF).astype(np.float16).astype(np.float32)
        if seed % 4 == 0:
            state["count"] = rng.choice([0, 1, ONE_SAMPLE - 1, ONE_SAMPLE, 2 * ONE_SAMPLE - 1, 4095], len(state))
            state["spread"], state["deviation"] = rng.choice([0, 1, 4095], (2, len(state)))
        some = rng.permutation(len(state))[: [len(state), 1, 40, 0][seed % 4]]
        one, two = (kind(maps).smoothed(value, state, some) for kind in (Smoother, twins[seed // 4 % 2]))
        wrong = np.flatnonzero((one.view(np.uint32) != two.view(np.uint32)).any(axis=1))
        assert not len(wrong), f"seed {seed}, texel {some[wrong[0]]}: {one[wrong[0]]}, compiled {two[wrong[0]]}"


def test_a_part_is_as_the_whole() -> None:
    """What is found of some texels alone, and of those only up to REACH away, is what is found of them among all."""
    maps = maps_of(SIZES)
    state, value = known(maps, 5)
    smoother = Smoother(maps)
    whole = smoother.smoothed(value, state, np.arange(len(state)))
    row, column = np.divmod(np.arange(19 * 13), 19)
    for p in (0, 130, 246):
        assert (smoother.smoothed(value, state, np.array([p])) == whole[p]).all()
        far = np.flatnonzero(np.maximum(abs(row - p // 19), abs(column - p % 19)) > REACH)
        other, noisy = value.copy(), state.copy()
        other[far], noisy["count"][far] = 7, 150
        assert (smoother.smoothed(other, noisy, np.array([p])) == whole[p]).all()


def test_it_looks_as_far_as_it_says_and_no_farther() -> None:
    """Stale texels around the middle, fresh ones from some distance on: what these show counts at REACH, not beyond."""
    side, middle = 4 * REACH + 1, 2 * REACH
    maps = maps_of([(side, side)])
    away = np.abs(np.arange(side) - middle)
    away = np.maximum(away[:, None], away).reshape(-1)
    maps.texels["normal"] = (0, 0, 1)
    state = np.zeros(len(away), dtype=TEXEL_STATE)
    state["spread"] = 64
    differ = dict.fromkeys((REACH, REACH + 1), 0)
    for seed in range(20):
        noisy = np.random.default_rng(seed).uniform(0.5, 1.5, (len(away), 1)).repeat(3, axis=1)
        for distance in differ:
            fresh = away >= distance
            state["count"] = np.where(fresh, ONE_SAMPLE, 1)
            one, other = (
                Smoother(maps).smoothed(
                    np.where(fresh[:, None], light, noisy).astype(np.float16).astype(np.float32),
                    state,
                    np.array([middle * side + middle]),
                )
                for light in (0.25, 4)
            )
            differ[distance] += int((one != other).any())
    assert differ[REACH] > 0
    assert differ[REACH + 1] == 0


def flat(side: int, seed: int, relative: float) -> tuple[Lightmaps, np.ndarray, np.ndarray]:
    """A square map of mean 1 in noise of `relative` that its state knows of."""
    maps = maps_of([(side, side)])
    maps.texels["normal"] = (0, 0, 1)
    state = np.zeros(side * side, dtype=TEXEL_STATE)
    state["count"], state["spread"] = 16, round(relative * 256)
    value = np.random.default_rng(seed).gamma(relative**-2, relative**2, (side * side, 1)).repeat(3, axis=1)
    return maps, state, value.astype(np.float16).astype(np.float32)


def test_no_light_is_made_or_lost() -> None:
    """Of skewed noise, whose outliers a normalised filter cuts."""
    for relative in (0.1, 0.5, 1.0):
        maps, state, value = flat(96, 6, relative)
        found = Smoother(maps).smoothed(value, state, np.arange(len(state)))
        assert found.astype(np.float64).mean() == pytest.approx(value.astype(np.float64).mean(), rel=1e-4)


def test_little_light_is_lost_where_some_are_known_better() -> None:
    """What is known better moves less: then the light of outliers that are known badly gives way, a little."""
    mixed, apart = (1, 2, 3, 5, 8, 12, 20), (1, 255)
    for relative, counts, lost in ((0.5, mixed, 0.003), (0.5, apart, 0.006), (1, mixed, 0.008), (1, apart, 0.020)):
        maps, state, _ = flat(192, 6, relative)
        rng = np.random.default_rng(6)
        count = rng.choice(counts, len(state))
        state["count"], state["deviation"] = np.minimum(count * 16, COUNT_MAX), relative * 204
        value = rng.gamma(count / relative**2, relative**2 / count)[:, None].repeat(3, axis=1)
        value = value.astype(np.float16).astype(np.float32)
        found = Smoother(maps).smoothed(value, state, np.arange(len(state)))
        kept = found.astype(np.float64).mean() / value.astype(np.float64).mean()
        # Of draws of this size the loss differs by .001 in the mean.
        assert 1 - kept == pytest.approx(lost, abs=0.003), (relative, counts)


def test_what_is_stale_shows_what_fresh_texels_beside_it_show() -> None:
    """A dark map of which one texel in nine has found the light; one of which none has stays as it was."""
    maps, state, value = flat(32, 12, 0.01)
    row, column = np.divmod(np.arange(32 * 32), 32)
    fresh = (row % 3 == 1) & (column % 3 == 1)
    state["count"] = np.where(fresh, ONE_SAMPLE, 1)
    value = np.where(fresh, 1, 1 / 64)[:, None].repeat(3, axis=1).astype(np.float32)
    found = Smoother(maps).smoothed(value, state, np.arange(len(state)))
    assert (found == 1).all()
    state["count"] = 1
    assert (Smoother(maps).smoothed(np.full_like(value, 0.5), state, np.arange(len(state))) == 0.5).all()


def test_what_is_stale_keeps_its_light_at_an_edge() -> None:
    """A light side and a dark one, of which every other texel is fresh: those between keep the side they were on."""
    maps, state, value = flat(32, 12, 0.01)
    row, column = np.divmod(np.arange(32 * 32), 32)
    state["count"] = np.where((row + column) % 2 == 0, ONE_SAMPLE, 1)
    value = np.where(column < 16, 1, 1 / 64)[:, None].repeat(3, axis=1).astype(np.float32)
    found = Smoother(maps).smoothed(value, state, np.arange(len(state)))
    assert (found == value).all()


def test_nothing_goes_over_a_wall_that_stands_on_a_floor() -> None:
    """A column of buried texels one wide, of the same chart as the floor on both sides."""
    maps, state, value = flat(16, 10, 1.0)
    column = np.arange(256) % 16
    maps.texels["state"][column == 8] = BURIED
    bright = value.copy()
    bright[column > 8] *= np.float32(1.5)
    left = np.flatnonzero(column < 8)
    one, two = (Smoother(maps).smoothed(v, state, left) for v in (value, bright.astype(np.float16).astype(np.float32)))
    assert (one == two).all()


def test_noise_goes_and_edges_stay() -> None:
    maps, state, value = flat(64, 7, 0.3)
    dark = np.arange(64 * 64) % 64 < 32
    value[dark] *= np.float32(1 / 16)
    value = value.astype(np.float16).astype(np.float32)
    found = Smoother(maps).smoothed(value, state, np.arange(len(state)))[:, 0]
    for side, level in ((dark, 1 / 16), (~dark, 1)):
        assert found[side].std() < 0.45 * value[side, 0].std()
        beside = side & np.isin(np.arange(64 * 64) % 64, [31, 32])
        assert found[beside].mean() == pytest.approx(level, rel=0.1), "the edge"


def test_well_known_texels_are_left_alone() -> None:
    """A fine pattern that the averages are sure of stays; and equal light stays as it is, whatever is known of it."""
    maps, state, value = flat(16, 8, 0.3)
    state["count"], state["deviation"] = 4095, 4
    assert np.abs(Smoother(maps).smoothed(value, state, np.arange(256)) / value - 1).mean() < 0.01
    state, _ = known(maps, 9)
    level = np.full_like(value, np.float32(np.float16(0.3)))
    assert (Smoother(maps).smoothed(level, state, np.arange(256)) == level).all()


def test_an_edge_as_small_as_noise_stays_where_averages_are_known() -> None:
    """Of just under fifteen samples on both sides more than half of it goes, from there on most of it stays."""
    maps, state, _ = flat(32, 13, 0.3)
    column = np.arange(32 * 32) % 32
    value = np.where(column < 16, 1, 1.12)[:, None].repeat(3, axis=1).astype(np.float16).astype(np.float32)
    state["deviation"] = state["spread"]
    steps = []
    for count in (15 * ONE_SAMPLE - 1, 15 * ONE_SAMPLE):
        state["count"] = count
        found = Smoother(maps).smoothed(value, state, np.arange(len(state)))[:, 0]
        steps.append((found[column == 16].mean() - found[column == 15].mean()) / 0.12)
    assert steps[0] < 0.5, steps
    assert steps[1] > 0.6, steps


def test_nothing_crosses_charts_walls_or_creases() -> None:
    maps, state, value = flat(16, 10, 0.5)
    left = np.arange(256) % 16 < 8
    other = value.copy()
    other[~left] = 30
    for change in ("chart", "link", "normal"):
        if change == "chart":
            maps.chart[:] = left
        elif change == "link":
            maps.chart[:] = 0
            right, down = joined(maps)
            right[np.arange(256) % 16 == 7] = False
            maps = replace(maps, links=(right * RIGHT + down * DOWN).astype(np.uint8))
        else:
            maps = replace(maps, links=None)
            maps.chart[:] = 0
            maps.texels["normal"][left] = (0, 1, 0)
        one, two = (Smoother(maps).smoothed(v, state, np.flatnonzero(left)) for v in (value, other))
        assert (one == two).all(), change


@pytest.mark.parametrize("seed", [11, 12])
def test_a_region_shows_what_was_so_when_one_of_its_texels_changed(seed: int) -> None:
    """The rule of differences, against publishing everything each time and taking the regions written from it."""
    maps, rng = maps_of([(37, 21), (16, 16)]), np.random.default_rng(seed)
    state, value = known(maps, seed, holes=0)
    state["irradiance"] = value
    publisher = Publisher(maps, Smoother(maps))
    shown = publisher.everything(state)
    for step in range(12):
        texel = rng.choice(len(state), 5, replace=False)
        state["irradiance"][texel] *= rng.uniform(0.5, 1.5, (5, 1)).astype(np.float32)
        state["count"][texel] = rng.integers(0 if step > 6 else 1, 320, 5)
        difference = publisher.difference(shown, state, texel)
        apply(difference, shown)
        assert set(publisher.regions.of_texel[texel]) <= set(difference.region)
        whole = Publisher(maps, Smoother(maps)).everything(state)
        own = publisher.regions.texels(difference.region)
        assert (shown["rgba"][own] == whole["rgba"][own]).all(), f"seed {seed}, step {step}"
        others = np.setdiff1d(np.arange(len(state)), own)
        assert not np.isin(others, difference.texel).any()
