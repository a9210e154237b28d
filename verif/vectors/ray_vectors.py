"""Seeded operands for ray setup and the ray-triangle unit: plausible ones, and every kind of corner case.

A family is a function of (count, generator); `ray_setup_vectors` and `ray_triangle_vectors` mix them all.
"""

from collections.abc import Callable

import numpy as np

from lightloom.golden_model.contract import bitpack
from lightloom.golden_model.contract.formats import RAY, RAY_TRIANGLE, TRIANGLE
from lightloom.golden_model.numerics.floats import quiet
from lightloom.golden_model.stimuli.ray_families import mixed
from lightloom.golden_model.stimuli.ray_families import rays_from as rays
from lightloom.golden_model.tracing.ray_setup import ray_setup
from lightloom.golden_model.tracing.ray_triangle import ray_triangle, triangle_tests

Generator = np.random.Generator
Family = Callable[[int, Generator], np.ndarray]

VERTICES = ("v0", "v1", "v2")
SPECIALS = np.array(
    [0x00000000, 0x00000001, 0x007FFFFF, 0x00800000, 0x3F800000, 0x7F7FFFFF, 0x7F800000, 0x7F800001, 0x7FC00000],
    dtype=np.uint32,
)
"""Zero, subnormals, the least and greatest normal, one, infinity, a signalling and the quiet NaN; signs are added."""


def specials(shape: tuple[int, ...], rng: Generator) -> np.ndarray:
    """float32 special values of either sign."""
    return (rng.choice(SPECIALS, shape) | (rng.integers(0, 2, shape, dtype=np.uint32) << np.uint32(31))).view(
        np.float32
    )


def raw(dtype: np.dtype, count: int, rng: Generator) -> np.ndarray:
    """Every bit random."""
    words = rng.integers(0, 1 << 32, (count, bitpack.words(dtype)), dtype=np.uint32)
    return bitpack.unpack(words, dtype)


def triangles(vertices: np.ndarray) -> np.ndarray:
    """(N, 3 vertices, 3) to TRIANGLE (N,)."""
    out = np.zeros(len(vertices), dtype=TRIANGLE)
    for k, name in enumerate(VERTICES):
        out[name] = vertices[:, k]
    return out


def tests(origin: np.ndarray, direction: np.ndarray, vertices: np.ndarray, rng: Generator) -> np.ndarray:
    """RAY_TRIANGLE (N,), one in four with back faces culled."""
    cull = rng.integers(0, 4, len(origin)) == 0
    return triangle_tests(ray_setup(rays(origin, direction)), triangles(vertices), cull)


def weights(count: int, rng: Generator) -> np.ndarray:
    """(N, 3) barycentric weights, uniform over the triangle."""
    return rng.dirichlet([1.0, 1.0, 1.0], count).astype(np.float32)


# --- families of ray-triangle tests ---------------------------------------------------------------------------------


def inside(count: int, rng: Generator) -> np.ndarray:
    """Rays at the inside of triangles of all sizes and distances: nearly all hit."""
    origin = rng.normal(size=(count, 3))
    size = np.exp2(rng.uniform(-12, 4, (count, 1, 1)))
    vertices = (rng.normal(size=(count, 1, 3)) * 8 + rng.normal(size=(count, 3, 3)) * size).astype(np.float32)
    target = mixed(vertices, weights(count, rng))
    return tests(origin, (target - origin.astype(np.float32)) * rng.uniform(0.01, 2, (count, 1)), vertices, rng)


def around(count: int, rng: Generator) -> np.ndarray:
    """Rays at points in the triangle's plane, in and around it."""
    origin = rng.normal(size=(count, 3)) * 4
    vertices = rng.normal(size=(count, 3, 3)).astype(np.float32)
    weight = rng.normal(size=(count, 3)) + 1 / 3
    weight[:, 2] = 1 - weight[:, 0] - weight[:, 1]
    return tests(origin, mixed(vertices, weight) - origin, vertices, rng)


