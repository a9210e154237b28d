"""Direct light: samples of area and point lights, as shadow rays and what each brings if nothing is in its way.

The irradiance at a point is the sum of the weights of the shadow rays that are not blocked. Rays and weights come
first, so that the caller can count rays against a budget, trace them together with others, and add up afterwards.

Self-hits: a shadow ray starts off the surface (`golden_model.scene.ray_offset`), and ends as far in front of the light
as it would have to start from there (`t_max` is 1 there), so that neither end needs a tolerance of its own.
"""

from dataclasses import dataclass

import numpy as np

from lightloom.golden_model.contract.formats import RAY
from lightloom.golden_model.numerics.counter_rng import hash_u32, uniform
from lightloom.golden_model.numerics.directions import sobol
from lightloom.golden_model.numerics.floats import float_minmax, flush, quiet
from lightloom.golden_model.numerics.vectors import add, cross, scale, subtract
from lightloom.golden_model.numerics.vectors import dot as dot4
from lightloom.golden_model.scene.mesh import area_vectors, dot
from lightloom.golden_model.scene.ray_offset import ray_start
from lightloom.golden_model.scene.scene import Scene

_INVERSE_PI = np.float32(0.31830987)

NO_RIVALS = np.float32(0)
"""Light samples alone find the lights."""
WEIGHT_BITS = 31
"""The whole-number weights by which lights are chosen add up to less than 2**WEIGHT_BITS."""


@dataclass(frozen=True, kw_only=True)
class Lights:
    """The K lights of a scene: its emissive triangles in their order, then its point lights."""

    origin: np.ndarray
    """First corner, or position of a point light, (K, 3) float32."""
    edge1: np.ndarray
    """Second corner minus the first, (K, 3) float32, zero for a point light."""
    edge2: np.ndarray
    """Third corner minus the first, (K, 3) float32, zero for a point light."""
    doubled: np.ndarray
    """edge1 x edge2: the normal, as long as twice the area; (K, 3) float32, zero for a point light."""
    unit: np.ndarray
    """Unit normal, (K, 3) float32, zero for a point light."""
    span: np.ndarray
    """`Scene.spans` of a triangle, (K,) float32, 0 for a point light."""
    emitted: np.ndarray
    """Radiance of a triangle, radiant intensity of a point light, (K, 3) float32."""
    point: np.ndarray
    """Which are point lights, (K,) bool."""
    begin: np.ndarray
    """A light k is chosen for whole numbers begin[k] <= x < begin[k + 1], (K + 1,) uint64."""
    share: np.ndarray
    """One over the chance to be chosen, (K,) float32; for triangles halved, because `doubled` is twice the area."""
    of_triangle: np.ndarray
    """The light that each triangle of the scene is, (T,) int32, -1 where it does not shine."""

    def __len__(self) -> int:
        return len(self.point)


