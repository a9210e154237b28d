"""Cuts flat geometry along what stands on it thinly, so that no chart has texels on both sides ([0034]).

A shelf that meets a wall, a thin wall on a floor, a table that a block stands through: a read between texels beside it
would mix in what is on the other side, where other light falls. So such a piece is divided along the lines of what
stands on it, through as much of it as each line crosses, and put together again wherever that brings no two sides of
anything into one section. Each section becomes a chart with texels of its own on both sides of the line.

Triangles are part of the scene's data, not of the numeric contract: all of this is float64 of the host, once a scene,
of what never moves. New corners are put into the edges of all that meets there, so that no gap opens.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from lightloom.golden_model.contract.engine_image import DIFFUSE, GLASS
from lightloom.golden_model.scene.barriers import SLICE, barriers, plane_of, traces
from lightloom.golden_model.scene.cut_polygons import SAME, Corners, Piece, Polygon, divide, meet, triangulated
from lightloom.golden_model.scene.flat_pieces import flat_pieces
from lightloom.golden_model.scene.mesh import dot, shading_normals
from lightloom.golden_model.scene.parts import Part


def cut_parts(parts: Sequence[Part], texel_size: float) -> list[Part]:
    """The parts of a scene, those of flat geometry cut where that is needed; what is cut has a `section`.

    Of what never moves, by what never moves; emitters stay whole, and so does what has a reduced form.
    """
    flat = [flat_pieces(part.corners) if part.path is None or part.path.stays else None for part in parts]
    standing = [(k, piece) for k, piece in enumerate(flat) if piece is not None and parts[k].surface != GLASS]
    if not standing:
        return list(parts)
    others = np.concatenate([parts[k].corners for k, _ in standing]).astype(np.float64)
    corners = Corners(texel_size)
    pieces = [
        piece
        for k, number in standing
        if parts[k].surface == DIFFUSE and parts[k].coarse is None and not parts[k].emission.any()
        for piece in _pieces(k, parts[k].corners, number, others, corners)
    ]
    for piece in pieces:
        divide(piece, corners)
    if not corners.new:
        return list(parts)
    meet(pieces, corners)
    out = list(parts)
    for k in sorted({piece.part for piece in pieces}):
        out[k] = _rebuilt(parts[k], [piece for piece in pieces if piece.part == k], corners)
    return out


def _pieces(part: int, triangles: np.ndarray, number: np.ndarray, others: np.ndarray, corners: Corners) -> list[Piece]:
    """The flat pieces of a part, whole, with what they are to be cut along; `others` (T, 3, 3) may stand on them."""
    texel_size, out = corners.texel_size, []
    low, high = others.min(axis=1), others.max(axis=1)
    for k in range(int(number.max()) + 1):
        faces = np.flatnonzero(number == k)
        mine = triangles[faces].astype(np.float64)
        reach = 2 * SLICE * texel_size
        near = (low <= mine.max(axis=(0, 1)) + reach).all(axis=1) & (high >= mine.min(axis=(0, 1)) - reach).all(axis=1)
        plane = plane_of(mine)
        place = plane.place(mine)
        found = barriers(
            traces(plane, others[near], texel_size), place.min(axis=(0, 1)), place.max(axis=(0, 1)), texel_size
        )
        polygons = [Polygon(int(face), [corners.number(point) for point in triangles[face]]) for face in faces]
        out.append(Piece(part, plane, found, polygons))
    return out


def sections(piece: Piece, corners: Corners) -> list[int]:
    """The section of each polygon of a piece, from 0.

    Polygons that share an edge become one, those of a cell first and then at the longest edges, where that brings no
    two points together that have to be apart.
    """
    loops = [polygon.loop for polygon in piece.polygons]
    shared: dict[tuple[int, int], list[int]] = {}
    for number, loop in enumerate(loops):
        for a, b in zip(loop, loop[1:] + loop[:1], strict=True):
            shared.setdefault((min(a, b), max(a, b)), []).append(number)
    edges = []
    for (a, b), both in shared.items():
        if len(both) == 2:
            away = corners.place[b] - corners.place[a]
            cells = {piece.polygons[number].cell for number in both}
            edges.append((len(cells) > 1, -float(dot(away, away)), both[0], both[1]))
    owner = list(range(len(loops)))
    apart = _apart(piece, corners)
    for _, _, one, two in sorted(edges):
        a, b = sorted((owner[one], owner[two]))
        if a != b and b not in apart[a]:
            owner = [a if number == b else number for number in owner]
            apart[a] |= apart[b]
            for foe in apart[b]:
                apart[foe] = (apart[foe] - {b}) | {a}
    first = {number: k for k, number in enumerate(sorted(set(owner)))}
    return [first[number] for number in owner]


def _apart(piece: Piece, corners: Corners) -> list[set[int]]:
    """For each polygon those that must not be in its section."""
    pairs = piece.barriers.apart
    found = np.full(pairs.shape[:2], -1, dtype=np.int64)
    for number, polygon in enumerate(piece.polygons):
        place = piece.plane.place(corners.places(polygon.loop))
        edge = np.roll(place, -1, axis=0) - place
        toward = pairs[..., None, :] - place
        inside = (edge[:, 0] * toward[..., 1] - edge[:, 1] * toward[..., 0] >= 0).all(axis=2)
        found[inside & (found < 0)] = number
    out: list[set[int]] = [set() for _ in piece.polygons]
    for one, two in zip(found[:, 0].tolist(), found[:, 1].tolist(), strict=True):
        if one >= 0 and two >= 0 and one != two:
            out[one].add(two)
            out[two].add(one)
    return out


def _rebuilt(part: Part, pieces: list[Piece], corners: Corners) -> Part:
    """A part of the polygons of its pieces; the same one where nothing of it was cut."""
    loops = [polygon.loop for piece in pieces for polygon in piece.polygons]
    if len(loops) == len(part.corners) and all(len(loop) == 3 for loop in loops):
        return part
    rows: list[tuple[int, int, list[int]]] = []  # (triangle, section, corners)
    before = 0
    for piece in pieces:
        number = sections(piece, corners)
        for polygon, section in zip(piece.polygons, number, strict=True):
            place = piece.plane.place(corners.places(polygon.loop))
            ears = triangulated(place, SAME * corners.texel_size)
            rows += [(polygon.face, before + section, [polygon.loop[k] for k in ear]) for ear in ears]
        before += max(number) + 1
    rows.sort(key=lambda row: row[0])
    face = np.array([row[0] for row in rows])
    made = np.array([corners.places(row[2]) for row in rows]).astype(np.float32)
    weight = _weights(part.corners[face].astype(np.float64), made.astype(np.float64))
    normals = _carried(weight, (shading_normals(part.corners) if part.normals is None else part.normals)[face])
    return replace(
        part,
        corners=made,
        material=part.material[face],
        normals=(normals / np.sqrt(dot(normals, normals))[..., None]).astype(np.float32),
        texture_uv=None if part.texture_uv is None else _carried(weight, part.texture_uv[face]).astype(np.float32),
        section=np.array([row[1] for row in rows], dtype=np.int32),
    )


def _weights(triangle: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Barycentric weights (N, 3, 3) of points (N, 3, 3), three of each triangle (N, 3, 3)."""
    first, second = triangle[:, None, 1] - triangle[:, None, 0], triangle[:, None, 2] - triangle[:, None, 0]
    toward = points - triangle[:, None, 0]
    aa, ab, bb = dot(first, first), dot(first, second), dot(second, second)
    at, bt = dot(first, toward), dot(second, toward)
    area = aa * bb - ab * ab
    u, v = (bb * at - ab * bt) / area, (aa * bt - ab * at) / area
    return np.stack([1 - u - v, u, v], axis=-1)


def _carried(weight: np.ndarray, values: np.ndarray) -> np.ndarray:
    """What corners (N, 3, K) of triangles have at points inside by their weights (N, 3, 3): (N, 3, K)."""
    wide = values.astype(np.float64)
    return (weight[..., None] * wide[:, None]).sum(axis=2)
