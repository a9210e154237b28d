"""What is sampled before the first frame."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lightloom.golden_model.contract.formats import ONE_SAMPLE
from lightloom.golden_model.engine.maintainer import Maintainer
from lightloom.golden_model.engine.sampling.settings import Sampling
from lightloom.golden_model.host.stopwatch import Stopwatch
from lightloom.golden_model.rays.waves import run_together
from lightloom.golden_model.renderer import Renderer
from lightloom.golden_model.scene.files.cornell_box import cornell_box
from lightloom.golden_model.scene.keyframes import ObjectKey, ObjectPath
from lightloom.golden_model.scene.pose import entrances
from lightloom.golden_model.tables.lightmap import VALID
from tests.golden_model.moving_scenes import scene_of
from tests.golden_model.test_frame_loop import SIZE, room


def primed(renderer: Renderer, first: int, anew: bool) -> tuple[np.ndarray, np.ndarray]:
    """The texels of a round before the first frame, from one of their order on, and what they are after it."""
    world = renderer._world(renderer.scene, renderer.published)
    collector = renderer._collector(renderer.scene)
    order = np.roll(renderer.maintainer.priming_order(world), -first)
    prime = renderer.maintainer.prime(world, order, anew, 600, collector, Stopwatch())
    (done,) = run_together(collector, Stopwatch(), prime)
    return done.texels, renderer.state[done.texels]


def unprimed(tmp_path: Path, specular: bool) -> Renderer:
    sampling = Sampling(directions=4, light_samples=2, priming=0)
    return Renderer(room(tmp_path, 5, specular=specular), budget=600, sampling=sampling, **SIZE)


def test_rounds_that_are_numbered_alike_take_the_same_rays(tmp_path: Path) -> None:
    """Before the first frame: what their light comes to can be compared, as it differs by what they read alone."""
    renderer = unprimed(tmp_path, specular=True)
    found = []
    for first in (0, 0, 7):
        if first == 0:
            renderer.state["number"] = 0
        texels, states = primed(renderer, first, anew=True)
        found.append((texels.tolist(), states["irradiance"].tolist()))
    assert found[0] == found[1]
    again = [texel for texel in found[2][0] if texel in found[0][0]]
    assert again
    light = [dict(zip(texels, map(tuple, values), strict=True)) for texels, values in found]
    assert any(light[0][texel] != light[2][texel] for texel in again), "later rounds sample anew"


def test_rounds_average_or_sample_anew(tmp_path: Path) -> None:
    """Before the first frame, texels lose what was found of them until the light is at rest; then they are averaged."""
    renderer = unprimed(tmp_path, specular=False)
    found, _ = primed(renderer, 0, anew=True)
    before = renderer.state.copy()
    again, samples = primed(renderer, 0, anew=True)
    renderer.state[:] = before
    both, averages = primed(renderer, 0, anew=False)
    assert found.tolist() == again.tolist() == both.tolist()
    old = before["irradiance"][both]
    assert (averages["irradiance"] == old + np.float32(0.5) * (samples["irradiance"] - old)).all()
    assert (averages["count"] == 2 * ONE_SAMPLE).all()
    assert (samples["count"] == ONE_SAMPLE).all()


def test_what_comes_later_is_sampled_before_the_first_frame() -> None:
    """A thing that appears is not black in its first frame: it was sampled where and when it comes."""
    scene = replace(cornell_box(), texel_size=80.0, camera_path=())
    stay, upright = np.zeros(3, dtype=np.float32), np.array([1, 0, 0, 0], dtype=np.float32)
    keys = [
        ObjectKey(frame=frame, translate=stay, rotate=upright, emission=np.float32(1), present=present)
        for frame, present in ((0, False), (3, True), (5, False), (7, True))
    ]
    number = scene.object_names.index("tall block")
    path = ObjectPath(keys=tuple(keys), pivot=stay)
    scene = replace(scene, object_path=tuple(path if k == number else p for k, p in enumerate(scene.object_path)))
    assert entrances(scene) == [3]
    renderer = Renderer(scene, budget=4000, sampling=Sampling(primed=2), **SIZE)
    valid = renderer.lightmaps.texels["state"] == VALID
    own = valid & (renderer.lightmaps.texels["object"] == number)
    assert (renderer.state["count"][own] == 2 * ONE_SAMPLE).all()
    for _ in range(3):
        renderer.frame()
    result = renderer.frame()
    seen = result.gbuffer["object"] == number
    assert seen.any()
    assert (result.image[seen].max(axis=-1) > 0).all()


EMPTY_AT_FIRST = """
texel_size = 0.25
[camera]
position = [0, 1.2, 4]
target = [0, 1, 0]
fov_y_tan = 0.5
[sky]
radiance = [0.5, 0.6, 0.8]
[[sphere]]
center = [0, 1, 0]
radius = 0.6
subdivisions = 1
material = "mirror"
"""
LATER = """
[[quad]]
corners = [[-2, 0, 2], [2, 0, 2], [2, 0, -2], [-2, 0, -2]]
[[quad.path]]
frame = 0
present = false
[[quad.path]]
frame = 1
present = true
"""


@pytest.mark.parametrize(("later", "rounds"), [("", 0), (LATER, 6)])
def test_where_the_first_frame_has_no_texels_rounds_are_for_what_comes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, later: str, rounds: int
) -> None:
    asked: list[int] = []
    prime = Maintainer.prime

    def watched(self: Maintainer, world: Any, waiting: np.ndarray, *others: Any) -> Any:
        asked.append(len(waiting))
        return prime(self, world, waiting, *others)

    monkeypatch.setattr(Maintainer, "prime", watched)
    renderer = Renderer(scene_of(tmp_path, EMPTY_AT_FIRST + later), width=16, height=12, budget=20_000)
    assert len(asked) == rounds == (renderer.sampling.primed if later else 0)
    assert all(asked)
    assert (renderer.state["count"] > 0).sum() == max(asked, default=0)