def edges(count: int, rng: Generator) -> np.ndarray:
    """Rays at vertices and edge points. Half on a coarse grid, where edge functions come out as exact zeros."""
    origin = rng.normal(size=(count, 3)).astype(np.float32)
    vertices = (rng.normal(size=(count, 3, 3)) * 4).astype(np.float32)
    grid = rng.integers(0, 2, count).astype(bool)
    origin[grid], vertices[grid] = np.rint(origin[grid] * 4), np.rint(vertices[grid] * 2)
    weight = weights(count, rng)
    weight[np.arange(count), rng.integers(0, 3, count)] = 0
    weight[grid] = np.rint(weight[grid] * 2) / 2
    vertex = rng.integers(0, 2, count).astype(bool)
    weight[vertex] = np.eye(3)[rng.integers(0, 3, count)][vertex]
    weight /= np.maximum(weight.sum(axis=1, keepdims=True), 0.25)
    return tests(origin, mixed(vertices, weight) - origin, vertices, rng)


def axis_parallel(count: int, rng: Generator) -> np.ndarray:
    """Directions along an axis or in an axis plane, with zeros of both signs, between small whole numbers."""
    direction = rng.choice(np.array([0.0, -0.0, 1.0, -1.0, 2.0, -0.5]), (count, 3))
    vertices = rng.integers(-3, 4, (count, 3, 3)).astype(np.float32)
    target = np.rint(mixed(vertices, weights(count, rng)))
    return tests(target - direction * rng.integers(1, 4, (count, 1)), direction, vertices, rng)


def degenerate(count: int, rng: Generator) -> np.ndarray:
    """Two or three equal vertices, three on a line, and triangles seen edge-on."""
    vertices = rng.normal(size=(count, 3, 3)).astype(np.float32)
    target = mixed(vertices, weights(count, rng))
    origin = rng.normal(size=(count, 3))
    kind = rng.integers(0, 4, count)
    one, two = rng.permuted(np.tile(np.arange(3), (count, 1)), axis=1)[:, :2].T
    row = np.arange(count)
    same = kind == 0
    vertices[row[same], one[same]] = vertices[row[same], two[same]]
    vertices[kind == 1] = vertices[kind == 1, :1]
    line = kind == 2
    vertices[line, 2] = vertices[line, 0] + (vertices[line, 1] - vertices[line, 0]) * rng.choice(
        np.array([-1, 0.5, 2, 0.3], dtype=np.float32), (line.sum(), 1)
    )
    flat = kind == 3
    origin[flat] = (2 * vertices[flat, 0] - vertices[flat, 1]) + (vertices[flat, 2] - vertices[flat, 0])
    target[~flat] = mixed(vertices, weights(count, rng))[~flat]
    return tests(origin, target - origin, vertices, rng)


def specials_mixed_in(count: int, rng: Generator) -> np.ndarray:
    """Plausible tests with one to three fields replaced by special values, before or after ray setup."""
    out = inside(count, rng)
    flat = bitpack.pack(out)
    for _ in range(3):
        chosen = rng.integers(0, 2, count).astype(bool)
        word = rng.integers(0, flat.shape[1] - 1, count)  # the last word holds the flags
        flat[np.arange(count)[chosen], word[chosen]] = specials((count,), rng).view(np.uint32)[chosen]
    return bitpack.unpack(flat, RAY_TRIANGLE)


@quiet
def scaled(count: int, rng: Generator) -> np.ndarray:
    """Plausible tests scaled by 2**-80 to 2**80: products overflow and underflow. In half, one vertex lies apart."""
    origin = rng.normal(size=(count, 3))
    vertices = rng.normal(size=(count, 3, 3))
    target = mixed(vertices, weights(count, rng))
    scale = np.exp2(rng.integers(-80, 81, (count, 1)))
    direction = (target - origin) * np.exp2(rng.integers(-80, 81, (count, 1)))
    vertices *= scale[:, :, None]
    apart = rng.integers(0, 2, count).astype(bool)
    vertices[apart, 0] *= np.exp2(rng.integers(-60, 61, (count, 1)))[apart]
    return tests((origin * scale).astype(np.float32), direction.astype(np.float32), vertices.astype(np.float32), rng)


