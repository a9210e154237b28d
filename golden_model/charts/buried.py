"""Texels that are never seen, because they lie inside or under other geometry, and what is shown in their place.

A block that stands on a floor leaves the floor's texels under it in the dark. Reads between texels at the foot of the
block would mix that darkness in; so these texels are found, not sampled, and show the value of their nearest neighbour.
"""

from collections.abc import Iterator
from dataclasses import replace
from functools import partial

import numpy as np

from lightloom.golden_model.contract.formats import RAY, TRIANGLE
from lightloom.golden_model.numerics.directions import cosine_table, to_world
from lightloom.golden_model.scene.lightmap import BURIED, VALID, Lightmaps
from lightloom.golden_model.scene.scene import Scene
from lightloom.golden_model.tracing.bvh import traversal
from lightloom.golden_model.tracing.bvh.build import build
from lightloom.golden_model.tracing.trace_protocol import Trace

RAYS = 32
"""Rays a texel: the first entries of the cosine table."""

MOST = 24
"""A texel is buried when at least this many of its rays meet the back of a surface."""

BATCH = 1 << 18  # rays traced at a time


def find_buried(lightmaps: Lightmaps, scene: Scene, trace: Trace) -> Lightmaps:
    """Marks valid texels that lie inside or under other geometry as BURIED, and renews `fill`.

    From inside a closed surface all rays meet its back; three quarters of them are asked for, so that the inside of an
    open pot, which can be seen, counts as valid, and a lamp close under a ceiling hides the texels behind it. The backs
    of two-sided triangles hide nothing.

    Where objects move, what hides a texel in one frame may not in another. So there only what never moves against the
    texel can bury it: the still objects those of each other, a moving body its own (`Scene.bodies`, at rest).
    """
    texels = lightmaps.texels.copy()
    for objects, tracer in _alone(scene, trace):
        mine = np.flatnonzero((texels["state"] == VALID) & np.isin(texels["object"], objects))
        for begin in range(0, len(mine), BATCH // RAYS):
            chosen = mine[begin : begin + BATCH // RAYS]
            rays = hemisphere_rays(texels[chosen], cosine_table()[:RAYS])
            hits = tracer(rays.reshape(-1)).reshape(len(chosen), RAYS)
            met, material = hits["primitive"] >= 0, scene.material[np.maximum(hits["primitive"], 0)]
            backs = (met & ~hits["front"] & ~scene.two_sided[material]).sum(axis=1)
            texels["state"][chosen[backs >= MOST]] = BURIED
    return replace(lightmaps, texels=texels, fill=nearest_valid(lightmaps, texels["state"]))


def _alone(scene: Scene, trace: Trace) -> Iterator[tuple[list[int], Trace]]:
    """The bodies of a scene, each with a tracer that meets no other; `trace` serves where there is but one."""
    if len(scene.bodies) == 1:
        yield scene.bodies[0], trace
        return
    for objects in scene.bodies:
        triangles = scene.triangles.copy()
        other = ~np.isin(scene.object_id, objects)
        for name in TRIANGLE.names or ():
            triangles[name][other] = np.nan  # such a triangle is met by no ray
        yield objects, partial(traversal.trace, build(triangles))


def hemisphere_rays(texels: np.ndarray, local: np.ndarray) -> np.ndarray:
    """TEXEL (N,) and directions about +z (K, 3) to RAY (N, K), from where rays of the texels start, without end."""
    count = len(local)
    rays = np.zeros((len(texels), count), dtype=RAY)
    rays["origin"] = texels["position"][:, None, :]
    normal, tangent = (np.repeat(texels[name], count, axis=0) for name in ("normal", "tangent"))
    rays["direction"] = to_world(np.tile(local, (len(texels), 1)), normal, tangent).reshape(len(texels), count, 3)
    rays["t_max"] = np.inf
    return rays


def nearest_valid(lightmaps: Lightmaps, state: np.ndarray) -> np.ndarray:
    """For every texel (N,) the nearest valid one, (N,) int32, -1 if its map has none.

    A texel of a chart takes one of the same chart if there is any; one outside all charts takes the nearest of its map.
    """
    fill = np.full(len(state), -1, dtype=np.int32)
    for base, width, height in zip(lightmaps.offset, lightmaps.width, lightmaps.height, strict=True):
        part = slice(int(base), int(base) + int(width) * int(height))
        valid = (state[part] == VALID).reshape(height, width)
        chart = lightmaps.chart[part].reshape(height, width)
        inside = _spread(np.where(valid, np.arange(valid.size).reshape(valid.shape), -1), chart)
        anywhere = _spread(inside, None)
        fill[part] = np.where(anywhere >= 0, anywhere + int(base), -1).reshape(-1)
    return fill


def _spread(source: np.ndarray, chart: np.ndarray | None) -> np.ndarray:
    """Propagates sources (H, W), -1 where none, to the pixels around them until nothing changes; nearest wins.

    With `chart`, only from and to pixels of one chart. Each pass looks at the eight neighbours in a fixed order.
    """
    height, width = source.shape
    settled = source >= 0
    row = np.broadcast_to(np.arange(height)[:, None], source.shape)
    column = np.broadcast_to(np.arange(width), source.shape)
    source = source.copy()
    distance = np.where(settled, 0, np.iinfo(np.int64).max)
    changed = not settled.all() and bool(settled.any())
    while changed:
        changed = False
        for dy, dx in ((0, -1), (-1, 0), (0, 1), (1, 0), (-1, -1), (-1, 1), (1, 1), (1, -1)):
            here = slice(max(-dy, 0), height - max(dy, 0)), slice(max(-dx, 0), width - max(dx, 0))
            there = slice(max(dy, 0), height + min(dy, 0)), slice(max(dx, 0), width + min(dx, 0))
            offered = source[there]
            far = (row[here] - offered // width) ** 2 + (column[here] - offered % width) ** 2
            better = (offered >= 0) & (far < distance[here]) & ~settled[here]
            if chart is not None:
                better &= (chart[here] == chart[there]) & (chart[here] >= 0)
            if better.any():
                changed = True
                source[here] = np.where(better, offered, source[here])
                distance[here] = np.where(better, far, distance[here])
    return source
