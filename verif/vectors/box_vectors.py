"""Seeded operands for the units of the box test: rays and nodes of plausible scenes, and every kind of corner case.

A family is a function of (count, generator); `ray_time_vectors`, `box_setup_vectors` and `node_test_vectors` mix them.
"""

import numpy as np

from lightloom.golden_model.contract.formats import (
    BOX_RAY,
    BOX_SETUP,
    LATTICE_BITS,
    NODE_EXPONENT_MAX,
    NODE_TEST,
    RAY_TIME,
    SCALE_BIAS,
    TIME_BIAS,
    TIME_BITS,
    WIDTH,
    field_width,
)
from lightloom.golden_model.numerics.floats import quiet
from lightloom.golden_model.stimuli.ray_families import rays_from
from lightloom.golden_model.tracing.ray_setup import ray_setup
from lightloom.golden_model.tracing.wide_bvh.box_setup import box_setup
from lightloom.golden_model.tracing.wide_bvh.node_test import node_test
from lightloom.golden_model.tracing.wide_bvh.ray_time import ray_time
from lightloom.verif.vectors.ray_vectors import Family, Generator, mixture, raw, specials

TIME_MAX = (1 << TIME_BITS) - 1
EXPONENTS = np.array([-32768, -1000, -300, -260, -127, -126, -60, 0, 60, 109, 110, 250, 257, 258, 259, 32767])
"""Lattice exponents at which something saturates, or near; a tree has -126 to 109."""


# --- distances along a ray --------------------------------------------------------------------------------------------


def plausible_times(count: int, rng: Generator) -> np.ndarray:
    """Distances of a few units up to somewhat more than the range holds, of either sign."""
    out = np.zeros(count, dtype=RAY_TIME)
    out["rate"] = np.exp2(rng.uniform(-3, 0, count))
    out["scale"] = SCALE_BIAS + rng.integers(-40, 41, count)
    units = rng.choice(np.array([-1, 1]), count) * np.exp2(rng.uniform(-4, 27, count))
    out["t"] = np.ldexp(units / out["rate"], SCALE_BIAS - out["scale"].astype(np.int64))
    return out


def whole_times(count: int, rng: Generator) -> np.ndarray:
    """Products at, just below and just above whole numbers of units: small ones, and the ends of the range."""
    out = np.zeros(count, dtype=RAY_TIME)
    out["scale"] = SCALE_BIAS + rng.integers(-90, 91, count)
    units = rng.choice(np.array([0, 1, 2, 3, 4, 5, 1 << 22, 1 << 23, TIME_BIAS - 6, TIME_BIAS - 1, TIME_BIAS]), count)
    units = np.where(rng.integers(0, 2, count), units + rng.integers(-3, 4, count), rng.integers(0, TIME_BIAS, count))
    power = rng.integers(-5, 6, count)
    t = np.ldexp(units, SCALE_BIAS - out["scale"].astype(np.int64) - power).astype(np.float32)
    t = np.where(rng.integers(0, 2, count), t, np.nextafter(t, rng.choice(np.array([-1e38, 1e38], np.float32), count)))
    out["t"], out["rate"] = rng.choice(np.array([-1, 1]), count) * t, np.ldexp(1.0, power)
    return out


@quiet
def special_times(count: int, rng: Generator) -> np.ndarray:
    """Special values, and products at the ends of float32's range, with every scale."""
    out = np.zeros(count, dtype=RAY_TIME)
    out["t"] = np.where(rng.integers(0, 2, count), specials((count,), rng), np.exp2(rng.uniform(-149, 128, count)))
    out["rate"] = np.where(rng.integers(0, 2, count), specials((count,), rng), np.exp2(rng.uniform(-149, 128, count)))
    out["scale"] = rng.integers(0, 2 * SCALE_BIAS, count)
    return out


RAY_TIME_FAMILIES: dict[str, Family] = {
    "raw": lambda count, rng: raw(RAY_TIME, count, rng),
    "plausible": plausible_times,
    "whole": whole_times,
    "special": special_times,
}


# --- rays and lattices ------------------------------------------------------------------------------------------------


