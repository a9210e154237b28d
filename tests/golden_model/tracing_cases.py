"""Seeded scenes with rays that attack traversal: each family is a function of a generator to (triangles, rays)."""

from collections.abc import Callable

import numpy as np

from lightloom.golden_model.contract.formats import TRIANGLE
from lightloom.golden_model.numerics.floats import quiet
from lightloom.golden_model.stimuli.ray_families import aimed, points_on
from lightloom.verif.vectors import ray_vectors

Generator = np.random.Generator
Case = tuple[np.ndarray, np.ndarray]

RAYS = 300


def random_soup(rng: Generator, count: int) -> np.ndarray:
    """Triangles of all sizes in a unit ball or so."""
    size = np.exp2(rng.uniform(-6, 0, (count, 1, 1)))
    return ray_vectors.triangles(rng.normal(size=(count, 1, 3)) + rng.normal(size=(count, 3, 3)) * size)


def soup(rng: Generator) -> Case:
    triangles = random_soup(rng, int(rng.choice([1, 2, 3, 4, 5, 9, 40, 300])))
    rays = aimed(triangles, rng.normal(size=(RAYS, 3)) * 2, rng)
    rays["t_min"], rays["t_max"] = rng.uniform(-1, 0.5, RAYS), rng.choice([0.3, 1.0, np.inf], RAYS)
    return triangles, rays


def duplicates(rng: Generator) -> Case:
    """Each triangle several times, in mixed order and with its vertices turned round or swapped: ties everywhere."""
    triangles, rays = soup(rng)
    copies = np.repeat(triangles, 3)
    for k in range(len(copies)):
        order = rng.permutation(3) if k % 2 else np.arange(3)
        copies[k] = tuple(copies[k][f"v{j}"] for j in order)
    return rng.permutation(copies), rays


def lattice(rng: Generator) -> Case:
    """Small whole numbers: flat and degenerate triangles; rays along planes, axes, edges, with zeros of both signs."""
    triangles = ray_vectors.triangles(rng.integers(-2, 3, (int(rng.integers(1, 60)), 3, 3)))
    direction = rng.choice(np.array([0.0, -0.0, 1.0, -1.0, 2.0, -0.5]), (RAYS, 3))
    return triangles, ray_vectors.rays(rng.integers(-3, 4, (RAYS, 3)) / 2, direction)


def flat_floor(rng: Generator) -> Case:
    """A gridded floor in an axis plane: boxes of no thickness. Rays from above, from its surface, and along it."""
    axis = int(rng.integers(0, 3))
    u, v = np.meshgrid(np.arange(9), np.arange(9), indexing="ij")
    points = np.insert(np.stack([u, v], axis=-1).astype(np.float64), axis, rng.choice([0.0, 0.1, 3.0]), axis=-1)
    quads = [points[:-1, :-1], points[1:, :-1], points[1:, 1:], points[:-1, 1:]]
    corners = [np.stack([quads[i] for i in ids], axis=2).reshape(-1, 3, 3) for ids in ((0, 1, 2), (0, 2, 3))]
    triangles = ray_vectors.triangles(np.concatenate(corners))
    origin = rng.uniform(-1, 9, (RAYS, 3))
    on_it = rng.integers(0, 2, RAYS).astype(bool)
    origin[on_it] = points_on(triangles, on_it.sum(), rng)
    rays = aimed(triangles, origin, rng)
    straight = rng.integers(0, 2, RAYS).astype(bool)
    rays["direction"][straight] = np.eye(3)[rng.integers(0, 3, straight.sum())] * rng.choice(
        [-1, 1], (straight.sum(), 1)
    )
    return triangles, rays


def from_surfaces(rng: Generator) -> Case:
    """Origins at vertices, on edges and on faces, directions to other such points."""
    triangles = random_soup(rng, 60)
    return triangles, aimed(triangles, points_on(triangles, RAYS, rng), rng)


def nearly_parallel(rng: Generator) -> Case:
    """Directions with components many magnitudes below the greatest, subnormals among them."""
    triangles, rays = flat_floor(rng) if rng.integers(0, 2) else lattice(rng)
    small = np.exp2(rng.uniform(-150, -10, (RAYS, 3))) * rng.choice([-1, 1], (RAYS, 3))
    rays["direction"] = np.where(rng.integers(0, 2, (RAYS, 3)), rays["direction"], small)
    return triangles, rays


