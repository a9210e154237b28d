"""Steps of a scene, and how long they take to be shown."""

from pathlib import Path

import numpy as np
import pytest

from lightloom.golden_model.scene.files.load import load_scene
from lightloom.golden_model.stimuli.layouts.catalogue import write_layout
from lightloom.policies.steps import BLOCK, Lag, Seen, Step, blocks, longest, steps

STEP = Step(begin=3, first=4, last=9, followed=True)


@pytest.mark.parametrize(
    ("layout", "found", "followed"),
    [
        ("dimmer", [(8, 9, 27), (28, 29, 47)], True),
        ("cut", [(12, 12, 23), (24, 24, 35), (36, 36, 47)], True),
        ("appearing", [(10, 10, 19), (20, 20, 29), (30, 30, 39), (40, 40, 47)], False),
        ("room", [], True),
        ("crossing", [], True),
        ("flicker", [], True),
    ],
)
def test_steps_of_a_scene(tmp_path: Path, layout: str, found: list[tuple[int, int, int]], followed: bool) -> None:
    """What moves for longer is no step, nor what is never still; an object that appears is one that is not followed."""
    scene = load_scene(write_layout(layout, 0, tmp_path))
    assert steps(scene, 48) == [Step(*each, followed) for each in found]
    assert steps(scene, 10) == [Step(*each, followed) for each in found if each[0] < 0], "nothing is still after it"


def seen(level: float, shape: tuple[int, int] = (16, 16)) -> Seen:
    """A frame whose reference is of one level, under straight light of 5."""
    mapped = np.full((*shape, 3), level, dtype=np.float32)
    return Seen(mapped=mapped, straight=np.full_like(mapped, 5), counted=np.ones(shape, dtype=bool))


def followed(levels: list[float], before: float = 1.0, after: float = 0.1) -> Lag:
    """The lag of a step from one level to another, where the frames from `STEP.first` on show these."""
    lag = Lag(STEP)
    lag.look(STEP.begin - 1, {"a": seen(before).mapped + 5}, seen(before))
    lag.look(STEP.begin, {"a": seen(before).mapped + 5}, seen(before))
    for number, level in enumerate(levels):
        lag.look(STEP.first + number, {"a": seen(level).mapped + 5}, seen(after))
    lag.look(STEP.last + 1, {"a": seen(77).mapped}, seen(after))
    return lag


@pytest.mark.parametrize(
    ("levels", "frames", "shown"),
    [
        ([0.1] * 6, 1, True),  # at the earliest: the change itself takes a frame more
        ([1, 0.5, 0.2, 0.18, 0.1, 0.1], 4, True),
        ([1, 0.5, 0.18, 0.2, 0.1, 0.1], 5, True),  # it has to stay shown
        ([1, 0.5, 0.1, 0.0, 0.1, 0.1], 5, True),  # too dark is not shown either
        ([1, 1, 1, 1, 1, 0.2], 7, False),
        ([1, 1, 1, 1, 1, 0.1], 6, True),
        ([1, 1, 1, 1, 1, float("nan")], 7, False),  # what is not finite counts as black
    ],
)
def test_lag(levels: list[float], frames: int, shown: bool) -> None:
    found = followed(levels).of("a", turn=2)
    assert found == {"frame": 3, "frames": frames, "turns": frames / 2, "shown": shown}


def test_edges_are_what_lag_needs() -> None:
    assert list(STEP.edges) == [2, 3, 4]


def test_small_changes_have_no_lag() -> None:
    assert followed([1.0] * 6, 1.0, 1.05).of("a", 1) is None
    assert followed([1.0] * 6, 1.0, 1.2).of("a", 1) is not None


def test_noise_within_blocks_is_no_lag() -> None:
    """Blocks are of 8 x 8 pixels, smaller at the edges, and hold what counts."""
    rng = np.random.default_rng(0)
    picture = rng.uniform(0, 2, (20, 19, 3))
    counted = rng.uniform(size=(20, 19)) < 0.5
    found = blocks(picture, counted)
    assert found.shape == (3, 3, 3)
    assert found[2, 1] == pytest.approx(picture[16:20, 8:16][counted[16:20, 8:16]].sum(axis=0))
    assert found.sum() == pytest.approx(picture[counted].sum())
    noisy = Lag(STEP)
    noisy.look(STEP.begin - 1, {}, seen(1, (64, 64)))
    for frame in range(STEP.first, STEP.last + 1):
        image = seen(0.1, (64, 64)).mapped * rng.uniform(0, 2, (64, 64, 1)) + 5
        noisy.look(frame, {"a": image}, seen(0.1, (64, 64)))
    assert max(noisy.missing["a"]) < 2 * 0.1 / BLOCK


def test_the_longest_lag() -> None:
    lags = [{"frames": 3, "turns": 2.0, "shown": True}, {"frames": 4, "turns": 1.0, "shown": False}]
    assert longest(lags) == {"lag": 4, "lag_turns": 2.0, "lags": 2, "never_shown": 1}
    assert longest([]) == {"lag": None, "lag_turns": None, "lags": 0, "never_shown": 0}
