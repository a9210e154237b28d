"""Publishing: binary16, filling of what has not been sampled and of what never is, region by region."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lightloom.golden_model.charts.buried import nearest_valid
from lightloom.golden_model.contract.formats import ONE_SAMPLE, TEXEL, TEXEL_STATE
from lightloom.golden_model.engine.publishing.publisher import Publisher, apply, publish
from lightloom.golden_model.tables.lightmap import BURIED, EMPTY, VALID, Lightmaps


def maps_of(sizes: list[tuple[int, int]]) -> Lightmaps:
    """Lightmaps of the given (width, height), all texels valid, no triangles."""
    width, height = (np.array(side, dtype=np.int32) for side in zip(*sizes, strict=True))
    count = width * height
    texels = np.zeros(int(count.sum()), dtype=TEXEL)
    texels["state"] = VALID
    texels["object"] = np.repeat(np.arange(len(sizes)), count)
    return Lightmaps(
        width=width,
        height=height,
        offset=(np.cumsum(count) - count).astype(np.int32),
        uv=np.zeros((0, 3, 2), dtype=np.float32),
        texels=texels,
        chart=texels["object"].copy(),
        fill=np.arange(len(texels), dtype=np.int32),
    )


def state_of(values: np.ndarray, count: np.ndarray | int = 1) -> np.ndarray:
    state = np.zeros(len(values), dtype=TEXEL_STATE)
    state["irradiance"], state["count"] = values, np.asarray(count) * ONE_SAMPLE
    return state


def test_sampled_texels_are_published_in_binary16() -> None:
    values = np.random.default_rng(0).uniform(0, 100, (20, 3)).astype(np.float32)
    out = publish(maps_of([(5, 4)]), state_of(values))["rgba"]
    assert (out[:, :3] == values.astype(np.float16)).all()
    assert (out[:, 3] == 1).all()


def test_what_is_too_bright_for_binary16_stays_finite() -> None:
    out = publish(maps_of([(1, 1)]), state_of(np.array([[1e6, 65504, 3e38]], dtype=np.float32)))["rgba"]
    assert (out[0, :3] == 65504).all()


def test_empty_and_buried_texels_repeat_their_fill() -> None:
    maps = maps_of([(3, 1), (2, 1)])
    maps.texels["state"][[1, 3, 4]] = [0, 2, 0]
    maps.fill[:] = [0, 2, 2, -1, -1]
    values = np.arange(15, dtype=np.float32).reshape(5, 3) + 1
    out = publish(maps, state_of(values, np.array([1, 0, 1, 0, 0])))["rgba"]
    assert (out[[0, 1, 2]] == out[[0, 2, 2]]).all()
    assert (out[1, :3] == values[2]).all()
    assert not out[3:].any()


def test_unsampled_texels_lie_between_their_neighbours_with_weight_zero() -> None:
    maps = maps_of([(9, 7), (4, 4)])
    rng = np.random.default_rng(1)
    values = rng.uniform(2, 3, (len(maps.texels), 3)).astype(np.float32)
    count = (rng.random(len(values)) < 0.2).astype(int)
    count[63:] = 0  # nothing of the second map is known
    values[count == 0] = 0
    out = publish(maps, state_of(values, count))["rgba"]
    assert (out[:63, :3] >= 2).all()
    assert (out[:63, :3] <= 3).all()
    assert (out[:, 3] == count).all()
    assert not out[63:].any()


def ragged_maps(seed: int, sizes: list[tuple[int, int]]) -> Lightmaps:
    """Maps with holes: a third of the texels in patches is empty or buried, each shows the nearest valid one."""
    rng = np.random.default_rng(seed)
    maps = maps_of(sizes)
    holes = rng.random(len(maps.texels)) < 0.3
    maps.texels["state"][holes] = rng.choice([EMPTY, BURIED], holes.sum())
    maps.chart[maps.texels["state"] == EMPTY] = -1
    maps.fill[:] = nearest_valid(maps, maps.texels["state"])
    return maps


def valid_texels(maps: Lightmaps) -> np.ndarray:
    return np.flatnonzero(maps.texels["state"] == VALID)


@settings(deadline=None, max_examples=25, derandomize=True)
@given(seed=st.integers(0, 2**20), forget=st.booleans())
def test_differences_give_the_bits_of_publishing_everything(seed: int, forget: bool) -> None:
    """Over frames of random updates, from black maps on; with `forget` some texels lose their samples again."""
    rng = np.random.default_rng(seed)
    maps = ragged_maps(seed, [(37, 21), (1, 1), (8, 8), (5, 40)])
    valid = valid_texels(maps)
    state = state_of(np.zeros((len(maps.texels), 3)), 0)
    publisher = Publisher(maps)
    published = publisher.everything(state)
    for frame in range(8):
        # The last frames of some runs update everything, so that both the first frames and the steady state are met.
        updated = rng.permutation(valid)[: rng.integers(0, len(valid))] if frame < 5 else valid
        state["irradiance"][updated] = rng.uniform(0, 9, (len(updated), 3))
        state["count"][updated] = ONE_SAMPLE
        dropped = rng.choice(valid, 3) if forget else valid[:0]
        state["count"][dropped] = 0
        difference = publisher.difference(published, state, np.concatenate([updated, dropped]))
        apply(difference, published)
        expected = Publisher(maps).everything(state)
        assert (published["rgba"].view("u2") == expected["rgba"].view("u2")).all(), f"seed {seed}, frame {frame}"
        assert len(np.unique(difference.texel)) == len(difference.texel)


def test_level_0_is_what_publish_makes() -> None:
    maps = ragged_maps(3, [(19, 30), (12, 4)])
    rng = np.random.default_rng(3)
    known = np.where(maps.texels["state"] == VALID, rng.integers(0, 2, len(maps.texels)), 0)
    state = state_of(rng.uniform(0, 9, (len(maps.texels), 3)), known)
    assert (Publisher(maps).everything(state)["rgba"][: len(state)] == publish(maps, state)["rgba"]).all()


def test_only_regions_that_show_an_update_are_written() -> None:
    maps = maps_of([(64, 64), (16, 16)])
    maps.fill[64 * 64 - 1] = 0  # the last corner of the first map shows its first texel
    state = state_of(np.ones((len(maps.texels), 3)))
    publisher = Publisher(maps)
    published = publisher.everything(state)

    inner = 20 * 64 + 20
    state["irradiance"][inner] = 5
    one = publisher.difference(published, state, np.array([inner]))
    assert one.region.tolist() == [2 * 8 + 2]
    assert len(one.texel) == 64 + 16 + 4 + 1 + 3  # the region, its levels, one texel in each of the 3 above it

    state["irradiance"][0] = 7
    two = publisher.difference(published, state, np.array([0]))
    assert sorted(two.region.tolist()) == [0, 63]
    apply(two, published)
    assert (published["rgba"][64 * 64 - 1, :3] == 7).all()


def test_a_region_is_ready_when_the_last_update_that_it_shows_is_blended() -> None:
    maps = maps_of([(24, 8)])
    maps.fill[0] = 23  # region 0 shows a texel of region 2
    state = state_of(np.ones((len(maps.texels), 3)))
    publisher = Publisher(maps)
    published = publisher.everything(state)
    difference = publisher.difference(published, state, np.array([9, 23, 2, 1, 8, 8]))
    assert dict(zip(difference.region.tolist(), difference.ready.tolist(), strict=True)) == {2: 2, 0: 4, 1: 6}
    assert difference.region.tolist() == [2, 0, 1]


def test_regions_with_texels_to_fill_are_ready_after_all_updates() -> None:
    """What these show depends on every sample of their map; that of another map has no such texel."""
    maps = maps_of([(24, 8), (8, 8)])
    state = state_of(np.ones((len(maps.texels), 3)))
    state["count"][20] = 0  # of region 2
    publisher = Publisher(maps)
    published = publisher.everything(state)
    difference = publisher.difference(published, state, np.array([0, 1, 8, 193, 194]))
    assert dict(zip(difference.region.tolist(), difference.ready.tolist(), strict=True)) == {0: 2, 1: 3, 2: 5, 3: 5}


@pytest.mark.parametrize("forgotten", [[20], [5, 20]])
def test_texels_that_were_sampled_once_show_that_where_their_whole_map_is_forgotten(forgotten: list[int]) -> None:
    """`number` says that they were; `count` no longer does."""
    maps = maps_of([(5, 5)])
    state = state_of(np.zeros((25, 3)), 0)
    state["irradiance"][[5, 20]] = np.array([2, 4])[:, None]
    state["count"][[5, 20]], state["number"][[5, 20]] = ONE_SAMPLE, 1
    publisher = Publisher(maps)
    published = publisher.everything(state)
    state["count"][forgotten] = 0
    apply(publisher.difference(published, state, np.array(forgotten)), published)
    shown = published["rgba"][[5, 20], 0].tolist()
    assert shown == ([2, 4] if len(forgotten) == 2 else [2, 2])


def test_the_steady_state_is_local_and_the_first_frames_are_not() -> None:
    maps = maps_of([(64, 64)])
    state = state_of(np.ones((4096, 3)), 0)
    publisher = Publisher(maps)
    published = publisher.everything(state)
    state["count"][:4000] = ONE_SAMPLE  # all but the end of the last row of regions
    apply(publisher.difference(published, state, np.arange(4000)), published)
    state["irradiance"][5] = 3
    # Region 0 is touched; what the unsampled texels show depends on every sample.
    assert publisher.difference(published, state, np.array([5])).region.tolist() == [0, *range(56, 64)]
    state["count"] = ONE_SAMPLE
    apply(publisher.difference(published, state, np.arange(4000, 4096)), published)
    state["irradiance"][5] = 4
    assert publisher.difference(published, state, np.array([5])).region.tolist() == [0]
