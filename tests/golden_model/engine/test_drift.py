"""Drift: noise about the averages is none, a shift of a whole map is, by both thresholds and in exact integers.

And what it does: two frames to the same side, and samples weigh more.
"""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lightloom.golden_model.engine import maintainer
from lightloom.golden_model.engine.drift import departures
from lightloom.golden_model.engine.sampling.running_average import blend_texels
from lightloom.golden_model.engine.sampling.settings import Sampling
from lightloom.golden_model.engine.selection.policy import Policy
from lightloom.golden_model.renderer import Renderer
from lightloom.golden_model.scene.files.cornell_box import cornell_box
from lightloom.golden_model.scene.scene import Scene
from tests.golden_model.moving_scenes import scene_of

FRACTION = 16
UNIT = 2.0**-8
"""What luminances are added up in: 2**8 of the accumulators' last places."""
LEAST, CERTAINTY = Policy().drift_least, Policy().drift_certainty


def grey(units: list[int] | np.ndarray) -> np.ndarray:
    """(M,) luminances in units to (M, 3) float32."""
    return np.repeat((np.asarray(units) * UNIT).astype(np.float32)[:, None], 3, axis=1)


def departs(before: list[int] | np.ndarray, after: list[int] | np.ndarray, least: int, certainty: int) -> bool:
    """Whether a single map departs whose texels had averages `before` and get samples `after`, in units."""
    owner = np.zeros(len(before), dtype=np.int64)
    return bool(departures(owner, grey(before), grey(after), 1, FRACTION, least, certainty)[0] != 0)


def test_noise_about_the_averages_is_no_departure_and_a_shift_of_all_is() -> None:
    """200 maps of 400 samples with noise of 20 %: chance exceeds three times its measure in one map out of 370.

    A shift of 5 % is five times the measure, rather less where few bright texels weigh most.
    """
    seed, maps, samples = 5, 200, 400
    random = np.random.default_rng(seed)
    owner = np.repeat(np.arange(maps), samples)
    before = random.integers(500, 2000, len(owner))
    noise = random.normal(0, 0.2, len(owner))
    for shift, low, high in ((0.0, 0, 0.015), (0.05, 0.9, 1), (-0.05, 0.9, 1)):
        after = np.maximum(before * (1 + shift + noise), 0).round()
        found = departures(owner, grey(before), grey(after), maps, FRACTION, LEAST, CERTAINTY)
        share = (found != 0).mean()
        assert low <= share <= high, f"seed {seed}, shift {shift}: {share}"
        assert not shift or (found[found != 0] == np.sign(shift)).all()


def test_departures_that_cancel_are_none() -> None:
    assert not departs([1000] * 64, [1900, 100] * 32, 1, 1)
    assert departs([1000] * 64, [1900, 1100] * 32, 1, 1)


def test_a_small_part_of_the_light_does_not_count() -> None:
    """3/256 of sixteen averages of 256 units are 48: more than that has to come together."""
    before = [256] * 16
    assert not departs(before, [259] * 16, 3, 2)
    assert departs(before, [259] * 15 + [260], 3, 2)
    assert not departs(before, [253] * 16, 3, 2)
    assert departs(before, [253] * 15 + [252], 3, 2)


def test_few_samples_prove_nothing() -> None:
    """Equal departures d of n samples: (n d)**2 > certainty**2 n d**2 where n > certainty**2."""
    for certainty in (1, 2, 3, 15):
        enough = certainty * certainty
        assert not departs([100] * enough, [150] * enough, LEAST, certainty)
        assert departs([100] * (enough + 1), [150] * (enough + 1), LEAST, certainty)


def test_light_in_the_dark_and_no_samples() -> None:
    assert departs([0] * 8, [1] * 8, 256, 2)
    assert not departs([0] * 8, [0] * 8, 1, 1)
    assert not departs([], [], 1, 1)


@settings(max_examples=60, deadline=None, derandomize=True)
@given(
    samples=st.lists(st.tuples(st.integers(0, 2), st.integers(0, 2**23), st.integers(0, 2**23)), max_size=24),
    least=st.integers(1, 256),
    certainty=st.integers(1, 15),
    seed=st.integers(0, 2**32),
)
def test_sums_are_exact_by_map_and_free_of_order(
    samples: list[tuple[int, int, int]], least: int, certainty: int, seed: int
) -> None:
    """Against Python's integers; 2**23 units saturate, as 32 bits of the accumulators do."""
    owner = np.array([s[0] for s in samples], dtype=np.int64)
    before, after = ([s[k] for s in samples] for k in (1, 2))
    expected = []
    for number in range(3):
        most = 2**23 - 1
        pairs = [(min(old, most), min(new, most)) for which, old, new in samples if which == number]
        light, total = sum(old for old, _ in pairs), sum(new - old for old, new in pairs)
        squares = sum((new - old) ** 2 for old, new in pairs)
        beyond = 256 * abs(total) > least * light and total**2 > certainty**2 * squares
        expected.append(int(np.sign(total)) * beyond)
    found = departures(owner, grey(before), grey(after), 3, FRACTION, least, certainty)
    assert found.tolist() == expected
    order = np.random.default_rng(seed).permutation(len(samples))
    mixed = departures(owner[order], grey(before)[order], grey(after)[order], 3, FRACTION, least, certainty)
    assert mixed.tolist() == expected


