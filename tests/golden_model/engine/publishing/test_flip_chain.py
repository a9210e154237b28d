"""The flip chain: versions are complete before they are read, and what is read never changes."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lightloom.golden_model.contract.formats import ONE_SAMPLE
from lightloom.golden_model.engine.publishing.flip_chain import FlipChain
from lightloom.golden_model.engine.publishing.publisher import Difference, Publisher
from tests.golden_model.engine.publishing.test_publisher import maps_of, ragged_maps, state_of, valid_texels


class Maintained:
    """Maps whose texels change at random, with the published version of each step."""

    def __init__(self, seed: int, updates: int = 5):
        self.rng = np.random.default_rng(seed)
        self.maps = ragged_maps(seed, [(33, 20), (9, 9)])
        self.valid = valid_texels(self.maps)
        self.updates = updates
        self.state = state_of(np.ones((len(self.maps.texels), 3)), 0)
        self.state["count"][self.valid] = ONE_SAMPLE
        self.publisher = Publisher(self.maps)
        self.published = self.publisher.everything(self.state)

    def step(self) -> Difference:
        texel = self.rng.choice(self.valid, self.updates)
        self.state["irradiance"][texel] = self.rng.uniform(0, 9, (len(texel), 3))
        difference = self.publisher.difference(self.published, self.state, texel)
        self.published["rgba"][difference.texel] = difference.rgba
        return difference


@settings(deadline=None, max_examples=25, derandomize=True)
@given(seed=st.integers(0, 2**20), length=st.integers(1, 8))
def test_readers_and_a_writer_in_any_order(seed: int, length: int) -> None:
    """Begin, write, commit, read and release interleaved at random: every read is the version as it was published."""
    rng = np.random.default_rng(seed)
    maintained = Maintained(seed)
    chain = FlipChain(maintained.published, length)
    expected = {0: maintained.published.copy()}
    views: dict[int, np.ndarray] = {}
    oldest, newest, writing = 0, 0, False
    for _ in range(200):
        action = rng.integers(0, 4)
        if action == 0 and not writing and newest - oldest + 1 < length:
            chain.begin(newest + 1)
            writing = True
        elif action == 1 and writing:
            chain.write(newest + 1, maintained.step())
        elif action == 2 and writing:
            chain.commit(newest + 1)
            writing, newest = False, newest + 1
            expected[newest] = maintained.published.copy()
        elif action == 3 and (newest > oldest or rng.integers(0, 3) == 0) and oldest <= newest:
            chain.release(oldest)
            oldest += 1
        for version in range(oldest, newest + 1):
            if rng.integers(0, 2):
                views[version] = chain.read(version)
        assert chain.figures().versions == newest - oldest + 1 + writing <= length
    assert newest > 4, f"seed {seed}: too little happened"
    for version, view in views.items():
        assert (view["rgba"] == expected[version]["rgba"]).all(), f"seed {seed}, version {version}"


def test_what_cannot_be_done() -> None:
    maintained = Maintained(1)
    chain = FlipChain(maintained.published, 2, first=10)
    with pytest.raises(ValueError, match="version 11 cannot be read"):
        chain.read(11)
    with pytest.raises(ValueError, match="version 12 cannot begin"):
        chain.begin(12)
    with pytest.raises(ValueError, match="version 11 is not being written"):
        chain.write(11, maintained.step())
    chain.begin(11)
    chain.write(11, maintained.step())
    with pytest.raises(ValueError, match="version 11 cannot be read"):
        chain.read(11)
    chain.commit(11)
    with pytest.raises(ValueError, match="version 11 is not being written"):
        chain.write(11, maintained.step())
    with pytest.raises(ValueError, match="2 versions are in flight"):
        chain.begin(12)
    with pytest.raises(ValueError, match="version 11 cannot be released: the oldest is 10"):
        chain.release(11)
    chain.release(10)
    with pytest.raises(ValueError, match="version 10 cannot be read"):
        chain.read(10)
    with pytest.raises(ValueError, match="read-only"):
        chain.read(11)["rgba"][0] = 1
    for length in (0, 9):
        with pytest.raises(ValueError, match="must be 1 to 8"):
            FlipChain(maintained.published, length)


def test_memory_is_one_map_and_what_differs() -> None:
    maps = maps_of([(64, 64)])
    state = state_of(np.ones((4096, 3)))
    publisher = Publisher(maps)
    published = publisher.everything(state)
    chain = FlipChain(published, 3)
    whole = 4096 + 1024 + 256 + 64 + 16 + 4 + 1
    for version, texel in ((1, 0), (2, 4095)):
        chain.begin(version)
        chain.write(version, publisher.difference(published, state, np.array([texel])))
        chain.commit(version)
    figures = chain.figures()
    assert figures.versions == 3
    assert figures.baseline_bytes == 8 * whole
    assert figures.regions == {1: 1, 2: 1}
    assert figures.texels == {1: 88, 2: 88}
    assert figures.difference_bytes == 2 * (88 * 8 + 4)
    chain.release(0)
    assert chain.figures().texels == {2: 88}
    chain.release(1)
    chain.release(2)
    assert chain.figures().versions == 0
    assert chain.figures().difference_bytes == 0


def test_one_version_alone_takes_turns() -> None:
    maintained = Maintained(2)
    chain = FlipChain(maintained.published, 1)
    for version in range(1, 5):
        before = chain.read(version - 1)
        kept = before.copy()
        with pytest.raises(ValueError, match="1 versions are in flight"):
            chain.begin(version)
        chain.release(version - 1)
        chain.begin(version)
        chain.write(version, maintained.step())
        chain.commit(version)
        assert (chain.read(version)["rgba"] == maintained.published["rgba"]).all()
        assert (before["rgba"] == kept["rgba"]).all()
