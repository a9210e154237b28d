"""Which texels of a plan a frame updates: the rule of the budget, held against texels that go one by one."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lightloom.golden_model.contract.formats import ONE_SAMPLE
from lightloom.golden_model.host.stopwatch import Stopwatch
from lightloom.golden_model.maintenance.maintainer import Maintainer
from lightloom.golden_model.maintenance.sampling.settings import Sampling
from lightloom.golden_model.rays.waves import run_together
from lightloom.golden_model.renderer import FrameResult, Renderer
from tests.golden_model.test_frame_loop import SIZE, room

FRAMES = 4


def frames(folder: Path, seed: int, specular: bool, budget: int) -> tuple[Renderer, list[FrameResult]]:
    scene = room(folder, seed, specular)
    renderer = Renderer(scene, budget=budget, sampling=Sampling(directions=4, light_samples=2, priming=2), **SIZE)
    return renderer, [renderer.frame() for _ in range(FRAMES)]


@pytest.mark.parametrize(
    ("seed", "specular", "budget"), [(1, True, 400), (2, True, 611), (3, False, 200), (4, True, 30)]
)
def test_texels_are_admitted_as_if_they_went_one_by_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, seed: int, specular: bool, budget: int
) -> None:
    """The same texels with the same bits, each admitted knowing what every one before it has really taken."""
    together, at_once = frames(tmp_path, seed, specular, budget)
    asked: list[tuple[int, int]] = []
    admitted = Maintainer._admitted

    def one(self: Maintainer, world: Any, rays: int, waiting: int) -> int:
        count = min(admitted(self, world, rays, waiting), 1)
        asked.append((rays, count))
        return count

    monkeypatch.setattr(Maintainer, "_admitted", one)
    apart, single = frames(tmp_path, seed, specular, budget)
    reserve = together.sampling.reserve(specular)
    assert all(count == (rays >= reserve) for rays, count in asked), f"seed {seed}: a plan was too short"
    for a, b in zip(at_once, single, strict=True):
        assert a.maintenance.texels.tolist() == b.maintenance.texels.tolist(), f"seed {seed}, frame {a.frame}"
        assert a.maintenance.rays == b.maintenance.rays, f"seed {seed}, frame {a.frame}"
        assert a.image.tobytes() == b.image.tobytes(), f"seed {seed}, frame {a.frame}"
    assert together.state.tobytes() == apart.state.tobytes(), f"seed {seed}"
    assert any(len(a.maintenance.texels) > len(a.maintenance.plan.texel) for a in at_once), "nothing was left to spare"


def test_a_small_mirror_does_not_leave_the_budget_unspent(tmp_path: Path) -> None:
    """Where an update may take five times the rays that it mostly takes, 95 % and more of the budget is spent."""
    _, results = frames(tmp_path, 1, True, 25 * 22)
    for result in results:
        assert 0.95 * 550 <= sum(result.maintenance.rays.values()) <= 550


def test_rounds_from_the_first_texel_take_the_same_rays(tmp_path: Path) -> None:
    """Before the first frame: what their light comes to can be compared, as it differs by what they read alone."""
    scene = room(tmp_path, 5, specular=True)
    renderer = Renderer(scene, budget=600, sampling=Sampling(directions=4, light_samples=2, priming=0), **SIZE)
    maintainer, world = renderer.maintainer, renderer._world(renderer.scene, renderer.published)
    found = []
    for first in (0, 0, 7):
        collector = renderer._collector(renderer.scene)
        (done,) = run_together(
            collector, Stopwatch(), maintainer.prime(world, first, True, 600, collector, Stopwatch())
        )
        found.append((done.texels.tolist(), renderer.state["irradiance"][done.texels].tolist()))
    assert found[0] == found[1]
    again = [texel for texel in found[2][0] if texel in found[0][0]]
    assert again
    light = [dict(zip(texels, map(tuple, values), strict=True)) for texels, values in found]
    assert any(light[0][texel] != light[2][texel] for texel in again), "later rounds sample anew"


def test_rounds_average_or_sample_anew(tmp_path: Path) -> None:
    """Before the first frame, texels lose what was found of them until the light is at rest; then they are averaged."""
    scene = room(tmp_path, 5, specular=False)
    renderer = Renderer(scene, budget=600, sampling=Sampling(directions=4, light_samples=2, priming=0), **SIZE)
    maintainer, world = renderer.maintainer, renderer._world(renderer.scene, renderer.published)
    texels = len(maintainer.present(world))

    def sampled(first: int, anew: bool, before: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The texels of a round, and what they are after it."""
        renderer.state[:] = before
        collector = renderer._collector(renderer.scene)
        (done,) = run_together(
            collector, Stopwatch(), maintainer.prime(world, first, anew, 600, collector, Stopwatch())
        )
        return done.texels, renderer.state[done.texels]

    found, _ = sampled(0, True, renderer.state.copy())
    before = renderer.state.copy()
    again, samples = sampled(texels, True, before)
    both, averages = sampled(texels, False, before)
    assert found.tolist() == again.tolist() == both.tolist()
    old = before["irradiance"][both]
    assert (averages["irradiance"] == old + np.float32(0.5) * (samples["irradiance"] - old)).all()
    assert (averages["count"] == 2 * ONE_SAMPLE).all()
    assert (samples["count"] == ONE_SAMPLE).all()