def set_up(origin: np.ndarray, direction: np.ndarray, corner: np.ndarray, exponent: np.ndarray) -> np.ndarray:
    """Rays (N, 3) each, their scenes' lattices (N, 3) and (N,), to BOX_SETUP (N,)."""
    prepared = ray_setup(rays_from(origin, direction))
    out = np.zeros(len(origin), dtype=BOX_SETUP)
    for name in ("origin", "inverse", "axis"):
        out[name] = prepared[name]
    out["direction"], out["lattice_origin"], out["lattice_exponent"] = direction, corner, exponent
    return out


def lattices(count: int, rng: Generator) -> tuple[np.ndarray, np.ndarray]:
    """Lattice exponents (N,) of scenes from 2**-20 to 2**40 and lattice origins (N, 3), a third of them zero."""
    exponent = rng.integers(-40, 21, count)
    far = rng.choice(np.array([0, 1, 100]), (count, 1))
    corner = rng.normal(size=(count, 3)) * far * np.exp2(exponent + LATTICE_BITS)[:, None]
    return exponent, corner.astype(np.float32)


def ways(count: int, rng: Generator) -> np.ndarray:
    """Directions (N, 3): to all sides, almost along an axis, along an axis or in an axis plane."""
    kind = rng.integers(0, 3, (count, 1))
    near_axis = rng.normal(size=(count, 3)) * np.exp2(rng.uniform(-30, 0, (count, 3)))
    on_axis = rng.choice(np.array([0.0, -0.0, 1.0, -1.0, 2.0, -0.5]), (count, 3))
    way = np.where(kind == 0, rng.normal(size=(count, 3)), np.where(kind == 1, near_axis, on_axis))
    return way * np.exp2(rng.integers(-8, 9, (count, 1)))


def scene_rays(count: int, rng: Generator) -> np.ndarray:
    """Origins in and beside the scene."""
    exponent, corner = lattices(count, rng)
    origin = corner + rng.uniform(-0.5, 1.5, (count, 3)) * np.exp2(exponent + LATTICE_BITS)[:, None]
    out = set_up(origin, ways(count, rng), corner, exponent)
    out["t_min"] = rng.choice(np.array([0, 1]), count) * np.exp2(rng.uniform(-10, 22, count) + exponent)
    return out


def far_rays(count: int, rng: Generator) -> np.ndarray:
    """Origins up to 2**40 times the scene's extent away: every coarseness."""
    exponent, corner = lattices(count, rng)
    reach = np.exp2(rng.uniform(-2, 40, (count, 1)) + exponent[:, None] + LATTICE_BITS)
    return set_up(corner + rng.normal(size=(count, 3)) * reach, ways(count, rng), corner, exponent)


def level_rays(count: int, rng: Generator) -> np.ndarray:
    """Components equal, neighbouring numbers or powers of two apart: ratios at and just below powers of two."""
    exponent, corner = lattices(count, rng)
    step = rng.integers(-1, 2, (count, 3)).astype(np.uint32)
    magnitude = (np.exp2(rng.uniform(-4, 4, (count, 1))).astype(np.float32).view(np.uint32) + step).view(np.float32)
    way = magnitude * np.ldexp(rng.choice(np.array([-1.0, 1.0]), (count, 3)), -rng.integers(0, 4, (count, 3)))
    return set_up(corner, way, corner, exponent)


@quiet
def special_rays(count: int, rng: Generator) -> np.ndarray:
    """Fields of plausible rays replaced by special values, and lattices of every scale."""
    out = scene_rays(count, rng)
    for name in ("origin", "direction", "inverse", "lattice_origin", "t_min"):
        shape = out[name].shape
        out[name] = np.where(rng.integers(0, 4, shape) == 0, specials(shape, rng), out[name])
    wild = np.where(rng.integers(0, 2, count), rng.choice(EXPONENTS, count), rng.integers(-130, 115, count))
    out["lattice_exponent"] = np.where(rng.integers(0, 2, count), wild, out["lattice_exponent"])
    out["axis"] = np.where(rng.integers(0, 4, count) == 0, rng.integers(0, 4, count), out["axis"])
    return out


