"""The ray collector: the same bits however rays are grouped, and exactly the collections that its rules make."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lightloom.golden_model.contract.engine_image import MIRROR
from lightloom.golden_model.contract.formats import HIT, RAY
from lightloom.golden_model.host.errors import InputError
from lightloom.golden_model.rays.collector import (
    EMITTERS,
    FRAGMENT_SHADING,
    FRAME_SHADER,
    MAINTENANCE,
    Collector,
    Packing,
)
from lightloom.golden_model.structures.structure import Structure
from tests.golden_model.frame_scenes import ball, room, scene_of

LOW, HIGH = np.full(3, -1, dtype=np.float32), np.ones(3, dtype=np.float32)
SCENE = scene_of([*room(), ball("ball", (0, 0, 0), 0.4, 0.9, MIRROR)])


def rays_of(count: int, seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    rays = np.zeros(count, dtype=RAY)
    rays["origin"] = rng.uniform(-0.9, 0.9, (count, 3))
    rays["direction"] = rng.normal(size=(count, 3))
    rays["t_max"] = np.inf
    return rays


def no_hits(rays: np.ndarray, *, any_hit: bool = False, coarse: bool = False) -> np.ndarray:
    return np.zeros(len(rays), dtype=HIT)


@pytest.mark.parametrize("packing", [Packing(capacity=1), Packing(), Packing(definitions=1), Packing(cells=1)])
def test_every_emitter_gets_the_bits_of_its_own_rays_in_its_order(packing: Packing) -> None:
    structure = Structure(SCENE)
    collector = Collector(structure.trace, LOW, HIGH, packing)
    batches = [
        (FRAGMENT_SHADING, rays_of(700, 1), {"coarse": True}),
        (FRAME_SHADER, rays_of(1500, 2), {"any_hit": True}),
        (MAINTENANCE, rays_of(3000, 3), {}),
        (MAINTENANCE, rays_of(0, 4), {}),
        (MAINTENANCE, rays_of(900, 5), {"any_hit": True}),
    ]
    for batch in (batches, batches[::-1]):
        tickets = [collector.emit(emitter, rays, **kind) for emitter, rays, kind in batch]
        collector.run()
        for ticket, (_, rays, kind) in zip(tickets, batch, strict=True):
            expected = structure.trace(rays, **kind)
            assert collector.hits(ticket).tobytes() == expected.tobytes()
    assert collector.figures.rays == {FRAGMENT_SHADING: 1400, FRAME_SHADER: 3000, MAINTENANCE: 7800}
    assert collector.figures.kinds == {"nearest": 6000, "any": 4800, "nearest coarse": 1400, "any coarse": 0}
    assert collector.figures.waves == 2


def test_shuffled_rays_get_the_same_hits() -> None:
    structure = Structure(SCENE)
    rays = rays_of(2000, 6)
    expected = structure.trace(rays)
    for seed in range(3):
        order = np.random.default_rng(seed).permutation(len(rays))
        collector = Collector(structure.trace, LOW, HIGH, Packing(capacity=16, definitions=32))
        ticket = collector.emit(MAINTENANCE, rays[order])
        collector.run()
        assert collector.hits(ticket).tobytes() == expected[order].tobytes(), f"seed {seed}"


def packed_one_by_one(key: list[int], packing: Packing) -> list[list[int]]:
    """The rules, ray by ray: collections in the order in which they leave."""
    open_now: dict[int, list[int]] = {}
    left: list[list[int]] = []
    for ray, own in enumerate(key):
        place = (own ^ (own >> (packing.definitions.bit_length() - 1))) & (packing.definitions - 1)
        held = open_now.get(place)
        if held is not None and key[held[0]] != own:
            left.append(open_now.pop(place))
        open_now.setdefault(place, []).append(ray)
        if len(open_now[place]) == packing.capacity:
            left.append(open_now.pop(place))
    return left + [open_now[place] for place in sorted(open_now)]


@settings(deadline=None, max_examples=60, derandomize=True)
@given(
    st.lists(st.integers(0, 5), min_size=1, max_size=120),
    st.sampled_from([1, 2, 3, 8, 64]),
    st.sampled_from([1, 2, 4, 256]),
)
def test_collections_are_those_of_the_rules(cell: list[int], capacity: int, definitions: int) -> None:
    """Rays that differ in the cell of their origin alone, against the rules applied to one ray after the other."""
    packing = Packing(capacity=capacity, definitions=definitions, cells=8)
    rays = np.zeros(len(cell), dtype=RAY)
    rays["origin"][:, 2] = (np.array(cell) + 0.5) / 4 - 1
    rays["direction"] = 1
    collector = Collector(no_hits, LOW, HIGH, packing)
    found = [part.tolist() for part in collector.collections(rays)]
    # The two other coordinates are in the middle: cell 4 of 8.
    key = [(4 * 8 + 4) * 8 + c for c in cell]
    assert found == packed_one_by_one(key, packing)


def test_figures_count_full_forced_and_left_collections() -> None:
    """One definition, two kinds of rays: 5 of the first (2 full, 1 forced out), 4 of the second, 1 of the first."""
    rays = np.zeros(10, dtype=RAY)
    rays["direction"] = 1
    rays["direction"][5:9] = -1
    collector = Collector(no_hits, LOW, HIGH, Packing(capacity=2, definitions=1))
    collector.emit(MAINTENANCE, rays)
    collector.run()
    figures = collector.figures
    assert (figures.collections, figures.full, figures.forced) == (6, 4, 1)
    assert figures.mean_fill == pytest.approx(10 / 6)


def test_grouping_brings_alike_rays_together() -> None:
    """Of rays from few places, in random order, collections are fuller than chance and of one octant each."""
    rays = rays_of(4000, 8)
    rays["origin"] = np.array([[0.5, 0.5, 0.5], [-0.5, 0.5, -0.5]], dtype=np.float32)[np.arange(4000) % 2]
    collections = Collector(no_hits, LOW, HIGH).collections(rays)
    assert sorted(np.concatenate(collections)) == list(range(4000))
    assert max(map(len, collections)) == 64
    assert 4000 / len(collections) > 30
    for part in collections:
        assert len(np.unique(np.signbit(rays["direction"][part]), axis=0)) == 1
        assert len(np.unique(rays["origin"][part], axis=0)) == 1


def test_nothing_to_trace() -> None:
    collector = Collector(no_hits, LOW, HIGH)
    collector.run()
    ticket = collector.emit(FRAME_SHADER, rays_of(0, 0))
    collector.run()
    assert len(collector.hits(ticket)) == 0
    assert collector.figures.mean_fill == 0
    assert set(collector.figures.rays) == set(EMITTERS)


@pytest.mark.parametrize(
    "option", [{"capacity": 0}, {"capacity": 1025}, {"definitions": 3}, {"definitions": 0}, {"cells": 128}]
)
def test_packing_out_of_range_is_refused(option: dict[str, int]) -> None:
    with pytest.raises(InputError, match=next(iter(option))):
        Packing(**option)