def lights_of(scene: Scene) -> Lights:
    """The lights of a scene (K may be 0). The chance of a light goes with its power: area or 4, times luminance."""
    emission = scene.emission[scene.material]
    shining = np.flatnonzero((emission > 0).any(axis=1))
    corners = scene.corners[shining]
    points = scene.point_lights[(scene.point_lights["intensity"] > 0).any(axis=1)]
    nothing = np.zeros((len(points), 3), dtype=np.float32)
    edge1 = np.concatenate([subtract(corners[:, 1], corners[:, 0]), nothing])
    edge2 = np.concatenate([subtract(corners[:, 2], corners[:, 0]), nothing])
    doubled = cross(edge1, edge2)
    point = np.arange(len(edge1)) >= len(shining)
    emitted = np.concatenate([emission[shining], points["intensity"]]).astype(np.float32)

    vectors = area_vectors(corners)
    size = np.concatenate([np.sqrt(dot(vectors, vectors)) / 2, np.full(len(points), 4.0)])
    wide = emitted.astype(np.float64)
    power = size * (0.2126 * wide[:, 0] + 0.7152 * wide[:, 1] + 0.0722 * wide[:, 2])
    # The strongest gets 2**bits, the weakest at least 1, and together they stay below 2**WEIGHT_BITS.
    bits = WEIGHT_BITS - 1 - int(np.frexp(max(len(power), 1))[1])
    weight = np.maximum(np.rint(power / power.max(initial=1e-300) * 2.0**bits), 1).astype(np.uint64)
    begin = np.concatenate([[0], np.cumsum(weight)]).astype(np.uint64)
    share = begin[-1].astype(np.float64) / weight.astype(np.float64) * np.where(point, 1.0, 0.5)
    # Unit normals by way of float64: the squares of small triangles' areas would be flushed.
    unit = vectors / np.sqrt(dot(vectors, vectors))[:, None]
    of_triangle = np.full(len(scene.triangles), -1, dtype=np.int32)
    of_triangle[shining] = np.arange(len(shining))
    return Lights(
        origin=np.concatenate([corners[:, 0], points["position"]]),
        edge1=edge1,
        edge2=edge2,
        doubled=doubled,
        unit=np.concatenate([unit.astype(np.float32), nothing]),
        span=np.concatenate([scene.spans[shining], nothing[:, 0]]),
        emitted=emitted,
        point=point,
        begin=begin,
        share=share.astype(np.float32),
        of_triangle=of_triangle,
    )


@quiet
def direct_candidates(
    lights: Lights,
    start: np.ndarray,
    normal: np.ndarray,
    key: np.ndarray,
    *,
    first: np.ndarray | int = 0,
    samples: int = 1,
    rivals: np.ndarray | np.float32 = NO_RIVALS,
) -> tuple[np.ndarray, np.ndarray]:
    """Shadow rays and weights for points (N, 3) with unit normals (N, 3): RAY (N, S), float32 (N, S, 3).

    The points are those where rays start (`golden_model.scene.ray_offset`), which is close enough to the surface.

    `key` (N,) integers select a point's own sequence of samples and `first` (a number or (N,)) the place in it, so
    that updates of a texel go on where the last one stopped; runs of 16 are well spread over the lights. Samples with
    different keys are independent of each other.

    A light's back and points behind the surface bring nothing: their weights are zero and their rays (t_max 0) hit
    nothing and need not be traced. Without lights all are so. The sum over S of the weights that are not blocked is
    the irradiance: 1/S is in the weights.

    `rivals` (a number or (N,) float32) is for callers who also trace cosine-distributed rays from the point, `rivals`
    of them for each light sample, and add `met_emission` of what they hit: each of the two ways to find a light then
    counts by how likely it is to (the power heuristic of Veach 1997, with squares). So a light close by cannot bring a
    few enormous samples: the weights of a point stay below pi / 2 / rivals / S times the emission.
    """
    count = len(start)
    rays = np.zeros((count, samples), dtype=RAY)
    weight = np.zeros((count, samples, 3), dtype=np.float32)
    if not len(lights) or not count:
        return rays, weight
    light, u, v = _choose(lights, np.asarray(key), np.asarray(first), samples)

    target = add(lights.origin[light], add(scale(lights.edge1[light], u), scale(lights.edge2[light], v)))
    toward = subtract(target, start[:, None, :])
    factor = _transfer(lights, light, toward, np.broadcast_to(normal[:, None, :], toward.shape))
    lit = factor > 0
    odds = _odds(factor, np.asarray(rivals, dtype=np.float32)[..., None])
    factor = np.where(lights.point[light], factor, flush(factor / flush(np.float32(1) + odds)))
    weight[...] = scale(lights.emitted[light], flush(factor / np.float32(samples)))

    rays["origin"] = start[:, None, :]
    rays["direction"] = subtract(_in_front(lights, light, target, toward), start[:, None, :])
    rays["t_max"] = lit
    return rays, weight


