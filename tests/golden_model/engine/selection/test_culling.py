"""Regions that are left out as a whole have no texel that the tests of texels would find, and many are left out."""

from dataclasses import fields, replace

import numpy as np
import pytest

from lightloom.golden_model.contract.engine_image import DIFFUSE
from lightloom.golden_model.contract.formats import FOOTPRINT, INFLUENCE, SHADOW, VOLUME
from lightloom.golden_model.engine.selection.culling import region_boxes
from lightloom.golden_model.engine.selection.influence.reach import texel_changes
from lightloom.golden_model.engine.selection.influence.region_reach import reached_regions
from lightloom.golden_model.engine.selection.intervals import Interval
from lightloom.golden_model.engine.selection.policy import POLICIES, Policy
from lightloom.golden_model.engine.selection.screen_test import to_project
from lightloom.golden_model.engine.selection.selector import Selector
from lightloom.golden_model.engine.selection.texel_project import texel_project
from lightloom.golden_model.numerics.floats import flush
from lightloom.golden_model.numerics.vectors import dot
from lightloom.golden_model.scene.assemble import assemble
from lightloom.golden_model.scene.files.cornell_box import cornell_box, cornell_box_parts
from lightloom.golden_model.scene.pose import moved_records, scene_at
from lightloom.golden_model.tables.lightmap import VALID
from lightloom.golden_model.tables.pinhole import View, look_at
from tests.golden_model.engine.publishing.test_publisher import maps_of
from tests.golden_model.frame_scenes import ball
from tests.golden_model.selection_scenes import Stage, key, path_of, stage, visited


def turning() -> Stage:
    """A block and a ball that turn and move, frames 0 to 20, in the Cornell box."""
    parts = cornell_box_parts()
    away = replace(key(20, (60, 40, -80)), rotate=np.array((0.6, 0.48, 0.64, 0), dtype=np.float32))
    path = path_of(key(0, (0, 0, 0)), away)
    block = replace(cornell_box_parts(["short block"])[0], name="mover", path=path)
    round_one = replace(ball("ball", (250, 350, 250), 70.0, 0.5, DIFFUSE), path=path)
    parts += [block, round_one]
    return stage(assemble(name="turning", parts=parts, where="turning", camera=cornell_box().camera, texel_size=20.0))


STAGE = turning()
EXTENT = 560.0
FRACTIONS = [0, 2.0**-8, -(2.0**-8), 2.0**-9, -(2.0**-9)]
"""Of pixels, around the step of places on the screen."""


@pytest.fixture(params=range(8))
def rng(request: pytest.FixtureRequest) -> np.random.Generator:
    print(f"seed {request.param}")
    return np.random.default_rng(request.param)


def random_view(rng: np.random.Generator) -> View:
    """From anywhere in the box, around it or on one of its texels, towards anywhere, narrow or wide."""
    texels = STAGE.lightmaps.texels["position"]
    eye = rng.uniform(-200, 760, 3) if rng.integers(2) else texels[rng.integers(len(texels))]
    target = eye + rng.normal(size=3) * 10.0 ** rng.integers(-2, 4)
    up = rng.normal(size=3)
    width, height = rng.integers(1, 400, 2)
    return look_at(eye, target, up, 10.0 ** rng.uniform(-2, 1), int(width), int(height))


def random_record(rng: np.random.Generator) -> np.ndarray:
    """INFLUENCE () of any kind, from points to all of the box."""
    record = np.zeros((), dtype=INFLUENCE)
    record["kind"] = rng.choice([VOLUME, SHADOW, FOOTPRINT])
    record["level"], record["octaves"], record["facing"] = rng.integers(1, 4), rng.integers(8), rng.integers(2)
    record["object"], record["surface"] = rng.integers(-1, 4), -1
    record["low"] = rng.uniform(-100, 660, 3)
    record["high"] = record["low"] + 10.0 ** rng.uniform(-3, 2.7, 3)
    record["reach_low"], record["reach_high"] = 10.0 ** rng.uniform(-3, 2.7, (2, 3))
    record["light"] = rng.uniform(-100, 660, 3)
    record["light_half"] = 10.0 ** rng.uniform(-3, 2.5, 3)
    return record


