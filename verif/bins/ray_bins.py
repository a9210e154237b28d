"""Functional bins of ray setup, the triangle test and the box test, out of operands and the model's results."""

from collections.abc import Callable

import numpy as np

from lightloom.golden_model.contract.formats import NODE_EXPONENT_MAX, SCALE_BIAS, TIME_BITS, WIDTH
from lightloom.golden_model.numerics.floats import float_multiply, flush, quiet
from lightloom.golden_model.tracing.ray_triangle import ray_triangle
from lightloom.golden_model.tracing.wide_bvh.node_test import node_test
from lightloom.golden_model.tracing.wide_bvh.ray_time import TIME_MAX
from lightloom.verif.bins.coverage import Groups, cases
from lightloom.verif.bins.number_bins import classes, signed

VERTICES = ("v0", "v1", "v2")


def values(field: np.ndarray, count: int) -> dict[str, int]:
    """How often each of the numbers 0 to count - 1 occurs in a field, on whatever axis."""
    return {str(k): int(n) for k, n in enumerate(np.bincount(field.ravel(), minlength=count))}


def octants(backwards: np.ndarray) -> dict[str, int]:
    """Signs of directions, bool (N, 3)."""
    number = backwards @ np.array([4, 2, 1])
    return {"".join("-" if k >> s & 1 else "+" for s in (2, 1, 0)): int((number == k).sum()) for k in range(8)}


def any_of(x: np.ndarray, name: str) -> np.ndarray:
    """Which records have a component (N, 3) of a class."""
    return np.asarray(classes(x)[name].any(axis=1))


@quiet
def _ray_setup(i: np.ndarray, o: np.ndarray) -> Groups:
    direction = flush(i["direction"])
    size = np.abs(i["direction"])
    x, y, z = size.T
    invalid = np.isnan(o["shear"]).any(axis=1)
    return {
        "dominant axis": {
            f"{'-' if flip else '+'}{name}": int(((o["axis"] == k) & (o["flip"] == flip)).sum())
            for k, name in enumerate("xyz")
            for flip in (False, True)
        },
        "ties of the greatest": cases(
            x_and_y=(x == y) & (x > z),
            y_and_z=(y == z) & (y > x),
            x_and_z=(x == z) & (x > y),
            all_three=(x == y) & (y == z) & (x > 0),
        ),
        "directions": {
            f"{axis} {name}": count
            for k, axis in enumerate("xyz")
            for name, count in signed(i["direction"][:, k]).items()
        },
        "origins": cases(**{name: any_of(i["origin"], name) for name in classes(x)}),
        "ranges": {f"{name} {kind}": n for name in ("t_min", "t_max") for kind, n in signed(i[name]).items()},
        "rays that hit nothing": cases(
            zero_direction=invalid & (direction == 0).all(axis=1),
            direction_not_finite=invalid & ~np.isfinite(direction).all(axis=1),
            reciprocal_flushed=invalid & (size.max(axis=1) > 2.0**126) & np.isfinite(direction).all(axis=1),
            none=~invalid,
        ),
        "reciprocals": {name: count for name, count in signed(o["inverse"]).items() if not name.endswith("subnormal")},
    }


@quiet
def _ray_triangle(i: np.ndarray, o: np.ndarray) -> Groups:
    hit, front = o["hit"], o["front"]
    free = i.copy()
    free["t_min"], free["t_max"] = -np.inf, np.inf
    on_plane = ray_triangle(free)
    free["cull"] = False
    either = ray_triangle(free)
    vertices = np.stack([i[name] for name in VERTICES], axis=1)
    same = [(vertices[:, k] == vertices[:, (k + 1) % 3]).all(axis=1) for k in range(3)]
    t_min, t_max = flush(i["t_min"]), flush(i["t_max"])
    u, v = o["u"], o["v"]
    return {
        "dominant axis": {
            f"{'-' if flip else '+'}{name}": int((hit & (i["axis"] == k) & (i["flip"] == flip)).sum())
            for k, name in enumerate("xyz")
            for flip in (False, True)
        },
        "outcomes": cases(
            front_face=hit & front,
            back_face=hit & ~front,
            front_face_with_culling=hit & front & i["cull"],
            back_face_culled=either["hit"] & ~on_plane["hit"],
            before_the_range=on_plane["hit"] & ~hit & (on_plane["t"] <= t_min),
            beyond_the_range=on_plane["hit"] & ~hit & (on_plane["t"] > t_max),
            miss=~either["hit"],
        ),
        "ends of the range": cases(
            hit_at_t_max=hit & (o["t"] == t_max),
            miss_at_t_min=on_plane["hit"] & ~hit & (on_plane["t"] == t_min),
            hit_just_beyond_t_min=hit & (o["t"] == np.nextafter(t_min, np.float32(np.inf))),
            miss_just_beyond_t_max=on_plane["hit"] & ~hit & (t_max == np.nextafter(on_plane["t"], np.float32(-np.inf))),
            negative_t=hit & (o["t"] < 0),
            t_of_zero=hit & (o["t"] == 0),
        ),
        "edges and vertices": cases(
            edge_v0_v1=hit & (v == 0) & (u > 0) & (u < 1),
            edge_v0_v2=hit & (u == 0) & (v > 0) & (v < 1),
            edge_v1_v2=hit & (u + v == 1) & (u > 0) & (v > 0),
            vertex_v0=hit & (u == 0) & (v == 0),
            vertex_v1=hit & (u == 1) & (v == 0),
            vertex_v2=hit & (u == 0) & (v == 1),
        ),
        "triangles without area": cases(
            v0_is_v1=same[0], v1_is_v2=same[1], v2_is_v0=same[2], all_one=same[0] & same[1]
        ),
        "vertices": cases(**{name: classes(vertices)[name].any(axis=(1, 2)) for name in classes(u)}),
        "shear": cases(**{name: any_of(i["shear"], name) for name in classes(u)}),
        "range": {f"{name} {kind}": n for name in ("t_min", "t_max") for kind, n in signed(i[name]).items()},
    }


