"""The rays of texel updates."""

import numpy as np
import pytest

from golden_model.cornell_box import cornell_box
from golden_model.directions import COUNT, tangent_of
from golden_model.formats import TEXEL
from golden_model.lights import lights_of
from golden_model.sampling import Update, indirect_rays, indirect_share, shadow_rays
from golden_model.vectors import normalize


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
def test_indirect_rays_start_above_the_surface_and_go_up(directions: int) -> None:
    update = updates(50, 2)
    rays = indirect_rays(update, directions, np.float32(0.25)).reshape(50, directions)
    record = update.record[:, None]
    assert np.allclose(rays["origin"], record["position"] + 0.25 * record["normal"], atol=1e-5)
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
        rays = indirect_rays(update, directions, np.float32(0))
        cosine.append((rays["direction"] * update.record["normal"]).sum(axis=-1))
    together = np.concatenate(cosine).astype(np.float64)
    # Of the cosine distribution: the mean is 2/3, the mean square 1/2; 1024 heights stand in for it.
    assert together.mean() == pytest.approx(2 / 3, abs=1e-5)
    assert (together**2).mean() == pytest.approx(1 / 2, abs=1e-4)
    assert len({c.tobytes() for c in cosine}) == runs


def test_neighbours_and_seeds_turn_differently() -> None:
    one = indirect_rays(updates(40, 0), 16, np.float32(0))["direction"]
    assert len(np.unique(one.reshape(40, -1), axis=0)) == 40
    other = indirect_rays(updates(40, 0, seed=4), 16, np.float32(0))["direction"]
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
