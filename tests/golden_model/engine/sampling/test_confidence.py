"""What influence leaves of the worth of averages: against exact fractions, and for what it promises."""

from fractions import Fraction

import numpy as np

from lightloom.golden_model.contract.formats import COUNT_MAX, ONE_SAMPLE, TEXEL_STATE, WHOLE_CHANGE
from lightloom.golden_model.engine.sampling.confidence import STALE, lower

COUNTS = (0, 1, 3, 4, 5, 15, 16, 17, 32, 100, 160, 1000, COUNT_MAX)
SPREADS = (0, 1, 12, 13, 20, 51, 100, 204, 205, 206, 300, 4095)


def states(counts: np.ndarray, spreads: np.ndarray) -> np.ndarray:
    state = np.zeros(len(counts), dtype=TEXEL_STATE)
    state["count"], state["spread"], state["irradiance"] = counts, spreads, 3.0
    return state


def left_of(count: int, spread: int, expected: int) -> int:
    """What a count comes down to; the noise squared is the power of two in half octaves below it."""
    if not count or not expected:
        return count
    if expected == WHOLE_CHANGE:
        return 0
    noise = min(max(spread * 5 // 8, 8), 128)
    top = noise.bit_length() - 1
    squared = Fraction(2 ** (2 * top + (128 * noise >= 181 << top)), 2**16)
    change = Fraction(1, 4 ** (WHOLE_CHANGE - expected))
    samples = Fraction(count, 16)
    exact = 16 * samples / (1 + samples * change / squared)
    return max(int(exact + Fraction(1, 2)), 1)


def test_every_change_of_every_count_and_noise() -> None:
    grid = np.array(np.meshgrid(COUNTS, SPREADS, np.arange(WHOLE_CHANGE + 1))).reshape(3, -1)
    state = states(grid[0], grid[1])
    fallen = lower(state, grid[2].astype(np.uint8))
    wanted = [left_of(*map(int, each)) for each in grid.T]
    for each, found, want in zip(grid.T, state["count"].tolist(), wanted, strict=True):
        assert found == want, each
    crossed = [k for k, want in enumerate(wanted) if grid[0][k] >= STALE > want]
    assert fallen.tolist() == crossed
    assert (state["irradiance"] == 3).all()


def test_large_changes_leave_what_one_sample_of_as_much_noise_is_worth() -> None:
    """The same change again and again comes to rest where what is lost is nothing more, and never at nothing."""
    state = states(np.full(WHOLE_CHANGE, COUNT_MAX), np.full(WHOLE_CHANGE, 100))
    before = state["count"].astype(int)
    for _ in range(200):
        lower(state, np.arange(WHOLE_CHANGE).astype(np.uint8))
        assert (state["count"] <= before).all()
        before = state["count"].astype(int)
    assert before[0] == COUNT_MAX
    assert (before[1:] >= 1).all()
    assert (np.diff(before) <= 0).all()
    assert before[-1] == 1


def test_a_sample_after_a_change_weighs_by_what_was_left() -> None:
    """Of a step by all of the light nothing is left, of one by a quarter of it less than a sample."""
    state = states(np.full(2, 10 * ONE_SAMPLE), np.full(2, 80))
    lower(state, np.array([WHOLE_CHANGE, WHOLE_CHANGE - 2], dtype=np.uint8))
    assert state["count"][0] == 0
    assert 1 <= state["count"][1] < 2 * ONE_SAMPLE
