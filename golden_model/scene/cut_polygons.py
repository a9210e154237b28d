"""Triangles of flat geometry as convex polygons, while they are cut by lines: no corner is made twice."""

from dataclasses import dataclass, field

import numpy as np

from lightloom.golden_model.scene.barriers import FINE, Barriers, Plane, across
from lightloom.golden_model.scene.mesh import dot

SAME = 1e-4
"""In texels, new corners closer than this to each other, or to an edge, are the same, or on it."""


@dataclass
class Polygon:
    """A convex part of one triangle."""

    face: int
    """Number of the triangle in its part."""
    loop: list[int]
    """Numbers of its corners, counter-clockwise."""
    cell: int = 0
    """One number for what lies on the same side of every cut of the piece."""


@dataclass
class Piece:
    """A flat piece of a part while it is cut."""

    part: int
    plane: Plane
    barriers: Barriers
    polygons: list[Polygon]


@dataclass
class Corners:
    """All corners: those of the parts, then new ones."""

    texel_size: float
    place: list[np.ndarray] = field(default_factory=list)
    """(3,) float64 each, that float32 holds."""
    new: list[int] = field(default_factory=list)
    """Numbers of those that cuts have put into edges."""
    _known: dict[bytes, int] = field(default_factory=dict)

    def number(self, point: np.ndarray) -> int:
        """Of a corner (3,) float32: one for each place."""
        key = (point + np.float32(0)).tobytes()
        if key not in self._known:
            self._known[key] = len(self.place)
            self.place.append(point.astype(np.float64))
        return self._known[key]

    def between(self, a: int, b: int, step: float) -> int:
        """A new corner at `step` of the way from one to another, or one that is there already."""
        point = self.place[a] + step * (self.place[b] - self.place[a])
        if self.new:
            away = np.abs(self.places(self.new) - point).max(axis=1)
            if away.min() < SAME * self.texel_size:
                return self.new[int(away.argmin())]
        number = self.number(point.astype(np.float32))
        if number not in self.new:  # it may be there as a corner of another part
            self.new.append(number)
        return number

    def places(self, loop: list[int]) -> np.ndarray:
        """Of corners, (n, 3) float64."""
        return np.array([self.place[k] for k in loop])


def divide(piece: Piece, corners: Corners) -> None:
    """Cuts a piece along its barriers, each through those cells only that its trace passes through."""
    lines, fine = piece.barriers.lines, FINE * corners.texel_size
    for begin, end, front in zip(lines.begin, lines.end, lines.front, strict=True):
        along = np.array([-front[1], front[0]])
        low, high = sorted((float(across(begin, along)), float(across(end, along))))
        for cell in sorted({polygon.cell for polygon in piece.polygons}):
            passed, sides = 0.0, set()
            for polygon in (polygon for polygon in piece.polygons if polygon.cell == cell):
                place = piece.plane.place(corners.places(polygon.loop))
                level = _levels(place, begin, front, fine)
                sides |= set(np.sign(level).astype(int).tolist())
                on = _on_line(across(place, along), level)
                if len(on) > 1:
                    passed += max(min(high, max(on)) - max(low, min(on)), 0.0)
            if {-1, 1} <= sides and passed > 2 * fine:
                _divide_cell(piece, cell, begin, front, corners)


def _divide_cell(piece: Piece, cell: int, begin: np.ndarray, front: np.ndarray, corners: Corners) -> None:
    """Cuts the polygons of one cell; what lies behind the line becomes a cell of its own."""
    behind = max(polygon.cell for polygon in piece.polygons) + 1
    out: list[Polygon] = []
    for polygon in piece.polygons:
        if polygon.cell != cell:
            out.append(polygon)
            continue
        place = piece.plane.place(corners.places(polygon.loop))
        level = _levels(place, begin, front, FINE * corners.texel_size)
        for side in (1, -1):
            if (side * level > 0).any():
                loop = _kept(polygon.loop, side * level, corners)
                out.append(Polygon(polygon.face, loop, cell if side > 0 else behind))
    piece.polygons = out


