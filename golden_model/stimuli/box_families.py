"""Seeded rays and boxes of nodes that attack the box test: each family is a function of (count, generator) to `Cases`.

A ray comes with one node of eight boxes, and is aimed at or past one of them; the other boxes are where they are. The
same arguments give the same cases on every machine.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from lightloom.golden_model.contract.formats import (
    BOX_SETUP,
    F4,
    LATTICE_BITS,
    NODE_BLOCK,
    NODE_EXPONENT_MAX,
    NODE_KIND,
    NODE_TEST,
    RAY,
    RAY_TIME,
    WIDTH,
)
from lightloom.golden_model.numerics.floats import quiet
from lightloom.golden_model.tracing.ray_setup import ray_setup
from lightloom.golden_model.tracing.wide_bvh.box_setup import box_setup
from lightloom.golden_model.tracing.wide_bvh.ray_time import ray_time

Generator = np.random.Generator
AXES = "xyz"
LAST = 255
"""The greatest plane of a box."""
GREATEST = float(np.finfo(np.float32).max)
LEAST_LATTICE, GREATEST_LATTICE = -126, 110
"""Lattice exponents that scenes can have."""
PADDING = 16
"""How far outside its box, in the ray's units, a hit may lie by the box test's pad (`box_setup.PAD`)."""


@dataclass(frozen=True, kw_only=True)
class Cases:
    """Rays with a node each."""

    rays: np.ndarray
    """RAY (N,), all valid: they may hit something."""
    setups: np.ndarray
    """BOX_SETUP (N,) of the same rays."""
    nodes: np.ndarray
    """NODE_BLOCK (N,), eight boxes each."""

    def corners(self) -> tuple[np.ndarray, np.ndarray]:
        """The lower and the upper corners of the boxes, in lattice units: int64 (N, 8, 3) each."""
        return corners_of(self.nodes)

    def box_rays(self) -> np.ndarray:
        """BOX_RAY (N,)."""
        return box_setup(self.setups)

    def tests(self, box_rays: np.ndarray) -> np.ndarray:
        """NODE_TEST (N,), with t_max as it is before any hit."""
        times = np.zeros(len(self.rays), dtype=RAY_TIME)
        times["t"], times["rate"], times["scale"] = self.rays["t_max"], box_rays["rate"], box_rays["scale"]
        out = np.zeros(len(self.rays), dtype=NODE_TEST)
        for source in (box_rays, self.nodes):
            for name in set(source.dtype.names or ()) & set(NODE_TEST.names or ()):
                out[name] = source[name]
        out["t_max"] = ray_time(times)["high"]
        return out


def corners_of(nodes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The lower and the upper corners of the boxes of NODE_BLOCK (N,), in lattice units: int64 (N, 8, 3) each."""
    origin, exponent = nodes["origin"].astype(np.int64)[:, None], nodes["exponent"].astype(np.int64)[:, None]
    planes = (np.stack([nodes[f"{side}_{axis}"] for axis in AXES], axis=2) for side in ("lower", "upper"))
    lower, upper = (origin + (plane.astype(np.int64) << exponent) for plane in planes)
    return lower, upper


# --- lattices, nodes, points ------------------------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class Boxes:
    """Nodes on lattices of their own, one of their boxes chosen."""

    lattice_origin: np.ndarray
    """float32 (N, 3)."""
    lattice_exponent: np.ndarray
    """int64 (N,)."""
    nodes: np.ndarray
    """NODE_BLOCK (N,)."""
    lower: np.ndarray
    """The chosen box's lower corner, lattice units, int64 (N, 3)."""
    upper: np.ndarray
    """Its upper corner."""

    def world(self, point: np.ndarray) -> np.ndarray:
        """Points (N, 3) in lattice units, in the scene's: float64 (N, 3)."""
        return self.lattice_origin.astype(np.float64) + np.ldexp(point, self.lattice_exponent[:, None])

    def extent(self) -> np.ndarray:
        """The lattice's extent in the scene's unit, float64 (N, 1)."""
        return np.ldexp(1.0, self.lattice_exponent + LATTICE_BITS)[:, None]