@quiet
def _transfer(lights: Lights, light: np.ndarray, toward: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """Irradiance a unit of emission from sampled points of lights, over the density of the sample: (...) float32.

    `toward` (..., 3) leads from the lit points, with unit `normal` (..., 3), to the samples. For a triangle this is
    cosine * cosine / distance**2 * area over the light's chance. Zero where either side faces away.
    """
    square = dot4(toward, toward)
    incoming = flush(dot4(normal, toward) / square)
    outgoing = flush(dot4(-lights.doubled[light], toward) / square)
    # A point light has no cosine of its own: 1 / distance stands in for what `outgoing` is for a triangle.
    outgoing = np.where(lights.point[light], flush(np.float32(1) / np.sqrt(square)), outgoing)
    factor = flush(flush(incoming * outgoing) * lights.share[light])
    return np.where((incoming > 0) & (outgoing > 0) & np.isfinite(factor), factor, np.float32(0))


@quiet
def _in_front(lights: Lights, light: np.ndarray, target: np.ndarray, toward: np.ndarray) -> np.ndarray:
    """Where shadow rays end that lead `toward` (..., 3) samples `target` (..., 3) of lights (...): (..., 3) float32.

    Seen from the other end of the ray the light's farthest vertex is away by the ray's length more. Twice that counts:
    whether the light is met depends there on how far t reaches, not on its sign alone.
    """
    size = np.abs(toward)
    length = float_minmax(float_minmax(size[..., 0], size[..., 1], True), size[..., 2], True)
    span = flush(np.float32(2) * flush(length + lights.span[light]))
    return ray_start(target, lights.unit[light], span)


def _odds(factor: np.ndarray, rivals: np.ndarray) -> np.ndarray:
    """Weight of what cosine-distributed rays bring from a place over the weight of what light samples bring from it.

    The square of how many such rays go there for one light sample: `rivals` times the ratio of the densities, which is
    the transfer over pi.
    """
    expected = flush(flush(factor * _INVERSE_PI) * rivals)
    return flush(expected * expected)


@quiet
def met_emission(
    lights: Lights,
    primitive: np.ndarray,
    front: np.ndarray,
    toward: np.ndarray,
    normal: np.ndarray,
    rivals: np.ndarray | np.float32,
) -> np.ndarray:
    """Radiance (N, 3) that cosine-distributed rays count for the light that they hit, (N, 3) float32.

    Rays from points with unit `normal` (N, 3) hit triangles `primitive` (N,), on their front or not (N,), at `toward`
    (N, 3) from the points. `rivals`, a number or (N,), is the one that the points' light samples were made with.
    """
    radiance = np.zeros((len(primitive), 3), dtype=np.float32)
    shines = np.flatnonzero((lights.of_triangle[primitive] >= 0) & front)
    light = lights.of_triangle[primitive[shines]]
    factor = _transfer(lights, light, toward[shines], normal[shines])
    odds = _odds(factor, np.broadcast_to(np.asarray(rivals, dtype=np.float32), len(primitive))[shines])
    one = np.float32(1)
    share = flush(one - flush(one / flush(one + odds)))
    radiance[shines] = scale(lights.emitted[light], share)
    return radiance


def _choose(
    lights: Lights, key: np.ndarray, first: np.ndarray, samples: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Light (N, S) int64 and barycentrics u, v (N, S) float32 on it.

    Points of the Sobol' sequence, xored with two hashes of the key. The first coordinate chooses the light; where it
    fell within the light's share serves again as the first coordinate on the triangle. Points of the unit square
    beyond its diagonal are folded back into the triangle.
    """
    x, y = sobol(first[..., None] + np.arange(samples))
    x = np.broadcast_to(x ^ hash_u32(key, 0)[:, None], (len(key), samples)).astype(np.uint64)
    y = np.broadcast_to(y ^ hash_u32(key, 1)[:, None], (len(key), samples))
    scaled = x * lights.begin[-1]
    light = np.searchsorted(lights.begin, scaled >> np.uint64(32), side="right") - 1
    within = scaled - (lights.begin[light] << np.uint64(32))
    u = uniform((within // (lights.begin[light + 1] - lights.begin[light])).astype(np.uint32))
    v = uniform(y)
    fold = u + v > 1
    one = np.float32(1)
    return light, np.where(fold, one - u, u), np.where(fold, one - v, v)
