"""The variability map: what is high, how far it reaches, where it stops."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from lightloom.golden_model.contract.formats import TEXEL_STATE
from lightloom.golden_model.engine.selection.neighbourhoods import Windows
from lightloom.golden_model.engine.selection.policy import Policy
from lightloom.golden_model.engine.selection.variability import HIGH, Variability, contrast_bins
from tests.golden_model.engine.publishing.test_publisher import maps_of

NARROW = replace(
    Policy(), variability_bits=2, dilation=0, guard=0, rings=0, variability_share=0, contrast_bins=(16, 40, 96)
)
MAPS = maps_of([(20, 12), (3, 3)])
COUNT = len(MAPS.texels)
VALID = np.ones(COUNT, dtype=bool)


def variability(policy: Policy) -> Variability:
    return Variability(MAPS, Windows(MAPS), policy)


def state_with(name: str, values: np.ndarray | int, texel: np.ndarray | int = 0) -> np.ndarray:
    state = np.zeros(COUNT, dtype=TEXEL_STATE)
    state[name][texel] = values
    return state


def flat() -> np.ndarray:
    return np.ones((COUNT, 3), dtype=np.float32)


@pytest.mark.parametrize(("name", "switch"), [("deviation", "across_frames"), ("spread", "within_frame")])
def test_statistics_are_binned_by_thresholds_and_can_be_switched(name: str, switch: str) -> None:
    limits = getattr(NARROW, f"{name}_bins")
    values = np.array([0, limits[0] - 1, *limits, 4095])
    state = state_with(name, values, np.arange(6))
    assert variability(NARROW).look(state, flat(), VALID)[:6].tolist() == [0, 0, 1, 2, 3, 3]
    binary = replace(NARROW, variability_bits=1)
    assert variability(binary).look(state, flat(), VALID)[:6].tolist() == [0, 0, 0, HIGH, HIGH, HIGH]
    assert not variability(replace(NARROW, variability_bits=0)).look(state, flat(), VALID).any()
    off: dict[str, Any] = {switch: False}
    assert not variability(replace(NARROW, **off)).look(state, flat(), VALID).any()


def test_contrast_within_the_map_counts_for_both_sides_of_an_edge_and_no_further() -> None:
    values = flat()
    image = values[:240].reshape(12, 20, 3)
    image[:, 10:] = 2  # half of the larger one: 128/256
    image[5, 3] = 1.2
    bins = variability(NARROW).look(np.zeros(COUNT, dtype=TEXEL_STATE), values, VALID)[:240].reshape(12, 20)
    assert (bins[:, 9:11] == 3).all()
    spot = {(5, 3), (4, 3), (6, 3), (5, 2), (5, 4)}
    assert all(bins[place] == 2 for place in spot)
    assert (bins > 0).sum() == 2 * 12 + len(spot)
    # The second map begins with other values than the first ends with.
    values[240:] = 50
    assert not variability(NARROW).look(np.zeros(COUNT, dtype=TEXEL_STATE), values, VALID)[240:].any()
    without = replace(NARROW, within_map=False)
    assert not variability(without).look(np.zeros(COUNT, dtype=TEXEL_STATE), values, VALID).any()
    assert not variability(NARROW).look(np.zeros(COUNT, dtype=TEXEL_STATE), None, VALID).any()


def test_contrast_is_relative_and_black_has_none() -> None:
    values = np.random.default_rng(2).uniform(0, 1, (COUNT, 3)).astype(np.float32)
    windows = Windows(MAPS)
    bins = contrast_bins(values, windows, (16, 40, 96))
    assert (contrast_bins(values * np.float32(1024), windows, (16, 40, 96)) == bins).all()
    assert set(bins.tolist()) >= {1, 2, 3}
    assert not contrast_bins(values * 0, windows, (16, 40, 96)).any()


def test_regions_take_the_highest_bin() -> None:
    state = state_with("deviation", 4095, 20 * 9 + 18)  # row 9, column 18: region (1, 2) is 4 x 4 texels here
    bins = variability(replace(NARROW, by_region=True)).look(state, flat(), VALID)[:240].reshape(12, 20)
    assert (bins[8:, 16:] == 3).all()
    assert (bins > 0).sum() == 16
    valid = VALID.copy()
    valid[20 * 8 + 16] = False
    bins = variability(replace(NARROW, by_region=True)).look(state, flat(), valid)
    assert bins[20 * 8 + 16] == 0
    assert (bins > 0).sum() == 15


def test_a_region_and_the_eight_around_it_hold_all_that_matters_to_it() -> None:
    """As far as the policy lets windows reach, contrast at their ends; one texel differs at a time."""
    maps = maps_of([(56, 56)])
    row, column = np.divmod(np.arange(56 * 56), 56)
    rng = np.random.default_rng(8)
    for wide, rings in ((False, 2), (True, 3)):
        policy = replace(NARROW, dilation=3, guard=2, rings=rings, by_region=wide)
        reached = 0
        for texel in 56 * rng.integers(24, 32, 20) + rng.integers(24, 32, 20):
            values = np.ones((56 * 56, 3), dtype=np.float32)
            state = np.zeros(len(values), dtype=TEXEL_STATE)
            values[texel] = 2
            bins = Variability(maps, Windows(maps), policy).look(state, values, np.ones(len(values), dtype=bool))
            apart = np.maximum(abs(row // 8 - texel // 56 // 8), abs(column // 8 - texel % 56 // 8))
            assert not bins[apart > 1].any(), (wide, texel)
            away = np.maximum(abs(row - texel // 56), abs(column - texel % 56))
            reached = max(reached, int(away[bins > 0].max()))
        assert reached >= 8, "as far as that"


def square(bins: np.ndarray, value: int) -> tuple[int, int]:
    """Rows and columns of the area at or above a bin in the first map."""
    rows, columns = np.nonzero(bins[:240].reshape(12, 20) >= value)
    return int(np.ptp(rows)) + 1, int(np.ptp(columns)) + 1


def test_high_bins_are_dilated_and_fall_off_in_rings() -> None:
    state = state_with("deviation", 4095, 20 * 6 + 10)
    policy = replace(NARROW, dilation=1, rings=2)
    measured = variability(policy)
    measured.last = measured.measure(state, None, VALID)
    bins = measured.look(state, None, VALID)
    assert [square(bins, value) for value in (3, 2, 1)] == [(3, 3), (5, 5), (7, 7)]


@pytest.mark.parametrize("share", [32, 128])
def test_thresholds_follow_the_noise_so_that_a_share_of_the_texels_is_high(share: int) -> None:
    rng = np.random.default_rng(4)
    maps = maps_of([(64, 64)])
    measured = Variability(maps, Windows(maps), replace(NARROW, variability_share=share))
    state = np.zeros(4096, dtype=TEXEL_STATE)
    state["count"] = 9 * 16
    for noise in (600, 60):
        for _ in range(40):
            state["deviation"] = rng.integers(0, noise, 4096)
            bins = measured.look(state, None, np.ones(4096, dtype=bool))
        assert share / 256 / 2.2 < (bins == HIGH).mean() < 1.2 * share / 256
    # Without it the same map is all high, or all low.
    fixed = variability(replace(NARROW, across_frames=False))
    fixed.look(state_with("spread", 4095, np.arange(COUNT)), None, VALID)
    assert fixed.scale == 16
    # Where nothing varies the thresholds stop at a quarter, and a single step of a float is not noise.
    for _ in range(60):
        state["deviation"] = 7
        assert not (measured.look(state, None, np.ones(4096, dtype=bool)) > 0).any() or measured.scale > 4
    assert measured.scale == 4


def test_where_the_map_changes_the_guard_is_wider_for_that_frame() -> None:
    state = state_with("deviation", 4095, 20 * 6 + 10)
    measured = variability(replace(NARROW, dilation=1, guard=2))
    first, second = measured.look(state, None, VALID), measured.look(state, None, VALID)
    assert square(first, 3) == (7, 7)
    assert square(second, 3) == (3, 3)
    # By one bin only it is not.
    small = measured.look(state_with("deviation", 100, 20 * 6 + 10), None, VALID)
    assert square(small, 2) == (3, 3)
    measured.look(state, None, VALID)
    # What has become quiet is still guarded, once.
    gone = measured.look(np.zeros(COUNT, dtype=TEXEL_STATE), None, VALID)
    assert square(gone, 3) == (7, 7)
    assert not measured.look(np.zeros(COUNT, dtype=TEXEL_STATE), None, VALID).any()


def test_nothing_is_widened_over_the_border_of_a_chart() -> None:
    maps = maps_of([(20, 12), (3, 3)])
    maps.chart[:240].reshape(12, 20)[:, 10:] = 5
    measured = Variability(maps, Windows(maps), replace(Policy(variability_bits=2), dilation=3, guard=2, rings=2))
    bins = measured.look(state_with("spread", 4095, 20 * 6 + 9), None, VALID)
    image = bins[:240].reshape(12, 20)
    assert (image[:, 9] > 0).all()
    assert not image[:, 10:].any()
    assert not bins[240:].any()
