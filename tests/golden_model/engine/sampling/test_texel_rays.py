"""The rays of texel updates."""

import numpy as np
import pytest

from lightloom.golden_model.contract.formats import TEXEL
from lightloom.golden_model.engine.sampling.running_average import NUMBERS
from lightloom.golden_model.engine.sampling.texel_rays import (
    Update,
    indirect_rays,
    indirect_share,
    light_met,
    shadow_rays,
    texel_rays,
)
from lightloom.golden_model.numerics.directions import COUNT, tangent_of
from lightloom.golden_model.numerics.vectors import normalize
from lightloom.golden_model.scene.files.cornell_box import cornell_box
from lightloom.golden_model.scene.lights import lights_of
from lightloom.golden_model.tracing.brute_force import trace_brute_force


def some_texels(count: int) -> np.ndarray:
    """TEXEL (count,) at random places, normals and all."""
    rng = np.random.default_rng(0)
    record = np.zeros(count, dtype=TEXEL)
    record["position"] = rng.uniform(100, 400, (count, 3))
    record["normal"] = normalize(rng.normal(size=(count, 3)).astype(np.float32))
    record["tangent"] = tangent_of(record["normal"])
    return record


def updates(texels: int, number: int | np.ndarray, seed: int = 3) -> Update:
    record = some_texels(texels)
    return Update(texel=np.arange(texels) * 7, record=record, number=np.broadcast_to(number, texels), seed=seed)


@pytest.mark.parametrize("directions", [1, 4, 16, 64])
def test_indirect_rays_start_at_the_texel_and_go_up(directions: int) -> None:
    update = updates(50, 2)
    rays = indirect_rays(update, directions).reshape(50, directions)
    record = update.record[:, None]
    assert (rays["origin"] == record["position"]).all()
    cosine = (rays["direction"] * record["normal"]).sum(axis=-1)
    assert (cosine > 0).all()
    assert np.allclose((rays["direction"] ** 2).sum(axis=-1), 1, atol=1e-6)
    assert (rays["t_min"] == 0).all()
    assert np.isinf(rays["t_max"]).all()


def test_successive_updates_run_through_the_whole_table() -> None:
    directions = 64
    runs = COUNT // directions
    cosine = []
    for number in range(runs):
        update = updates(1, number)
        rays = indirect_rays(update, directions)
        cosine.append((rays["direction"] * update.record["normal"]).sum(axis=-1))
    together = np.concatenate(cosine).astype(np.float64)
    # Of the cosine distribution: the mean is 2/3, the mean square 1/2; 1024 heights stand in for it.
    assert together.mean() == pytest.approx(2 / 3, abs=1e-5)
    assert (together**2).mean() == pytest.approx(1 / 2, abs=1e-4)
    assert len({c.tobytes() for c in cosine}) == runs


