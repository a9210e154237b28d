"""Which texels are sampled: budget, turns of every texel, order, and what the policy asks for."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lightloom.golden_model.contract.formats import LIKELY, RAY, SEEN
from lightloom.golden_model.engine.publishing.regions import regions_of
from lightloom.golden_model.engine.selection.culling import RegionBoxes
from lightloom.golden_model.engine.selection.policy import POLICIES, Policy
from lightloom.golden_model.engine.selection.screen_test import Sight
from lightloom.golden_model.engine.selection.selector import FrameContext, Plan, Selector, coarse_to_fine
from lightloom.golden_model.tables.lightmap import VALID
from tests.golden_model.engine.publishing.test_publisher import maps_of
from tests.golden_model.selection_scenes import Stage, cornell, visited

STAGE = cornell(50.0)
VALID_TEXELS = np.flatnonzero(STAGE.lightmaps.texels["state"] == VALID)
STILL = replace(Policy(), prediction=0)
LONG = replace(STILL, influence="off")
"""For hundreds of frames in which nothing moves: not looking for what does takes a third off each."""


class Blind(Selector):
    """Takes degrees of visibility and rays spent on them from the test instead of from a picture."""

    degree: np.ndarray
    rays = 0

    def _look(
        self, context: FrameContext, valid: np.ndarray, rays: int, regions: RegionBoxes | None
    ) -> tuple[Sight, int]:
        return Sight(degree=self.degree, lod=np.zeros_like(self.degree)), min(self.rays, rays)


class Counted:
    """A tracer that counts."""

    def __init__(self, stage: Stage):
        self.stage, self.rays = stage, 0

    def __call__(self, rays: np.ndarray, *, any_hit: bool = False) -> np.ndarray:
        assert rays.dtype == RAY
        self.rays += len(rays)
        return self.stage.structure.trace(rays, any_hit=any_hit)


def random_state(stage: Stage, rng: np.random.Generator) -> np.ndarray:
    """Anything that a state may be."""
    state = stage.state()
    count = len(state)
    state["count"] = rng.integers(0, 4096, count) * (rng.random(count) < 0.7)
    state["frame"] = rng.integers(0, 4096, count)
    state["heavy"] = rng.integers(0, 8, count) * (rng.random(count) < 0.1)
    state["noticed"] = rng.random(count) < 0.05
    state["deviation"], state["spread"] = rng.integers(0, 200, (2, count))
    return state


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


@pytest.mark.parametrize("together", [2, 4, 16, 64])
def test_texels_of_a_region_follow_each_other_spread_over_it(together: int) -> None:
    maps = maps_of([(24, 16), (9, 3)])
    order = coarse_to_fine(maps, together)
    assert sorted(order) == list(range(24 * 16 + 9 * 3))
    region = regions_of(maps).of_texel[order]
    changes = np.flatnonzero(np.diff(region)) + 1
    runs = np.diff(np.concatenate([[0], changes, [len(order)]]))
    whole = runs[np.isin(region[np.concatenate([[0], changes])], np.arange(6))]
    assert (whole % together == 0).all(), "whole regions take their texels in groups"
    first = order[:together]
    assert (region[:together] == 0).all()
    rows, _columns = np.divmod(first, 24)
    apart = 8 // 2 ** ((together.bit_length() - 1) // 2)
    assert (rows % apart == 0).all()


def test_no_valid_texels() -> None:
    maps = maps_of([(2, 2)])
    maps.texels["state"][:] = 0
    order = coarse_to_fine(maps)
    assert len(order) == 0


@settings(deadline=None, derandomize=True, max_examples=25)
@given(
    budget=st.integers(0, 4000),
    cost=st.integers(1, 40),
    least=st.integers(1, 40),
    frame=st.integers(0, 40),
    name=st.sampled_from(["round-robin", "visibility", "variability", "influence", "footprints", "invalidate"]),
    seed=st.integers(0, 1000),
)
def test_no_plan_exceeds_its_budget(budget: int, cost: int, least: int, frame: int, name: str, seed: int) -> None:
    """Rays counted where they are traced, with any state of the texels, over objects that come and go."""
    own = {"footprints": Policy(influence="footprints"), "invalidate": Policy(invalidate=True)}
    policy = own.get(name) or POLICIES[name]
    stage, rng = visited(), np.random.default_rng(seed)
    selector = Selector(stage.lightmaps, policy)
    for step in range(3):
        counted = Counted(stage)
        state = random_state(stage, rng)
        values = rng.random((len(state), 3)).astype(np.float32)
        rays = policy.selection_rays(budget, cost)
        context = stage.context(frame + step, 24, state, values=values, trace=counted, policy=policy, rays=rays)
        plan = selector.plan(context, budget, cost, min(least, cost))
        assert counted.rays == sum(plan.rays.values()), seed
        assert len(plan.texel) * cost + counted.rays <= budget, seed
        if budget >= cost:
            valid = context.lightmaps.texels["state"] == VALID
            assert len(plan.texel) == min((budget - counted.rays) // cost, valid.sum()) >= 1, seed
            chosen = np.concatenate([plan.texel, plan.spare])
            assert len(np.unique(chosen)) == len(chosen), seed
            assert len(chosen) == min((budget - counted.rays) // min(least, cost), valid.sum()), seed
            assert valid[chosen].all(), seed
        classes = plan.priority[plan.spare].astype(int)
        assert (np.diff(classes) <= 0).all(), seed
        assert (classes == plan.spare_class).all()
        selector.spend(plan, int(rng.integers(0, len(plan.spare) + 1)))


@settings(deadline=None, derandomize=True, max_examples=15)
@given(updates=st.integers(20, 400), cost=st.integers(1, 20), sweep=st.integers(48, 200), seed=st.integers(0, 1000))
def test_no_texel_that_is_seen_starves(updates: int, cost: int, sweep: int, seed: int) -> None:
    """Whoever is likely to be seen in `longest_wait` frames in a row is sampled in one of them, whoever else comes."""
    rng = np.random.default_rng(seed)
    selector = Blind(STAGE.lightmaps, replace(LONG, sweep=sweep, probe=16, variability_bits=0))
    budget = updates * cost + int(rng.integers(0, cost))
    bound = selector.longest_wait(budget, cost)
    certain = (budget - min(budget * 16 // 256, budget - cost)) // cost
    assert bound == -(-(len(VALID_TEXELS) + 1) * 256 // (certain * sweep))
    waiting = np.zeros(len(STAGE.lightmaps.texels), dtype=int)
    favoured = rng.random(len(waiting)) < 0.3
    base = STAGE.context(0, 8)
    for frame in range(2 * bound + 5):
        # Some texels are seen for long, others now and then; the favoured ones always fill the higher classes.
        if frame % 7 == 0:
            lasting = rng.random(len(waiting)) < rng.random()
        degree = np.where(lasting | (rng.random(len(waiting)) < 0.2), rng.integers(LIKELY, SEEN + 1, len(waiting)), 1)
        selector.degree = np.where(favoured, SEEN, degree).astype(np.uint8)
        selector.degree[STAGE.lightmaps.texels["state"] != VALID] = 0
        selector.rays = int(rng.integers(0, 300))
        state = STAGE.state(1)
        state["heavy"][favoured] = 6
        plan = selector.plan(replace(base, frame=frame, state=state), budget, cost)
        waiting = np.where(selector.degree >= LIKELY, waiting + 1, 0)
        waiting[plan.texel] = 0
        assert waiting.max() < bound, f"seed {seed}, frame {frame}"


@settings(deadline=None, derandomize=True, max_examples=10)
@given(updates=st.integers(50, 300), probe=st.integers(24, 128), seed=st.integers(0, 1000))
def test_probing_comes_to_every_texel(updates: int, probe: int, seed: int) -> None:
    """Seen or not, in ceil(256 V / (updates * probe)) frames; here nothing is ever seen and some classes never win."""
    selector = Blind(STAGE.lightmaps, replace(LONG, probe=probe, sweep=0, rays_share=0))
    bound = -(-len(VALID_TEXELS) * 256 // (updates * probe))
    waiting = np.zeros(len(STAGE.lightmaps.texels), dtype=int)
    rng = np.random.default_rng(seed)
    context = STAGE.context(0, 8)
    for frame in range(2 * bound):
        selector.degree = np.zeros(len(waiting), dtype=np.uint8)
        state = STAGE.state(1)
        state["heavy"] = 6 * (rng.random(len(state)) < 0.5)
        plan = selector.plan(replace(context, frame=frame, state=state), updates)
        waiting[VALID_TEXELS] += 1
        waiting[plan.texel] = 0
        assert waiting.max() < bound + 1, f"seed {seed}, frame {frame}"


def rates(policy: Policy, change: Any, frames: int = 60, updates: int = 40) -> np.ndarray:
    """How often each texel of a still frame is sampled; `change` (state, frame) prepares the state."""
    selector = Selector(STAGE.lightmaps, policy)
    context, often = STAGE.context(0, 64), np.zeros(len(STAGE.lightmaps.texels), dtype=int)
    for frame in range(frames):
        state = STAGE.state(200)
        state["frame"] = frame - 1 if frame else 65535
        change(state)
        plan = selector.plan(replace(context, frame=frame, state=state), updates)
        often[plan.texel] += 1
    return often


def test_round_robin_takes_the_order_round_and_round() -> None:
    selector = Selector(STAGE.lightmaps, POLICIES["round-robin"])
    context = STAGE.context(0, 8)
    updates = 1000 // 7
    taken = np.concatenate([selector.plan(context, 1000, 7).texel for _ in range(12)])
    assert (taken == selector.order[np.arange(12 * updates) % len(selector.order)]).all()


def test_seen_texels_are_sampled_more() -> None:
    often = rates(POLICIES["visibility"], lambda state: None)
    degree = Selector(STAGE.lightmaps, STILL).plan(STAGE.context(0, 64), 100).degree
    mean = [often[VALID_TEXELS][degree[VALID_TEXELS] == k].mean() for k in range(4)]
    assert mean[3] > 4 * mean[1] > 0
    assert mean[2] > 2 * mean[0] > 0


def test_variable_new_old_and_changed_texels_are_sampled_more() -> None:
    chosen = np.zeros(len(STAGE.lightmaps.texels), dtype=bool)
    chosen[VALID_TEXELS[::9]] = True
    others = np.setdiff1d(VALID_TEXELS, np.flatnonzero(chosen))
    narrow = replace(STILL, variability_bits=2, dilation=0, rings=0, guard=0)

    def more(name: str, value: int, policy: Policy = narrow) -> float:
        def change(state: np.ndarray) -> None:
            state[name][chosen] = value

        often = rates(policy, change)
        return float(often[chosen].mean() / often[others].mean())

    assert more("deviation", 100) > 1.8
    assert more("deviation", 4000) > 3
    assert more("spread", 4000) > 3
    assert more("count", 0) > 1.8
    assert more("count", 4) > 4
    assert more("heavy", 3) > 2, "two points are four times the rate, until all of a class are taken"
    assert more("frame", 4000) > 1.2
    assert more("deviation", 4000, POLICIES["visibility"]) == pytest.approx(1, abs=0.3)


def test_far_texels_are_sampled_less() -> None:
    """With a sixteenth of the pixels a side, most texels of a picture share their pixel with many others."""
    stage = cornell(24.0)

    def lead(size: int, policy: Policy) -> float:
        state = stage.state(200)
        plan = Selector(stage.lightmaps, policy).plan(stage.context(0, size, state), 100)
        return float((2.0 ** plan.priority[plan.degree == SEEN].astype(int)).mean())

    assert lead(256, STILL) == lead(256, replace(STILL, lod_levels=0))
    assert lead(16, STILL) < lead(256, STILL) / 8
    assert lead(16, replace(STILL, lod_levels=0)) == lead(256, replace(STILL, lod_levels=0))


def test_sampling_spreads_around_texels_that_noticed_a_change() -> None:
    stage = cornell(24.0)
    wall = stage.lightmaps.texels["object"] == stage.scene.object_names.index("back wall")
    width = int(stage.lightmaps.width[stage.scene.object_names.index("back wall")])
    middle = int(np.flatnonzero(wall)[0]) + 9 * width + width // 2
    policy = replace(STILL, notice_radius=2, notice_votes=2)

    def plan(noticed: list[int], policy: Policy = policy) -> Plan:
        state = stage.state(200)
        state["noticed"][noticed] = True
        return Selector(stage.lightmaps, policy).plan(stage.context(0, 64, state), 100)

    one = plan([middle])  # a single one may be noise: more samples around it will tell
    assert (one.change == 1).sum() == 25
    assert one.change.max() == 1
    assert not one.heavy.any()
    two = plan([middle, middle + 1])
    before = plan([]).priority
    assert (two.priority[[middle - 1, middle, middle + 2]] > before[[middle - 1, middle, middle + 2]]).all()
    assert two.priority[middle + 20] == before[middle + 20]
    both = [middle + dy * width + dx for dy in (-1, 0, 1) for dx in (0, 1)]
    assert np.flatnonzero(two.heavy).tolist() == both, "whose 3 x 3 have both in them"
    assert [(two.change >= level).sum() for level in (3, 2, 1)] == [2, 5 * 6, 9 * 10]
    alone = plan([middle], replace(policy, notice_votes=1))
    around = [middle + dy * width + dx for dy in (-1, 0, 1) for dx in (-1, 0, 1)]
    assert np.flatnonzero(alone.heavy).tolist() == around
    assert [(alone.change >= level).sum() for level in (3, 2, 1)] == [1, 25, 81]
    assert not plan([middle, middle + 1], replace(policy, notice=False)).change.any()
    assert not plan([]).change.any()


def test_influence_lowers_what_texels_know_unless_that_is_off() -> None:
    stage = visited()
    for lowered in (True, False):
        selector = Selector(stage.lightmaps, replace(STILL, lower=lowered))
        plan = selector.plan(stage.context(20, 64, stage.state(200)), 100)
        assert plan.influence.any()
        assert ((plan.expected > 0) == ((plan.influence > 0) & lowered)).all()


def test_influenced_texels_get_heavy_weights_or_drop_their_values() -> None:
    stage = visited()
    plans = {}
    for invalidate in (False, True):
        policy = replace(STILL, heavy_level=3, heavy_updates=6, invalidate=invalidate)
        selector = Selector(stage.lightmaps, policy)
        state = stage.state(200)
        plan = selector.plan(stage.context(20, 64, state), 100)
        assert (plan.heavy == (plan.influence == 3)).all()
        assert 0 < plan.heavy.sum() < len(state) / 2
        plan.mark(state, policy.heavy_updates)
        plan.forget_old(state, plan.texel)
        assert (state["heavy"] == 6 * plan.heavy).all()
        dropped = np.flatnonzero(state["count"] == 0)
        assert dropped.tolist() == (sorted(plan.texel[plan.heavy[plan.texel]]) if invalidate else [])
        plans[invalidate] = plan
        # In the next frame nothing moves; what waits for its first update since still drops its value then.
        state["heavy"][plan.texel] -= state["heavy"][plan.texel] > 0
        after = selector.plan(stage.context(21, 64, state), 100)
        assert not after.heavy.any()
        assert (after.forget == ((state["heavy"] == 6) & invalidate)).all()
        assert (after.change == 3 * (state["heavy"] > 0)).all()
    assert len(plans[True].texel) == len(plans[False].texel)


def test_absent_objects_are_not_sampled() -> None:
    stage = visited()
    own = stage.lightmaps.texels["object"] == stage.scene.object_names.index("guest")
    selector = Selector(stage.lightmaps, STILL)
    present, absent = (selector.plan(stage.context(frame, 32), 10_000) for frame in (15, 25))
    assert own[present.texel].any()
    assert not own[absent.texel].any()
    for quantity in (absent.priority, absent.degree, absent.bins, absent.change):
        assert not quantity[own].any()


def test_spare_texels_take_their_turn_when_they_are_spent() -> None:
    first, second = (Selector(STAGE.lightmaps, replace(STILL, sweep=0, probe=0)) for _ in range(2))
    context = STAGE.context(0, 64)
    plan = first.plan(context, 60, 2, 1)
    assert (second.plan(context, 60, 2).texel == plan.texel).all()
    first.spend(plan, 10)
    # Classes are unchanged, so the texels spent are not chosen again at once, and those not spent are.
    assert not np.isin(plan.spare[:10], first.plan(context, 60, 2).texel).any()
    assert np.isin(plan.spare[:10], second.plan(context, 60, 2).texel).any()
