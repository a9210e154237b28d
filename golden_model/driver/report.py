"""What the engine is told of a frame's scene: records of influence, loose boxes of maps, poses.

Whoever moves the objects knows it: physics, or the builder of the acceleration structure ([0081]).
"""

import numpy as np

from lightloom.golden_model.driver.changes import Table, bounds, table_of
from lightloom.golden_model.driver.footprints import footprints
from lightloom.golden_model.driver.volumes import volumes
from lightloom.golden_model.engine.selection.policy import Policy
from lightloom.golden_model.engine.selection.selector import Report
from lightloom.golden_model.scene.scene import Scene
from lightloom.golden_model.tracing.trace_protocol import Trace


class Reporter:
    """Of one scene over a sequence of frames."""

    def __init__(self, scene: Scene, policy: Policy):
        """The scene at rest."""
        self.policy = policy
        self._table = table_of(scene)

    def report(self, before: Scene, after: Scene, trace: Trace | None, rays: int) -> Report:
        """The scenes of the frame before and of this one; without `trace` there are no footprints.

        At most `rays` rays are traced, in the scene `after`.
        """
        policy = self.policy
        records, traced = volumes(self._table, before, after, policy), 0
        if policy.influence == "footprints" and trace is not None:
            found, traced = footprints(self._table, before, after, policy, trace, rays)
            records = np.concatenate([records, found])
        return Report(
            records=records,
            rays=traced,
            boxes=loose_bounds(self._table, after, policy),
            rotation=after.rotation,
            translation=after.translation,
            texel_size=after.texel_size,
        )


def loose_bounds(table: Table, scene: Scene, policy: Policy) -> np.ndarray:
    """Boxes of the lightmaps of all objects, larger by `influence_slack` texels: (O, 2, 3) float32, low and high.

    For an absent object low is above high, so that nothing overlaps.
    """
    slack = scene.texel_size * policy.influence_slack
    boxes = [bounds(table, scene, number) for number in range(len(scene.object_names))]
    return np.array([[box.low - slack, box.high + slack] for box in boxes], dtype=np.float32)
