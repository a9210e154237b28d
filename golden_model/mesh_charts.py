"""Lightmap charts of curved meshes, by xatlas, which engines use; kept on disk, because a scanned mesh takes a while.

The charts are part of the scene's data, not of the numeric contract: xatlas is pinned, and gives the same charts for
any number of threads, but its float arithmetic is the host's.
"""

import ctypes
import hashlib
import importlib.metadata
import os
import zipfile
from pathlib import Path

import numpy as np

from golden_model.errors import InputError
from golden_model.outputs import whole_file
from golden_model.planar_charts import GAP, ObjectCharts

VERSION = 1
"""Part of the key on disk; rises when this file makes other charts of the same mesh."""


def default_cache() -> Path:
    """Where charts are kept: $LIGHTLOOM_CACHE, or `lightloom` in $XDG_CACHE_HOME, or ~/.cache/lightloom."""
    own = os.environ.get("LIGHTLOOM_CACHE")
    return Path(own) if own else Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "lightloom"


def mesh_charts(corners: np.ndarray, texel_size: float, cache: Path | None = None) -> ObjectCharts:
    """(F, 3, 3) float32 corners to charts with texels of about `texel_size`.

    With `cache` (a folder) charts are looked up by a hash of everything they depend on, and kept there. A damaged entry
    is made again; a folder that cannot be written is no error.
    """
    points, index = np.unique(corners.reshape(-1, 3) + np.float32(0), axis=0, return_inverse=True)
    faces = np.ascontiguousarray(index.reshape(-1, 3).astype(np.uint32))
    settings = repr((VERSION, GAP, importlib.metadata.version("xatlas"), texel_size, faces.shape, points.shape))
    key = hashlib.sha256(settings.encode() + points.tobytes() + faces.tobytes()).hexdigest()
    kept = cache / "charts" / f"{key}.npz" if cache is not None else None
    if kept is not None:
        found = _read(kept, len(faces))
        if found is not None:
            return found
    made = _unwrap(points, faces, texel_size)
    if kept is not None:
        _write(kept, made)
    return made


def _unwrap(points: np.ndarray, faces: np.ndarray, texel_size: float) -> ObjectCharts:
    import xatlas  # only scenes with curved meshes need it

    # xatlas drops triangles by absolute thresholds of size, so it sees the mesh measured in texels.
    atlas = xatlas.Atlas()
    # Never destroyed, not even at the interpreter's end: its destructor wakes its worker threads without holding their
    # lock, so that on a busy machine one can miss it, and the destructor then waits for that thread for ever.
    ctypes.pythonapi.Py_IncRef(ctypes.py_object(atlas))
    atlas.add_mesh((points.astype(np.float64) / texel_size).astype(np.float32), faces)
    packing = xatlas.PackOptions()
    packing.texels_per_unit = 1.0
    packing.padding = GAP
    packing.bilinear = True
    atlas.generate(xatlas.ChartOptions(), packing)
    _, new_faces, uv = atlas.get_mesh(0)
    size = np.array([atlas.width, atlas.height], dtype=np.float32)
    chart = np.full(len(faces), -1, dtype=np.int32)
    for k in range(atlas.get_mesh_chart_count(0)):
        chart[atlas.get_mesh_chart(0, k).faces] = k
    return _with_strays(points, faces, np.asarray(uv)[new_faces] * size, chart, atlas.width, atlas.height)


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
