"""Which texels of a plan a frame updates: the rule of the budget, held against texels that go one by one."""

from pathlib import Path
from typing import Any

import pytest

from lightloom.golden_model.engine.maintainer import Maintainer
from lightloom.golden_model.engine.sampling.settings import Sampling
from lightloom.golden_model.engine.selection.selector import Plan, Selector
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


def test_spare_texels_that_are_updated_have_had_their_turn(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Selection is told of as many as were updated beyond the plan, in every frame."""
    told: list[tuple[int, int]] = []
    spend = Selector.spend

    def watched(selector: Selector, plan: Plan, count: int) -> None:
        told.append((len(plan.texel), count))
        spend(selector, plan, count)

    monkeypatch.setattr(Selector, "spend", watched)
    _, results = frames(tmp_path, 1, True, 400)
    updated = [len(result.maintenance.texels) for result in results]
    assert [planned + count for planned, count in told] == updated
    assert max(count for _, count in told) > 0
