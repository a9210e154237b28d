"""Functional bins of the units that see to texels, out of operands and the model's results."""

from collections.abc import Callable

import numpy as np

from lightloom.golden_model.contract.formats import (
    COUNT_BITS,
    COUNT_MAX,
    HIDDEN,
    LIKELY,
    ONE_SAMPLE,
    RELATIVE_MAX,
    SEEN,
    TAPS,
)
from lightloom.golden_model.engine.selection.texel_match import depth_tolerance
from lightloom.golden_model.numerics.floats import flush, quiet
from lightloom.verif.bins.coverage import Groups, cases
from lightloom.verif.bins.number_bins import classes, signed
from lightloom.verif.bins.ray_bins import any_of, values


@quiet
def _project(i: np.ndarray, o: np.ndarray) -> Groups:
    visible, column, row = o["visible"], o["column"], o["row"]
    depth = (flush(i["position"] - i["eye"]).astype(np.float64) * i["forward"]).sum(axis=1)
    along = (flush(i["position"] - i["eye"]).astype(np.float64) * i["normal"]).sum(axis=1)
    last = np.stack([i["width"], i["height"]], axis=1).astype(int) - 1
    pixels = np.stack([column, row], axis=2).astype(int)
    ends: dict[str, np.ndarray] = {}
    for axis, name in enumerate(("column", "row")):
        first, second = pixels[:, 0, axis], pixels[:, 1, axis]
        inner = (first > 0) & (second < last[:, axis])
        ends |= {
            f"{name}, both": visible & inner & (second == first + 1),
            f"{name}, before the first": visible & (second == 0) & (last[:, axis] > 0),
            f"{name}, at the first": visible & (first == 0) & (second == 1),
            f"{name}, beyond the last": visible & (first == second) & (first == last[:, axis]) & (first > 0),
            f"{name}, one pixel": visible & (last[:, axis] == 0),
        }
    return {
        "texels": cases(
            visible=visible,
            behind=~visible & (depth < 0),
            nearer_than_the_near_plane=~visible & (depth > 0) & (depth <= i["near"]),
            facing_away=~visible & (depth > i["near"]) & (along > 0),
            seen_from_behind_within_the_slack=visible & (along > 0),
            off_the_screen=~visible & (depth > i["near"]) & (along < 0),
        ),
        "pixels around": cases(**ends),
        "off the screen": cases(
            on_it=visible & (o["outside"] == 0),
            by_less_than_a_texel=visible & (o["outside"] > 0),
        ),
        "position": cases(**{name: any_of(i["position"], name) for name in classes(i["near"])}),
        "normal": cases(**{name: any_of(i["normal"], name) for name in classes(i["near"])}),
        "focal": signed(i["focal"]),
        "near": signed(i["near"]),
    }


@quiet
def _match(i: np.ndarray, o: np.ndarray) -> Groups:
    empty = i["pixel_depth"] == np.inf
    behind = flush(flush(i["depth"])[:, None] - flush(i["pixel_depth"]))
    tolerance = depth_tolerance(i)[:, None]
    every = tolerance[:, 0]
    both = i["normal_test"] & i["depth_test"]
    tests = {
        "both": both,
        "normal alone": i["normal_test"] & ~i["depth_test"],
        "depth alone": ~i["normal_test"] & i["depth_test"],
        "none": ~i["normal_test"] & ~i["depth_test"],
    }
    degrees = {"hidden": HIDDEN, "likely": LIKELY, "seen": SEEN}
    found = {
        f"{test}, {name}": int((mask & (o["degree"] == degree)).sum())
        for test, mask in tests.items()
        for name, degree in degrees.items()
        if test != "none" or degree == LIKELY
    }
    halves = i["pixel_normal"]
    return {
        "degrees": found,
        "level of detail": values(o["lod"][o["degree"] == SEEN], TAPS),
        "levels allowed": values(i["lod_levels"], TAPS),
        "empty pixels": {str(k): int((empty.sum(axis=1) == k).sum()) for k in range(TAPS)},
        "depths": cases(
            exactly_the_tolerance=(np.abs(behind) == tolerance).any(axis=1) & (every > 0),
            exactly_the_doubt=(behind == flush(tolerance * i["depth_doubt"][:, None])).any(axis=1),
            nearer_than_all=(behind < -tolerance).all(axis=1),
            behind_all=(behind > tolerance).all(axis=1),
            NaN=np.isnan(behind).any(axis=1),
        ),
        "pixels' normals": cases(**{name: mask.any(axis=1) for name, mask in classes(halves).items()}),
        "normal": cases(**{name: any_of(i["normal"], name) for name in classes(i["depth"])}),
        "tolerance": cases(
            none=every == 0,
            a_number=np.isfinite(every),
            at_the_limit_of_the_slope=(every >= flush(i["depth_limit"] * i["depth"])) & (i["depth_limit"] > 0),
            infinite=np.isinf(every),
            NaN=np.isnan(every),
        ),
        "height of the eye": signed(i["above"]),
        "off the screen": signed(i["outside"]),
    }