@quiet
def _ray_time(i: np.ndarray, o: np.ndarray) -> Groups:
    product = float_multiply(i["t"], i["rate"])
    known = np.isfinite(product)
    middle = 1 << (TIME_BITS - 1)
    return {
        "t": signed(i["t"]),
        "product": {name: count for name, count in signed(product).items() if not name.endswith("subnormal")},
        "result": cases(
            both_in_range=known & (o["low"] > 0) & (o["high"] < TIME_MAX),
            low_saturates=known & (o["low"] == 0) & (o["high"] > 5) & (o["high"] < TIME_MAX),
            both_saturate_below=known & (o["high"] == 5),
            high_saturates=known & (o["high"] == TIME_MAX) & (o["low"] > 0),
            unknown=~known & (o["low"] == 0) & (o["high"] == TIME_MAX),
            at_the_origin=known & (o["low"] < middle) & (o["high"] > middle),
        ),
        "scale": cases(least=i["scale"] == 0, none=i["scale"] == SCALE_BIAS, greatest=i["scale"] == 2 * SCALE_BIAS - 1),
    }


@quiet
def _box_setup(i: np.ndarray, o: np.ndarray) -> Groups:
    return {
        "dominant axis": values(i["axis"], 4),
        "octants": octants(o["backwards"]),
        "steepness": values(o["steepness"], 28),
        "coarseness": values(o["coarseness"], 32),
        "rays": cases(blind=o["blind"], seeing=~o["blind"]),
        "pad": cases(none=o["pad"] == 0, least=o["pad"] == 22, more=o["pad"] > 22),
        # No ray's unit is small enough for the greatest scale: it lies at some distance from the lattice.
        "scale": cases(least=o["scale"] == 0, more=o["scale"] > 0),
        "t_min": cases(saturates=o["t_min"] == 0, in_range=(o["t_min"] > 0) & (o["t_min"] < TIME_MAX - 10)),
        "inverse": cases(**{name: any_of(i["inverse"], name) for name in classes(i["t_min"])}),
    }


def _node_test(i: np.ndarray, o: np.ndarray) -> Groups:
    count = o["count"].astype(int)
    listed = np.arange(WIDTH) < count[:, None]
    pairs = listed[:, 1:]
    turned = (o["slot"][:, :-1] > o["slot"][:, 1:]) & pairs
    same = (o["entry"][:, :-1] == o["entry"][:, 1:]) & pairs
    endless = i.copy()
    endless["t_max"] = TIME_MAX
    whole = node_test(endless)["count"]
    return {
        "children": values(i["count"], 16),
        "children entered": values(o["count"], WIDTH + 1),
        "slot of the nearest": values(o["slot"][count > 0, 0], WIDTH),
        "slot of the farthest": values(o["slot"][np.arange(len(o)), np.maximum(count - 1, 0)][count > 1], WIDTH),
        "order": cases(
            as_stored=(count > 1) & ~turned.any(axis=1),
            turned=turned.any(axis=1),
            equal_entries=same.any(axis=1),
            four_or_more_turned_round=(count >= 4) & (turned.sum(axis=1) == count - 1),
        ),
        "rays": cases(
            blind=i["blind"],
            in_a_box=(listed & (o["entry"] == i["t_min"][:, None]) & ~i["blind"][:, None]).any(axis=1),
            cut_at_t_max=o["count"] < whole,
        ),
        "octants": octants(i["backwards"]),
        "steepness": values(i["steepness"], 32),
        "coarseness": values(i["coarseness"], 32),
        "exponent": values(i["exponent"], 16),
        "exponent beyond the greatest": cases(one=(i["exponent"] > NODE_EXPONENT_MAX).any(axis=1)),
    }


BINS: dict[str, Callable[[np.ndarray, np.ndarray], Groups]] = {
    "ray_setup": _ray_setup,
    "ray_triangle": _ray_triangle,
    "ray_triangle_half": _ray_triangle,
    "ray_time": _ray_time,
    "box_setup": _box_setup,
    "node_test": _node_test,
}
"""The groups of each unit."""
