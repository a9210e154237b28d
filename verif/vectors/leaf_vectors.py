"""Seeded rays and the leaves that they visit, for the bench of the leaf stage, and what comes of them.

Triangles lie on a coarse grid around the origin, so that equal t (also -0 and +0, from triangles through a ray's
origin) are common, and blocks share triangles under different indices.
"""

import functools
from dataclasses import dataclass, field

import numpy as np

from lightloom.golden_model.contract import bitpack
from lightloom.golden_model.contract.formats import (
    HIT,
    LEAF_RAY,
    RAY,
    RAY_TIME,
    TRACE_ERRORS,
    TRIANGLE,
    TRIANGLE_BLOCK,
    TRIANGLES_KIND,
)
from lightloom.golden_model.numerics.floats import quiet
from lightloom.golden_model.stimuli.ray_families import rays_from
from lightloom.golden_model.tracing.ray_setup import ray_setup
from lightloom.golden_model.tracing.ray_triangle import ray_triangle, triangle_tests
from lightloom.golden_model.tracing.wide_bvh.ray_time import ray_time

Generator = np.random.Generator
POOL = 200
"""Different blocks."""
T_LIMITS = np.array([np.inf, 1.5, 1.0, 0.0, -0.0, 1e-40, -1e-40, 2.0**-126, -0.5], np.float32)


@dataclass
class Visit:
    """A block for a ray, and what it holds for it."""

    block: int
    """TRIANGLE_BLOCK, as its payload."""
    memory_error: bool
    error: int
    """Of TRACE_ERRORS."""
    tests: int
    """Triangles that the ray's mask shows."""
    may_hit: bool = False
    """A test hits within the ray's own range."""
    must_hit: bool = False
    """One hits also up to the best t of all visits before."""


@dataclass
class Ray:
    """A ray, its visits in the order in which they are to begin, and the best hit after each."""

    data: int
    """LEAF_RAY, as its payload."""
    any_hit: bool = False
    visits: list[Visit] = field(default_factory=list)
    bests: list[int] = field(default_factory=list)
    """The best HIT, as its payload, after the first 0, 1, … visits; primitive -1 and zeros for a miss."""
    times: list[int] = field(default_factory=list)
    """`high` of ray_time for the best t, after the first 0, 1, … visits."""


def triangle_blocks(rng: Generator, count: int = POOL) -> np.ndarray:
    """TRIANGLE_BLOCK (count,), one in twelve of them no proper one; what is reserved is random."""
    blocks = np.zeros(count, TRIANGLE_BLOCK)
    corners = rng.integers(-2, 3, (count, 4, 3)).astype(np.float32)
    off_grid = rng.random(count) < 0.3
    corners[off_grid] += rng.normal(size=(off_grid.sum(), 4, 3)).astype(np.float32)
    # One plane in three is z = 0 or the like, where rays begin.
    flat = np.flatnonzero(rng.random(count) < 0.3)
    corners[flat, :, rng.integers(0, 3, len(flat))] = 0
    again = np.flatnonzero(rng.random(count) < 0.2)
    corners[again] = corners[rng.integers(0, count, len(again))]
    blocks["vertices"] = corners.reshape(count, 12)
    blocks["kind"] = np.where(rng.random(count) < 0.96, TRIANGLES_KIND, rng.integers(0, 16, count))
    blocks["count"] = np.where(rng.random(count) < 0.96, rng.integers(1, 3, count), rng.integers(0, 4, count))
    order = np.array([rng.permutation(4)[:3] for _ in range(count)])
    blocks["order"] = np.where(rng.random((count, 1)) < 0.9, order, rng.integers(0, 4, (count, 3)))
    blocks["mask"] = np.where(rng.random((count, 2)) < 0.5, 0xFF, rng.integers(0, 256, (count, 2)) & 0x49)
    blocks["primitive"] = rng.integers(0, 1 << 31, (count, 2)) >> rng.choice([0, 26], (count, 1))
    blocks["reserved"], blocks["reserved_high"] = rng.integers(0, 16, count), rng.integers(0, 1 << 32, count)
    return blocks