def blocks(count: int, rng: Generator, *, exponents: np.ndarray | None = None, flat: bool = False) -> np.ndarray:
    """NODE_BLOCK (N,) of eight boxes of all sizes within the lattice; `exponents` (N, 3) if not any."""
    out = np.zeros(count, dtype=NODE_BLOCK)
    out["kind"], out["count"] = NODE_KIND, WIDTH
    if exponents is None:
        exponents = rng.integers(0, NODE_EXPONENT_MAX + 1, (count, 3))
        exponents[: count // 2] = exponents[: count // 2, :1]
    out["exponent"] = exponents
    size = 1 << LATTICE_BITS
    reach = np.minimum(LAST << exponents, size - 1)
    corner = (rng.random((count, 3)) * (size - reach)).astype(np.int64)
    # Some at the lattice's very ends.
    corner = np.where(rng.integers(0, 16, (count, 3)) == 0, rng.choice([0, size - 1], (count, 3)), corner)
    out["origin"] = corner
    room = np.minimum((size - 1 - corner) >> exponents, LAST)[:, None]
    first = (rng.random((count, WIDTH, 3)) * (room + 1)).astype(np.int64)
    thick = (room - first + 1) >> rng.integers(0, 9, (count, WIDTH, 3))
    if flat:
        thick *= rng.integers(0, 2, (count, WIDTH, 3))
    for k, axis in enumerate(AXES):
        out[f"lower_{axis}"] = first[:, :, k]
        out[f"upper_{axis}"] = np.minimum(first + thick, room)[:, :, k]
    return out


def boxes(
    count: int,
    rng: Generator,
    *,
    lattices: tuple[int, int] = (-16, 20),
    rare: tuple[int, int] | None = None,
    nodes: np.ndarray | None = None,
    away: int = 12,
) -> Boxes:
    """Nodes on lattices of exponents in a range, an eighth of them in a `rare` one.

    Half of the lattices begin at zero, the others up to 2**away extents from it.
    """
    nodes = blocks(count, rng) if nodes is None else nodes
    exponent = rng.integers(lattices[0], lattices[1] + 1, count)
    if rare is not None:
        exponent = np.where(rng.integers(0, 8, count) == 0, rng.integers(rare[0], rare[1] + 1, count), exponent)
    extent = np.ldexp(1.0, exponent + LATTICE_BITS)[:, None]
    distance = extent * np.ldexp(1.0, rng.integers(-2, away + 1, (count, 1)))
    origin = rng.uniform(-1, 1, (count, 3)) * distance * rng.integers(0, 2, (count, 1))
    lower, upper = corners_of(nodes)
    row, slot = np.arange(count), rng.integers(0, WIDTH, count)
    return Boxes(
        lattice_origin=narrow(origin),
        lattice_exponent=exponent,
        nodes=nodes,
        lower=lower[row, slot],
        upper=upper[row, slot],
    )


def narrow(x: np.ndarray) -> np.ndarray:
    """float64 to float32, beyond its range to its greatest number."""
    return np.clip(x, -GREATEST, GREATEST).astype(np.float32)


def cases(
    where: Boxes,
    origin: np.ndarray,
    direction: np.ndarray,
    t_min: np.ndarray | float = 0,
    t_max: np.ndarray | float = np.inf,
) -> Cases:
    """Cases of origins and directions (N, 3) in the scene's unit; those whose ray is invalid are left out."""
    rays = np.zeros(len(origin), dtype=RAY)
    rays["origin"], rays["direction"] = narrow(origin), narrow(direction)
    rays["t_min"], rays["t_max"] = t_min, t_max
    prepared = ray_setup(rays)
    setups = np.zeros(len(rays), dtype=BOX_SETUP)
    for name in ("origin", "inverse", "axis", "t_min"):
        setups[name] = prepared[name]
    setups["direction"] = rays["direction"]
    setups["lattice_origin"], setups["lattice_exponent"] = where.lattice_origin, where.lattice_exponent
    valid = np.flatnonzero(~np.isnan(prepared["shear"][:, 0]) & (prepared["t_min"] < prepared["t_max"]))
    return Cases(rays=rays[valid], setups=setups[valid], nodes=where.nodes[valid])


def lengths(direction: np.ndarray, rng: Generator, low: int = -8, high: int = 8) -> np.ndarray:
    """Directions (N, 3) with their greatest component between 2**low and 2**high; zero where they are zero."""
    greatest = np.abs(direction).max(axis=1, keepdims=True)
    scale = np.ldexp(1 + rng.random(len(direction)), rng.integers(low, high, len(direction)))[:, None]
    return direction / np.where(greatest > 0, greatest, 1) * scale


def origins(where: Boxes, rng: Generator) -> np.ndarray:
    """Points (N, 3) of the scene's unit in and around the lattice, and around the chosen box: as float32 has them."""
    count = len(where.nodes)
    size = float(1 << LATTICE_BITS)
    around = rng.uniform(-0.5, 1.5, (count, 3)) * size
    thick = np.maximum(where.upper - where.lower, 1)
    close = where.lower + rng.uniform(-3, 4, (count, 3)) * thick
    return narrow(where.world(np.where(rng.integers(0, 2, (count, 1)), around, close))).astype(np.float64)


# --- families ---------------------------------------------------------------------------------------------------------


def as_in_trees(count: int, rng: Generator) -> Cases:
    """Nodes as trees have them, their boxes about half as long each as the node's, and rays that enter such a node."""
    exponents = np.clip(rng.integers(4, 13, (count, 1)) + rng.integers(-1, 2, (count, 3)), 0, NODE_EXPONENT_MAX)
    nodes = blocks(count, rng, exponents=exponents)
    room = np.minimum(((1 << LATTICE_BITS) - 1 - nodes["origin"].astype(np.int64)) >> exponents, LAST)[:, None]
    thick = (room * rng.uniform(0.25, 0.75, (count, WIDTH, 3))).astype(np.int64)
    first = (rng.random((count, WIDTH, 3)) * (room - thick + 1)).astype(np.int64)
    for k, axis in enumerate(AXES):
        nodes[f"lower_{axis}"], nodes[f"upper_{axis}"] = first[:, :, k], (first + thick)[:, :, k]
    where = boxes(count, rng, nodes=nodes, away=2)
    origin = where.world(rng.random((count, 3)) * (1 << LATTICE_BITS))
    corner = nodes["origin"].astype(np.int64)
    target = where.world(corner + rng.random((count, 3)) * (room[:, 0] << exponents))
    return cases(where, origin, lengths(target - origin, rng, -8, 1))


def anywhere(count: int, rng: Generator) -> Cases:
    """From points in the lattice in all directions, past boxes of all sizes."""
    where = boxes(count, rng)
    origin = where.world(rng.random((count, 3)) * (1 << LATTICE_BITS))
    return cases(where, origin, lengths(rng.uniform(-1, 1, (count, 3)), rng))


def aimed(count: int, rng: Generator) -> Cases:
    """At points of the box, from in and around the lattice."""
    where = boxes(count, rng)
    origin = origins(where, rng)
    target = where.lower + rng.random((count, 3)) * (where.upper - where.lower)
    return cases(where, origin, lengths(where.world(target) - origin, rng))


def grazed_edge(where: Boxes, outside: np.ndarray, rng: Generator) -> tuple[np.ndarray, np.ndarray]:
    """A point (N, 3) on an edge of the box, moved out by `outside` (N, 1) lattice units on both its axes, and a
    direction that touches the moved edge from outside.
    """
    count = len(where.nodes)
    side = rng.integers(0, 2, (count, 3)).astype(bool)
    inner = where.lower + rng.random((count, 3)) * (where.upper - where.lower)
    along = (rng.integers(0, 3, count)[:, None] == np.arange(3)) & (rng.integers(0, 4, (count, 1)) > 0)
    point = np.where(along, inner, np.where(side, where.upper + outside, where.lower - outside))
    # Outwards on one of the edge's axes, inwards on another.
    inwards = np.where(side, -1.0, 1.0)
    way = rng.integers(0, 2, (count, 1)) * 2 - 1.0
    sign = inwards * np.where(np.arange(3) == (np.argmax(along, axis=1)[:, None] + 1) % 3, way, -way)
    steep = np.ldexp(1 + rng.random((count, 3)), -(rng.integers(0, 30, (count, 3)) >> rng.integers(0, 5, (count, 3))))
    return point, np.where(along, rng.uniform(-1, 1, (count, 3)), sign) * steep


def grazing(count: int, rng: Generator) -> Cases:
    """Past edges and corners of the box grown by what it must be grown by, a little inside or outside it."""
    where = boxes(count, rng, away=2)
    off = rng.choice([0, 0, 2.0**-6, -(2.0**-6), 0.25, 0.5, 1, -1], (count, 1))
    # The unit is a quarter of a lattice unit for origins in or near the lattice.
    point, direction = grazed_edge(where, (PADDING - off) / 4, rng)
    reach = (1 << LATTICE_BITS) * rng.random((count, 1))
    reach = reach * np.ldexp(1.0, -rng.integers(0, 16, (count, 1)))
    greatest = np.abs(direction).max(axis=1, keepdims=True)
    origin = narrow(where.world(point - direction / greatest * reach)).astype(np.float64)
    again = rng.integers(0, 2, (count, 1)).astype(bool)
    way = np.where(again, where.world(point) - origin, direction)
    return cases(where, origin, lengths(way, rng))


def axis_parallel(count: int, rng: Generator) -> Cases:
    """Along an axis or in an axis plane, zeros of both signs; in planes of the box and of the grown box, or beside."""
    where = boxes(count, rng, away=2)
    plane = np.where(rng.integers(0, 2, (count, 3)), where.lower, where.upper)
    off = rng.choice([0, 0, 1 / 4, 1, 4, 4.25, 4.5, 5], (count, 3)) * rng.choice([-1, 1], (count, 3))
    beside = np.where(rng.integers(0, 2, (count, 3)), plane + off, (where.lower + where.upper) / 2)
    moving = rng.integers(0, 3, (count, 1)) == np.arange(3)
    moving |= rng.integers(0, 4, (count, 3)) == 0
    direction = np.where(moving, rng.choice([-1.0, 1.0, 0.5, -3.0], (count, 3)), rng.choice([0.0, -0.0], (count, 3)))
    origin = narrow(where.world(beside - direction * rng.uniform(-1, 1, (count, 1)) * (1 << LATTICE_BITS)))
    step = rng.choice([-np.inf, 0, np.inf], (count, 3)).astype(np.float32)
    return cases(where, np.where(step == 0, origin, np.nextafter(origin, step)), direction)


def on_the_box(count: int, rng: Generator) -> Cases:
    """From faces, edges and corners of the box, in all directions, t_min zero, least, or a little below zero."""
    where = boxes(count, rng, away=2)
    inner = where.lower + rng.random((count, 3)) * (where.upper - where.lower)
    kind = rng.integers(0, 3, (count, 3))
    point = np.where(kind == 0, where.lower, np.where(kind == 1, where.upper, np.rint(inner)))
    direction = rng.uniform(-1, 1, (count, 3)) * (rng.integers(0, 4, (count, 3)) > 0)
    t_min = rng.choice(np.array([0, -0.0, 2.0**-126, -1e-6], dtype=F4), count)
    return cases(where, where.world(point), lengths(direction, rng), t_min)


def from_afar(count: int, rng: Generator) -> Cases:
    """At points of the box from 2**-2 to 2**40 extents away."""
    where = boxes(count, rng, away=2)
    away = lengths(rng.uniform(-1, 1, (count, 3)), rng, -2, 40) * where.extent()
    target = where.world(where.lower + rng.random((count, 3)) * (where.upper - where.lower))
    origin = narrow(target + away).astype(np.float64)
    return cases(where, origin, lengths(target - origin, rng))


def past_from_afar(count: int, rng: Generator) -> Cases:
    """From 2**-1 to 2**10 extents away past edges of the box grown by what it must be grown by at that distance."""
    where = boxes(count, rng, away=0)
    octave = rng.integers(0, 10, (count, 1))
    # From 2**k extents on the unit has doubled k + 1 times: to half a lattice unit, one, two ...
    point, direction = grazed_edge(where, np.ldexp(PADDING - rng.choice([0, 0.25, 1], (count, 1)), octave - 1), rng)
    greatest = np.abs(direction).max(axis=1, keepdims=True)
    reach = np.ldexp(1 + rng.random((count, 1)), octave + LATTICE_BITS)
    origin = narrow(where.world(point - direction / greatest * reach)).astype(np.float64)
    return cases(where, origin, lengths(where.world(point) - origin, rng))


def flat(count: int, rng: Generator) -> Cases:
    """Boxes without thickness on one axis to all, rays at them, and within their planes."""
    where = boxes(count, rng, nodes=blocks(count, rng, flat=True), away=2)
    target = where.world(where.lower + rng.random((count, 3)) * (where.upper - where.lower))
    origin = origins(where, rng)
    within = (rng.integers(0, 2, (count, 1)) > 0) & (rng.integers(0, 3, (count, 1)) == np.arange(3))
    origin = narrow(np.where(within, target, origin)).astype(np.float64)
    zero = rng.choice([0.0, -0.0], (count, 3))
    return cases(where, origin, lengths(np.where(within, zero, target - origin), rng))


def tiny_scenes(count: int, rng: Generator) -> Cases:
    """Lattices around the exponents from which on the pad for underflow grows, and down to the least."""
    where = boxes(count, rng, lattices=(-48, -25), rare=(LEAST_LATTICE, -48), away=0)
    origin = origins(where, rng)
    target = where.world(where.lower + rng.random((count, 3)) * (where.upper - where.lower))
    return cases(where, origin, lengths(target - origin, rng, -40, 4))


def huge_scenes(count: int, rng: Generator) -> Cases:
    """Lattices up to the greatest exponent, origins up to the greatest number, so that distances overflow."""
    where = boxes(count, rng, lattices=(60, 104), rare=(104, GREATEST_LATTICE), away=0)
    origin = narrow(
        np.where(rng.integers(0, 2, (count, 1)), origins(where, rng), rng.uniform(-1, 1, (count, 3)) * GREATEST)
    )
    target = where.world(where.lower + rng.random((count, 3)) * (where.upper - where.lower))
    return cases(where, origin, lengths(target - origin, rng, -20, 126))


@quiet
def at_the_range(count: int, rng: Generator) -> Cases:
    """At and past the box, with a t_min or t_max where the ray enters or leaves it, or a few numbers beside that."""
    where = boxes(count, rng)
    origin = origins(where, rng)
    target = where.lower + rng.random((count, 3)) * (where.upper - where.lower)
    direction = narrow(lengths(where.world(target) - origin, rng)).astype(np.float64)
    way = np.where(direction == 0, 1, direction)
    enters, leaves = ((where.world(corner) - origin) / way for corner in (where.lower, where.upper))
    enters, leaves = np.minimum(enters, leaves).max(axis=1), np.maximum(enters, leaves).min(axis=1)
    start = rng.integers(0, 2, count).astype(bool)
    bound = narrow(np.where(start, leaves, enters))
    for _ in range(3):
        bound = np.nextafter(bound, rng.choice(np.array([-np.inf, 0, np.inf], dtype=F4), count))
    return cases(where, origin, direction, np.where(start, bound, -np.inf), np.where(start, np.inf, bound))


def steep(count: int, rng: Generator) -> Cases:
    """Components whose ratios are powers of two or the numbers beside them, from 1 to beyond the steepest."""
    where = boxes(count, rng, away=2)
    origin = origins(where, rng)
    power = narrow(np.ldexp(1.0, -rng.integers(0, 40, (count, 3)) * rng.integers(0, 2, (count, 3))))
    beside = np.nextafter(power, rng.choice(np.array([0, 1, np.inf], dtype=F4), (count, 3)))
    common = (1 + rng.random((count, 1))) * rng.integers(0, 2, (count, 1)) + 1
    direction = beside * common * rng.choice([-1, 1], (count, 3))
    # So that the ray passes the box, the origin lies as far before the box as the direction goes.
    target = where.world(where.lower + rng.random((count, 3)) * (where.upper - where.lower))
    ahead = target - direction * where.extent() * rng.random((count, 1))
    return cases(where, np.where(rng.integers(0, 4, (count, 1)), ahead, origin), direction)


def level(count: int, rng: Generator) -> Cases:
    """Components equal or one or two numbers apart, so that a ratio may be rounded to less than 1."""
    where = boxes(count, rng, away=2)
    direction = np.repeat(narrow(1 + rng.random((count, 1))), 3, axis=1)
    for _ in range(2):
        direction = np.nextafter(direction, rng.choice(np.array([0, 1.5, 4], dtype=F4), (count, 3)))
    direction = direction * rng.choice([-1, 1], (count, 3))
    outside = rng.choice([0, PADDING / 4, PADDING / 4 - 0.25], (count, 1))
    side = np.where(rng.integers(0, 2, (count, 3)), where.upper + outside, where.lower - outside)
    ahead = where.world(side) - direction * where.extent() * rng.random((count, 1))
    return cases(where, ahead, direction)


def limits(count: int, rng: Generator) -> Cases:
    """Nodes of the least and the greatest exponent, at the ends of the lattice and beyond it."""
    nodes = blocks(count, rng, exponents=rng.choice([0, NODE_EXPONENT_MAX], (count, 3)))
    beyond = rng.integers(0, 2, count).astype(bool)
    nodes["origin"] = np.where(
        beyond[:, None], rng.choice([0, 1, (1 << LATTICE_BITS) - 1], (count, 3)), nodes["origin"]
    )
    for axis in AXES:
        first = rng.choice([0, 1, 254, LAST], (count, WIDTH))
        last = np.maximum(first, rng.choice([0, 1, 254, LAST], (count, WIDTH)))
        nodes[f"lower_{axis}"] = np.where(beyond[:, None], first, nodes[f"lower_{axis}"])
        nodes[f"upper_{axis}"] = np.where(beyond[:, None], last, nodes[f"upper_{axis}"])
    where = boxes(count, rng, nodes=nodes, away=2)
    origin = origins(where, rng)
    side = np.where(rng.integers(0, 2, (count, 3)), where.upper + PADDING / 4, where.lower - PADDING / 4)
    inner = where.lower + rng.random((count, 3)) * (where.upper - where.lower)
    target = np.where(rng.integers(0, 2, (count, 3)), side, inner)
    return cases(where, origin, lengths(where.world(target) - origin, rng))


BOX_FAMILIES: dict[str, Callable[[int, Generator], Cases]] = {
    family.__name__: family
    for family in (
        as_in_trees,
        anywhere,
        aimed,
        grazing,
        axis_parallel,
        on_the_box,
        from_afar,
        past_from_afar,
        flat,
        tiny_scenes,
        huge_scenes,
        at_the_range,
        steep,
        level,
        limits,
    )
}
