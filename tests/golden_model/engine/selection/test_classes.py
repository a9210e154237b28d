"""Classes and how updates are shared out among them."""

from fractions import Fraction
from itertools import pairwise

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from lightloom.golden_model.contract.formats import TEXEL_STATE
from lightloom.golden_model.engine.selection.classes import (
    FEW,
    IN_ORDER,
    NEVER,
    OLD,
    Share,
    class_table,
    classes_of,
    needs,
    quotas,
)
from lightloom.golden_model.engine.selection.policy import SHARE, Policy


@settings(deadline=None, derandomize=True, max_examples=200)
@given(members=st.lists(st.integers(0, 5000), min_size=16, max_size=16), updates=st.integers(0, 20_000))
def test_quotas_spend_all_and_higher_classes_are_sampled_more(members: list[int], updates: int) -> None:
    out = quotas(members, updates)
    assert sum(out) == min(updates, sum(members))
    assert all(0 <= q <= n for q, n in zip(out, members, strict=True))
    # Rates never fall with the class, but for what rounding down moves: less than one update a class.
    there = [c for c in range(16) if members[c]]
    for low, high in pairwise(there):
        assert Fraction(out[high] + 1, members[high]) >= min(Fraction(out[low] - 16, members[low]), Fraction(1))


def test_a_class_is_sampled_twice_as_often_as_the_one_below() -> None:
    members = [0] * 16
    members[4:8] = [1000] * 4
    assert quotas(members, 150) == [0, 0, 0, 0, 10, 20, 40, 80, 0, 0, 0, 0, 0, 0, 0, 0]
    members[7] = 10  # a class that is full leaves the rest to the others
    assert quotas(members, 1410) == [0, 0, 0, 0, 200, 400, 800, 10, 0, 0, 0, 0, 0, 0, 0, 0]
    assert quotas([0] * 16, 9) == [0] * 16


@settings(deadline=None, derandomize=True, max_examples=100)
@given(
    first=st.integers(0, SHARE),
    second=st.integers(0, SHARE),
    frames=st.lists(st.integers(0, 40), min_size=1, max_size=60),
)
def test_shares_add_up_over_any_frames(first: int, second: int, frames: list[int]) -> None:
    second = min(second, SHARE - first)
    shares = Share(first), Share(second)
    had: list[tuple[int, int]] = []
    for updates in frames:
        one = shares[0].of(updates, updates)
        two = shares[1].of(updates, updates - one)
        assert one + two <= updates
        had.append((one, two))
    for begin in range(len(frames)):
        total = sum(frames[begin:])
        assert sum(one for one, _ in had[begin:]) >= total * first // SHARE
        assert sum(two for _, two in had[begin:]) >= total * second // SHARE - 1


def test_class_table_adds_points_and_stays_in_range() -> None:
    policy = Policy(
        degree_points=(0, 1, 6, 7),
        change_points=(0, 2, 3, 4),
        hidden_change_points=(0, 3, 5, 6),
        variability_points=(0, 1, 2, 3),
        need_points=(0, 1, 2, 4),
        hidden_need_points=(0, 0, 1, 3),
        lod_points=(0, -2, -4, -6),
    )
    table = class_table(policy)
    assert table.shape == (4, 4, 4, 4, 4)
    assert table[0, 0, 0, 0].tolist() == [0, 1, 6, 7]
    assert table[0, 0, 0, 3].tolist() == [6, 7, 10, 11]  # hidden texels gain more from a change
    assert table[2, 0, 1, 0].tolist() == [0, 0, 3, 4]
    assert table[0, :, 0, 0, 1].tolist() == [1, 1, 2, 4]
    assert table[0, :, 0, 0, 2].tolist() == [6, 7, 8, 10]
    assert table[0, 3, 3, 3, 3] == 15
    assert table[3, 0, 0, 0, 0] == 0


def test_classes_are_read_off_the_table() -> None:
    seed = 3
    table = class_table(Policy())
    what = np.random.default_rng(seed).integers(0, 4, (5, 4000)).astype(np.uint8)
    assert (classes_of(table, *what) == table[tuple(what)]).all(), f"seed {seed}"


def test_needs_by_count_and_age() -> None:
    state = np.zeros(5, dtype=TEXEL_STATE)
    state["count"] = 0, 8 * 16 - 1, 8 * 16, 3200, 3200
    state["frame"] = 10, 10, 10, 4090, 4060
    assert needs(state, 4106, Policy(few=8, old=20)).tolist() == [NEVER, FEW, IN_ORDER, IN_ORDER, OLD]
