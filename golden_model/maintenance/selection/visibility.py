"""How likely each texel is to be seen: texel to surface, surface to screen, and what the G-buffer says there.

[0068] to [0070], FIG. 8 and 9, claim 15. Cheap tests first: the texel's normal, then its depth, against those of the
four pixels around its place on the screen. What they leave in doubt (a depth slightly off, a silhouette, the border of
the picture) is likely to be seen, and may be decided by a ray from the texel to the eye.
"""

from dataclasses import dataclass

import numpy as np

from lightloom.golden_model.contract.formats import RAY
from lightloom.golden_model.maintenance.selection.neighbourhoods import Windows
from lightloom.golden_model.maintenance.selection.policy import Policy
from lightloom.golden_model.maintenance.selection.round_robin import RoundRobin
from lightloom.golden_model.numerics.floats import flush, quiet
from lightloom.golden_model.numerics.vectors import dot, subtract
from lightloom.golden_model.scene.pinhole import View, to_view
from lightloom.golden_model.tracing.trace_protocol import Trace

UNSEEN, HIDDEN, LIKELY, SEEN = range(4)
"""Degrees: off the screen or facing away; facing and on the screen, but something else is seen there; likely to be
seen now or soon; seen."""

SHORTEST = np.float32(2.0**-40)
"""Stands in for distances of zero."""


@dataclass(frozen=True, kw_only=True)
class Sight:
    """What is known of N texels."""

    degree: np.ndarray
    """UNSEEN to SEEN, (N,) uint8; UNSEEN for texels that are not valid."""
    lod: np.ndarray
    """Level of detail at which a seen texel is read: whole levels, 0 to 3, 0 for others, (N,) uint8."""


@quiet
def screen_test(
    position: np.ndarray, normal: np.ndarray, view: View, gbuffer: np.ndarray, texel_size: float, policy: Policy
) -> Sight:
    """The tests by the G-buffer: surface points (N, 3) and unit normals (N, 3), GBUFFER (H, W).

    `texel_size` is the side of a texel in the scene's unit. LIKELY is what is in doubt, which is everything on the
    screen where the policy has neither of the two tests.
    """
    count = len(position)
    degree, lod = np.zeros(count, dtype=np.uint8), np.zeros(count, dtype=np.uint8)
    size = np.asarray(texel_size, dtype=np.float32)

    # Facing: the distance of the eye from the texel's plane, against a part of the distance along the view axis.
    towards = subtract(view.position, position)
    height = dot(normal, towards)
    place = to_view(view, position)
    depth = place[:, 2]
    facing = height > flush(depth * -np.float32(policy.facing_slack))
    chosen = np.flatnonzero((depth > view.near) & facing)

    # On the screen, or off it by less than a texel: pixels at the border may read the texel all the same.
    depth, height = depth[chosen], np.abs(height[chosen])
    inverse = flush(np.float32(1) / depth)
    x = flush(flush(flush(place[chosen, 0] * view.focal) * inverse) + np.float32(view.width / 2))
    y = flush(np.float32(view.height / 2) - flush(flush(place[chosen, 1] * view.focal) * inverse))
    pixels = flush(inverse * flush(np.asarray(size * view.focal)))
    outside = np.maximum(
        np.maximum(np.maximum(-x, flush(x - np.float32(view.width))), -y), flush(y - np.float32(view.height))
    )
    near = outside < pixels
    chosen, depth, height, inverse, x, y = (a[near] for a in (chosen, depth, height, inverse, x, y))
    outside = np.maximum(outside[near], np.float32(0))

    # How much the texel's plane rises in depth over a pixel: z*z * (|nx| + |ny|) / (focal * height of the eye over it).
    sideways = [np.abs(dot(normal[chosen], axis)) for axis in (view.right, view.up)]
    steep = flush(flush(flush(sideways[0] + sideways[1]) * depth) / np.maximum(flush(view.focal * height), SHORTEST))
    reach = flush(np.float32(policy.depth_slopes) * flush(np.float32(1) + outside))
    slope = np.minimum(flush(steep * reach), np.float32(policy.depth_limit))
    fixed = flush(np.asarray(size * np.float32(policy.depth_texels)))
    tolerance = flush(flush(flush(slope + np.float32(policy.depth_relative)) * depth) + fixed)
    doubt = flush(tolerance * np.float32(policy.depth_doubt))

    best = np.full(len(chosen), HIDDEN, dtype=np.uint8)
    level = np.full(len(chosen), 32767, dtype=np.int16)
    picture = _picture(gbuffer)
    wanted = normal[chosen]
    columns, rows = _taps(x, view.width), _taps(y, view.height)
    for row in rows:
        for column in columns:
            pixel = row * view.width + column
            outcome = _compare(wanted, depth, tolerance, doubt, pixel, picture, policy)
            best = np.maximum(best, outcome)
            level = np.where(outcome == SEEN, np.minimum(level, picture.lod[pixel]), level)
    degree[chosen] = best
    whole = np.clip((level.astype(np.int32) + 128) >> 8, 0, policy.lod_levels)
    lod[chosen] = np.where(best == SEEN, whole, 0)
    return Sight(degree=degree, lod=lod)