def test_no_texel_of_a_region_that_is_left_out_is_on_the_screen(rng: np.random.Generator) -> None:
    resting, maps = region_boxes(STAGE.lightmaps), STAGE.lightmaps
    left_out = visible = 0
    for _ in range(60):
        scene = scene_at(STAGE.scene, int(rng.integers(0, 21)))
        policy = Policy(facing_slack=float(rng.choice([0, 2.0**-12, 0.0625, 1])))
        size, view = 10.0 ** rng.uniform(-1, 2), random_view(rng)
        regions, texels = resting.posed(scene.rotation, scene.translation), moved_records(maps, scene).texels
        there = regions.on_screen(view, size, policy)
        place = texel_project(to_project(texels["position"], texels["normal"], view, size, policy))
        found = place["visible"] & (texels["state"] == VALID)
        wrong = np.flatnonzero(found & ~there[regions.of_texel])
        assert not len(wrong), f"texel {wrong[0]} is visible from {view}"
        left_out += int((~there & regions.filled).sum())
        visible += len(np.unique(regions.of_texel[found]))
    filled = 60 * int(resting.posed(STAGE.scene.rotation, STAGE.scene.translation).filled.sum())
    print(f"{left_out / filled:.3f} left out, {1 - visible / filled:.3f} could be")
    assert left_out > 0.75 * (filled - visible)


def test_no_texel_of_a_region_that_is_left_out_is_reached(rng: np.random.Generator) -> None:
    resting, maps = region_boxes(STAGE.lightmaps), STAGE.lightmaps
    everywhere = np.array([[[-np.inf] * 3, [np.inf] * 3]] * len(maps.width), dtype=np.float32)
    left_out = reached = looked = 0
    for _ in range(100):
        scene, record = scene_at(STAGE.scene, int(rng.integers(0, 21))), random_record(rng)
        regions, moved = resting.posed(scene.rotation, scene.translation), moved_records(maps, scene)
        valid = moved.texels["state"] == VALID
        levels, expected = texel_changes(record[None], everywhere, moved, valid)
        with_culling = texel_changes(record[None], everywhere, moved, valid, regions)
        assert (with_culling[0] == levels).all(), record
        assert (with_culling[1] == expected).all(), record
        looked += int(regions.filled.sum())
        left_out += int((~reached_regions(record, regions) & regions.filled).sum())
        reached += len(np.unique(regions.of_texel[levels > 0]))
    print(f"{left_out / looked:.3f} left out, {1 - reached / looked:.3f} could be")
    assert left_out > 0.6 * (looked - reached)


@pytest.mark.parametrize("scale", [1e-36, 1e-30, 1e17, 1e19, 1e30, 1e38])
def test_nothing_is_left_out_where_numbers_overflow_or_vanish(scale: float, rng: np.random.Generator) -> None:
    """Of coordinates at the ends of float32, whose products are infinite or 0."""
    factor, policy = np.float32(scale / EXTENT), Policy()
    texels = STAGE.lightmaps.texels.copy()
    texels["position"] = flush(texels["position"] * factor)
    regions = region_boxes(replace(STAGE.lightmaps, texels=texels)).posed(STAGE.scene.rotation, STAGE.scene.translation)
    valid = texels["state"] == VALID
    for _ in range(20):
        view, size = random_view(rng), float(20 * factor)
        view = replace(
            view, position=flush(view.position * factor), near=np.float32(flush(np.asarray(view.near * factor)))
        )
        place = texel_project(to_project(texels["position"], texels["normal"], view, size, policy))
        assert regions.on_screen(view, size, policy)[regions.of_texel[place["visible"] & valid]].all()
        record = random_record(rng)
        for name in ("low", "high", "reach_low", "reach_high", "light", "light_half"):
            with np.errstate(over="ignore", under="ignore"):
                record[name] = flush(record[name] * factor)
        everywhere = np.array([[[-np.inf] * 3, [np.inf] * 3]] * len(STAGE.lightmaps.width), dtype=np.float32)
        maps = replace(STAGE.lightmaps, texels=texels)
        levels, _ = texel_changes(record[None], everywhere, maps, valid)
        assert reached_regions(record, regions)[regions.of_texel[levels > 0]].all(), record