def _levels(place: np.ndarray, begin: np.ndarray, front: np.ndarray, fine: float) -> np.ndarray:
    """How far points (n, 2) lie before a line, (n,); 0 for those on it."""
    level = across(place - begin, front)
    return np.where(np.abs(level) < fine, 0.0, level)


def _on_line(along: np.ndarray, level: np.ndarray) -> list[float]:
    """Where a polygon's rim meets a line, of coordinates along it and levels (n,)."""
    out = [float(a) for a, d in zip(along, level, strict=True) if d == 0]
    for k, (a, d) in enumerate(zip(along, level, strict=True)):
        b, e = along[k - 1], level[k - 1]
        if d * e < 0:
            out.append(float(a + d / (d - e) * (b - a)))
    return out


def _kept(loop: list[int], level: np.ndarray, corners: Corners) -> list[int]:
    """The part of a polygon where levels are 0 or more."""
    out: list[int] = []
    for k, number in enumerate(loop):
        after = (k + 1) % len(loop)
        if level[k] >= 0:
            out.append(number)
        if level[k] * level[after] < 0:
            # From the same end for both sides, and for the polygon beyond the edge.
            a, b = (k, after) if number < loop[after] else (after, k)
            out.append(corners.between(loop[a], loop[b], float(level[a] / (level[a] - level[b]))))
    return out


def meet(pieces: list[Piece], corners: Corners) -> None:
    """Puts new corners into the edges of all polygons that they lie on, so that no gap opens there."""
    new, tolerance = corners.places(corners.new), SAME * corners.texel_size
    for polygon in (polygon for piece in pieces for polygon in piece.polygons):
        begin = corners.places(polygon.loop)
        edge = np.roll(begin, -1, axis=0) - begin
        length = np.sqrt(dot(edge, edge))
        toward = new[:, None] - begin
        step = dot(toward, edge[None]) / length
        away = toward - step[..., None] * (edge / length[:, None])
        distance = np.sqrt(dot(away, away))
        distance[(step < tolerance) | (step > length - tolerance)] = np.inf
        # Near a sharp corner two edges may do; it comes into one.
        nearest = distance.argmin(axis=1)
        on = (distance.min(axis=1) < tolerance) & ~np.isin(corners.new, polygon.loop)
        loop: list[int] = []
        for k, number in enumerate(polygon.loop):
            here = np.flatnonzero(on & (nearest == k))
            loop += [number, *(corners.new[i] for i in here[np.argsort(step[here, k], kind="stable")])]
        polygon.loop = loop


def triangulated(place: np.ndarray, tolerance: float) -> list[tuple[int, int, int]]:
    """A convex polygon (n, 2), counter-clockwise, as n - 2 triangles; corners may lie within edges, by a tolerance."""
    left, out = list(range(len(place))), []
    while len(left) > 3:
        # The smallest ear first: what is left then keeps its widest corner until the end. One that is no wider than the
        # tolerance is a corner within an edge, which has to stay.
        ears = [(*_ear(place[[left[k - 1], left[k], left[(k + 1) % len(left)]]]), k) for k in range(len(left))]
        _, _, k = min((ear for ear in ears if ear[1] > tolerance), default=max(ears))
        out.append((left[k - 1], left[k], left[(k + 1) % len(left)]))
        del left[k]
    return [*out, (left[0], left[1], left[2])]


def _ear(place: np.ndarray) -> tuple[float, float]:
    """Twice the area of a triangle (3, 2), and how far its second corner lies from the line of the others."""
    first, base = place[1] - place[0], place[2] - place[0]
    area = float(first[0] * base[1] - first[1] * base[0])
    return area, area / float(np.sqrt(base[0] ** 2 + base[1] ** 2))
