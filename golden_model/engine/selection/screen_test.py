"""What the G-buffer says of texels: whether, and how finely, each is seen on the screen ([0068] to [0070], FIG. 8, 9).

The two units' models one after the other: `texel_project` for all texels, `texel_match` for those on the screen, with
the four pixels around each of these.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from lightloom.golden_model.contract.formats import FACING_BITS, PIXEL, TEXEL_MATCH, TEXEL_PROJECT, UNSEEN
from lightloom.golden_model.engine.selection.policy import Policy
from lightloom.golden_model.engine.selection.texel_match import texel_match
from lightloom.golden_model.engine.selection.texel_project import texel_project
from lightloom.golden_model.numerics.floats import float_multiply, float_to_half
from lightloom.golden_model.tables.pinhole import View


@dataclass(frozen=True, kw_only=True)
class Sight:
    """What is known of N texels."""

    degree: np.ndarray
    """UNSEEN to SEEN, (N,) uint8; UNSEEN for texels that are not valid."""
    lod: np.ndarray
    """Level of detail at which a seen texel is read: whole levels, 0 to 3, 0 for others, (N,) uint8."""


ScreenTest = Callable[..., Sight]
"""`screen_test` or its compiled twin."""


def screen_test(
    position: np.ndarray,
    normal: np.ndarray,
    view: View,
    gbuffer: np.ndarray,
    texel_size: float,
    policy: Policy,
    valid: np.ndarray | None = None,
) -> Sight:
    """The tests by the G-buffer: surface points (N, 3) and unit normals (N, 3), GBUFFER (H, W).

    Of the texels `valid` (N,) bool are looked at, or all; the others are UNSEEN. `texel_size` is the side of a texel in
    the scene's unit. LIKELY is what is in doubt, which is everything on the screen where the policy has neither of the
    two tests.
    """
    degree, lod = unseen(len(position))
    chosen = np.arange(len(position)) if valid is None else np.flatnonzero(valid)
    place = texel_project(to_project(position[chosen], normal[chosen], view, texel_size, policy))
    on_screen = np.flatnonzero(place["visible"])
    visible = chosen[on_screen]
    operands = to_match(normal[visible], place[on_screen], view, pixels_of(gbuffer), texel_size, policy)
    found = texel_match(operands)
    degree[visible], lod[visible] = found["degree"], found["lod"]
    return Sight(degree=degree, lod=lod)


def unseen(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Degree and level of texels of which nothing is known yet, (N,) uint8 each."""
    return np.full(count, UNSEEN, dtype=np.uint8), np.zeros(count, dtype=np.uint8)


def pixels_of(gbuffer: np.ndarray) -> np.ndarray:
    """What the tests read of GBUFFER (H, W): PIXEL (H, W)."""
    out = np.zeros(gbuffer.shape, dtype=PIXEL)
    out["depth"], out["lod"] = gbuffer["depth"], gbuffer["lod"]
    out["normal"] = float_to_half(gbuffer["normal"])
    return out


def to_project(position: np.ndarray, normal: np.ndarray, view: View, texel_size: float, policy: Policy) -> np.ndarray:
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


def to_match(
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
