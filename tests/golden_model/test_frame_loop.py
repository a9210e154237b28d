"""The frame loop on random scenes that move: the budget holds, nothing that is seen starves, the bits are fixed."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from lightloom.golden_model.charts.unwrap import unwrap
from lightloom.golden_model.contract.formats import LIKELY
from lightloom.golden_model.engine.sampling.settings import Sampling
from lightloom.golden_model.engine.selection.policy import POLICIES, Policy
from lightloom.golden_model.engine.selection.selector import FrameContext, Selector
from lightloom.golden_model.frame.frame_rays import FrameShading
from lightloom.golden_model.host.errors import InputError
from lightloom.golden_model.machine.cost_model import Machine
from lightloom.golden_model.renderer import FrameResult, Pipeline, Renderer
from lightloom.golden_model.scene.pose import moved_records
from lightloom.golden_model.scene.scene import Scene
from lightloom.golden_model.structures.structure import Structure
from lightloom.golden_model.tables.lightmap import VALID, Lightmaps
from lightloom.golden_model.tracing.bvh.traversal import backend_of
from lightloom.golden_model.tracing.recorder import TestRecorder
from tests.golden_model.changed_hosts import texels_are_shuffled
from tests.golden_model.moving_scenes import MOVING, scene_of

SIZE: dict[str, Any] = {"width": 24, "height": 20}
CAMERA = """
[camera]
position = [0.5, 2.0, 6.0]
target = [0.0, 1.0, 0.0]
[[camera.path]]
frame = 0
position = [0.5, 2.0, 6.0]
target = [0.0, 1.0, 0.0]
[[camera.path]]
frame = 6
position = [4.0, 1.0, 4.0]
target = [0.0, 1.0, 0.0]
"""


def room(folder: Path, seed: int, specular: bool) -> Scene:
    """A room with a few boxes and balls of random places, sizes and paths, under a lamp that flickers."""
    random = np.random.default_rng(seed)
    text = "texel_size = 0.5\n" + CAMERA + MOVING[: MOVING.index("[[sphere]]")].replace("texel_size = 0.25\n", "")
    for number in range(int(random.integers(1, 5))):
        kind = random.choice(["box", "sphere"])
        centre = random.uniform([-2, 0.5, -2], [2, 2, 2]).round(2).tolist()
        box = f"size = {random.uniform(0.3, 1.2, 3).round(2).tolist()}"
        shape = box if kind == "box" else "radius = 0.5\nsubdivisions = 1"
        surface = random.choice(["mirror", "glass", "diffuse"]) if specular else "diffuse"
        text += f'[[{kind}]]\nname = "thing {number}"\ncenter = {centre}\n{shape}\nmaterial = "{surface}"\n'
        if random.random() < 0.7:
            for frame in (0, int(random.integers(1, 7))):
                shift = random.uniform(-1, 1, 3).round(2).tolist()
                present = "true" if random.random() < 0.8 else "false"
                text += f"[[{kind}.path]]\nframe = {frame}\ntranslate = {shift}\npresent = {present}\n"
    return scene_of(folder, text)


@st.composite
def policies(draw: st.DrawFn) -> Policy:
    """A policy with its shares and its tests at random."""
    return replace(
        POLICIES[draw(st.sampled_from(sorted(POLICIES)))],
        sweep=draw(st.integers(1, 128)),
        probe=draw(st.integers(0, 128)),
        rays_share=draw(st.integers(0, 128)),
        ray_test=draw(st.booleans()),
        invalidate=draw(st.booleans()),
        influence=draw(st.sampled_from(["off", "volumes", "footprints"])),
    )


# Shrinking would take minutes and say no more than the seed.
@settings(max_examples=12, deadline=None, derandomize=True, phases=[Phase.generate])
@given(
    seed=st.integers(0, 10**6),
    specular=st.booleans(),
    budget=st.integers(200, 6000),
    directions=st.sampled_from([1, 4, 16]),
    direct=st.sampled_from(["maps", "rays"]),
    versions=st.integers(1, 3),
    policy=policies(),
)
def test_budget_is_never_exceeded_and_nothing_seen_starves(
    tmp_path_factory: pytest.TempPathFactory,
    seed: int,
    specular: bool,
    budget: int,
    directions: int,
    direct: Any,
    versions: int,
    policy: Policy,
) -> None:
    """Rays are counted where they are traced. A texel seen in `longest_wait` frames in a row is sampled in one."""
    scene = room(tmp_path_factory.mktemp("scene"), seed, specular)
    sampling = Sampling(directions=directions, light_samples=2, direct=direct, priming=2)
    if budget < sampling.reserve(scene.specular):
        return
    recorder = TestRecorder(1, 0)
    pipeline = Pipeline(shading=FrameShading(direct=direct, bounces=0, shadow_samples=1), versions=versions)
    renderer = Renderer(
        scene, budget=budget, sampling=sampling, policy=policy, pipeline=pipeline, recorder=recorder, **SIZE
    )
    assert recorder.rays == renderer.priming_rays <= 2 * budget
    waiting = np.zeros(len(renderer.state), dtype=np.int64)
    bound = renderer.maintainer.selector.longest_wait(budget, sampling.reserve(scene.specular))
    for _ in range(8):
        before = recorder.rays
        result = renderer.frame()
        spent = sum(result.maintenance.rays.values())
        reserve = sampling.reserve(scene.specular)
        valid = moved_records(renderer.lightmaps, result.scene).texels["state"] == VALID
        every = len(result.maintenance.texels) == valid.sum()
        assert spent <= budget, f"seed {seed}"
        assert every or spent > budget - reserve, f"seed {seed}"
        assert recorder.rays - before == spent + result.frame_rays.total, f"seed {seed}"
        waiting = np.where(result.maintenance.plan.degree >= LIKELY, waiting + 1, 0)
        waiting[result.maintenance.texels] = 0
        assert waiting.max() <= bound, f"seed {seed}, frame {result.frame}"


def frames_of(scene: Scene, maps: Lightmaps, count: int, **options: Any) -> list[FrameResult]:
    sampling = Sampling(directions=4, priming=2)
    renderer = Renderer(scene, budget=2500, sampling=sampling, lightmaps=maps, **SIZE, **options)
    return [renderer.frame() for _ in range(count)]


def same(one: list[FrameResult], two: list[FrameResult]) -> bool:
    """Whether all bits of pictures, maps and counts are the same."""
    return all(
        a.image.tobytes() == b.image.tobytes()
        and a.gbuffer.tobytes() == b.gbuffer.tobytes()
        and a.lightmap.tobytes() == b.lightmap.tobytes()
        and a.maintenance.rays == b.maintenance.rays
        for a, b in zip(one, two, strict=True)
    )


@pytest.mark.parametrize("specular", [False, True])
def test_the_same_seed_gives_the_same_bits(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, specular: bool) -> None:
    """With NumPy and numba, with one and two threads, with any grouping of rays and any order of maintenance."""
    seed = 12
    scene = room(tmp_path, seed, specular)
    maps = unwrap(scene, trace=Structure(scene).trace)
    once = frames_of(scene, maps, 5, backend="numpy", seed=seed)
    assert same(once, frames_of(scene, maps, 5, backend="numpy", threads=2, seed=seed))
    if backend_of("auto") == "numba":
        assert same(once, frames_of(scene, maps, 5, backend="numba", seed=seed))
        assert same(once, frames_of(scene, maps, 5, backend="numba", threads=2, seed=seed))
    assert not same(once, frames_of(scene, maps, 5, seed=seed + 1))

    texels_are_shuffled(monkeypatch, seed)
    assert same(once, frames_of(scene, maps, 5, seed=seed))


def test_maintenance_does_not_depend_on_the_picture(tmp_path: Path) -> None:
    """What the maps become is the same whatever the rays of the frame are (claims 6 and 7: asynchronous)."""
    scene = room(tmp_path, 3, specular=True)
    maps = unwrap(scene, trace=Structure(scene).trace)
    one = frames_of(scene, maps, 4)
    two = frames_of(scene, maps, 4, pipeline=Pipeline(shading=FrameShading(bounces=0), filtered=False, blend="raster"))
    assert all(a.lightmap.tobytes() == b.lightmap.tobytes() for a, b in zip(one, two, strict=True))
    assert not same(one, two)


@pytest.mark.parametrize("whose", ["this", "before"])
def test_selection_looks_at_the_surfaces_that_it_should(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, whose: Any
) -> None:
    """Those of its own frame, or of the one before; the first frame has none before it."""
    scene = room(tmp_path, 5, specular=False)
    looked_at: list[bytes] = []
    plan = Selector.plan

    def watched(selector: Selector, context: FrameContext, *others: Any) -> Any:
        looked_at.append(context.gbuffer.tobytes() + context.view.position.tobytes())
        return plan(selector, context, *others)

    monkeypatch.setattr(Selector, "plan", watched)
    pipeline = Pipeline(selects_by=whose)
    drawn = [
        each.gbuffer.tobytes() + each.view.position.tobytes()
        for each in frames_of(scene, unwrap(scene), 3, pipeline=pipeline)
    ]
    assert len(set(drawn)) == 3
    assert looked_at == (drawn if whose == "this" else [drawn[0], *drawn[:2]])


def test_machine_and_pipeline_agree_on_whose_surfaces_selection_looks_at(tmp_path: Path) -> None:
    scene = room(tmp_path, 5, specular=False)
    with pytest.raises(InputError, match="early selection"):
        frames_of(scene, unwrap(scene), 1, pipeline=Pipeline(selects_by="before"), machine=Machine())
    with pytest.raises(InputError, match="pipeline selects_by that"):
        Pipeline(selects_by="that")
