"""Turns: nobody is passed over for good, whoever comes and goes."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from lightloom.golden_model.engine.selection.round_robin import RoundRobin


@settings(deadline=None, derandomize=True, max_examples=60)
@given(size=st.integers(1, 60), counts=st.lists(st.integers(0, 20), min_size=1, max_size=40), seed=st.integers(0, 999))
def test_a_steady_member_is_taken_before_the_counts_add_up_to_the_places(
    size: int, counts: list[int], seed: int
) -> None:
    rng = np.random.default_rng(seed)
    turns = RoundRobin()
    turns.take(rng.random(size) < 0.5, int(rng.integers(0, size + 1)))  # begins anywhere
    missed = np.zeros(size, dtype=int)  # the counts since a place was taken, while it was a member all the time
    for count in counts:
        members = rng.random(size) < rng.random()
        taken = turns.take(members, count)
        assert len(taken) == min(count, members.sum()), seed
        assert members[taken].all(), seed
        assert len(np.unique(taken)) == len(taken)
        missed = np.where(members, missed + count, 0)
        missed[taken] = 0
        assert (missed < size).all(), seed


def test_members_come_in_the_order_of_the_places_from_the_cursor_on() -> None:
    turns = RoundRobin()
    members = np.array([True, False, True, True, False, True])
    assert turns.take(members, 2).tolist() == [0, 2]
    assert turns.upcoming(members, 3).tolist() == [3, 5, 0]
    assert turns.take(members, 0).tolist() == []
    assert turns.take(members, 9).tolist() == [3, 5, 0, 2]
    turns.pass_over(4)
    assert turns.take(members, 1).tolist() == [5]
    assert turns.take(np.zeros(6, dtype=bool), 3).tolist() == []
