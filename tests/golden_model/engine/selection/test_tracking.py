"""The tracking signal: averages that samples keep departing from are worth less, and those at rest are not."""

import numpy as np
import pytest

from lightloom.golden_model.contract.formats import COUNT_MAX, ONE_SAMPLE, TEXEL_STATE
from lightloom.golden_model.engine.sampling.confidence import limit
from lightloom.golden_model.engine.sampling.running_average import Blending, blend_texels
from lightloom.golden_model.engine.selection.neighbourhoods import Windows
from lightloom.golden_model.engine.selection.tracking import LEAST_WORTH, most_worth
from tests.golden_model.engine.publishing.test_publisher import maps_of
from tests.golden_model.engine.sampling.test_running_average import FRACTION, sums_of

MAPS = maps_of([(48, 40)])
WINDOWS = Windows(MAPS)
NOISE = 0.1
QUIET = Blending(alpha_min=np.float32(1 / 32), notice_factor=255, notice_floor=4095)
"""Nothing is noticed: what follows is the signal's alone."""


class Texels:
    """A map of samples with noise, and how often the signal spoke."""

    def __init__(self, seed: int, track: bool):
        self.state = np.zeros(len(MAPS.texels), dtype=TEXEL_STATE)
        self.spoke = 0
        self._rng, self._track = np.random.default_rng(seed), track

    def update(self, level: float) -> None:
        """Every texel once."""
        if self._track:
            most = most_worth(self.state, WINDOWS)
            self.spoke += int((most < COUNT_MAX).sum())
            limit(self.state, most)
        sample = level * np.repeat(self._rng.normal(1, NOISE, (len(self.state), 1)), 3, axis=1)
        blend_texels(self.state, np.arange(len(self.state)), sums_of(sample.astype(np.float32)), FRACTION, QUIET, 0)

    def mean(self) -> float:
        return float(self.state["irradiance"][:, 0].mean())


def updates_until_followed(step: float, track: bool, most: int) -> int:
    """Updates until nine tenths of a step are shown, `most` if not before."""
    seed = 5
    texels = Texels(seed, track)
    for _ in range(100):
        texels.update(1.0)
    for count in range(1, most):
        texels.update(1.0 + step)
        if abs(1 + step - texels.mean()) <= abs(step) / 10:
            return count
    return most


@pytest.mark.parametrize("step", [0.2, -0.2, 0.4])
def test_a_step_that_no_sample_tells_is_followed(step: float) -> None:
    """Of two or four standard deviations of a sample. With a weight of 1/32 it would take 73 updates."""
    assert updates_until_followed(step, True, 80) <= 22
    assert updates_until_followed(step, False, 80) > 60


def test_what_is_at_rest_stays_worth_what_it_was() -> None:
    """The noise of 63 samples, where a least weight of 0.1 has that of 19; the signal speaks of one texel in 200."""
    seed, rounds = 9, 160
    texels = Texels(seed, True)
    for _ in range(rounds):
        texels.update(1.0)
    assert texels.spoke / (rounds * len(texels.state)) < 0.005, f"seed {seed}"
    assert texels.state["irradiance"][:, 0].std() < NOISE / np.sqrt(50), f"seed {seed}"


def test_only_settled_texels_of_the_window_are_heard() -> None:
    state = np.zeros(len(MAPS.texels), dtype=TEXEL_STATE)
    middle = 20 * 48 + 20
    window = [middle + 48 * dy + dx for dy in (-1, 0, 1) for dx in (-1, 0, 1)]
    state["count"] = 100 * ONE_SAMPLE
    state["deviation"] = 40
    assert (most_worth(state, WINDOWS) == COUNT_MAX).all()
    state["bias"][window] = -40
    assert most_worth(state, WINDOWS)[middle] == LEAST_WORTH, "as far off as samples are apart: two samples"
    state["bias"][window] = -20
    assert most_worth(state, WINDOWS)[middle] == 25 * 4, "half as far: (1.25 * 2)**2 samples, in 16ths"
    state["bias"][window] = -13
    assert most_worth(state, WINDOWS)[middle] == COUNT_MAX, "less than three standard deviations of nine texels"
    state["bias"][window], state["count"][window] = -40, 8 * ONE_SAMPLE - 1
    assert (most_worth(state, WINDOWS)[window] == COUNT_MAX).all()