def at_the_range(count: int, rng: Generator) -> np.ndarray:
    """Hits whose t lies at, just inside or just outside t_min or t_max."""
    out = inside(count, rng)
    t = ray_triangle(out)["t"]
    near = rng.choice(np.array([-np.inf, 0, np.inf], dtype=np.float32), count)
    bound = np.where(near == 0, t, np.nextafter(t, near))
    lower = rng.integers(0, 2, count).astype(bool)
    out["t_min"] = np.where(lower, bound, 0)
    out["t_max"] = np.where(lower, np.inf, bound)
    return out


RAY_TRIANGLE_FAMILIES: dict[str, Family] = {
    "raw": lambda count, rng: raw(RAY_TRIANGLE, count, rng),
    "inside": inside,
    "around": around,
    "edges": edges,
    "axis_parallel": axis_parallel,
    "degenerate": degenerate,
    "specials": specials_mixed_in,
    "scaled": scaled,
    "at_the_range": at_the_range,
}


# --- families of rays -----------------------------------------------------------------------------------------------


def plausible_rays(count: int, rng: Generator) -> np.ndarray:
    out = rays(rng.normal(size=(count, 3)) * 10, rng.normal(size=(count, 3)) * np.exp2(rng.uniform(-8, 8, (count, 1))))
    out["t_min"], out["t_max"] = rng.uniform(0, 1, count), rng.uniform(1, 100, count)
    return out


def tied_rays(count: int, rng: Generator) -> np.ndarray:
    """Directions whose components are equal, opposite, neighbouring numbers or zeros: ties of the dominant axis."""
    out = plausible_rays(count, rng)
    step = rng.integers(-1, 2, (count, 3)).astype(np.uint32)
    magnitude = (np.abs(out["direction"][:, :1]).view(np.uint32) + step).view(np.float32)
    out["direction"] = magnitude * rng.choice(np.array([-1, 1, 0.0, -0.0, 0.5], dtype=np.float32), (count, 3))
    return out


def special_rays(count: int, rng: Generator) -> np.ndarray:
    out = plausible_rays(count, rng)
    flat = bitpack.pack(out)
    return bitpack.unpack(
        np.where(rng.integers(0, 3, flat.shape), flat, specials(flat.shape, rng).view(np.uint32)), RAY
    )


@quiet
def scaled_rays(count: int, rng: Generator) -> np.ndarray:
    """Directions over the whole range of exponents: reciprocals overflow and underflow."""
    out = plausible_rays(count, rng)
    common = rng.integers(0, 2, (count, 1)).astype(bool)
    exponent = np.where(common, rng.integers(-130, 130, (count, 1)), rng.integers(-130, 130, (count, 3)))
    out["direction"] = np.ldexp(rng.uniform(-2, 2, (count, 3)), exponent).astype(np.float32)
    return out


RAY_FAMILIES: dict[str, Family] = {
    "raw": lambda count, rng: raw(RAY, count, rng),
    "plausible": plausible_rays,
    "tied": tied_rays,
    "special": special_rays,
    "scaled": scaled_rays,
}


def mixture(families: dict[str, Family], count: int, seed: int) -> np.ndarray:
    """`count` operands, shuffled, an equal part from each family."""
    rng = np.random.default_rng(seed)
    part = -(-count // len(families))
    operands = np.concatenate([family(part, rng) for family in families.values()])
    return operands[rng.permutation(len(operands))[:count]]


def ray_setup_vectors(count: int, seed: int) -> np.ndarray:
    """RAY (count,)."""
    return mixture(RAY_FAMILIES, count, seed)


def ray_triangle_vectors(count: int, seed: int) -> np.ndarray:
    """RAY_TRIANGLE (count,); about a third hit."""
    return mixture(RAY_TRIANGLE_FAMILIES, count, seed)