def test_a_region_of_one_texel_is_left_out_just_where_the_texel_would_be(rng: np.random.Generator) -> None:
    """Nothing lies between the ends of its intervals, so no margin is left: here to the last bit of every test.

    Texels of a flat map that is seen straight on, or nearly, with borders of pixels and of the screen between them.
    """
    count, side = 400, 16
    maps = maps_of([(1, 1)] * count)
    for _ in range(20):
        distance, size, slack = float(rng.choice([1, 2, 3])), float(rng.choice([0.25, 0.5, 1])), 0.0625
        maps.texels["position"] = 0
        place = rng.integers(-3 * side, 3 * side + 1, (count, 2)) / 4 + rng.choice(FRACTIONS, (count, 2))
        maps.texels["position"][:, :2] = place * distance
        towards = rng.choice([1, 0, -slack, -slack - 2.0**-12, -slack + 2.0**-12], count)
        maps.texels["normal"] = np.stack([np.sqrt(1 - towards**2), np.zeros(count), towards], axis=1)
        maps.texels["position"][rng.random(count) < 0.2, 0] = 0
        maps.texels["object"] = np.arange(count)
        eye = (0, 0, side * distance)
        view = look_at(np.array(eye), np.zeros(3), np.array([0, 1, 0]), 0.5, side, side)
        view = replace(view, near=np.float32(rng.choice([1, side * distance])))
        scene = replace(
            STAGE.scene,
            rotation=np.broadcast_to(np.eye(3, dtype=np.float32), (count, 3, 3)),
            translation=np.zeros((count, 3), dtype=np.float32),
        )
        policy = Policy(facing_slack=slack)
        found = region_boxes(maps).posed(scene.rotation, scene.translation).on_screen(view, size, policy)
        place = texel_project(to_project(maps.texels["position"], maps.texels["normal"], view, size, policy))
        assert found.tolist() == place["visible"].tolist()


def test_only_numbers_are_finite() -> None:
    low, high = np.array([[-1, -np.inf, 0, np.nan, -np.inf], [1, 0, np.inf, 1, np.inf]], dtype=np.float32)
    assert Interval(low, high).finite.tolist() == [True, False, False, False, False]


@pytest.mark.parametrize("policy", ["visibility", "variability", "influence"])
def test_plans_are_the_same_with_culling_and_without(policy: str) -> None:
    scenes = visited()
    with_it, without = (Selector(scenes.lightmaps, replace(POLICIES[policy], cull=cull)) for cull in (True, False))
    for frame in (0, 1, 5, 9, 10, 20, 29, 30, 31):
        context = scenes.context(frame, policy=POLICIES[policy])
        one, other = (selector.plan(context, budget=3000, cost=20, least=16) for selector in (with_it, without))
        for field in fields(one):
            assert np.array_equal(getattr(one, field.name), getattr(other, field.name)), (frame, field.name)


def test_intervals_hold_all_that_operands_between_their_ends_give(rng: np.random.Generator) -> None:
    for _ in range(200):
        ends = flush((rng.normal(size=(2, 2, 3)) * 10.0 ** rng.integers(-20, 20, (2, 2, 3))).astype(np.float32))
        one, other = (Interval(pair.min(axis=0), pair.max(axis=0)) for pair in ends)
        share = rng.uniform(0, 1, (2, 50, 3)).astype(np.float32)
        a, b = (
            flush(np.clip(i.low + t * (i.high - i.low), i.low, i.high))
            for i, t in zip((one, other), share, strict=True)
        )
        pairs = [
            (one + other, flush(a + b)),
            (one - other, flush(a - b)),
            (one * other, flush(a * b)),
            (one.scalar_product(other), dot(a, b)),
            (-one, -a),
            (Interval(one.least_size, one.greatest_size), np.abs(a)),
        ]
        for bound, value in pairs:
            assert ((bound.low <= value) & (value <= bound.high)).all()