@dataclass(frozen=True, kw_only=True)
class _Picture:
    """The fields of a G-buffer that are compared, each of its own: (P,) or (P, 3)."""

    depth: np.ndarray
    normal: np.ndarray
    lod: np.ndarray
    empty: np.ndarray


def _picture(gbuffer: np.ndarray) -> _Picture:
    flat = gbuffer.reshape(-1)
    return _Picture(
        depth=np.ascontiguousarray(flat["depth"]),
        normal=np.ascontiguousarray(flat["normal"]),
        lod=np.ascontiguousarray(flat["lod"]),
        empty=flat["primitive"] < 0,
    )


def _taps(coordinate: np.ndarray, size: int) -> tuple[np.ndarray, np.ndarray]:
    """The two pixels (of a row or column) whose centres lie around screen coordinates (N,), kept on the screen."""
    first = np.floor(flush(coordinate - np.float32(0.5))).astype(np.int64)
    return np.clip(first, 0, size - 1), np.clip(first + 1, 0, size - 1)


def _compare(
    normal: np.ndarray,
    depth: np.ndarray,
    tolerance: np.ndarray,
    doubt: np.ndarray,
    pixel: np.ndarray,
    picture: _Picture,
    policy: Policy,
) -> np.ndarray:
    """What one pixel (N,) says of each texel: HIDDEN, LIKELY (in doubt) or SEEN."""
    behind = flush(depth - picture.depth[pixel])
    same_depth = np.abs(behind) <= tolerance
    if policy.normal_test:
        same_normal = dot(normal, picture.normal[pixel]) >= np.float32(policy.normal_cosine)
        # Beside an empty pixel may be a silhouette. A crease has the depth but not the normal.
        doubtful = picture.empty[pixel] | (same_depth & policy.depth_test)
        if not policy.depth_test:
            return np.where(same_normal, SEEN, np.where(doubtful, LIKELY, HIDDEN)).astype(np.uint8)
        doubtful |= same_normal & (behind < doubt)
        return np.where(same_normal & same_depth, SEEN, np.where(doubtful, LIKELY, HIDDEN)).astype(np.uint8)
    if policy.depth_test:
        # Nearer than what the pixel sees: a silhouette, or geometry thinner than a pixel.
        return np.where(same_depth, SEEN, np.where(behind < doubt, LIKELY, HIDDEN)).astype(np.uint8)
    return np.full(len(depth), LIKELY, dtype=np.uint8)


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
        """`order` (V,): the texels that exist, in the order in which doubts are decided."""
        self.windows, self.order, self.policy = windows, order, policy
        self.turn = RoundRobin()

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
            asked = self.order[self.turn.take(degree[self.order] == LIKELY, min(rays, policy.visibility_rays))]
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
