"""Two resolutions of geometry ([0055]): reduced meshes, and how what is known about the fine ones is read on them.

Rays of mirrors and glass may be traced against the reduced triangles of `Scene.coarse`. What they hit has no lightmap
of its own: the irradiance there is interpolated between that of texels of the fine object, one for each corner of the
reduced triangle. Objects that have no reduced form keep their own triangles in `Scene.coarse`, and their lightmap.
"""

from dataclasses import replace

import numpy as np

from lightloom.golden_model.scene.mesh import area_vectors, dot, without_area
from lightloom.golden_model.scene.nearest import nearest
from lightloom.golden_model.scene.parts import Part
from lightloom.golden_model.scene.scene import Scene
from lightloom.golden_model.tables.lightmap import VALID, Lightmaps

FEWEST = 4
"""Triangles of a reduced mesh, at least: the fewest that enclose anything."""


def decimated(part: Part, ratio: float) -> Part | None:
    """A part of about `ratio` (0 to 1) times its triangles, None where that makes it no smaller.

    By quadric edge collapses (Garland and Heckbert 1997), in the library of that name; like charts, reduced meshes are
    part of the scene's data, not of the numeric contract. Each triangle takes its material, and its corners their
    texture coordinates, from the nearest triangle of the fine mesh.
    """
    import fast_simplification  # only scenes with reduced meshes need it

    wanted = max(round(len(part.corners) * ratio), FEWEST)
    if wanted >= len(part.corners):
        return None
    points, index = np.unique(part.corners.reshape(-1, 3) + np.float32(0), axis=0, return_inverse=True)
    faces = index.reshape(-1, 3).astype(np.int32)
    new_points, new_faces = fast_simplification.simplify(points.astype(np.float64), faces, target_count=wanted)
    corners = np.asarray(new_points)[np.asarray(new_faces)].astype(np.float32)
    corners = corners[~without_area(corners)]
    if not FEWEST <= len(corners) < len(part.corners):
        return None
    source = _nearest_triangles(part.corners, corners) if len(part.albedo) > 1 or part.texture_uv is not None else None
    return replace(
        part,
        corners=corners,
        normals=None,
        material=np.zeros(len(corners), dtype=np.int32) if source is None else part.material[source],
        texture_uv=None
        if part.texture_uv is None or source is None
        else _carried(part.corners[source], part.texture_uv[source], corners),
        coarse=None,
    )


def coarse_links(lightmaps: Lightmaps, scene: Scene) -> np.ndarray:
    """For each corner of each triangle of `scene.coarse` the texel that knows the irradiance there.

    (T, 3) int32; without reduced geometry T is that of the scene itself. The texel is a valid one of the same object,
    the nearest in space of those whose normal is within 60 degrees of the corner's, or of all if there is none;
    -1 for objects without valid texels. For a scene at rest and its lightmaps; links hold in all frames, because texels
    and corners of an object move together.
    """
    coarse = scene if scene.coarse is None else scene.coarse
    links = np.full((len(coarse.triangles), 3), -1, dtype=np.int32)
    for number in range(len(scene.object_names)):
        mine = coarse.object_id == number
        first = int(lightmaps.offset[number])
        end = first + int(lightmaps.width[number]) * int(lightmaps.height[number])
        valid = first + np.flatnonzero(lightmaps.texels["state"][first:end] == VALID)
        if not (mine.any() and len(valid)):
            continue
        found = nearest(
            lightmaps.texels["position"][valid],
            coarse.corners[mine].reshape(-1, 3),
            scene.texel_size,
            (lightmaps.texels["normal"][valid], coarse.normals[mine].reshape(-1, 3)),
        )
        links[mine] = valid[found].reshape(-1, 3)
    return links


def fine_triangles(scene: Scene) -> np.ndarray:
    """Which of the scene's triangles each triangle of `scene.coarse` is, (T,) int32; -1 where it is a reduced one.

    A hit on a triangle that is also a fine one is shaded from the lightmap itself, with the hit's own coordinates: the
    corners of a wall know nothing of its middle.
    """
    coarse = scene if scene.coarse is None else scene.coarse
    out = np.full(len(coarse.triangles), -1, dtype=np.int32)
    for number in range(len(scene.object_names)):
        fine, other = np.flatnonzero(scene.object_id == number), np.flatnonzero(coarse.object_id == number)
        # As bytes, because the vertices of absent objects are NaN.
        if scene.triangles[fine].tobytes() == coarse.triangles[other].tobytes():
            out[other] = fine
    return out


def _nearest_triangles(fine: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """For each triangle (C, 3, 3) the nearest of `fine` (F, 3, 3) by their centres, (C,) int64."""
    wide, centres = fine.astype(np.float64), corners.astype(np.float64)
    centre = (wide[:, 0] + wide[:, 1] + wide[:, 2]) / 3
    sides = area_vectors(fine)
    typical = float(np.median(np.sqrt(np.sqrt(dot(sides, sides)))))
    return nearest(centre, (centres[:, 0] + centres[:, 1] + centres[:, 2]) / 3, typical)


def _carried(fine: np.ndarray, uv: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Coordinates (N, 3, 2) of triangles `fine` (N, 3, 3), continued over their planes to `corners` (N, 3, 3)."""
    wide = fine.astype(np.float64)
    first, second = wide[:, None, 1] - wide[:, None, 0], wide[:, None, 2] - wide[:, None, 0]
    toward = corners.astype(np.float64) - wide[:, None, 0]
    aa, ab, bb = dot(first, first), dot(first, second), dot(second, second)
    at, bt = dot(first, toward), dot(second, toward)
    area = aa * bb - ab * ab
    u, v = (bb * at - ab * bt) / area, (aa * bt - ab * at) / area
    c0, c1, c2 = (uv[:, None, k].astype(np.float64) for k in range(3))
    return (c0 + (c1 - c0) * u[..., None] + (c2 - c0) * v[..., None]).astype(np.float32)