def test_widths_of_the_sums_of_65536_glaring_samples() -> None:
    """24 + 16 bits for the sums with their sign and 46 + 16 for the squares hold them."""
    before, after = np.zeros(65536, dtype=np.int64), np.full(65536, 2**23)
    assert departs(before, after, 256, 15)
    assert departs(after, before, 255, 15)
    assert not departs(after, before, 256, 15), "not more than all light can go"


def test_sums_of_a_quarter_million_glaring_samples_do_not_overflow() -> None:
    """Of 2**18 samples 2 k more become glaring than dark, and with k <= 2**9 that may be chance; 64 bits would wrap."""
    count = 1 << 18
    for more, beyond in ((300, False), (512, False), (513, True), (-512, False), (-513, True)):
        before = np.zeros(count, dtype=np.int64)
        before[count // 2 + more :] = 2**23
        assert departs(before, 2**23 - before, 1, 2) == beyond, more


def test_two_frames_to_the_same_side_make_a_drift(monkeypatch: pytest.MonkeyPatch) -> None:
    """Departures frame by frame, by a script; samples are heavy in the frame after two that are equal and not 0."""
    sides = [1, -1, -1, 0, 1, 1, 1, -1]
    script = iter(sides)
    heavy: list[set[int]] = []

    def blended(state: np.ndarray, texel: np.ndarray, *rest: Any) -> None:
        heavy[-1].update(state["heavy"][texel].tolist())
        blend_texels(state, texel, *rest)

    renderer = Renderer(
        replace(cornell_box(), texel_size=100.0),
        width=24,
        height=20,
        budget=200,
        sampling=Sampling(directions=4, light_samples=2, priming=0),
        policy=Policy(influence="off", notice=False),
    )
    maps = len(renderer.lightmaps.width)
    monkeypatch.setattr(maintainer, "departures", lambda *_: np.full(maps, next(script), dtype=np.int8))
    monkeypatch.setattr(maintainer, "blend_texels", blended)
    for _ in sides:
        heavy.append(set())
        renderer.frame()
    assert heavy == [{0}, {0}, {0}, {1}, {0}, {0}, {1}, {1}]


def test_texels_with_heavy_updates_to_come_keep_as_many_in_a_drift() -> None:
    """Of two maps one drifts: there a texel without any gets one."""
    scene = replace(cornell_box(), texel_size=100.0)
    sampling = Sampling(directions=4, light_samples=2, priming=0)
    renderer = Renderer(scene, width=24, height=20, budget=2000, sampling=sampling, policy=Policy(influence="off"))
    owner = renderer.lightmaps.texels["object"]
    renderer.maintainer._departures[:, owner[0]] = 1
    renderer.state["heavy"] = np.arange(len(owner)) % 4
    before = renderer.state["heavy"].astype(int)
    done = renderer.frame().maintenance.texels
    drifts = owner[done] == owner[0]
    assert 0 < drifts.sum() < len(done)
    weighed = np.where(drifts, np.maximum(before[done], 1), before[done])
    assert (renderer.state["heavy"][done] == np.maximum(weighed - 1, 0)).all()


def switched(folder: Path, frame: int) -> Scene:
    """A room whose shining ceiling goes down to a tenth after a frame."""
    return scene_of(
        folder,
        f"""
texel_size = 0.5
[camera]
position = [0, 0, 1.5]
target = [0, 0, 0]
[[box]]
name = "ball"
center = [0, -0.5, 0]
size = [0.5, 0.5, 0.5]
[[quad]]
name = "floor"
corners = [[-2, -1, 2], [2, -1, 2], [2, -1, -2], [-2, -1, -2]]
albedo = [0.9, 0.9, 0.9]
[[quad]]
name = "wall"
corners = [[-2, -1, -2], [2, -1, -2], [2, 2, -2], [-2, 2, -2]]
albedo = [0.9, 0.9, 0.9]
[[quad]]
name = "lamp"
corners = [[-2, 2, -2], [2, 2, -2], [2, 2, 2], [-2, 2, 2]]
emission = [5, 5, 5]
[[quad.path]]
frame = {frame}
[[quad.path]]
frame = {frame + 1}
emission = 0.1
""",
    )


def test_maps_that_drift_take_their_samples_heavily(tmp_path: Path) -> None:
    """Without influence and notice nothing else tells that the lamp was dimmed; with drift the maps follow sooner."""
    scene = switched(tmp_path, 6)
    policy = Policy(influence="off", notice=False)
    left = []
    for drift in (False, True):
        renderer = Renderer(
            scene,
            width=24,
            height=20,
            budget=1200,
            sampling=Sampling(directions=4, light_samples=2),
            policy=replace(policy, drift=drift),
        )
        light = []
        for _ in range(16):
            renderer.frame()
            known = renderer.state["count"] > 0
            light.append(float(renderer.state["irradiance"][known].mean()))
        left.append(light[-1] / light[6])
    without, heavy = left
    assert heavy < 0.7 * without, left  # 0.27 and 0.41 of the light before