def near_underflow(rng: Generator) -> Case:
    """Slivers and origins a hair from a plane: edge functions and determinants underflow."""
    triangles, rays = lattice(rng)
    hair = np.exp2(rng.integers(-140, -20, (len(triangles), 3)))
    axis = rng.integers(0, 3)
    for k, name in enumerate(("v0", "v1", "v2")):
        triangles[name][:, axis] *= hair[:, k]
    rays["origin"][:, axis] *= np.exp2(rng.integers(-140, -20, RAYS))
    rays["direction"][:, axis] *= np.exp2(rng.integers(-140, -20, RAYS))
    return triangles, rays


def far_origin(rng: Generator) -> Case:
    """Origins far from a small scene, and a small scene with origins in it far from zero."""
    triangles = random_soup(rng, 80)
    away = (rng.normal(size=3) * 10.0 ** rng.uniform(2, 6)).astype(np.float32)
    origin = rng.normal(size=(RAYS, 3)).astype(np.float32)
    if rng.integers(0, 2):
        for name in ("v0", "v1", "v2"):
            triangles[name] += away
        return triangles, aimed(triangles, origin + away, rng)
    return triangles, aimed(triangles, origin * np.abs(away).max(), rng)


def slivers(rng: Generator) -> Case:
    """Long triangles much thinner than the spacing of floats at their ends, and rays that graze them."""
    base, way, side = rng.normal(size=(3, 80, 1, 3)) * np.array([1, 10, 1e-7]).reshape(3, 1, 1, 1)
    corners = base + way * np.array([0, 1, 0.5]).reshape(1, 3, 1) + side * np.array([0, 0, 1]).reshape(1, 3, 1)
    triangles = ray_vectors.triangles(corners)
    origin = points_on(triangles, RAYS, rng) + rng.normal(size=(RAYS, 3)) * 10.0 ** rng.uniform(-7, 1, (RAYS, 1))
    return triangles, aimed(triangles, origin, rng)


@quiet
def scaled(rng: Generator) -> Case:
    """The other families scaled by a power of two, rays and triangles together; directions by one of their own."""
    triangles, rays = [soup, lattice, from_surfaces, flat_floor][rng.integers(0, 4)](rng)
    scale = np.float32(2.0 ** int(rng.integers(-60, 60)))
    for name in TRIANGLE.names or ():
        triangles[name] *= scale
    rays["origin"] *= scale
    rays["direction"] *= np.float32(2.0 ** int(rng.integers(-60, 60)))
    rays["t_max"] = np.inf
    return triangles, rays


@quiet
def mixed_scales(rng: Generator) -> Case:
    """Every triangle and every ray at a scale of its own."""
    triangles, rays = soup(rng)
    scale = np.exp2(rng.integers(-40, 40, (len(triangles), 1))).astype(np.float32)
    for name in TRIANGLE.names or ():
        triangles[name] *= scale
    aim = aimed(triangles, rng.normal(size=(RAYS, 3)) * np.exp2(rng.integers(-40, 40, (RAYS, 1))), rng)
    aim["t_min"], aim["t_max"] = rays["t_min"], np.inf
    return triangles, aim


def specials(rng: Generator) -> Case:
    """Infinities, NaNs, subnormals and extreme numbers among vertices and rays."""
    triangles, rays = soup(rng)
    for name in TRIANGLE.names or ():
        chosen = rng.integers(0, 12, triangles[name].shape) == 0
        triangles[name][chosen] = ray_vectors.specials((int(chosen.sum()),), rng)
    for name in ("origin", "direction", "t_min", "t_max"):
        chosen = rng.integers(0, 12, rays[name].shape) == 0
        rays[name][chosen] = ray_vectors.specials((int(chosen.sum()),), rng)
    return triangles, rays


FAMILIES: dict[str, Callable[[Generator], Case]] = {
    family.__name__: family
    for family in (
        soup,
        duplicates,
        lattice,
        flat_floor,
        from_surfaces,
        nearly_parallel,
        near_underflow,
        far_origin,
        slivers,
        scaled,
        mixed_scales,
        specials,
    )
}
