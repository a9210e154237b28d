"""Converged irradiance by path tracing, without any lightmap: what the lightmaps are to come to.

Every vertex of a path samples the lights (next-event estimation), and what its rays meet by chance is counted too, each
by how likely it is to find the light. Surfaces are diffuse and reflect on both sides; lights shine from their front.

A path goes on from a surface with the chance of its albedo's largest component (Russian roulette: throughput stays at
most 1 and nothing is lost on average). Paths are cut after the first K vertices for which (largest albedo)**K < 2**-11:
light that was reflected more often is less than 0.05 % of all, even in a closed room.
"""

from collections.abc import Callable

import numpy as np

from lightloom.golden_model.contract.formats import RAY
from lightloom.golden_model.driver.geometry import shapes_of
from lightloom.golden_model.numerics.counter_rng import hash_u32, uniform
from lightloom.golden_model.numerics.directions import (
    COUNT,
    ROTATIONS,
    cosine_table,
    rotation_table,
    tangent_of,
    to_world,
)
from lightloom.golden_model.numerics.floats import flush, quiet
from lightloom.golden_model.numerics.vectors import add, scale, subtract
from lightloom.golden_model.rays.hit_surface import surface_at
from lightloom.golden_model.rays.light_samples import direct_candidates, met_beyond, met_emission
from lightloom.golden_model.scene.lights import lights_of
from lightloom.golden_model.scene.scene import Scene
from lightloom.golden_model.tables.lights import Lights
from lightloom.golden_model.tables.ray_offset import lift, ray_start
from lightloom.golden_model.tracing.trace_protocol import Trace

_PI = np.float32(3.1415927)
_RIVALS = np.float32(1)  # a ray goes on from a vertex for each light sample there
BATCH = 1 << 17  # paths traced at a time: bounds the memory
SKY_SIDE = 512  # cells along each side of the table of a sky: no larger than a seventh to a third of a degree
MOST_VERTICES = 512  # of a path, where an albedo is 1
_DIRECT, _ROTATION, _ROULETTE, _DIRECTION, _LIGHT = range(5)  # what a hash is for