@quiet
def long_rays(count: int, rng: Generator) -> np.ndarray:
    """Tiny scenes and directions of any length: the pad for underflow grows until the ray is blind."""
    exponent, corner = lattices(count, rng)
    exponent = exponent - rng.integers(0, 80, count)
    way = ways(count, rng) * np.exp2(rng.uniform(-60, 60, (count, 1)))
    return set_up(corner + rng.normal(size=(count, 3)) * 1e-20, way, corner, exponent)


BOX_SETUP_FAMILIES: dict[str, Family] = {
    "raw": lambda count, rng: raw(BOX_SETUP, count, rng),
    "scene": scene_rays,
    "far": far_rays,
    "level": level_rays,
    "special": special_rays,
    "long": long_rays,
}


# --- rays and nodes ---------------------------------------------------------------------------------------------------


def nodes(count: int, rng: Generator) -> np.ndarray:
    """NODE_TEST (N,) with nodes of all sizes inside the lattice, whose boxes lie anywhere in them; a quarter of the
    boxes' sides are flat. No rays yet."""
    out = np.zeros(count, dtype=NODE_TEST)
    out["exponent"] = rng.integers(0, NODE_EXPONENT_MAX - 1, (count, 1)) + rng.integers(0, 3, (count, 3))
    room = (1 << LATTICE_BITS) - (255 << out["exponent"].astype(np.int64))
    out["origin"] = rng.uniform(size=(count, 3)) * np.maximum(room, 0)
    out["count"] = rng.integers(1, WIDTH + 1, count)
    for axis in "xyz":
        lower, size = rng.integers(0, 256, (2, count, WIDTH))
        size = np.where(rng.integers(0, 4, (count, WIDTH)), size, 0)
        out[f"lower_{axis}"], out[f"upper_{axis}"] = lower, np.minimum(lower + size, 255)
    return out


def with_rays(out: np.ndarray, setups: np.ndarray) -> np.ndarray:
    """Puts rays, BOX_SETUP (N,), into NODE_TEST (N,) with the greatest t_max."""
    prepared = box_setup(setups)
    for name in set(BOX_RAY.names or ()) & set(NODE_TEST.names or ()):
        out[name] = prepared[name]
    out["t_max"] = TIME_MAX
    return out


def aimed(count: int, rng: Generator, away: float = 1.0) -> np.ndarray:
    """Rays at a point in one of the boxes, from up to about `away` extents of the scene; some end on the way."""
    out, (exponent, corner) = nodes(count, rng), lattices(count, rng)
    row, slot = np.arange(count), rng.integers(0, WIDTH, count) % out["count"]
    unit = np.ldexp(1.0, exponent)
    target = np.empty((count, 3))
    for k, axis in enumerate("xyz"):
        lower, upper = (out[f"{side}_{axis}"][row, slot].astype(np.float64) for side in ("lower", "upper"))
        plane = lower + rng.uniform(size=count) * (upper - lower)
        target[:, k] = corner[:, k] + (out["origin"][:, k] + np.ldexp(plane, out["exponent"][:, k])) * unit
    origin = (target - ways(count, rng) * (away * unit * (1 << LATTICE_BITS))[:, None]).astype(np.float32)
    setups = set_up(origin, target - origin, corner, exponent)
    out = with_rays(out, setups)
    ends = np.zeros(count, dtype=RAY_TIME)
    prepared = box_setup(setups)
    ends["t"], ends["rate"], ends["scale"] = rng.uniform(0.5, 1.5, count), prepared["rate"], prepared["scale"]
    out["t_max"] = np.where(rng.integers(0, 2, count), ray_time(ends)["high"], TIME_MAX)
    return out


def far_aimed(count: int, rng: Generator) -> np.ndarray:
    return aimed(count, rng, away=2.0**16)


