"""How likely each texel is to be seen: texel to surface, surface to screen, and what the G-buffer says there.

[0068] to [0070], FIG. 8 and 9, claim 15. Cheap tests first: the texel's normal, then its depth, against those of the
four pixels around its place on the screen (`screen_test`). What they leave in doubt (a depth slightly
off, a silhouette, the border of the picture) is likely to be seen, and may be decided by a ray from the texel to the
eye.
"""

import numpy as np

from lightloom.golden_model.contract.formats import HIDDEN, LIKELY, RAY, SEEN
from lightloom.golden_model.engine.selection.culling import RegionBoxes
from lightloom.golden_model.engine.selection.neighbourhoods import Windows
from lightloom.golden_model.engine.selection.policy import Policy
from lightloom.golden_model.engine.selection.round_robin import RoundRobin
from lightloom.golden_model.engine.selection.screen_test import ScreenTest, Sight, screen_test
from lightloom.golden_model.numerics.floats import quiet
from lightloom.golden_model.numerics.vectors import subtract
from lightloom.golden_model.tables.pinhole import View
from lightloom.golden_model.tracing.trace_protocol import Trace


@quiet
def eye_rays(start: np.ndarray, view: View) -> np.ndarray:
    """RAY (N,) from where texels' rays start (N, 3) to the eye, which is at t = 1."""
    rays = np.zeros(len(start), dtype=RAY)
    rays["origin"] = start
    rays["direction"] = subtract(view.position, rays["origin"])
    rays["t_max"] = 1
    return rays


class Visibility:
    """Degrees of all texels, frame by frame; keeps the turn of those in doubt."""

    def __init__(self, windows: Windows, order: np.ndarray, policy: Policy, test: ScreenTest = screen_test):
        """`order` (V,): the texels that exist, in the order in which doubts are decided: that of memory."""
        self._screen_test = test
        self.windows, self.order, self.policy = windows, order, policy
        self.cursor = RoundRobin()

    def look(
        self,
        texels: np.ndarray,
        valid: np.ndarray,
        view: View,
        gbuffer: np.ndarray,
        texel_size: float,
        *,
        predicted: tuple[View, np.ndarray] | None = None,
        trace: Trace | None = None,
        rays: int = 0,
        regions: RegionBoxes | None = None,
    ) -> tuple[Sight, int]:
        """TEXEL (N,) of a frame, of which `valid` (N,) bool count, to what is known of them, and the rays traced.

        At most `rays` rays are traced, and none without `trace`. Those of `regions` that cannot be on the screen are
        not looked at.
        """
        policy, count = self.policy, len(texels)
        position, normal = texels["position"], texels["normal"]

        def test(view: View, gbuffer: np.ndarray) -> Sight:
            there = valid
            if regions is not None:
                there = valid & regions.on_screen(view, texel_size, policy)[regions.of_texel]
            return self._screen_test(position, normal, view, gbuffer, texel_size, policy, there)

        here = test(view, gbuffer)
        degree = here.degree

        traced = 0
        if policy.ray_test and trace is not None and rays > 0:
            asked = self.order[self.cursor.take(degree[self.order] == LIKELY, min(rays, policy.visibility_rays))]
            traced = len(asked)
            hits = trace(eye_rays(texels["position"][asked], view), any_hit=True)
            degree[asked] = np.where(hits["primitive"] >= 0, HIDDEN, SEEN)

        soon = np.zeros(count, dtype=bool)
        later = np.zeros(count, dtype=np.uint8)
        if predicted is not None:
            there = test(*predicted)
            # What is in doubt there counts too: strips that appear along a silhouette are narrower than its pixels.
            soon = self.windows.largest((there.degree >= LIKELY).view(np.uint8), policy.near_seen) > 0
            # A pixel of the small picture covers more texels than one of the frame will.
            finer = np.uint8(int(policy.prediction_scale).bit_length() - 1)
            later = np.maximum(there.lod, finer) - finer
        return self._together(here, valid, soon, later), traced

    def _together(self, here: Sight, valid: np.ndarray, soon: np.ndarray, later: np.ndarray) -> Sight:
        """`here`, with all that lies within `near_seen` of a seen texel, or is seen `soon`, likely to be read.

        What is likely has the level of detail of the seen texels around it, or without any that of the prediction.
        """
        seen = here.degree == SEEN
        around = self.windows.largest(seen.astype(np.uint8), self.policy.near_seen) > 0
        level = self.windows.largest(here.lod, self.policy.near_seen)
        degree = np.where(valid & ~seen & (around | soon), np.uint8(LIKELY), here.degree)
        lod = np.where(here.lod > 0, here.lod, np.where(around, level, np.where(soon, later, 0)))
        return Sight(degree=degree, lod=np.where(degree >= LIKELY, lod, 0).astype(np.uint8))
