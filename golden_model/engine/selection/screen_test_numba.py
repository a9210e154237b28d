"""The compiled twin of `screen_test`, texel by texel, in all bits. Needs numba; NumPy's remains the definition."""

from collections.abc import Callable
from typing import Any

import numpy as np

from lightloom.golden_model.contract.formats import (
    HIDDEN,
    LIKELY,
    LOD_BITS,
    PIXEL_BITS,
    SEEN,
    SHORTEST,
    TEXEL_PLACE,
)
from lightloom.golden_model.engine.selection.policy import Policy
from lightloom.golden_model.engine.selection.screen_test import Sight, pixels_of, to_match, to_project, unseen
from lightloom.golden_model.numerics import floats
from lightloom.golden_model.tables.pinhole import View
from lightloom.golden_model.tracing.bvh.traversal_numba import flush
from lightloom.golden_model.tracing.compiled import cached, compiled, plain

CAMERA = ("eye", "right", "up", "forward", "focal", "near", "width", "height", "texel_size", "facing_shift")
"""Fields of TEXEL_PROJECT that all texels have in common."""
RULES = (
    *("depth_slopes", "depth_limit", "depth_relative", "depth_fixed", "normal_test", "depth_test"),
    *("normal_cosine", "depth_doubt", "lod_levels"),
)
"""Of TEXEL_MATCH, those of the policy."""
FIXED_LIMIT = 2.0**31
BEYOND_LIMIT = (1 << 31) - 1
NO_LEVEL = np.iinfo(np.int16).max
ONE = np.float32(1)
HALF_NORMAL = np.float32(2.0**-14)
"""The smallest number of binary16 that has all its bits."""
HALF_UNIT = np.float32(2.0**24)
"""What makes whole numbers of those below."""
HALF_BEYOND = np.float32(65520)
"""From here on they are infinite."""
SHORTER = np.uint32(13)
"""Bits that the fraction of binary16 has less than that of float32."""


def screen_test(
    position: np.ndarray,
    normal: np.ndarray,
    view: View,
    gbuffer: np.ndarray,
    texel_size: float,
    policy: Policy,
    valid: np.ndarray | None = None,
    *,
    run: Callable[[Callable[[slice], None], int], None],
) -> Sight:
    """As `screen_test.screen_test`; `run` has a work done on all slices of a number of texels."""
    nowhere, pixels = np.zeros((1, 3), dtype=np.float32), pixels_of(gbuffer[:1, :1])
    camera = _common(to_project(nowhere, nowhere, view, texel_size, policy), CAMERA)
    place = np.zeros(1, dtype=TEXEL_PLACE)
    rules = _common(to_match(nowhere, place, view, pixels, texel_size, policy), RULES)
    degree, lod = unseen(len(position))
    chosen = np.ones(len(position), dtype=np.bool_) if valid is None else valid
    depth, facing, level = gbuffer["depth"], gbuffer["normal"], gbuffer["lod"]

    def work(part: slice) -> None:
        texels = position[part], normal[part], chosen[part]
        look(*texels, camera[0], rules[0], depth, facing, level, degree[part], lod[part])

    run(work, len(position))
    return Sight(degree=degree, lod=lod)


def _common(operands: np.ndarray, names: tuple[str, ...]) -> np.ndarray:
    """Fields of operands (1,), flushed, as numba takes them."""
    out = np.zeros(1, dtype=plain(np.dtype([(name, operands.dtype[name]) for name in names])))
    for name in names:
        value = operands[name]
        out[name] = floats.flush(value) if value.dtype == np.float32 else value
    return out


@compiled
def dot(ax: Any, ay: Any, az: Any, b: Any) -> Any:
    """As `texel_project.dot_of`, with b three numbers."""
    return flush(flush(flush(ax * b[0]) + flush(ay * b[1])) + flush(az * b[2]))


@compiled
def half(number: Any) -> Any:
    """As `floats.float_to_half` and `floats.half_to_float` one after the other, up to the payload of a NaN."""
    size = abs(number)
    if size < HALF_NORMAL:
        return np.rint(number * HALF_UNIT) / HALF_UNIT
    if not size < HALF_BEYOND:
        return np.copysign(np.float32(np.inf), number) if size >= HALF_BEYOND else number
    pattern = np.float32(number).view(np.uint32)
    odd = (pattern >> SHORTER) & np.uint32(1)
    rounded = (pattern + np.uint32((1 << SHORTER - 1) - 1) + odd) >> SHORTER << SHORTER
    return np.uint32(rounded).view(np.float32)


@compiled
def on_axis(moved: Any, size: Any) -> Any:
    """As `texel_project._on_axis`."""
    scaled = np.floor(float(moved) * 2.0**PIXEL_BITS)
    if np.isnan(scaled):
        scaled = 0.0
    return int(min(max(scaled, -FIXED_LIMIT), FIXED_LIMIT - 1)) + (size << PIXEL_BITS - 1)


