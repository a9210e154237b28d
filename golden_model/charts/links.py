"""Which neighbouring texels see each other, so that what goes from one to the other goes through no wall.

Two texels beside each other in a chart are joined if a ray from just above the one to just above the other meets
nothing that stands on the chart. Smoothing, fills and coarser levels go along links only.
"""

from dataclasses import replace

import numpy as np

from lightloom.golden_model.charts.buried import BATCH, alone
from lightloom.golden_model.charts.sample_points import ChartedTriangles
from lightloom.golden_model.contract.engine_image import GLASS
from lightloom.golden_model.contract.formats import RAY
from lightloom.golden_model.scene.barriers import SLICE, STEEPEST
from lightloom.golden_model.scene.mesh import area_vectors, dot
from lightloom.golden_model.scene.scene import Scene
from lightloom.golden_model.tables.lightmap import DOWN, RIGHT, VALID, Lightmaps, followed, joined, steps_of
from lightloom.golden_model.tracing.trace_protocol import Trace


def find_links(lightmaps: Lightmaps, scene: Scene, trace: Trace, triangles: ChartedTriangles) -> Lightmaps:
    """The lightmaps with `links`: of a scene at rest, and only what never moves against a texel comes between."""
    texels = lightmaps.texels
    links = np.zeros(len(texels), dtype=np.uint8)
    steps = tuple(zip((RIGHT, DOWN), steps_of(lightmaps), strict=True))
    for objects, tracer in alone(scene, trace):
        mine = np.isin(texels["object"], objects)
        for (bit, step), reached in zip(steps, joined(lightmaps), strict=True):
            first = np.flatnonzero(reached & mine)
            second = first + step[first]
            both = (texels["state"][first] == VALID) & (texels["state"][second] == VALID)
            first, second = first[both], second[both]
            for begin in range(0, len(first), BATCH):
                part = slice(begin, begin + BATCH)
                free = _free(lightmaps, scene, tracer, triangles, first[part], second[part])
                links[first[part][free]] |= bit
    return replace(lightmaps, links=_with_shown(lightmaps, links, steps))


def _free(
    lightmaps: Lightmaps,
    scene: Scene,
    tracer: Trace,
    triangles: ChartedTriangles,
    first: np.ndarray,
    second: np.ndarray,
) -> np.ndarray:
    """Whether texels (M,) and (M,) see each other, (M,) bool.

    What lies on the chart rather than standing on it, and the chart itself where it is bent, are not in the way.
    """
    height = SLICE * scene.texel_size
    ends = [lightmaps.texels[each] for each in (first, second)]
    start, end = (each["position"] + height * each["normal"] for each in ends)
    away = (end - start).astype(np.float64)
    length = np.sqrt(dot(away, away))
    rays = np.zeros(len(first), dtype=RAY)
    rays["origin"] = start
    rays["direction"] = away / np.maximum(length, 1e-30)[:, None]
    rays["t_max"] = length
    hits = tracer(rays)
    met = hits["primitive"]
    normal = area_vectors(scene.corners[met])
    upright = np.abs(dot(normal, ends[0]["normal"].astype(np.float64))) <= STEEPEST * np.sqrt(dot(normal, normal))
    other = triangles.chart[met] != lightmaps.chart[first]
    return ~((met >= 0) & upright & other & (scene.surface[scene.material[met]] != GLASS))


def _with_shown(lightmaps: Lightmaps, links: np.ndarray, steps: tuple[tuple[int, np.ndarray], ...]) -> np.ndarray:
    """Links (N,) with those of empty and buried texels: two are joined where the texels that they show are.

    These are one, or joined neighbours.
    """
    links = links.copy()
    shown = np.maximum(lightmaps.fill, 0).astype(np.int64)
    own = lightmaps.fill == np.arange(len(links))
    made = links.copy()
    for (bit, step), there in zip(steps, followed(lightmaps), strict=True):
        other = np.minimum(np.arange(len(links)) + step, len(links) - 1)
        a, b = np.minimum(shown, shown[other]), np.maximum(shown, shown[other])
        near = a == b
        for side, stride in steps:
            near |= (b == a + stride[a]) & ((links[a] & side) > 0)
        inside = there & (lightmaps.fill >= 0) & (lightmaps.fill[other] >= 0) & ~(own & own[other])
        made[inside & near] |= bit
    return made
