"""From a scene to its lightmaps: charts for every object, texel records, buried texels."""

from dataclasses import dataclass, fields, replace
from pathlib import Path

import numpy as np

from lightloom.golden_model.charts.buried import find_buried, nearest_valid
from lightloom.golden_model.charts.curved import mesh_charts
from lightloom.golden_model.charts.links import find_links
from lightloom.golden_model.charts.planar import GAP, ObjectCharts, planar_charts
from lightloom.golden_model.charts.read_levels import deepest_levels
from lightloom.golden_model.charts.sample_points import ChartedTriangles
from lightloom.golden_model.charts.texels import MARGIN, chart_border, texel_records, unit
from lightloom.golden_model.charts.unwrap_process import KilledError, Unwrapper
from lightloom.golden_model.contract.formats import TEXEL
from lightloom.golden_model.host.errors import InputError
from lightloom.golden_model.scene.flat_pieces import flat_pieces
from lightloom.golden_model.scene.mesh import area_vectors, dot
from lightloom.golden_model.scene.scene import Scene
from lightloom.golden_model.tables.lightmap import Lightmaps
from lightloom.golden_model.tables.ray_offset import lift
from lightloom.golden_model.tracing.trace_protocol import Trace

MOST_TEXELS = 1 << 24
LONGEST_SIDE = 1 << 14


@dataclass(frozen=True)
class _Object:
    charts: ObjectCharts
    texels: np.ndarray
    chart: np.ndarray
    span: np.ndarray
    border: np.ndarray
    back_rows: int = 0
    backs: ChartedTriangles | None = None
    """Two-sided triangles from behind, charts numbered as in `chart`."""


def unwrap(
    scene: Scene, texel_size: float | None = None, *, trace: Trace | None = None, cache: Path | None = None
) -> Lightmaps:
    """The lightmaps of a scene at rest, one map an object, with texels of about `texel_size` (default: the scene's).

    An object without a diffuse surface gets a map of one EMPTY texel.

    `trace` traces rays through the scene's triangles; without it buried texels are not looked for. `cache` is a folder
    that keeps the charts of curved meshes (`curved.default_cache()`), None keeps nothing.
    Raises InputError where the texels are so small that there would be more than MOST_TEXELS, and where the process
    that makes the charts of curved meshes is killed from outside.
    """
    size = scene.texel_size if texel_size is None else texel_size
    if not (np.isfinite(size) and size > 0):
        raise InputError(f"{scene.name}: texel_size must be a positive number, not {size}")
    area = _area(scene)
    if area / size / size > MOST_TEXELS:
        raise InputError(
            f"{scene.name}: texel_size {size:g} needs {area / size / size:.2g} texels, at most {MOST_TEXELS} are "
            f"possible; choose {np.sqrt(area / MOST_TEXELS):.2g} or more"
        )
    with Unwrapper() as unwrapper:
        objects = [_unwrap_object(scene, k, size, cache, unwrapper) for k in range(len(scene.object_names))]
    back_rows = np.array([item.back_rows for item in objects], dtype=np.int32)
    width = np.array([item.charts.width for item in objects], dtype=np.int32)
    height = np.array([item.charts.height for item in objects], dtype=np.int32)
    count = width.astype(np.int64) * height
    if count.sum() > 2 * MOST_TEXELS or max(width.max(), height.max()) > LONGEST_SIDE:
        raise InputError(f"{scene.name}: texel_size {size:g} makes maps too large; choose a larger one")

    texels = np.concatenate([item.texels for item in objects]).astype(TEXEL)
    texels["object"] = np.repeat(np.arange(len(objects)), count)
    sides = np.array([1 + (item.back_rows > 0) for item in objects])
    charts = np.array([int(item.charts.chart.max()) + 1 for item in objects]) * sides
    charts_before = np.cumsum(charts) - charts
    lightmaps = Lightmaps(
        width=width,
        height=height,
        offset=(np.cumsum(count) - count).astype(np.int32),
        uv=np.concatenate([item.charts.uv for item in objects]),
        texels=texels,
        chart=_numbered([item.chart for item in objects], charts_before),
        fill=np.full(len(texels), -1, dtype=np.int32),
        back_rows=back_rows if back_rows.any() else None,
    )
    if trace is not None:
        triangles = ChartedTriangles(
            corners=scene.corners,
            normals=scene.normals,
            uv=lightmaps.uv,
            chart=_numbered([item.charts.chart for item in objects], charts_before),
            span=np.concatenate([item.span for item in objects]),
            border=np.concatenate([item.border for item in objects]),
        )
        triangles = _with_backs(triangles, objects, charts_before)
        lightmaps = find_links(find_buried(lightmaps, scene, trace, triangles), scene, trace, triangles)
    else:
        lightmaps.fill[:] = nearest_valid(lightmaps, texels["state"])
    return replace(lightmaps, deepest=deepest_levels(lightmaps))


def _numbered(chart: list[np.ndarray], before: np.ndarray) -> np.ndarray:
    """The charts of each object's texels or triangles numbered through all objects, int32; -1 stays."""
    return np.concatenate([np.where(own >= 0, own + k, -1) for own, k in zip(chart, before, strict=True)]).astype(
        np.int32
    )