@compiled
def beyond(place: Any, size: Any) -> Any:
    """As `texel_project._beyond`."""
    return min(max(-place, place - (size << PIXEL_BITS), 0), BEYOND_LIMIT)


@compiled
def taps(place: Any, size: Any) -> tuple[Any, Any]:
    """As `texel_project._taps`."""
    first, last = (place - (1 << PIXEL_BITS - 1)) >> PIXEL_BITS, size - 1
    kept = 0 if first < 0 else min(first, last)
    return kept, kept + int(0 <= first < last)


@compiled
def tolerance_of(nx: Any, ny: Any, nz: Any, z: Any, above: Any, outside: Any, camera: Any, rules: Any) -> Any:
    """As `texel_match.depth_tolerance`."""
    across, along = abs(dot(nx, ny, nz, camera.right)), abs(dot(nx, ny, nz, camera.up))
    over = flush(camera.focal * abs(above))
    if not over > SHORTEST:  # so that a NaN loses
        over = SHORTEST
    steep = flush(flush(flush(across + along) * z) / over)
    slope = flush(steep * flush(flush(ONE + outside) * rules.depth_slopes))
    if not slope < rules.depth_limit:
        slope = rules.depth_limit
    return flush(flush(flush(slope + rules.depth_relative) * z) + rules.depth_fixed)


@compiled
def outcome(nx: Any, ny: Any, nz: Any, z: Any, tolerance: Any, seen_depth: Any, facing: Any, rules: Any) -> Any:
    """As `texel_match._compare`."""
    by_normal, by_depth = rules.normal_test != 0, rules.depth_test != 0
    behind = flush(z - flush(seen_depth))
    same_depth = abs(behind) <= tolerance
    not_behind = behind < flush(tolerance * rules.depth_doubt)
    if by_depth and not (same_depth or not_behind or seen_depth == np.inf):
        return HIDDEN  # whatever its normal: most texels end here
    there = (half(facing[0]), half(facing[1]), half(facing[2]))
    same_normal = dot(nx, ny, nz, there) >= rules.normal_cosine
    if (by_normal or by_depth) and (same_normal or not by_normal) and (same_depth or not by_depth):
        return SEEN
    if by_normal:
        doubtful = seen_depth == np.inf or (by_depth and (same_depth or (same_normal and not_behind)))
    else:
        doubtful = not_behind or not by_depth
    return LIKELY if doubtful else HIDDEN


@cached
def look(
    sources: Any,  # left out by callers: `cached` says why
    position: Any,  # float32 (N, 3)
    normal: Any,  # float32 (N, 3)
    valid: Any,  # bool (N,)
    camera: Any,
    rules: Any,
    depth: Any,  # float32 (H, W), as the next two of GBUFFER
    facing: Any,  # float32 (H, W, 3)
    level: Any,  # int16 (H, W)
    degree: Any,  # uint8 (N,), all UNSEEN
    lod: Any,  # uint8 (N,), all 0
) -> None:
    """Writes what is known of texels into `degree` and `lod`."""
    slack = np.float32(2.0 ** -np.int64(camera.facing_shift))
    width, height = np.int64(camera.width), np.int64(camera.height)
    for number in range(len(position)):
        if not valid[number]:
            continue
        x, y, z = position[number]
        x, y, z = flush(flush(x) - camera.eye[0]), flush(flush(y) - camera.eye[1]), flush(flush(z) - camera.eye[2])
        nx, ny, nz = normal[number]
        nx, ny, nz = flush(nx), flush(ny), flush(nz)
        above = -dot(nx, ny, nz, (x, y, z))
        away = dot(x, y, z, camera.forward)
        if not (away > camera.near and above > -flush(slack * away)):
            continue
        enlarged = flush(camera.focal / away)
        column = on_axis(flush(dot(x, y, z, camera.right) * enlarged), width)
        row = on_axis(-flush(dot(x, y, z, camera.up) * enlarged), height)
        farther = max(beyond(column, width), beyond(row, height))
        outside = np.float32(farther) * np.float32(2.0**-PIXEL_BITS)
        if farther != 0 and not outside < flush(enlarged * camera.texel_size):
            continue
        tolerance = tolerance_of(nx, ny, nz, away, above, outside, camera, rules)
        best: Any = HIDDEN
        finest: Any = NO_LEVEL
        for i in taps(row, height):
            for j in taps(column, width):
                found = outcome(nx, ny, nz, away, tolerance, depth[i, j], facing[i, j], rules)
                best = max(best, found)
                if found == SEEN:
                    finest = min(finest, np.int64(level[i, j]))
        degree[number] = best
        if best == SEEN:
            lod[number] = min(max((finest + (1 << LOD_BITS >> 1)) >> LOD_BITS, 0), np.int64(rules.lod_levels))
