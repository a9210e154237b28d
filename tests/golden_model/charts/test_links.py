"""What comes between texels: points that are moved out of it, links that it parts, levels that stop at it."""

from dataclasses import replace

import numpy as np
import pytest

from lightloom.golden_model.charts.read_levels import deepest_levels
from lightloom.golden_model.charts.unwrap import unwrap
from lightloom.golden_model.contract.formats import TEXEL_STATE
from lightloom.golden_model.engine.publishing.publisher import Publisher
from lightloom.golden_model.rays.surface_shading import readable
from lightloom.golden_model.scene.scene import Scene
from lightloom.golden_model.structures.structure import Structure
from lightloom.golden_model.tables.lightmap import BURIED, DOWN, RIGHT, VALID, Lightmaps, joined, sample
from tests.golden_model.frame_scenes import scene_of
from tests.golden_model.leak_scenes import block_through_table, box, room, thin_wall


def maps_of(scene: Scene) -> Lightmaps:
    return unwrap(scene, trace=Structure(scene).trace)


def on(scene: Scene, maps: Lightmaps, name: str) -> np.ndarray:
    return np.asarray(maps.texels["object"] == scene.object_names.index(name))


def test_texels_that_reads_beside_a_block_meet_are_sampled_beside_it() -> None:
    scene = scene_of([*room((-2, 0, -2), (2, 2, 2)), box("block", (-0.53, 0, -0.48), (0.44, 1, 0.51))], texel_size=0.1)
    maps, before = maps_of(scene), unwrap(scene)
    floor = on(scene, maps, "floor")
    centre, point = before.texels["position"].astype(np.float64), maps.texels["position"].astype(np.float64)

    def inside(place: np.ndarray, more: float) -> np.ndarray:
        low, high = np.array([-0.53, -0.48]) + more, np.array([0.44, 0.51]) - more
        return np.asarray((place[:, [0, 2]] > low).all(axis=1) & (place[:, [0, 2]] < high).all(axis=1))

    under = floor & inside(centre, 0)
    moved = under & (maps.texels["state"] == VALID)
    assert 30 < moved.sum() < under.sum() / 2, "the rim"
    assert not inside(point[moved], 0).any()
    assert (np.abs(point - centre)[moved].max(axis=1) < 0.1).all(), "less than a texel away"
    deep = floor & inside(centre, 0.1)
    assert (maps.texels["state"][deep] == BURIED).all()
    unmoved = maps.texels["position"] == before.texels["position"]
    assert unmoved[~moved & (maps.texels["state"] == VALID) & floor].all()


def test_a_block_that_stands_in_the_floor_is_sampled_above_it() -> None:
    scene = block_through_table()
    maps = maps_of(scene)
    side = on(scene, maps, "block") & (np.abs(maps.texels["normal"][:, 1]) < 0.1)
    lowest = maps.texels["position"][side & (maps.texels["state"] == VALID), 1]
    assert lowest.min() > 0
    assert (unwrap(scene).texels["position"][side, 1] < 0).any(), "else there is nothing to show"


def test_links_end_at_what_stands_on_a_chart() -> None:
    """A wall thicker than what charts are cut for, and shorter than the floor."""
    scene = scene_of([*room((-2, 0, -2), (2, 2, 2)), box("wall", (-0.14, 0, -2), (0.14, 2, 0.6))], texel_size=0.1)
    maps = maps_of(scene)
    assert maps.links is not None
    floor = on(scene, maps, "floor") & (maps.texels["state"] == VALID)
    owner = maps.texels["object"]
    x, z = maps.texels["position"][:, 0], maps.texels["position"][:, 2]
    width = maps.width[owner].astype(np.int64)
    for linked, step in zip(joined(maps), (1, width), strict=True):
        first = np.flatnonzero(linked & floor)
        second = first + np.broadcast_to(step, len(owner))[first]
        crossing = floor[second] & ((x[first] < 0) != (x[second] < 0))
        assert (z[np.where(crossing, first, second)][crossing] > 0.55).all(), "beyond the end of the wall"
    apart = joined(replace(maps, links=None))
    lost = [int((a & ~b & floor).sum()) for a, b in zip(apart, joined(maps), strict=True)]
    assert sum(lost) < 120, "all others are joined"


@pytest.mark.parametrize("reach", [1.0, 0.7])
def test_no_level_is_read_through_a_wall(reach: float) -> None:
    """Thin, and thick enough for the chart to be whole: of all levels, reads see their own side alone."""
    thick = scene_of(
        [*room((-2, 0, -2), (2, 2, 2)), box("wall", (-0.2, 0, -2), (0.2, 2, -2 + 4 * reach))], texel_size=0.1
    )
    for scene, half in ((thin_wall(reach=reach), 0.01), (thick, 0.2)):
        maps = maps_of(scene)
        assert maps.deepest is not None
        floor = scene.object_names.index("floor")
        every = np.flatnonzero(on(scene, maps, "floor") & (maps.texels["state"] == VALID))
        values, place = levels_of_sides(maps), maps.texels["position"][every]
        ends = scene.corners[scene.object_id == floor][..., 2]
        low, high = ends.min(), ends.max()
        for level in (0, 1, 2, 3):
            # Farther from the wall's end than a read of the level reaches round it.
            before = place[:, 2] < low + (high - low) * reach - (0 if reach == 1 else 0.15 * 2**level)
            texel = every[before & (np.abs(place[:, 0]) > half)]
            row, column = np.divmod(texel - maps.offset[floor], maps.width[floor])
            uv = np.stack([column + 0.5, row + 0.5], axis=1).astype(np.float32)
            found = sample(maps, values, np.full(len(texel), floor), uv, np.full(len(texel), level * 256))[:, 0]
            assert len(texel) > 0
            assert np.abs(found - (maps.texels["position"][texel, 0] > 0)).max() < 1e-6, (half, level)
        assert (maps.deepest[every] >= 2).mean() > 0.5, "levels are read where nothing stands"


def levels_of_sides(maps: Lightmaps) -> np.ndarray:
    """What readers see of maps that show 1 on the right and 0 on the left."""
    state = np.zeros(len(maps.texels), dtype=TEXEL_STATE)
    state["irradiance"] = (maps.texels["position"][:, :1] > 0) * np.ones(3, dtype=np.float32)
    state["count"] = 1
    return readable(Publisher(maps).everything(state))


def test_levels_of_maps_without_links_are_those_of_charts_alone() -> None:
    scene = thin_wall()
    maps = maps_of(scene)
    free = deepest_levels(replace(maps, links=None))
    assert maps.deepest is not None
    assert (maps.deepest <= free).all()
    everywhere = np.full(len(maps.texels), RIGHT | DOWN, dtype=np.uint8)
    assert (deepest_levels(replace(maps, links=everywhere)) <= free).all()