def object_charts(
    corners: np.ndarray, texel_size: float, cache: Path | None = None, unwrapper: Unwrapper | None = None
) -> ObjectCharts:
    """Charts of one object's triangles (F, 3, 3): planar ones for flat geometry, else those of xatlas."""
    piece = flat_pieces(corners)
    if piece is not None:
        return planar_charts(corners, piece, texel_size)
    return mesh_charts(corners, texel_size, cache, unwrapper)


def _unwrap_object(scene: Scene, number: int, texel_size: float, cache: Path | None, unwrapper: Unwrapper) -> _Object:
    members = scene.object_id == number
    if not scene.lightmapped[number]:
        return _empty_map(int(members.sum()))
    corners = scene.corners[members]
    try:
        section = scene.section[members]
        if section[0] >= 0:
            charts = planar_charts(corners, section, texel_size)
        else:
            charts = object_charts(corners, texel_size, cache, unwrapper)
    except KilledError as error:
        raise InputError(
            f"{scene.name}: object {scene.object_names[number]!r}: the process that makes its lightmap charts was "
            "killed, perhaps for want of memory; free some, or take a mesh of fewer triangles"
        ) from error
    span = scene.spans[members]
    if (path := scene.object_path[number]) is not None and not path.stays:
        # Texels and triangles are carried to a frame's pose each by itself: both round with the coordinates there.
        span = span + np.float32(scene.object_reach[number])
    normal = unit(area_vectors(corners)).astype(np.float32)
    # Where texels are tiny the margin is what keeps rays from starting in a wall that meets this one.
    farthest = lift(corners, normal[:, None], span[:, None]).max(axis=1)
    margin = np.maximum(MARGIN, 2 * farthest.astype(np.float64) / texel_size)
    texels, chart = texel_records(
        corners, scene.normals[members], charts.uv, charts.chart, charts.width, charts.height, span, margin
    )
    border = chart_border(charts.uv, charts.chart) * margin[:, None]
    front = _Object(charts, texels, chart, span, border)
    two_sided = scene.two_sided[scene.material[members]]
    return _with_back(front, corners, scene.normals[members], two_sided, margin) if two_sided.any() else front


def _with_back(
    front: _Object, corners: np.ndarray, normals: np.ndarray, two_sided: np.ndarray, margin: np.ndarray
) -> _Object:
    """A map with texels for the backs of the triangles that are `two_sided` (F,), below those of the fronts.

    They lie at the same places of the surface, on its other side, in charts of their own.
    """
    charts, turned = front.charts, [0, 2, 1]
    rows, before = charts.height + GAP, int(charts.chart.max()) + 1
    backs = ChartedTriangles(
        corners=corners[two_sided][:, turned],
        normals=-normals[two_sided][:, turned],
        uv=charts.uv[two_sided][:, turned],
        chart=charts.chart[two_sided],
        span=front.span[two_sided],
        border=front.border[two_sided][:, [2, 1, 0]],  # edge k goes from corner k to the next
    )
    texels, chart = texel_records(
        backs.corners,
        backs.normals,
        backs.uv,
        backs.chart,
        charts.width,
        charts.height,
        backs.span,
        margin[two_sided],
    )
    gap = GAP * charts.width
    behind = np.where(chart >= 0, chart + before, -1)
    return replace(
        front,
        charts=replace(charts, height=2 * charts.height + GAP),
        texels=np.concatenate([front.texels, np.zeros(gap, dtype=TEXEL), texels]),
        chart=np.concatenate([front.chart, np.full(gap, -1, dtype=np.int32), behind]).astype(np.int32),
        back_rows=rows,
        backs=replace(backs, uv=backs.uv + np.array([0, rows], dtype=np.float32), chart=backs.chart + before),
    )


def _with_backs(fronts: ChartedTriangles, objects: list[_Object], charts_before: np.ndarray) -> ChartedTriangles:
    """The triangles of a scene, and behind them those of all backs."""
    backs = [
        replace(item.backs, chart=item.backs.chart + before)
        for item, before in zip(objects, charts_before, strict=True)
        if item.backs is not None
    ]
    together = {
        each.name: np.concatenate([getattr(part, each.name) for part in (fronts, *backs)]) for each in fields(fronts)
    }
    return ChartedTriangles(**together)


def _empty_map(faces: int) -> _Object:
    """The map of an object that has no lightmap: one texel outside all charts, so that every object has a place."""
    charts = ObjectCharts(1, 1, np.zeros((faces, 3, 2), dtype=np.float32), np.full(faces, -1, dtype=np.int32))
    none = np.zeros(faces, dtype=np.float32)
    return _Object(charts, np.zeros(1, dtype=TEXEL), np.full(1, -1, dtype=np.int32), none, np.zeros((faces, 3)))


def _area(scene: Scene) -> float:
    """Of all triangles with lightmaps together, for an estimate of the number of texels."""
    vectors = area_vectors(scene.corners[scene.lightmapped[scene.object_id]])
    if not len(vectors):
        return 0.0
    return float(np.cumsum(np.sqrt(dot(vectors, vectors)) / 2)[-1])
