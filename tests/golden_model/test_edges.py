"""Smoothing against none on the edges of light: the pixels there are no further from the truth.

One layout seed and one render seed: a ratio of errors moves by a tenth and more with either, so this holds what these
draws come to, not what smoothing does to edges in the mean.
"""

from pathlib import Path

import numpy as np
import pytest

from lightloom.golden_model.charts.unwrap import unwrap
from lightloom.golden_model.numerics.sample_spread import luminance
from lightloom.golden_model.oracle.converged_maps import Reference
from lightloom.golden_model.renderer import Pipeline, Renderer
from lightloom.golden_model.scene.files.load import load_scene
from lightloom.golden_model.stimuli.layouts.catalogue import BUDGETS, write_layout
from lightloom.golden_model.structures.structure import Structure
from lightloom.policies.judge import counted_pixels, error, straight_light, visible_texels

pytestmark = pytest.mark.long

FRAMES = 25
STEP = 0.15
"""Of the brighter of two pixels beside each other: an edge."""
WORSE = {"thin-walls": 1.10}
"""What smoothing costs there, at most; elsewhere nothing, to half a percent."""


def edges(gbuffer: np.ndarray, light: np.ndarray) -> np.ndarray:
    """Pixels (H, W) bool of an object's flat side, beside another of it that is brighter or darker by `STEP`."""
    found = np.zeros(light.shape, dtype=np.bool_)
    for axis in (0, 1):
        level, normal, owner, out = (
            np.moveaxis(each, axis, 0) for each in (light, gbuffer["normal"], gbuffer["object"], found)
        )
        same = (owner[1:] == owner[:-1]) & (owner[1:] >= 0) & ((normal[1:] * normal[:-1]).sum(axis=-1) > 0.999)
        steep = same & (np.abs(level[1:] - level[:-1]) > STEP * np.maximum(level[1:], level[:-1]))
        out[1:] |= steep
        out[:-1] |= steep
    return found


@pytest.mark.parametrize("budget", ["scarce", "plenty"])
@pytest.mark.parametrize("layout", ["room", "thin-walls", "curves", "few-movers"])
def test_edges_are_no_worse_than_unfiltered(layout: str, budget: str, tmp_path: Path) -> None:
    scene = load_scene(write_layout(layout, 0, tmp_path))
    maps = unwrap(scene, trace=Structure(scene).trace)
    errors = []
    wanted = None
    for smoothing in (True, False):
        renderer = Renderer(
            scene,
            width=120,
            height=80,
            budget=BUDGETS[budget],
            lightmaps=maps,
            pipeline=Pipeline(smoothing=smoothing),
        )
        for _ in range(FRAMES):
            result = renderer.frame()
        if wanted is None:
            reference = Reference(scene, maps, rays=512, seed=99)
            wanted = renderer.picture(result, reference.published(result.frame, visible_texels(maps, result.gbuffer)))
            straight = straight_light(renderer, result)
            mapped = wanted - straight
            there = edges(result.gbuffer, luminance(mapped)) & counted_pixels(straight, wanted)
            assert there.sum() > 100
        errors.append(error((result.image - straight)[there], mapped[there]))
    smoothed, plain = errors
    assert smoothed is not None
    assert plain is not None
    assert smoothed <= WORSE.get(layout, 1.005) * plain, errors
