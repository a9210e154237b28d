"""What rays bring to texels: each contribution by itself, in fixed point."""

from dataclasses import replace

import numpy as np
import pytest

from lightloom.golden_model.charts.unwrap import unwrap
from lightloom.golden_model.contract.formats import SAMPLE_SUMS, field_width
from lightloom.golden_model.driver.geometry import collector_of
from lightloom.golden_model.engine.sampling.gather import Gathered, World, gather
from lightloom.golden_model.engine.sampling.settings import Sampling
from lightloom.golden_model.engine.sampling.texel_rays import Update
from lightloom.golden_model.host.errors import InputError
from lightloom.golden_model.host.parameters import parameters
from lightloom.golden_model.host.stopwatch import Stopwatch
from lightloom.golden_model.numerics.directions import COUNT
from lightloom.golden_model.numerics.sample_spread import LUMINANCE_BITS
from lightloom.golden_model.rays.surface_shading import Surfaces
from lightloom.golden_model.rays.waves import run_together
from lightloom.golden_model.scene.lights import lights_of
from lightloom.golden_model.scene.scene import Scene
from lightloom.golden_model.structures.structure import Structure
from lightloom.golden_model.tables.lightmap import VALID
from lightloom.golden_model.tables.lights import Lights
from tests.golden_model.frame_scenes import geometry_of
from tests.golden_model.test_frame_loop import room

SEED = 21


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    """A room with mirrors and glass."""
    return room(tmp_path_factory.mktemp("scene"), SEED, specular=True)


@pytest.fixture(scope="module")
def world(scene: Scene) -> World:
    """The room, its maps evenly lit."""
    maps = unwrap(scene)
    shown = np.ones((len(maps.texels), 3), dtype=np.float32)
    surfaces = Surfaces(geometry=geometry_of(scene, maps), lightmaps=maps, irradiance=shown)
    return World(surfaces=surfaces, lightmaps=maps, lights=lights_of(scene), fraction=20, specular=scene.specular)


def sampled(scene: Scene, world: World, sampling: Sampling) -> Gathered:
    """One sample of each texel."""
    texel = np.flatnonzero(world.lightmaps.texels["state"] == VALID)
    number = np.zeros(len(texel), dtype=np.int64)
    update = Update(texel=texel, record=world.lightmaps.texels[texel], number=number, seed=SEED)
    collector, clock = collector_of(scene, Structure(scene).trace), Stopwatch()
    (done,) = run_together(collector, clock, gather(world, update, sampling, collector, clock))
    return done


def test_shadow_rays_of_what_was_met_are_contributions_of_their_own(scene: Scene, world: World) -> None:
    """What paths bring is the same to the bit with them and without, and so their results may come in at any time."""
    sampling = Sampling(directions=8, direct="rays")
    none = Lights(
        **{name: value if value is None else value[:0] for name, value in vars(world.lights).items()}
        | {"begin": world.lights.begin[:1], "of_triangle": np.full_like(world.lights.of_triangle, -1)}
    )
    paths, both = sampled(scene, replace(world, lights=none), sampling), sampled(scene, world, sampling)
    assert paths.rays["shadow"] == 0
    assert both.rays["shadow"] > 500
    assert both.rays["specular"] == paths.rays["specular"] > 100
    for name in ("sums", "squares"):
        assert (both.sums[name][:, 0] == paths.sums[name][:, 0]).all()
        assert not paths.sums[name][:, 1].any()
        assert (both.sums[name][:, 1] > 0).mean() > 0.2
    # Luminance is a sixteenth of r + 2 g + b, rounded down at each contribution: at most one a ray.
    brought = both.sums["total"] - paths.sums["total"]
    luminance = (brought[:, 0] + 2 * brought[:, 1] + brought[:, 2]) / 16
    rest = luminance - both.sums["sums"][:, 1]
    assert ((rest >= 0) & (rest <= sampling.directions)).all()


@pytest.mark.parametrize("direct", ["maps", "rays"])
def test_rays_that_a_texel_may_have_are_counted(scene: Scene, world: World, direct: str) -> None:
    sampling = Sampling(directions=8, light_samples=4, direct=direct)  # type: ignore[arg-type]
    sums = sampled(scene, world, sampling).sums
    assert (sums["rays"] == (8, 4 if direct == "maps" else 8)).all()


def test_no_update_has_more_rays_than_its_sums_hold() -> None:
    """In either mode: shadow rays of its own, or one of each path."""
    ranges = [parameters(Sampling)[name].range for name in ("directions", "light_samples")]
    most = sum(int(high or 0) for _, high in (each for each in ranges if each))
    assert most == 2 * COUNT
    total, sums, squares, rays = (field_width(SAMPLE_SUMS[name].base) for name in SAMPLE_SUMS.names or ())
    assert most * ((1 << 31) - 1) < 1 << total - 1
    assert most * ((1 << LUMINANCE_BITS) - 1) < 1 << sums
    assert most * ((1 << LUMINANCE_BITS) - 1) ** 2 < 1 << squares
    assert most < 1 << rays
    with pytest.raises(InputError, match=f"light_samples {COUNT + 1}: must be 1 to {COUNT}"):
        Sampling(light_samples=COUNT + 1)
