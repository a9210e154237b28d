"""Texels that are never seen, because they lie inside or under other geometry, and what is shown in their place.

A block that stands on a floor leaves the floor's texels under it in the dark. Reads between texels at the foot of the
block would mix that darkness in; so these texels are found. Those at its rim, which such reads touch, are sampled at
another point, beside the block; the others are not sampled, and show the value of their nearest neighbour.
"""

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial

import numpy as np

from lightloom.golden_model.charts.sample_points import ChartedTriangles, other_points
from lightloom.golden_model.contract.formats import RAY, TRIANGLE
from lightloom.golden_model.numerics.directions import cosine_table, to_world
from lightloom.golden_model.scene.scene import Scene
from lightloom.golden_model.tables.lightmap import (
    BURIED,
    SIDE_LEVELS,
    VALID,
    Lightmaps,
    lightmap_coordinates,
    row_and_column,
)
from lightloom.golden_model.tracing.bvh import traversal
from lightloom.golden_model.tracing.bvh.build import build
from lightloom.golden_model.tracing.trace_protocol import Trace

RAYS = 32
"""Rays a texel: the first entries of the cosine table."""

MOST = 24
"""A texel is buried when at least this many of its rays meet the back of a surface."""

SHADED = 8
"""One of whose rays so many meet backs and none or one a front is behind a sheet: under a floor that has no other side,
say. It is not buried, because it may be seen from there, but another point is looked for as if it were."""

FREE = 4
"""A point is taken in the place of a buried one if fewer of its rays meet backs."""

PASSES = 3
"""Where a block stands in a wall, a texel under it sees the wall's front, of which those texels are buried already that
see less of others. So what partly sees backs is looked at again, fronts of buried texels counting as backs."""

BATCH = 1 << 18  # rays traced at a time


def find_buried(lightmaps: Lightmaps, scene: Scene, trace: Trace, triangles: ChartedTriangles) -> Lightmaps:
    """Finds valid texels that lie inside or under other geometry, moves them or marks them BURIED, and renews `fill`.

    From inside a closed surface all rays meet its back; three quarters of them are asked for, so that the inside of an
    open pot, which can be seen, counts as valid, and a lamp close under a ceiling hides the texels behind it. Beside
    texels that are not buried reads touch it; so there another point of its chart is taken, less than a texel away. The
    backs of two-sided triangles hide nothing.

    Where objects move, what hides a texel in one frame may not in another. So there only what never moves against the
    texel can bury it: the still objects those of each other, a moving body its own (`Scene.bodies`, at rest).
    """
    texels = lightmaps.texels.copy()
    for objects, tracer in alone(scene, trace):
        mine = np.flatnonzero((texels["state"] == VALID) & np.isin(texels["object"], objects))
        backs, fronts = _met(texels[mine], scene, tracer)
        texels["state"][mine[backs >= MOST]] = BURIED
        dark = np.zeros(len(texels), dtype=np.bool_)
        dark[mine] = (backs >= MOST) | ((backs >= SHADED) & (fronts <= 1))
        partly = mine[(backs >= SHADED) & ~dark[mine]]
        for _ in range(PASSES):
            hidden = partial(_hidden, lightmaps, texels["state"], scene)
            backs, _ = _met(texels[partly], scene, tracer, hidden)
            texels["state"][partly[backs >= MOST]] = BURIED
            dark[partly[backs >= MOST]] = True
            partly = partly[backs < MOST]
        _move(texels, lightmaps, scene, triangles, np.flatnonzero(dark & _beside(lightmaps, mine, ~dark)), tracer)
    return replace(lightmaps, texels=texels, fill=nearest_valid(lightmaps, texels["state"]))


def _hidden(lightmaps: Lightmaps, state: np.ndarray, scene: Scene, hits: np.ndarray) -> np.ndarray:
    """Which HIT (K,) met a buried texel's part of a surface, (K,) bool."""
    met = np.flatnonzero(hits["primitive"] >= 0)
    primitive = hits["primitive"][met]
    owner = scene.object_id[primitive]
    place = np.floor(lightmap_coordinates(lightmaps, primitive, hits["u"][met], hits["v"][met])).astype(np.int64)
    column, row = (
        np.clip(place[:, k], 0, size[owner] - 1) for k, size in enumerate((lightmaps.width, lightmaps.height))
    )
    out = np.zeros(len(hits), dtype=np.bool_)
    out[met] = state[lightmaps.offset[owner] + row * lightmaps.width[owner] + column] == BURIED
    return out


