"""FIG. 16: an object appears that reflects light onto another; how soon the lightmaps show it ([0077] to [0083])."""

from pathlib import Path

import numpy as np
import pytest

from lightloom.golden_model.charts.unwrap import unwrap
from lightloom.golden_model.engine.sampling.running_average import Blending
from lightloom.golden_model.engine.sampling.settings import Sampling
from lightloom.golden_model.engine.selection.policy import POLICIES
from lightloom.golden_model.numerics.floats import half_to_float
from lightloom.golden_model.oracle.converged_maps import Reference
from lightloom.golden_model.renderer import Renderer
from lightloom.golden_model.structures.structure import Structure
from lightloom.golden_model.tables.lightmap import VALID
from tests.golden_model.moving_scenes import scene_of

APPEARS = 10
# A wall in the shade of its own, lit by what a white panel sends back that comes to stand before it.
SCENE = f"""
texel_size = 0.25
[[box]]
name = "wall"
center = [0, 1, -0.1]
size = [3, 2, 0.2]
albedo = [0.6, 0.6, 0.6]
[[quad]]
name = "floor"
corners = [[-3, 0, 4], [3, 0, 4], [3, 0, -3], [-3, 0, -3]]
albedo = [0.2, 0.2, 0.2]
[[box]]
name = "panel"
center = [0, 1.2, -1.6]
size = [2, 1.6, 0.1]
albedo = [0.95, 0.95, 0.95]
[[box.path]]
frame = 0
present = false
[[box.path]]
frame = {APPEARS}
present = true
[[quad]]
name = "lamp"
corners = [[-1.2, 4, -0.9], [1.2, 4, -0.9], [1.2, 4, 0.5], [-1.2, 4, 0.5]]
emission = [20, 20, 20]
"""


@pytest.mark.parametrize(("policy", "updates"), [("visibility", 22), ("influence", 6)])
def test_affected_texels_reach_the_change(tmp_path: Path, policy: str, updates: int) -> None:
    """90 % of the change within 22 updates at alpha = 0.10, and within 6 where influence makes samples weigh more.

    The latter with what samples weigh by default, which is less.

    Counted from the first update that can see it: in the frame in which the panel appears its own maps are still dark.

    Affected are the texels whose converged irradiance changes by a quarter or more. The share of the change that they
    have made is the projection on it: sum((E - before) * (after - before)) / sum((after - before)**2).
    """
    seed = 4
    scene = scene_of(tmp_path, SCENE)
    maps = unwrap(scene, trace=Structure(scene).trace)
    reference = Reference(scene, maps, rays=256, seed=seed)
    before, after = (
        half_to_float(reference.published(frame)["rgba"][: len(maps.texels), 1]).astype(np.float64)
        for frame in (APPEARS - 1, APPEARS)
    )
    # The panel's own texels have no light before it is there.
    others = (maps.texels["state"] == VALID) & (maps.texels["object"] != scene.object_names.index("panel"))
    affected = np.flatnonzero(others & (np.abs(after - before) >= 0.25 * before))
    assert len(affected) > 100, f"seed {seed}"

    blending = Blending() if policy == "influence" else Blending(alpha_min=np.float32(0.10))
    renderer = Renderer(
        scene,
        width=8,
        height=8,
        budget=10**6,
        seed=seed,
        lightmaps=maps,
        policy=POLICIES[policy],
        sampling=Sampling(directions=64, light_samples=16, blending=blending),
    )
    change = (after - before)[affected]
    made = []
    for _ in range(APPEARS + 1 + updates):
        maintenance = renderer.frame().maintenance
        assert np.isin(affected, maintenance.texels).all(), "the budget pays for all texels"
        moved = renderer.state["irradiance"][affected, 1] - before[affected]
        made.append(float((moved * change).sum() / (change * change).sum()))
    print(f"{policy}: {np.round(made[APPEARS - 1 :], 3)} of the change, {len(affected)} texels")
    assert abs(made[APPEARS - 1]) < 0.05, f"seed {seed}"
    assert made[-1] > 0.9, f"seed {seed}"
    # Without influence the weight of 0.1 takes its time; so that this test would fail for a policy that does nothing.
    assert policy == "influence" or made[APPEARS + 6] < 0.75