@pytest.mark.parametrize("directions", [2, 16, 64])
def test_the_number_after_the_last_takes_the_run_that_comes_next(directions: int) -> None:
    """Numbers begin again from the middle, which is a whole number of rounds of the table."""
    after, begun = (indirect_rays(updates(20, number), directions) for number in (NUMBERS // 2, 0))
    assert (after == begun).all()
    assert NUMBERS == COUNT


def test_neighbours_and_seeds_turn_differently() -> None:
    one = indirect_rays(updates(40, 0), 16)["direction"]
    assert len(np.unique(one.reshape(40, -1), axis=0)) == 40
    other = indirect_rays(updates(40, 0, seed=4), 16)["direction"]
    assert (one != other).any()


def test_share_is_pi_over_the_number_of_directions() -> None:
    radiance = np.array([[1, 2, 0]], dtype=np.float32)
    assert indirect_share(radiance, 16)[0] == pytest.approx(radiance[0] * np.pi / 16, rel=1e-7)


def test_shadow_rays_go_on_where_the_last_update_stopped() -> None:
    lights = lights_of(cornell_box())
    rays, weight = shadow_rays(updates(30, 5), lights, 4)
    assert rays.shape == (120,)
    assert weight.shape == (120, 3)
    late, _ = shadow_rays(updates(30, 2), lights, 10)  # samples 20 to 29 of each, the others 20 to 23
    assert (late.reshape(30, 10)[:, :4] == rays.reshape(30, 4)).all()


def test_texels_may_have_different_numbers_of_directions() -> None:
    """Each gets the rays that it would get among texels of its own kind."""
    update = updates(12, np.arange(12) * 300)
    directions = np.array([1, 16, 64, 4, 16, 1, 4096, 2, 16, 8, 64, 16])
    lights = lights_of(cornell_box())
    mixed = texel_rays(update, lights, directions, 4, balanced=True)
    assert len(mixed.indirect) == directions.sum()
    for count in np.unique(directions):
        alone = texel_rays(update, lights, int(count), 4, balanced=True)
        for texel in np.flatnonzero(directions == count):
            assert (mixed.indirect[mixed.indirect_slot == texel] == alone.indirect[alone.indirect_slot == texel]).all()
            assert (mixed.light[mixed.shadow_slot == texel] == alone.light[alone.shadow_slot == texel]).all()
    radiance = np.ones((len(mixed.indirect), 3), dtype=np.float32)
    share = indirect_share(radiance, directions[mixed.indirect_slot])
    for texel in np.arange(12):
        assert share[mixed.indirect_slot == texel, 0].sum() == pytest.approx(np.pi, rel=1e-5)


def test_only_shadow_rays_that_can_carry_light_are_traced() -> None:
    """What an update really costs: texels that look away from the lamp need no shadow ray."""
    lights = lights_of(cornell_box())
    update = updates(60, 3)
    rays, contribution = shadow_rays(update, lights, 8)
    some = texel_rays(update, lights, 4, 8, balanced=False)
    assert (some.shadow == rays[contribution.any(axis=1)]).all()
    assert (some.light == contribution[contribution.any(axis=1)]).all()
    assert len(some) == 60 * 4 + len(some.shadow)
    assert 0 < len(some.shadow) < 60 * 8
    away = update.record["normal"][:, 1] < -0.99  # the lamp is above them all
    assert not np.isin(some.shadow_slot, np.flatnonzero(away)).any()


def test_without_light_samples_there_is_no_direct_light() -> None:
    """For maps that hold indirect light alone."""
    scene = cornell_box()
    lights, update = lights_of(scene), updates(40, 0)
    rays = texel_rays(update, lights, 16, 0, balanced=True)
    assert len(rays.shadow) == 0
    assert len(rays) == 640
    hits = trace_brute_force(scene.triangles, rays.indirect)
    assert np.isin(hits["primitive"], np.flatnonzero(lights.of_triangle >= 0)).any(), "some rays meet the lamp"
    assert not light_met(update, lights, rays, hits).any()


@pytest.mark.parametrize(("directions", "light_samples"), [(4, 4), (16, 4), (64, 1)])
def test_both_ways_to_find_a_light_share_it_out_and_neither_glares(directions: int, light_samples: int) -> None:
    """Together they bring what shadow rays alone bring, whatever the numbers of rays; what one brings is bounded."""
    scene = cornell_box()
    lights = lights_of(scene)
    lamp = np.flatnonzero(lights.of_triangle >= 0)  # alone: nothing is in its way
    record = some_texels(30)
    record["normal"], record["position"][:, 1] = (0, 1, 0), 450
    record["tangent"] = tangent_of(record["normal"])
    shared, alone = np.zeros(30), np.zeros(30)
    for number in range(200):
        update = Update(texel=np.arange(30), record=record, number=np.full(30, number), seed=1)
        rays = texel_rays(update, lights, directions, light_samples, balanced=True)
        hits = trace_brute_force(scene.triangles[lamp], rays.indirect)
        hits["primitive"] = np.where(hits["primitive"] >= 0, lamp[hits["primitive"]], -1)
        met = indirect_share(light_met(update, lights, rays, hits), directions)
        for slot, brought in ((rays.shadow_slot, rays.light), (rays.indirect_slot, met)):
            assert brought.max(initial=0) <= 1.001 * np.pi / directions * lights.emitted.max()
            np.add.at(shared, slot, brought[:, 0].astype(np.float64))
        slots, light = np.repeat(np.arange(30), 16), shadow_rays(update, lights, 16)[1]
        np.add.at(alone, slots, light[:, 0].astype(np.float64))
    assert shared.sum() == pytest.approx(alone.sum(), rel=0.01)
    assert shared == pytest.approx(alone, rel=0.1)
