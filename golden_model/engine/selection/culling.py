"""Regions that are left out as a whole: of which no texel can be on the screen, or be reached by a change.

At a million texels most of selection is arithmetic on texels of which nothing comes: behind the eye, off the screen,
facing away, far from all that moves. A region of 8 x 8 texels has a box around its texels' points and one around their
normals, at rest; the object's pose is applied to the boxes as to the texels. The tests are those of the texels
(`texel_project`; `influence.region_reach` has those of changes) on intervals (`intervals`). So they never rule out a
texel that these would find, and selection has the same bits with culling and without it.
"""

from dataclasses import dataclass, replace

import numpy as np

from lightloom.golden_model.contract.formats import PIXEL_BITS
from lightloom.golden_model.engine.publishing.regions import Regions, regions_of
from lightloom.golden_model.engine.selection.intervals import Interval
from lightloom.golden_model.engine.selection.policy import Policy
from lightloom.golden_model.engine.selection.screen_test import facing_shift
from lightloom.golden_model.numerics.floats import fixed_to_float, float_minmax, float_to_fixed_down, flush, quiet
from lightloom.golden_model.tables.lightmap import VALID, Lightmaps
from lightloom.golden_model.tables.pinhole import View

NOWHERE = np.float32(np.inf)
"""Of a region without texels: `low` of its boxes, and less it `high`."""


@dataclass(frozen=True, kw_only=True)
class RegionBoxes:
    """What R regions of one scene's maps lie within: at rest a table of the hardware, or in a frame."""

    object: np.ndarray
    """Map of each region, (R,) int64."""
    of_texel: np.ndarray
    """Region of each texel, (N,) int64."""
    filled: np.ndarray
    """Regions that have texels, (R,) bool."""
    position: Interval
    """Of the texels' points, (R, 3)."""
    normal: Interval
    """Of their normals, (R, 3)."""

    @quiet
    def posed(self, rotation: np.ndarray, translation: np.ndarray) -> "RegionBoxes":
        """Of those at rest, in the poses of a frame: rotations (O, 3, 3), translations (O, 3)."""
        rotation = rotation[self.object]
        position = _turned(rotation, self.position) + translation[self.object]
        return replace(self, position=position, normal=_turned(rotation, self.normal))

    @quiet
    def on_screen(self, view: View, texel_size: float, policy: Policy) -> np.ndarray:
        """Whether any texel of each region may be `visible` to `texel_project`: (R,) bool."""
        moved = self.position - view.position
        above, depth = -self.normal.scalar_product(moved), moved.scalar_product(view.forward)
        focal, close = (flush(np.asarray(number, dtype=np.float32)) for number in (view.focal, view.near))
        # Below its horizon even of the texel that faces the eye most, where the slack is greatest.
        slack = np.ldexp(np.float32(1), -facing_shift(policy.facing_slack))
        facing = above.high > -flush(slack * depth.high)

        # Texels before the near plane do not count.
        enlarged = Interval(flush(focal / depth.high), flush(focal / float_minmax(depth.low, close, True)))
        across, upward = moved.scalar_product(view.right), moved.scalar_product(view.up)
        farther = np.maximum(_beyond(across * enlarged, view.width), _beyond(-(upward * enlarged), view.height))
        outside = fixed_to_float(np.minimum(farther, (1 << 31) - 1).astype(np.int32), PIXEL_BITS)
        near = (farther == 0) | (outside < flush(enlarged.high * np.float32(texel_size)))

        known = above.finite & depth.finite & across.finite & upward.finite & enlarged.finite
        known &= moved.finite.all(axis=1)
        # Where the whole box is before the near plane `enlarged` means nothing, and is not asked.
        behind = depth.finite & (depth.high <= close)
        return self.filled & ~behind & ((facing & near) | ~known)


def region_boxes(lightmaps: Lightmaps) -> RegionBoxes:
    """Of lightmaps at rest, made once a scene; texels that are not valid there do not count."""
    regions = regions_of(lightmaps)
    position, normal = (_around(regions, lightmaps, field) for field in ("position", "normal"))
    return RegionBoxes(
        object=regions.object,
        of_texel=regions.of_texel,
        filled=position.low[:, 0] < NOWHERE,
        position=position,
        normal=normal,
    )


def _around(regions: Regions, lightmaps: Lightmaps, field: str) -> Interval:
    """The boxes (R, 3) around a vector of the valid texels of each region, flushed; inside out where there are none."""
    valid = lightmaps.texels["state"] == VALID
    which, vectors = regions.of_texel[valid], flush(lightmaps.texels[field][valid])
    low = np.full((regions.count, 3), NOWHERE)
    high = -low
    np.minimum.at(low, which, vectors)
    np.maximum.at(high, which, vectors)
    return Interval(low, high)


def _turned(rotation: np.ndarray, box: Interval) -> Interval:
    """As `keyframes.rotated`: boxes (R, 3), each by its rotation (R, 3, 3)."""
    rows = [box.scalar_product(rotation[:, row]) for row in range(3)]
    return Interval(np.stack([each.low for each in rows], axis=1), np.stack([each.high for each in rows], axis=1))


def _beyond(moved: Interval, size: int) -> np.ndarray:
    """How far all of places from the middle of an axis are beyond the same end of it, (R,) int64; 0 if one is not.

    As `texel_project._on_axis` and `_beyond`, of the nearest of them.
    """
    first, last = (float_to_fixed_down(end, PIXEL_BITS).astype(np.int64) for end in (moved.low, moved.high))
    half = size << PIXEL_BITS - 1
    return np.maximum(np.maximum(-(last + half), first - half), 0)
