"""Round robin: the budget, the turn of every texel, the order."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from golden_model.selection import RoundRobin, coarse_to_fine
from tests.golden_model.test_publish import maps_of


@given(
    texels=st.integers(1, 300),
    cost=st.integers(1, 40),
    budgets=st.lists(st.integers(0, 3000), min_size=1, max_size=20),
)
def test_budget_holds_and_no_texel_comes_twice(texels: int, cost: int, budgets: list[int]) -> None:
    robin = RoundRobin(np.arange(texels) * 3)
    for budget in budgets:
        chosen = robin.select(budget, cost)
        assert len(chosen) * cost <= budget
        assert len(chosen) == min(budget // cost, texels)
        assert len(np.unique(chosen)) == len(chosen)


@given(texels=st.integers(1, 300), cost=st.integers(1, 20), count=st.integers(1, 400), start=st.integers(0, 5))
def test_every_texel_has_its_turn(texels: int, cost: int, count: int, start: int) -> None:
    robin = RoundRobin(np.random.default_rng(texels).permutation(texels))
    for _ in range(start):
        robin.select(cost * count, cost)
    frames = -(-texels // min(count, texels))
    chosen = np.concatenate([robin.select(cost * count + cost - 1, cost) for _ in range(frames)])
    assert set(chosen) == set(range(texels))


def test_order_holds_every_valid_texel_once_coarse_first() -> None:
    maps = maps_of([(16, 16), (5, 3)])
    maps.texels["state"][[3, 40, 200]] = [0, 2, 0]
    order = coarse_to_fine(maps)
    assert sorted(order) == np.flatnonzero(maps.texels["state"] == 1).tolist()
    assert order[:2].tolist() == [0, 256]  # the first texel of both maps
    # Every beginning is spread: the first quarter of a full map is the even lattice.
    whole = coarse_to_fine(maps_of([(16, 16)]))
    for lattice in (2, 4, 8):
        rows, columns = np.divmod(whole[: 256 // lattice**2], 16)
        assert (rows % lattice == 0).all()
        assert (columns % lattice == 0).all()


def test_no_valid_texels() -> None:
    maps = maps_of([(2, 2)])
    maps.texels["state"][:] = 0
    order = coarse_to_fine(maps)
    assert len(order) == 0
    assert len(RoundRobin(order).select(1000, 3)) == 0
