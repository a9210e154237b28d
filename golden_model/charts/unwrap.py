"""From a scene to its lightmaps: charts for every object, texel records, buried texels."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from lightloom.golden_model.charts.buried import find_buried, nearest_valid
from lightloom.golden_model.charts.curved import mesh_charts
from lightloom.golden_model.charts.planar import GAP, ObjectCharts, planar_charts, planar_pieces
from lightloom.golden_model.charts.read_levels import deepest_levels
from lightloom.golden_model.charts.texels import MARGIN, texel_records, unit
from lightloom.golden_model.charts.unwrap_process import KilledError, Unwrapper
from lightloom.golden_model.contract.formats import TEXEL
from lightloom.golden_model.host.errors import InputError
from lightloom.golden_model.scene.lightmap import Lightmaps
from lightloom.golden_model.scene.mesh import area_vectors, dot
from lightloom.golden_model.scene.ray_offset import lift
from lightloom.golden_model.scene.scene import Scene
from lightloom.golden_model.tracing.trace_protocol import Trace

PLANAR_TRIANGLES = 512
"""Objects with more triangles are taken for curved meshes without looking for flat pieces."""

PLANAR_PIECES = 16
"""An object is flat geometry if it has at most this many flat pieces, or two triangles a piece on average."""

MOST_TEXELS = 1 << 24
LONGEST_SIDE = 1 << 14


@dataclass(frozen=True)
class _Object:
    charts: ObjectCharts
    texels: np.ndarray
    chart: np.ndarray
    back_rows: int = 0


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
    sides = [1 + (item.back_rows > 0) for item in objects]
    charts = [int(item.charts.chart.max()) + 1 for item in objects]
    charts_before = np.cumsum([0, *(count * k for count, k in zip(charts, sides, strict=True))])
    lightmaps = Lightmaps(
        width=width,
        height=height,
        offset=(np.cumsum(count) - count).astype(np.int32),
        uv=np.concatenate([item.charts.uv for item in objects]),
        texels=texels,
        chart=np.concatenate(
            [
                np.where(item.chart >= 0, item.chart + before, -1)
                for item, before in zip(objects, charts_before, strict=False)
            ]
        ).astype(np.int32),
        fill=np.full(len(texels), -1, dtype=np.int32),
        back_rows=back_rows if back_rows.any() else None,
    )
    if trace is not None:
        lightmaps = find_buried(lightmaps, scene, trace)
    else:
        lightmaps.fill[:] = nearest_valid(lightmaps, texels["state"])
    return replace(lightmaps, deepest=deepest_levels(lightmaps))


def object_charts(
    corners: np.ndarray, texel_size: float, cache: Path | None = None, unwrapper: Unwrapper | None = None
) -> ObjectCharts:
    """Charts of one object's triangles (F, 3, 3): planar ones for flat geometry, else those of xatlas."""
    if len(corners) <= PLANAR_TRIANGLES:
        piece = planar_pieces(corners)
        pieces = int(piece.max()) + 1
        if pieces <= max(PLANAR_PIECES, len(corners) // 2):
            return planar_charts(corners, piece, texel_size)
    return mesh_charts(corners, texel_size, cache, unwrapper)


def _unwrap_object(scene: Scene, number: int, texel_size: float, cache: Path | None, unwrapper: Unwrapper) -> _Object:
    members = scene.object_id == number
    if not scene.lightmapped[number]:
        return _empty_map(int(members.sum()))
    corners = scene.corners[members]
    try:
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
    front = _Object(charts, texels, chart)
    two_sided = scene.two_sided[scene.material[members]]
    return _with_back(front, corners, scene.normals[members], two_sided, span, margin) if two_sided.any() else front


def _with_back(
    front: _Object,
    corners: np.ndarray,
    normals: np.ndarray,
    two_sided: np.ndarray,
    span: np.ndarray,
    margin: np.ndarray,
) -> _Object:
    """A map with texels for the backs of the triangles that are `two_sided` (F,), below those of the fronts.

    They lie at the same places of the surface, on its other side, in charts of their own.
    """
    charts, turned = front.charts, [0, 2, 1]
    texels, chart = texel_records(
        corners[two_sided][:, turned],
        -normals[two_sided][:, turned],
        charts.uv[two_sided][:, turned],
        charts.chart[two_sided],
        charts.width,
        charts.height,
        span[two_sided],
        margin[two_sided],
    )
    gap = GAP * charts.width
    behind = np.where(chart >= 0, chart + charts.chart.max() + 1, -1)
    return _Object(
        replace(charts, height=2 * charts.height + GAP),
        np.concatenate([front.texels, np.zeros(gap, dtype=TEXEL), texels]),
        np.concatenate([front.chart, np.full(gap, -1, dtype=np.int32), behind]).astype(np.int32),
        charts.height + GAP,
    )


def _empty_map(faces: int) -> _Object:
    """The map of an object that has no lightmap: one texel outside all charts, so that every object has a place."""
    charts = ObjectCharts(1, 1, np.zeros((faces, 3, 2), dtype=np.float32), np.full(faces, -1, dtype=np.int32))
    return _Object(charts, np.zeros(1, dtype=TEXEL), np.full(1, -1, dtype=np.int32))


def _area(scene: Scene) -> float:
    """Of all triangles with lightmaps together, for an estimate of the number of texels."""
    vectors = area_vectors(scene.corners[scene.lightmapped[scene.object_id]])
    if not len(vectors):
        return 0.0
    return float(np.cumsum(np.sqrt(dot(vectors, vectors)) / 2)[-1])
