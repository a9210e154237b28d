"""Lightmap charts of curved meshes, by xatlas, which engines use; kept on disk, because a scanned mesh takes a while.

The charts are part of the scene's data, not of the numeric contract: xatlas is pinned, and gives the same charts for
any number of threads, but its float arithmetic is the host's.
"""

import hashlib
import importlib.metadata
import os
import zipfile
from contextlib import nullcontext
from pathlib import Path

import numpy as np

from lightloom.golden_model.charts.planar import GAP, ObjectCharts, pack, planar_charts
from lightloom.golden_model.charts.unwrap_process import Unwrapper
from lightloom.golden_model.host.errors import InputError
from lightloom.golden_model.host.fingerprint import fingerprint
from lightloom.golden_model.host.outputs import whole_file
from lightloom.golden_model.scene.flat_pieces import planar_pieces

FEWEST_TRIANGLES = 512
"""A piece of a mesh with no more triangles is not cut again where xatlas fails on it: it gets a chart a flat piece."""


def default_cache() -> Path | None:
    """Where charts are kept: $LIGHTLOOM_CACHE, or `lightloom` in $XDG_CACHE_HOME, or ~/.cache/lightloom.

    None, nowhere, for a user without a home: no $HOME, and no entry among the system's users.
    """
    if own := os.environ.get("LIGHTLOOM_CACHE"):
        return Path(own)
    try:
        return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "lightloom"
    except RuntimeError:
        return None


def mesh_charts(
    corners: np.ndarray, texel_size: float, cache: Path | None = None, unwrapper: Unwrapper | None = None
) -> ObjectCharts:
    """(F, 3, 3) float32 corners to charts with texels of about `texel_size`.

    With `cache` (a folder) charts are looked up by a hash of everything they depend on, and kept there. A damaged entry
    is made again; a folder that cannot be written is no error. `unwrapper` is one that is already there.
    Raises KilledError where its process is killed from outside; then nothing is kept.
    """
    points, faces = _indexed(corners)
    made_by = fingerprint(__name__), importlib.metadata.version("xatlas")
    settings = repr((*made_by, texel_size, faces.shape, points.shape))
    key = hashlib.sha256(settings.encode() + points.tobytes() + faces.tobytes()).hexdigest()
    kept = cache / "charts" / f"{key}.npz" if cache is not None else None
    if kept is not None:
        found = _read(kept, len(faces))
        if found is not None:
            return found
    with nullcontext(unwrapper) if unwrapper is not None else Unwrapper() as process:
        made = _unwrap(corners, texel_size, process)
    if kept is not None:
        _write(kept, made)
    return made


def _indexed(corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points (P, 3) float32 and faces (F, 3) uint32: equal positions are one point."""
    points, index = np.unique(corners.reshape(-1, 3) + np.float32(0), axis=0, return_inverse=True)
    return points, np.ascontiguousarray(index.reshape(-1, 3).astype(np.uint32))


def _unwrap(corners: np.ndarray, texel_size: float, process: Unwrapper) -> ObjectCharts:
    """The charts of xatlas; of a mesh on which it fails those of its halves, and so on."""
    points, faces = _indexed(corners)
    # xatlas drops triangles by absolute thresholds of size, so it sees the mesh measured in texels.
    made = process.charts((points.astype(np.float64) / texel_size).astype(np.float32), faces, GAP)
    if made is not None:
        width, height = (int(n) for n in made["size"])
        return _with_strays(points, faces, made["uv"], made["chart"], width, height)
    if len(corners) <= FEWEST_TRIANGLES:
        return planar_charts(corners, planar_pieces(corners), texel_size)
    members = _halves(corners)
    return _side_by_side(members, [_unwrap(corners[half], texel_size, process) for half in members])


def _halves(corners: np.ndarray) -> list[np.ndarray]:
    """The triangles on either side of the middle one, along the axis in which they reach farthest."""
    wide = corners.astype(np.float64)
    centre = (wide[:, 0] + wide[:, 1]) + wide[:, 2]
    order = np.argsort(centre[:, np.argmax(np.ptp(centre, axis=0))], kind="stable")
    return [np.sort(half) for half in np.array_split(order, 2)]


def _side_by_side(members: list[np.ndarray], pieces: list[ObjectCharts]) -> ObjectCharts:
    """The maps of pieces of a mesh, whose triangles are `members`, in one map."""
    place, width, height = pack(np.array([[piece.width, piece.height] for piece in pieces]))
    faces = sum(len(piece.chart) for piece in pieces)
    uv, chart = np.zeros((faces, 3, 2), dtype=np.float32), np.zeros(faces, dtype=np.int32)
    before = 0
    for mine, piece, corner in zip(members, pieces, place, strict=True):
        uv[mine] = piece.uv + corner.astype(np.float32)
        chart[mine] = piece.chart + before
        before += int(piece.chart.max()) + 1
    return ObjectCharts(width, height, uv, chart)


def _with_strays(
    points: np.ndarray, faces: np.ndarray, uv: np.ndarray, chart: np.ndarray, width: int, height: int
) -> ObjectCharts:
    """Gives the triangles that xatlas leaves out (slivers) the place of a neighbour in some chart."""
    for face in np.flatnonzero(chart < 0):
        shared = np.isin(faces, faces[face]) & (chart >= 0)[:, None]
        near = np.flatnonzero(shared.any(axis=1))
        neighbour = int(near[np.argmax(shared[near].sum(axis=1))]) if len(near) else int(np.argmax(chart >= 0))
        # Every corner goes to the neighbour's corner that is the same point, or to its first.
        same = faces[face][:, None] == faces[neighbour][None, :]
        uv[face] = uv[neighbour][np.where(same.any(axis=1), same.argmax(axis=1), shared[neighbour].argmax())]
        chart[face] = chart[neighbour]
    return ObjectCharts(width, height, uv.astype(np.float32), chart)


def _read(path: Path, faces: int) -> ObjectCharts | None:
    try:
        with path.open("rb") as file, np.load(file) as kept:
            width, height = (int(n) for n in kept["size"])
            charts = ObjectCharts(width, height, kept["uv"], kept["chart"])
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile):
        return None
    whole = charts.uv.shape == (faces, 3, 2) and charts.chart.shape == (faces,)
    return charts if whole and charts.uv.dtype == np.float32 and charts.chart.dtype == np.int32 else None


def _write(path: Path, charts: ObjectCharts) -> None:
    try:
        with whole_file(path) as scratch, scratch.open("wb") as file:
            np.savez(file, size=np.array([charts.width, charts.height]), uv=charts.uv, chart=charts.chart)
    except (InputError, OSError):
        return  # the cache only saves time
