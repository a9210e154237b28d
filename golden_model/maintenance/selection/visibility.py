"""How likely each texel is to be seen: texel to surface, surface to screen, and what the G-buffer says there.

[0068] to [0070], FIG. 8 and 9, claim 15. Cheap tests first: the texel's normal, then its depth, against those of the
four pixels around its place on the screen (`texel_project`, `texel_match`). What they leave in doubt (a depth slightly
off, a silhouette, the border of the picture) is likely to be seen, and may be decided by a ray from the texel to the
eye.
"""

import math
from dataclasses import dataclass

import numpy as np

from lightloom.golden_model.contract.formats import (
    FACING_BITS,
    HIDDEN,
    LIKELY,
    PIXEL,
    RAY,
    SEEN,
    TEXEL_MATCH,
    TEXEL_PROJECT,
    UNSEEN,
)
from lightloom.golden_model.maintenance.selection.neighbourhoods import Windows
from lightloom.golden_model.maintenance.selection.policy import Policy
from lightloom.golden_model.maintenance.selection.round_robin import RoundRobin
from lightloom.golden_model.maintenance.selection.texel_match import texel_match
from lightloom.golden_model.maintenance.selection.texel_project import texel_project
from lightloom.golden_model.numerics.floats import float_multiply, float_to_half, quiet
from lightloom.golden_model.numerics.vectors import subtract
from lightloom.golden_model.scene.pinhole import View
from lightloom.golden_model.tracing.trace_protocol import Trace


@dataclass(frozen=True, kw_only=True)
class Sight:
    """What is known of N texels."""

    degree: np.ndarray
    """UNSEEN to SEEN, (N,) uint8; UNSEEN for texels that are not valid."""
    lod: np.ndarray
    """Level of detail at which a seen texel is read: whole levels, 0 to 3, 0 for others, (N,) uint8."""


def screen_test(
    position: np.ndarray, normal: np.ndarray, view: View, gbuffer: np.ndarray, texel_size: float, policy: Policy
) -> Sight:
    """The tests by the G-buffer: surface points (N, 3) and unit normals (N, 3), GBUFFER (H, W).

    `texel_size` is the side of a texel in the scene's unit. LIKELY is what is in doubt, which is everything on the
    screen where the policy has neither of the two tests.
    """
    count = len(position)
    degree, lod = np.full(count, UNSEEN, dtype=np.uint8), np.zeros(count, dtype=np.uint8)
    place = texel_project(_to_project(position, normal, view, texel_size, policy))
    visible = np.flatnonzero(place["visible"])
    operands = _to_match(normal[visible], place[visible], view, pixels_of(gbuffer), texel_size, policy)
    found = texel_match(operands)
    degree[visible], lod[visible] = found["degree"], found["lod"]
    return Sight(degree=degree, lod=lod)


def pixels_of(gbuffer: np.ndarray) -> np.ndarray:
    """What the tests read of GBUFFER (H, W): PIXEL (H, W)."""
    out = np.zeros(gbuffer.shape, dtype=PIXEL)
    out["depth"], out["lod"] = gbuffer["depth"], gbuffer["lod"]
    out["normal"] = float_to_half(gbuffer["normal"])
    return out


def _to_project(position: np.ndarray, normal: np.ndarray, view: View, texel_size: float, policy: Policy) -> np.ndarray:
    """TEXEL_PROJECT (N,)."""
    out = np.zeros(len(position), dtype=TEXEL_PROJECT)
    out["position"], out["normal"], out["eye"] = position, normal, view.position
    for name in ("right", "up", "forward", "focal", "near", "width", "height"):
        out[name] = getattr(view, name)
    out["texel_size"], out["facing_shift"] = texel_size, facing_shift(policy.facing_slack)
    return out


def facing_shift(slack: float) -> int:
    """n of the greatest 2**-n that is not more than a slack of 0 to 1, at most what the field holds."""
    most = (1 << FACING_BITS) - 1
    return min(1 - math.frexp(slack)[1], most) if slack else most


def _to_match(
    normal: np.ndarray, place: np.ndarray, view: View, pixels: np.ndarray, texel_size: float, policy: Policy
) -> np.ndarray:
    """TEXEL_MATCH (N,) of visible texels' normals and TEXEL_PLACE (N,), and PIXEL (H, W)."""
    out = np.zeros(len(place), dtype=TEXEL_MATCH)
    out["normal"] = normal
    for name in ("depth", "above", "outside"):
        out[name] = place[name]
    for name in ("right", "up", "focal"):
        out[name] = getattr(view, name)
    for name in ("depth_slopes", "depth_limit", "depth_relative"):
        out[name] = getattr(policy, name)
    out["depth_fixed"] = float_multiply(
        *(np.asarray(each, dtype=np.float32) for each in (texel_size, policy.depth_texels))
    )
    for name in ("normal_test", "depth_test", "normal_cosine", "depth_doubt", "lod_levels"):
        out[name] = getattr(policy, name)
    for tap, (row, column) in enumerate(np.ndindex(2, 2)):
        pixel = pixels[place["row"][:, row], place["column"][:, column]]
        out["pixel_depth"][:, tap], out["pixel_lod"][:, tap] = pixel["depth"], pixel["lod"]
        out["pixel_normal"][:, 3 * tap : 3 * tap + 3] = pixel["normal"]
    return out


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

    def __init__(self, windows: Windows, order: np.ndarray, policy: Policy):
        """`order` (V,): the texels that exist, in the order in which doubts are decided: that of memory."""
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
    ) -> tuple[Sight, int]:
        """TEXEL (N,) of a frame, of which `valid` (N,) bool count, to what is known of them, and the rays traced.

        At most `rays` rays are traced, and none without `trace`.
        """
        policy, count = self.policy, len(texels)
        chosen = np.flatnonzero(valid)
        position, normal = texels["position"][chosen], texels["normal"][chosen]
        here = screen_test(position, normal, view, gbuffer, texel_size, policy)
        degree, lod = (np.zeros(count, dtype=np.uint8) for _ in range(2))
        degree[chosen], lod[chosen] = here.degree, here.lod

        traced = 0
        if policy.ray_test and trace is not None and rays > 0:
            asked = self.order[self.cursor.take(degree[self.order] == LIKELY, min(rays, policy.visibility_rays))]
            traced = len(asked)
            hits = trace(eye_rays(texels["position"][asked], view), any_hit=True)
            degree[asked] = np.where(hits["primitive"] >= 0, HIDDEN, SEEN)

        soon = np.zeros(count, dtype=bool)
        later = np.zeros(count, dtype=np.uint8)
        if predicted is not None:
            there = screen_test(position, normal, *predicted, texel_size, policy)
            # What is in doubt there counts too: strips that appear along a silhouette are narrower than its pixels.
            soon[chosen] = there.degree >= LIKELY
            soon = self.windows.largest(soon.view(np.uint8), policy.near_seen) > 0
            # A pixel of the small picture covers more texels than one of the frame will.
            finer = int(policy.prediction_scale).bit_length() - 1
            later[chosen] = np.maximum(there.lod.astype(np.int16) - finer, 0)
        return self._together(Sight(degree=degree, lod=lod), valid, soon, later), traced

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
