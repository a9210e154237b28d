"""Direct light: samples of lights, as shadow rays and what each brings if nothing is in its way.

The irradiance at a point is the sum of the weights of the shadow rays that are not blocked. Rays and weights come
first, so that the caller can count rays against a budget, trace them together with others, and add up afterwards.

Self-hits: a shadow ray starts off the surface (`golden_model.tables.ray_offset`), and ends as far in front of the light
as it would have to start from there (`t_max` is 1 there), so that neither end needs a tolerance of its own.
"""

import numpy as np

from lightloom.golden_model.contract.formats import RAY
from lightloom.golden_model.numerics.counter_rng import hash_u32, uniform
from lightloom.golden_model.numerics.directions import COUNT, cosine_table, sobol
from lightloom.golden_model.numerics.floats import float_minmax, flush, quiet
from lightloom.golden_model.numerics.vectors import add, dot, scale, subtract
from lightloom.golden_model.rays.surface_shading import INVERSE_PI
from lightloom.golden_model.tables.lights import POINT, SKY, SUN, TRIANGLE, Lights
from lightloom.golden_model.tables.octahedral import on_octahedron
from lightloom.golden_model.tables.ray_offset import ray_start

NO_RIVALS = np.float32(0)
"""Light samples alone find the lights."""


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

    The points are those where rays start (`golden_model.tables.ray_offset`), which is close enough to the surface.

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
    light, x, y = _choose(lights, np.asarray(key), np.asarray(first), samples)
    target = _sampled(lights, light, x, y)
    beyond = lights.kind[light] >= SUN
    toward = np.where(beyond[..., None], target, subtract(target, start[:, None, :]))
    factor = _transfer(lights, light, toward, np.broadcast_to(normal[:, None, :], toward.shape))
    lit = factor > 0
    odds = _odds(factor, np.asarray(rivals, dtype=np.float32)[..., None])
    factor = np.where(_met(lights)[light], flush(factor / flush(np.float32(1) + odds)), factor)
    emitted = lights.emitted[light]
    if lights.sky is not None and lights.sky.sampled:
        emitted = np.where((lights.kind[light] == SKY)[..., None], lights.sky.map.nearest(toward), emitted)
    weight[...] = scale(emitted, flush(factor / np.float32(samples)))

    rays["origin"] = start[:, None, :]
    near = subtract(_in_front(lights, light, target, toward), start[:, None, :])
    rays["direction"] = np.where(beyond[..., None], toward, near)
    rays["t_max"] = np.where(beyond & lit, np.float32(np.inf), lit)
    return rays, weight


def _met(lights: Lights) -> np.ndarray:
    """Which lights cosine-distributed rays can meet, (K,) bool."""
    return (lights.kind == TRIANGLE) | (lights.kind == SKY) | ((lights.kind == SUN) & (lights.sun is not None))