def _met(
    texels: np.ndarray, scene: Scene, tracer: Trace, hidden: Callable[[np.ndarray], np.ndarray] | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """How many rays of TEXEL (M,) meet a back, and how many a front, (M,) each.

    A front that is `hidden` is a back; either side of a two-sided triangle is a front.
    """
    counts = np.zeros((2, len(texels)), dtype=np.int64)
    for begin in range(0, len(texels), BATCH // RAYS):
        part = slice(begin, begin + BATCH // RAYS)
        rays = hemisphere_rays(texels[part], cosine_table()[:RAYS])
        hits = tracer(rays.reshape(-1))
        front = hits["front"] if hidden is None else hits["front"] & ~hidden(hits)
        two_sided = scene.two_sided[scene.material[np.maximum(hits["primitive"], 0)]]
        front = front | (two_sided & ~hits["front"])
        met, front = (each.reshape(-1, RAYS) for each in (hits["primitive"] >= 0, front))
        counts[:, part] = (met & ~front).sum(axis=1), (met & front).sum(axis=1)
    return counts[0], counts[1]


def _beside(lightmaps: Lightmaps, texel: np.ndarray, chosen: np.ndarray) -> np.ndarray:
    """Texels (N,) bool with one of `texel` (M,) that is `chosen` (N,) bool among their eight neighbours of a chart."""
    owner = lightmaps.texels["object"][texel]
    width, height = lightmaps.width[owner].astype(np.int64), lightmaps.height[owner].astype(np.int64)
    row, column = row_and_column(lightmaps, texel)
    out = np.zeros(len(chosen), dtype=np.bool_)
    for dy, dx in ((-1, -1), (-1, 0), (-1, 1), (0, -1), (0, 1), (1, -1), (1, 0), (1, 1)):
        there = (row + dy >= 0) & (row + dy < height) & (column + dx >= 0) & (column + dx < width) & chosen[texel]
        other = np.where(there, texel + dy * width + dx, texel)
        out[other[there & (lightmaps.chart[other] == lightmaps.chart[texel])]] = True
    return out


def _move(
    texels: np.ndarray,
    lightmaps: Lightmaps,
    scene: Scene,
    triangles: ChartedTriangles,
    moved: np.ndarray,
    tracer: Trace,
) -> None:
    """Gives those of `moved` (M,) another point that have one that is not buried, in `texels` (N,)."""
    left = np.ones(len(moved), dtype=np.bool_)
    for place, record in other_points(triangles, lightmaps, moved):
        wanted = left[place]
        place, record = place[wanted], record[wanted]
        free = _met(record, scene, tracer)[0] < FREE
        texels[moved[place[free]]] = record[free]
        left[place[free]] = False


def alone(scene: Scene, trace: Trace) -> Iterator[tuple[list[int], Trace]]:
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
    """For every texel (N,) the nearest valid one, (N,) int32, -1 if that lies too far or its map has none.

    A texel of a chart takes one of the same chart if there is any; one outside all charts takes the nearest of its map.
    It lies in the region of 8 x 8 texels (`publishing.regions`) that the texel lies in or in one of the eight around.
    """
    fill = np.full(len(state), -1, dtype=np.int32)
    for base, width, height in zip(lightmaps.offset, lightmaps.width, lightmaps.height, strict=True):
        part = slice(int(base), int(base) + int(width) * int(height))
        valid = (state[part] == VALID).reshape(height, width)
        chart = lightmaps.chart[part].reshape(height, width)
        inside = _spread(np.where(valid, np.arange(valid.size).reshape(valid.shape), -1), chart)
        anywhere = _spread(inside, None)
        row, column = np.indices(anywhere.shape) >> SIDE_LEVELS
        up, left = np.divmod(anywhere, width)
        apart = np.maximum(np.abs((up >> SIDE_LEVELS) - row), np.abs((left >> SIDE_LEVELS) - column))
        fill[part] = np.where((anywhere >= 0) & (apart <= 1), anywhere + int(base), -1).reshape(-1)
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
