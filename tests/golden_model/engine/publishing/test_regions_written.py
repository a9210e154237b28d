"""How many regions the updates of a frame rewrite, in the Cornell box."""

from functools import cache

import numpy as np
import pytest

from lightloom.golden_model.contract.formats import ONE_SAMPLE
from lightloom.golden_model.engine.publishing.publisher import Difference
from lightloom.golden_model.engine.sampling.settings import Sampling
from lightloom.golden_model.engine.selection.policy import POLICIES
from lightloom.golden_model.renderer import Renderer
from lightloom.golden_model.scene.files.cornell_box import cornell_box
from lightloom.golden_model.tables.lightmap import VALID

SEED = 20261130


@cache
def settled() -> Renderer:
    """Every texel has a sample, so that nothing is filled from afar."""
    unprimed = Sampling(priming=0)
    maps = Renderer(cornell_box(), width=8, height=8, budget=20000, sampling=unprimed, policy=POLICIES["influence"])
    maps.state["count"] = ONE_SAMPLE
    return maps


def written(maps: Renderer, texel: np.ndarray) -> int:
    """Regions that updates of texels (M,) rewrite."""
    return len(maps.publisher.difference(maps.publisher.everything(maps.state), maps.state, texel).region)


@pytest.mark.parametrize(("updates", "most"), [(100, 40), (300, 100), (1000, 333), (2000, 666)])
def test_updates_in_the_order_of_turns_share_regions(updates: int, most: int) -> None:
    """Of so many a third, and of a few not many more: wherever in the order a frame begins."""
    maps = settled()
    order = maps.maintainer.selector.order
    order = order[maps.lightmaps.texels["state"][order] == VALID]
    for first in np.random.default_rng(SEED).integers(len(order), size=12):
        found = written(maps, np.roll(order, -first)[:updates])
        assert found <= most, f"from {first} on, seed {SEED}"


def test_updates_in_a_corner_of_a_map_write_what_lies_there() -> None:
    maps = settled()
    for number, (width, height) in enumerate(zip(maps.lightmaps.width, maps.lightmaps.height, strict=True)):
        row, column = np.divmod(np.arange(100), 10)
        inside = (row < height) & (column < width)
        texel = (maps.lightmaps.offset[number] + row * width + column)[inside]
        assert 0 < written(maps, texel[maps.publisher.regions.covered[texel]]) <= 20


def test_a_settled_frame_writes_what_updates_and_fills_touch(monkeypatch: pytest.MonkeyPatch) -> None:
    """No region more, though what is read is smoothed; nothing is stale where nothing changes."""
    once = Sampling(primed=1)
    maps = Renderer(cornell_box(), width=32, height=32, budget=20000, sampling=once, policy=POLICIES["influence"])
    writes_what_is_touched(maps, monkeypatch)


@pytest.mark.long
def test_a_frame_of_the_film_does_so_too(monkeypatch: pytest.MonkeyPatch) -> None:
    """The Cornell box at frame 120, as it is rendered."""
    maps = Renderer(cornell_box(), width=256, height=256, budget=20000)
    for _ in range(120):
        maps.frame()
    writes_what_is_touched(maps, monkeypatch)


def writes_what_is_touched(maps: Renderer, monkeypatch: pytest.MonkeyPatch) -> None:
    """The next frames."""
    found: list[Difference] = []
    make = maps.publisher.difference

    def difference(before: np.ndarray, state: np.ndarray, texel: np.ndarray) -> Difference:
        found.append(make(before, state, texel))
        return found[-1]

    monkeypatch.setattr(maps.publisher, "difference", difference)
    for _ in range(4):
        done = maps.frame().maintenance
        updated = done.texels
        shown = np.isin(maps.lightmaps.fill, np.concatenate([updated, done.stale]))
        touched = np.unique(maps.publisher.regions.of_texel[shown])
        assert np.sort(found[-1].region).tolist() == touched.tolist()
        assert len(updated) > 1000
        assert len(touched) <= len(updated) / 3