@quiet
def _blend(i: np.ndarray, o: np.ndarray) -> Groups:
    known = i["count"] > 0
    finite = np.isfinite(o["irradiance"]).all(axis=1)
    return {
        "samples in the average": cases(
            none=i["count"] == 0,
            less_than_one=(i["count"] > 0) & (i["count"] < ONE_SAMPLE),
            sixteenths=(i["count"] > ONE_SAMPLE) & (i["count"] % ONE_SAMPLE > 0),
            **{f"weight_of_deviations_1/{1 << s}": mask for s, mask in enumerate(_by_weight(i["count"] >> COUNT_BITS))},
            most=i["count"] == COUNT_MAX,
        ),
        "weight": cases(
            heavy=i["heavy"] > 0,
            heavy_for_the_last_time=i["heavy"] == 1,
            of_the_mean=known & (i["heavy"] == 0) & (ONE_SAMPLE / (i["count"] + ONE_SAMPLE) > i["alpha_min"]),
            least=known & (i["heavy"] == 0) & (ONE_SAMPLE / (i["count"] + ONE_SAMPLE) < i["alpha_min"]),
        ),
        "noticed": cases(
            noticed=o["noticed"],
            not_noticed=known & ~o["noticed"] & (i["count"] >> COUNT_BITS >= i["notice_count"]),
            too_few_samples=known & (i["count"] >> COUNT_BITS < i["notice_count"]),
            no_samples_where_none_are_asked_for=(i["count"] == 0) & (i["notice_count"] == 0),
        ),
        "deviation": cases(
            falls=known & (o["deviation"] < i["deviation"]),
            stays=known & (o["deviation"] == i["deviation"]),
            rises=known & (o["deviation"] > i["deviation"]),
            greatest=o["deviation"] == RELATIVE_MAX,
        ),
        "bias": cases(
            turns=known & (i["bias"].astype(int) * o["bias"] < 0),
            darker=o["bias"] < 0,
            none=known & (o["bias"] == 0),
            brighter=o["bias"] > 0,
            heavy=(o["bias"] != 0) & (i["heavy"] > 0),
            greatest=o["bias"] == RELATIVE_MAX,
        ),
        "spread": cases(none=o["spread"] == 0, some=(o["spread"] > 0) & (o["spread"] < RELATIVE_MAX))
        | cases(greatest=o["spread"] == RELATIVE_MAX),
        "rays": cases(one=i["rays"][:, 0] == 1, several=i["rays"][:, 0] > 1, none_to_lights=i["rays"][:, 1] == 0),
        "totals": cases(
            zero=(i["total"] == 0).any(axis=1),
            negative=(i["total"] < 0).any(axis=1),
            greatest=(i["total"] == (1 << 44) - 1).any(axis=1),
        ),
        "irradiance": cases(finite=finite, not_finite=~finite, dropped_whatever_it_was=~known & finite),
        "fraction": {str(k): int((i["fraction"] == k).sum()) for k in range(12, 29)},
    }


def _by_weight(count: np.ndarray) -> list[np.ndarray]:
    return [
        (count >= low) & (count < high) for low, high in ((1, 2), (2, 4), (4, 8), (8, (COUNT_MAX >> COUNT_BITS) + 1))
    ]


BINS: dict[str, Callable[[np.ndarray, np.ndarray], Groups]] = {
    "texel_project": _project,
    "texel_match": _match,
    "texel_blend": _blend,
}
"""The groups of each unit."""