def crowded(count: int, rng: Generator) -> np.ndarray:
    """Rays through the middles of nodes whose boxes all hold the middle, in any order; some are entered together."""
    out, (exponent, corner) = nodes(count, rng), lattices(count, rng)
    for axis in "xyz":
        depth = rng.integers(1, 129, (count, 1))
        out[f"lower_{axis}"], out[f"upper_{axis}"] = rng.integers(128 - depth, 128, (2, count, WIDTH))
        out[f"upper_{axis}"] = 255 - out[f"upper_{axis}"]
    size = np.ldexp(256.0, out["exponent"])
    way = ways(count, rng)
    way /= np.abs(way).max(axis=1, keepdims=True) + 1e-9
    start = out["origin"] + size / 2 - way * size.max(axis=1, keepdims=True) * rng.uniform(0, 1.5, (count, 1))
    out = with_rays(out, set_up(corner + start * np.ldexp(1.0, exponent)[:, None], way, corner, exponent))
    later = rng.integers(0, 1 << rng.integers(0, 24, count)) * (rng.integers(0, 4, count) == 0)
    out["t_min"] = np.minimum(out["t_min"] + later, TIME_MAX)
    return out


def any_node(count: int, rng: Generator) -> np.ndarray:
    """As `crowded`, but counts above 8, exponents above 13, nodes that reach out of the lattice, boxes inside out."""
    out = crowded(count, rng)
    out["count"] = rng.integers(0, 16, count)
    out["exponent"] = np.where(rng.integers(0, 4, (count, 1)) == 0, rng.integers(0, 16, (count, 3)), out["exponent"])
    out["origin"] = np.where(rng.integers(0, 8, (count, 1)) == 0, (1 << LATTICE_BITS) - 1, out["origin"])
    for axis in "xyz":
        lower, upper = out[f"lower_{axis}"].copy(), out[f"upper_{axis}"]
        turned = rng.integers(0, 16, (count, WIDTH)) == 0
        out[f"lower_{axis}"], out[f"upper_{axis}"] = np.where(turned, upper, lower), np.where(turned, lower, upper)
    return out


def corners(count: int, rng: Generator) -> np.ndarray:
    """Fields of plausible tests replaced by the ends and the middles of their ranges, impossible ones among them."""
    out = np.where(rng.integers(0, 2, count), aimed(count, rng), crowded(count, rng))
    for name in NODE_TEST.names or ():
        base, shape = NODE_TEST[name].base, (count, *NODE_TEST[name].shape)
        ones = (1 << field_width(base)) - 1
        values = {0, 1, ones // 2, ones // 2 + 1, max(ones - 1, 0), ones}
        chosen = rng.choice(np.array(sorted(values), dtype=np.int64), shape).astype(base)
        one_in = 32 if name.startswith(("lower", "upper")) else 8
        out[name] = np.where(rng.integers(0, one_in, shape) == 0, chosen, out[name])
    return out


def at_t_max(count: int, rng: Generator) -> np.ndarray:
    """t_max at, just before or just after the entry of one of the children."""
    out = aimed(count, rng)
    out["t_max"] = TIME_MAX
    hits = node_test(out)
    chosen = hits["entry"][np.arange(count), rng.integers(0, 8, count) % np.maximum(hits["count"], 1)]
    out["t_max"] = np.clip(chosen.astype(np.int64) + rng.integers(-1, 2, count), 0, TIME_MAX)
    return out


NODE_TEST_FAMILIES: dict[str, Family] = {
    "raw": lambda count, rng: raw(NODE_TEST, count, rng),
    "aimed": aimed,
    "far": far_aimed,
    "crowded": crowded,
    "corners": corners,
    "any_node": any_node,
    "at_t_max": at_t_max,
}


def ray_time_vectors(count: int, seed: int) -> np.ndarray:
    """RAY_TIME (count,)."""
    return mixture(RAY_TIME_FAMILIES, count, seed)


def box_setup_vectors(count: int, seed: int) -> np.ndarray:
    """BOX_SETUP (count,)."""
    return mixture(BOX_SETUP_FAMILIES, count, seed)


def node_test_vectors(count: int, seed: int) -> np.ndarray:
    """NODE_TEST (count,)."""
    return mixture(NODE_TEST_FAMILIES, count, seed)