@quiet
def leaf_rays(rng: Generator, count: int) -> tuple[np.ndarray, np.ndarray]:
    """LEAF_RAY (count,) and the PREPARED_RAY (count,) that they hold; few blocks of the grid are missed."""
    origin = rng.integers(-1, 2, (count, 3)).astype(np.float32)
    target = rng.integers(-2, 3, (count, 3)) * 0.5 + rng.integers(0, 2, (count, 1)) * rng.normal(size=(count, 3)) * 0.5
    direction = target.astype(np.float32) - origin
    direction[~direction.any(axis=1)] = (0, 0, -1)
    rays: np.ndarray = rays_from(origin, direction)
    assert rays.dtype == RAY
    rays["t_min"] = rng.choice(np.array([-4.0, 0.0, 0.25], np.float32), count)
    rays["t_max"] = np.where(rng.random(count) < 0.6, np.float32(np.inf), rng.choice(T_LIMITS, count))
    prepared = ray_setup(rays)
    out = np.zeros(count, LEAF_RAY)
    for name in ("origin", "shear", "t_min", "t_max", "axis", "flip"):
        out[name] = prepared[name]
    out["rate"] = np.abs(direction).max(axis=1)
    out["scale"] = 256 + rng.integers(-8, 24, count)
    out["cull"] = rng.random(count) < 0.25
    out["mask"] = np.where(rng.random(count) < 0.5, 0xFF, rng.integers(0, 256, count) & 0x51)
    out["any_hit"] = rng.random(count) < 0.3
    return out, prepared


@functools.cache
def leaf_scenario(count: int, seed: int) -> tuple[Ray, ...]:
    """`count` rays with 0 to 6 visits each, and what comes of them by the model."""
    rng = np.random.default_rng(seed)
    rays, prepared = leaf_rays(rng, count)
    visits = rng.integers(0, 7, count)
    owner = np.repeat(np.arange(count), visits)
    blocks = triangle_blocks(rng)[rng.integers(0, POOL, len(owner))]
    memory_error = rng.random(len(owner)) < 0.02
    proper = (blocks["kind"] == TRIANGLES_KIND) & np.isin(blocks["count"], (1, 2))
    error = np.where(memory_error, TRACE_ERRORS["memory"], np.where(proper, TRACE_ERRORS["none"], TRACE_ERRORS["kind"]))

    hits = np.zeros((len(owner), 2), HIT)
    tested = (error[:, None] == 0) & (blocks["mask"] & rays["mask"][owner, None] != 0)
    tested[:, 1] &= blocks["count"] == 2
    for k in range(2):
        corners = blocks["vertices"].reshape(-1, 4, 3)
        triangles = np.zeros(len(owner), TRIANGLE)
        for vertex in range(3):
            chosen = vertex if k == 0 else blocks["order"][:, vertex]
            triangles[f"v{vertex}"] = corners[np.arange(len(owner)), chosen]
        result = ray_triangle(triangle_tests(prepared[owner], triangles, rays["cull"][owner]))
        for name in ("t", "u", "v", "front"):
            hits[name][:, k] = result[name]
        hits["primitive"][:, k] = np.where(result["hit"] & tested[:, k], blocks["primitive"][:, k], -1)

    # The best hits after each visit: the nearest, of equal ones that of the lowest index.
    best = np.zeros(count + len(owner), HIT)
    best["primitive"] = -1
    must_hit = np.zeros(len(owner), bool)
    row = 0
    for ray in range(count):
        for _ in range(visits[ray]):
            at = row + ray + 1
            best[at] = best[at - 1]
            t_max = best["t"][at] if best["primitive"][at] >= 0 else np.inf
            for hit in hits[row]:
                must_hit[row] |= hit["primitive"] >= 0 and hit["t"] <= t_max
                if hit["primitive"] >= 0 and (
                    best["primitive"][at] < 0
                    or hit["t"] < best["t"][at]
                    or (hit["t"] == best["t"][at] and hit["primitive"] < best["primitive"][at])
                ):
                    best[at] = hit
            row += 1
    of_best = np.repeat(np.arange(count), visits + 1)
    times = np.zeros(len(best), RAY_TIME)
    times["t"] = np.where(best["primitive"] >= 0, best["t"], rays["t_max"][of_best])
    times["rate"], times["scale"] = rays["rate"][of_best], rays["scale"][of_best]
    high = ray_time(times)["high"]

    out = [Ray(data=data, any_hit=bool(any_hit)) for data, any_hit in zip(payloads(rays), rays["any_hit"], strict=True)]
    for ray, payload, time in zip(of_best.tolist(), payloads(best), high, strict=True):
        out[ray].bests.append(payload)
        out[ray].times.append(int(time))
    may_hit = np.any(hits["primitive"] >= 0, axis=1)
    for row, (ray, block) in enumerate(zip(owner.tolist(), payloads(blocks), strict=True)):
        visit = Visit(block, bool(memory_error[row]), int(error[row]), int(tested[row].sum()))
        visit.may_hit, visit.must_hit = bool(may_hit[row]), bool(must_hit[row])
        out[ray].visits.append(visit)
    return tuple(out)


def payloads(records: np.ndarray) -> list[int]:
    """Records (N,) as payloads."""
    return [int.from_bytes(row.tobytes(), "little") for row in bitpack.pack(records)]