def irradiance(
    scene: Scene,
    trace: Trace,
    position: np.ndarray,
    normal: np.ndarray,
    samples: int,
    seed: int = 0,
    progress: Callable[[int, int], None] | None = None,
) -> np.ndarray:
    """Irradiance (N, 3) float32 at points (N, 3) with unit normals (N, 3), float32, from `samples` paths a point.

    The same seed gives the same bits. `progress(done, total)` is called with numbers of paths as they are finished.
    """
    lights, shapes = lights_of(scene, SKY_SIDE), shapes_of(scene)
    total = np.zeros((len(position), 3))
    points = max(BATCH // samples, 1)
    run = min(samples, BATCH)
    done = 0
    for begin in range(0, len(position), points):
        part = slice(begin, begin + points)
        number = np.arange(begin, min(begin + points, len(position)))
        for first in range(0, samples, run):
            count = min(run, samples - first)
            facing = normal[part].astype(np.float32)
            place = _starts(scene, trace, position[part].astype(np.float32), facing)
            key = hash_u32(number, seed)
            batch = _direct(lights, trace, place, facing, key, first, count)
            batch += _indirect(scene, shapes, lights, trace, place, facing, key, first, count)
            total[part] += batch
            done += len(number) * count
            if progress is not None:
                progress(done, len(position) * samples)
    return (total / samples).astype(np.float32)


def _starts(scene: Scene, trace: Trace, position: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """Where the rays of points (N, 3) on surfaces with unit normals (N, 3) start, (N, 3) float32.

    Which triangle a point lies on is found by a ray to it, and through it, from as far off as the largest triangle of
    the scene could make it: of all that the ray meets the one nearest to the point, because something small may well be
    above the point yet within that distance. A point in the air needs no more than its own coordinates do.
    """
    probe = np.zeros(len(position), dtype=RAY)
    far = lift(position, normal, scene.spans.max())
    probe["origin"] = add(position, scale(normal, far))
    probe["direction"], probe["t_max"] = -normal, flush(np.float32(2) * far)
    nearest = np.full(len(position), np.inf)
    span = np.zeros(len(position), dtype=np.float32)
    corners = scene.corners
    on = np.arange(len(position))  # the points whose probes have not come to their ends
    while len(on):
        hits = trace(probe[on])
        met = hits["primitive"] >= 0
        on, hits = on[met], hits[met]
        distance = _distance(corners[hits["primitive"]], position[on], normal[on])
        nearer = distance < nearest[on]
        nearest[on[nearer]] = distance[nearer]
        span[on[nearer]] = scene.spans[hits["primitive"][nearer]]
        probe["t_min"][on] = hits["t"]  # hits lie beyond it
    return ray_start(position, normal, span)


def _distance(corners: np.ndarray, position: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """From points (N, 3) along unit normals (N, 3) to the planes of triangles (N, 3, 3), either way: (N,) float64.

    The tracer's own distance is off by as much as the size of the triangle makes it, which may be more than lies
    between two of them. Infinite where the plane holds the normal.
    """
    first, second, third = np.moveaxis(corners.astype(np.float64), 1, 0)
    across = np.cross(second - first, third - first)
    height = np.abs(((position - first) * across).sum(axis=1))
    slope = np.abs((normal * across).sum(axis=1))
    return np.divide(height, slope, out=np.full(len(height), np.inf), where=slope > 0)


def _in_order(values: np.ndarray) -> np.ndarray:
    """(N, S, 3) to their sums over S, (N, 3) float64, added one after the other."""
    return np.cumsum(values, axis=1, dtype=np.float64)[:, -1]


def _direct(
    lights: Lights, trace: Trace, position: np.ndarray, normal: np.ndarray, key: np.ndarray, first: int, samples: int
) -> np.ndarray:
    """Sum of `samples` estimates of the direct irradiance, (N, 3) float64."""
    rays, weight = direct_candidates(
        lights, position, normal, hash_u32(key, _DIRECT), first=first, samples=samples, rivals=_RIVALS
    )
    return _in_order(weight * _open(trace, rays.reshape(-1)).reshape(rays.shape)[..., None]) * samples


def _open(trace: Trace, rays: np.ndarray) -> np.ndarray:
    """Which shadow rays nothing blocks, float32 1 or 0; rays that end where they start are not traced."""
    free = np.zeros(len(rays), dtype=np.float32)
    wanted = np.flatnonzero(rays["t_max"] > 0)
    free[wanted] = trace(rays[wanted], any_hit=True)["primitive"] < 0
    return free


@quiet
def _indirect(
    scene: Scene,
    shapes: np.ndarray,
    lights: Lights,
    trace: Trace,
    position: np.ndarray,
    normal: np.ndarray,
    key: np.ndarray,
    first: int,
    samples: int,
) -> np.ndarray:
    """Sum of `samples` estimates of the irradiance by cosine-distributed rays, (N, 3) float64.

    The density of directions is cosine / pi and a surface reflects albedo / pi of its irradiance, so pi cancels: each
    vertex adds throughput times its direct irradiance, throughput being the product of the albedos so far. Emission
    that a ray meets adds pi times throughput times what the light samples before left of it.
    """
    points = len(position)
    gathered = np.zeros((points * samples, 3), dtype=np.float32)
    path = np.arange(points * samples)
    sample = np.tile(np.arange(first, first + samples), points)
    own = hash_u32(np.repeat(key, samples), sample)  # of each path
    angle = hash_u32(np.repeat(key, samples), _ROTATION, sample // COUNT)
    place, facing = np.repeat(position, samples, axis=0), np.repeat(normal, samples, axis=0)
    rays = _bounce(place, facing, sample % COUNT, angle)
    throughput = np.ones((len(path), 3), dtype=np.float32)
    for vertex in range(_vertices(scene)):
        hits = trace(rays)
        met = hits["primitive"] >= 0
        if lights.distant:
            glow = met_beyond(lights, rays["direction"][~met], facing[~met], _RIVALS)
            gathered[path[~met]] += flush(throughput[~met] * flush(glow * _PI))
        path, own, throughput, hits = path[met], own[met], throughput[met], hits[met]
        if not len(path):
            break
        before, normal_before = place[met], facing[met]
        surface = surface_at(shapes, hits)
        place, facing, albedo = surface.start, surface.facing, scene.albedo[scene.material[hits["primitive"]]]
        glow = met_emission(lights, hits["primitive"], hits["front"], subtract(place, before), normal_before, _RIVALS)
        gathered[path] += flush(throughput * flush(glow * _PI))
        throughput = flush(throughput * albedo)
        shadow, weight = direct_candidates(lights, place, facing, hash_u32(own, _LIGHT, vertex), rivals=_RIVALS)
        gathered[path] += flush(throughput * flush(weight[:, 0] * _open(trace, shadow[:, 0])[:, None]))

        chance = albedo.max(axis=1)
        onward = uniform(hash_u32(own, _ROULETTE, vertex)) < chance
        path, own, place, facing = path[onward], own[onward], place[onward], facing[onward]
        throughput = flush(throughput[onward] / chance[onward, None])
        entry = hash_u32(own, _DIRECTION, vertex)
        rays = _bounce(place, facing, entry % np.uint32(COUNT), entry // np.uint32(COUNT))
    return _in_order(gathered.reshape(points, samples, 3))


def _vertices(scene: Scene) -> int:
    """Vertices after which a path is cut."""
    largest = float(scene.albedo[scene.material].max())
    remaining, count = 1.0, 0
    while remaining >= 2.0**-11 and count < MOST_VERTICES:
        remaining *= largest
        count += 1
    return count


def _bounce(start: np.ndarray, facing: np.ndarray, entry: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """RAY (N,) from points with normals (N, 3) along entries of the cosine table, turned by entries of the other."""
    rays = np.zeros(len(start), dtype=RAY)
    rays["origin"] = start
    rotation = rotation_table()[angle % np.uint32(ROTATIONS)]
    rays["direction"] = to_world(cosine_table()[entry], facing, tangent_of(facing), rotation)
    rays["t_max"] = np.inf
    return rays