def _sampled(lights: Lights, light: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Places on lights (...) for uint32 fractions x and y (...), or directions to them: (..., 3) float32.

    A triangle is half the unit square: points beyond its diagonal are folded back. The disc of the sun is that below
    the cosine table, whose aligned runs are spread over it: the fraction's bits in reverse order are the entry, so that
    fractions that are spread make such runs. The sky has a table of its own.
    """
    u, v = uniform(x), uniform(y)
    fold, one = u + v > 1, np.float32(1)
    u, v = np.where(fold, one - u, u), np.where(fold, one - v, v)
    kind = lights.kind[light]
    if lights.sun is not None:
        disc = cosine_table()[_reversed(x, COUNT.bit_length() - 1)]
        u, v = (np.where(kind == SUN, disc[..., k], value) for k, value in ((0, u), (1, v)))
    target = add(lights.origin[light], add(scale(lights.edge1[light], u), scale(lights.edge2[light], v)))
    if lights.sky is not None and lights.sky.sampled:
        target = np.where((kind == SKY)[..., None], lights.sky.choose(x, y), target)
    return target


def _reversed(x: np.ndarray, bits: int) -> np.ndarray:
    """The upper `bits` of uint32 numbers (...), in reverse order, (...) int64."""
    out = np.zeros(x.shape, dtype=np.int64)
    for k in range(bits):
        out |= ((x >> np.uint32(31 - k)) & np.uint32(1)).astype(np.int64) << k
    return out


@quiet
def _transfer(lights: Lights, light: np.ndarray, toward: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """Irradiance a unit of emission from sampled points of lights, over the density of the sample: (...) float32.

    `toward` (..., 3) leads from the lit points, with unit `normal` (..., 3), to the samples; to those of the sun as far
    as the plane of its disc one unit off, to those of the sky as far as the octahedron. For a triangle this is
    cosine * cosine / distance**2 * area over the light's chance. Zero where either side faces away.
    """
    square = dot(toward, toward)
    incoming = flush(dot(normal, toward) / square)
    outgoing = flush(dot(-lights.doubled[light], toward) / square)
    # A point light has no cosine of its own: 1 / distance stands in for what `outgoing` is for a triangle. Beyond the
    # scene it is 1 / distance**2, because solid angles go with distance**-3 on plane and octahedron.
    kind, one = lights.kind[light], np.float32(1)
    outgoing = np.where(kind == POINT, flush(one / np.sqrt(square)), outgoing)
    if (kind >= SUN).any():
        outgoing = np.where(kind >= SUN, flush(one / square), outgoing)
    share = lights.share[light]
    if lights.sky is not None and lights.sky.sampled:
        share = np.where(kind == SKY, flush(share * lights.sky.share_at(toward)), share)
    if lights.cone is not None:
        share = flush(share * _into_cone(lights.cone[light], flush(toward * outgoing[..., None])))
    factor = flush(flush(incoming * outgoing) * share)
    return np.where((incoming > 0) & (outgoing > 0) & np.isfinite(factor), factor, np.float32(0))


@quiet
def _into_cone(cone: np.ndarray, toward: np.ndarray) -> np.ndarray:
    """What CONE (...) leave of the light that comes from where unit vectors `toward` (..., 3) lead: 0 to 1, (...).

    x**2 (3 - 2 x) across the edge, x its part of the way from the outer cosine to the inner one.
    """
    zero, one = np.zeros(1, dtype=np.float32), np.ones(1, dtype=np.float32)
    place = flush(flush(-dot(cone["axis"], toward) - cone["outer"]) * cone["steepness"])
    place = float_minmax(float_minmax(place, zero, True), one)
    return flush(flush(place * place) * flush(np.float32(3) - flush(place + place)))


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
    expected = flush(flush(factor * INVERSE_PI) * rivals)
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
    radiance[shines] = scale(lights.emitted[light], _left_over(odds))
    return radiance


@quiet
def met_beyond(
    lights: Lights, direction: np.ndarray, normal: np.ndarray, rivals: np.ndarray | np.float32
) -> np.ndarray:
    """Radiance (N, 3) that cosine-distributed rays of `direction` (N, 3) count that meet nothing, (N, 3) float32.

    `normal` and `rivals` as for `met_emission`. Of a sky that light samples do not choose it is all.
    """
    radiance = np.zeros(direction.shape, dtype=np.float32)
    rivals = np.broadcast_to(np.asarray(rivals, dtype=np.float32), len(direction))
    if lights.sky is not None:
        toward = on_octahedron(direction)
        radiance = lights.sky.map.nearest(toward)
        if lights.sky.sampled:
            radiance = scale(radiance, _left(lights, SKY, toward, normal, rivals))
    if lights.sun is not None:
        disc = np.flatnonzero(lights.sun.seen(direction))
        toward = scale(direction[disc], flush(np.float32(1) / dot(lights.sun.towards, direction[disc])))
        left = _left(lights, SUN, toward, normal[disc], rivals[disc])
        radiance[disc] = add(radiance[disc], scale(lights.sun.radiance[None], left))
    return radiance


def _left(lights: Lights, kind: int, toward: np.ndarray, normal: np.ndarray, rivals: np.ndarray) -> np.ndarray:
    """What light samples leave to rays `toward` (N, 3) the only light of a kind: 0 to 1, (N,) float32."""
    number = np.flatnonzero(lights.kind == kind)
    if not len(number):
        return np.zeros(len(toward), dtype=np.float32)
    factor = _transfer(lights, np.full(len(toward), number[0]), toward, normal)
    return _left_over(_odds(factor, rivals))


def _left_over(odds: np.ndarray) -> np.ndarray:
    """1 - 1 / (1 + odds)."""
    one = np.float32(1)
    return flush(one - flush(one / flush(one + odds)))


def _choose(
    lights: Lights, key: np.ndarray, first: np.ndarray, samples: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Light (N, S) int64, and two uint32 fractions (N, S) that choose the place on it.

    Points of the Sobol' sequence, xored with two hashes of the key. The first coordinate chooses the light; where it
    fell within the light's share serves again as the first coordinate on the light.
    """
    x, y = sobol(first[..., None] + np.arange(samples))
    x = np.broadcast_to(x ^ hash_u32(key, 0)[:, None], (len(key), samples)).astype(np.uint64)
    y = np.broadcast_to(y ^ hash_u32(key, 1)[:, None], (len(key), samples))
    scaled = x * lights.begin[-1]
    light = np.searchsorted(lights.begin, scaled >> np.uint64(32), side="right") - 1
    within = scaled - (lights.begin[light] << np.uint64(32))
    return light, (within // (lights.begin[light + 1] - lights.begin[light])).astype(np.uint32), y
