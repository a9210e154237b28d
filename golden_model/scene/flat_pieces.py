"""Flat geometry: objects of few flat pieces, as rooms and boxes are, told from curved meshes, and their pieces."""

import numpy as np

from lightloom.golden_model.scene.mesh import area_vectors, dot

FLAT_COSINE = 0.9995
"""Triangles within 1.8 degrees of the first one of a piece belong to it: walls of measured rooms are not quite flat."""

PLANAR_TRIANGLES = 512
"""Objects with more triangles are taken for curved meshes without looking for flat pieces."""

PLANAR_PIECES = 16
"""An object is flat geometry if it has at most this many flat pieces, or two triangles a piece on average."""


def flat_pieces(corners: np.ndarray) -> np.ndarray | None:
    """The flat piece of each triangle (F, 3, 3) of an object, (F,) int32 as `planar_pieces`; None if it is curved."""
    if len(corners) > PLANAR_TRIANGLES:
        return None
    piece = planar_pieces(corners)
    return piece if int(piece.max()) < max(PLANAR_PIECES, len(corners) // 2) else None


def planar_pieces(corners: np.ndarray) -> np.ndarray:
    """(F, 3, 3) corners to the piece of each triangle, (F,) int32, numbered in the order of their first triangles."""
    faces = len(corners)
    area = area_vectors(corners)
    unit = area / np.sqrt(dot(area, area))[:, None]
    neighbours = _neighbours(points_of(corners))
    piece = np.full(faces, -1, dtype=np.int32)
    count = 0
    for seed in range(faces):
        if piece[seed] >= 0:
            continue
        piece[seed] = count
        pending = [seed]
        while pending:
            for other in neighbours.get(pending.pop(), ()):
                if piece[other] < 0 and dot(unit[other], unit[seed]) >= FLAT_COSINE:
                    piece[other] = count
                    pending.append(other)
        count += 1
    return piece


def points_of(corners: np.ndarray) -> np.ndarray:
    """Number of the point at each corner of (F, 3, 3), (F, 3): equal positions are one point."""
    _, point = np.unique(corners.reshape(-1, 3) + np.float32(0), axis=0, return_inverse=True)
    return point.reshape(-1, 3)


def _neighbours(point: np.ndarray) -> dict[int, list[int]]:
    """Triangles that share an edge with each triangle."""
    at_edge: dict[tuple[int, int], list[int]] = {}
    for face, (a, b, c) in enumerate(point.tolist()):
        for edge in ((a, b), (b, c), (c, a)):
            at_edge.setdefault((min(edge), max(edge)), []).append(face)
    out: dict[int, list[int]] = {}
    for members in at_edge.values():
        for face in members:
            out.setdefault(face, []).extend(other for other in members if other != face)
    return out
