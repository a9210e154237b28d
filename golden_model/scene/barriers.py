"""Where other geometry stands on a flat piece so thinly that a read between texels would reach what is behind it.

A piece is looked at in a slice, a little above it: every triangle that passes through the slice leaves a trace there, a
segment with a front. Behind the front is the inside of something solid, as a rule; where that is so wide that no read
spans it, texels inside are buried and show their nearest neighbour, and there is nothing to do. Where it is not, or
where there is only a sheet, the piece has to be cut.
"""

from dataclasses import dataclass

import numpy as np

from lightloom.golden_model.scene.mesh import cross, dot

SLICE = 1.0 / 16
"""Height of the slice above the piece, in texels: what comes closer than that keeps light out."""

STEEPEST = 0.9
"""Cosine of the normals of a piece and of a triangle above which the latter lies on it rather than standing on it."""

THIN = 2.5
"""Width of what is solid, in texels, up to which reads and fills on its two sides can meet."""

SHORTEST = 1.0
"""Length in texels below which something thin is too short to matter."""

FINE = 1.0 / 64
"""In texels, what lies closer together than this is at the same place."""


@dataclass(frozen=True)
class Plane:
    """A piece's plane, with coordinates of its own."""

    origin: np.ndarray  # (3,) float64, so with the others
    normal: np.ndarray
    u: np.ndarray
    v: np.ndarray

    def place(self, points: np.ndarray) -> np.ndarray:
        """Points (..., 3) to their coordinates within the plane, (..., 2) float64."""
        away = points - self.origin
        return np.stack([dot(away, self.u), dot(away, self.v)], axis=-1)


@dataclass(frozen=True)
class Traces:
    """S segments in a piece's plane."""

    begin: np.ndarray  # (S, 2) float64
    end: np.ndarray  # (S, 2)
    front: np.ndarray  # (S, 2): unit vectors across, to the side that can be seen

    def __len__(self) -> int:
        return len(self.begin)

    def take(self, which: np.ndarray) -> "Traces":
        """Some of them, by numbers or by a mask."""
        return Traces(self.begin[which], self.end[which], self.front[which])


@dataclass(frozen=True)
class Barriers:
    """What a piece has to be cut along."""

    lines: Traces
    apart: np.ndarray
    """Pairs of points in the plane, (P, 2, 2) float64, that no chart may have both."""


def across(points: np.ndarray, way: np.ndarray) -> np.ndarray:
    """(..., 2) by (2,): how far points lie along a way, (...)."""
    return np.asarray(points[..., 0] * way[0] + points[..., 1] * way[1])


def plane_of(corners: np.ndarray) -> Plane:
    """The plane of a piece's first triangle, from its triangles (F, 3, 3) float64."""
    first = corners[0, 1] - corners[0, 0]
    normal = cross(first, corners[0, 2] - corners[0, 0])
    normal = normal / np.sqrt(dot(normal, normal))
    u = first / np.sqrt(dot(first, first))
    return Plane(corners[0, 0], normal, u, cross(normal, u))


def traces(plane: Plane, corners: np.ndarray, texel_size: float) -> Traces:
    """What triangles (T, 3, 3) float64 leave in a piece's slice, as seen on the piece below it."""
    height = SLICE * texel_size
    area = cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    slope = dot(area, plane.normal[None])
    length = np.sqrt(dot(area, area))
    above = dot(corners - plane.origin, plane.normal[None, None]) - height
    passing = (above.min(axis=1) < 0) & (above.max(axis=1) > 0) & (np.abs(slope) <= STEEPEST * length)
    corners, area, above = corners[passing], area[passing], above[passing]
    following = np.roll(above, -1, axis=1)
    crossing = (above < 0) != (following < 0)
    step = above / np.where(crossing, above - following, 1.0)
    points = corners + step[..., None] * (np.roll(corners, -1, axis=1) - corners)
    first = crossing.argmax(axis=1)
    second = 2 - crossing[:, ::-1].argmax(axis=1)
    row = np.arange(len(corners))
    toward = np.stack([dot(area, plane.u[None]), dot(area, plane.v[None])], axis=-1)
    wide = np.sqrt(toward[:, 0] ** 2 + toward[:, 1] ** 2)[:, None]
    # Down its own plane from the slice to the piece.
    down = toward / wide * (slope[passing] * height)[:, None] / wide
    begin, end = (plane.place(points[row, k]) + down for k in (first, second))
    return joined(Traces(begin, end, toward / wide), FINE * texel_size)


def joined(found: Traces, fine: float) -> Traces:
    """Segments on one line that meet or overlap made one, as those of the two triangles of a quad."""
    along = np.stack([-found.front[:, 1], found.front[:, 0]], axis=1)
    left = np.ones(len(found), dtype=np.bool_)
    out: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []
    for k in range(len(found)):
        if not left[k]:
            continue
        a, b = across(found.begin, along[k]), across(found.end, along[k])
        level = float(across(found.begin[k], found.front[k]))
        beside = (across(found.front, found.front[k]) > 1 - 1e-6) & (
            np.abs(across(found.begin, found.front[k]) - level) < fine
        )
        low, high = np.minimum(a, b), np.maximum(a, b)
        first, last = low[k], high[k]
        left[k] = False
        while (met := left & beside & (low <= last + fine) & (high >= first - fine)).any():
            first, last = min(first, low[met].min()), max(last, high[met].max())
            left &= ~met
        ends = [along[k] * place + found.front[k] * level for place in (first, last)]
        out.append((ends[0], ends[1], found.front[k]))
    return Traces(*(np.array(part) for part in zip(*out, strict=True))) if out else found


def barriers(found: Traces, low: np.ndarray, high: np.ndarray, texel_size: float) -> Barriers:
    """Of the traces on a piece, which lies between `low` and `high` (2,), those along which it has to be cut."""
    needed = np.zeros(len(found), dtype=np.bool_)
    over, sides = [np.zeros((0, 2, 2))], []
    for k in range(len(found)):
        front = found.front[k]
        middle, step = _samples(found.begin[k], found.end[k], low, high, texel_size / 2)
        away = 2 * FINE * texel_size * front
        seen = ~_hidden(found, middle + away, front)
        behind, narrow, sheet = _behind(found, middle, front, texel_size)
        narrow &= seen
        if narrow.sum() * step < SHORTEST * texel_size:
            narrow[:] = False  # too short to matter
        needed[k] = bool(narrow.any() or (seen & sheet).any())
        over.append(np.stack([middle + away, behind], axis=1)[narrow])
        sides.append(np.stack([middle + away, middle - away], axis=1)[seen])
    needed |= _ends_of(found, needed, THIN * texel_size)
    own = [sides[k] for k in np.flatnonzero(needed)]
    # The longest first: the ends of a wall then divide no more than what is under it.
    order = np.argsort(-_length(found), kind="stable")
    return Barriers(found.take(order[needed[order]]), np.concatenate(over + own))


def _samples(
    begin: np.ndarray, end: np.ndarray, low: np.ndarray, high: np.ndarray, most: float
) -> tuple[np.ndarray, float]:
    """Points (M, 2) along as much of a segment as lies between `low` and `high`, and their distance, at most `most`."""
    first, last = 0.0, 1.0
    for a, b, least, largest in zip(begin, end, low, high, strict=True):
        if a == b:
            last = last if least <= a <= largest else 0.0
            continue
        enters, leaves = sorted((float((least - a) / (b - a)), float((largest - a) / (b - a))))
        first, last = max(first, enters), min(last, leaves)
    if last <= first:
        return np.zeros((0, 2)), 0.0
    away = end - begin
    length = (last - first) * float(np.sqrt(away[0] ** 2 + away[1] ** 2))
    count = max(int(np.ceil(length / most)), 3)
    place = first + (last - first) * (np.arange(count) + 0.5) / count
    return begin + place[:, None] * away, length / count


def _behind(
    found: Traces, middle: np.ndarray, front: np.ndarray, texel_size: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """What is behind points (M, 2) of a trace.

    Where something solid ends, (M, 2), whether that is near and what is behind it can be seen, (M,) bool, and whether
    there is nothing solid but open space, (M,) bool.
    """
    fine = 2 * FINE * texel_size
    inside = middle - fine * front
    solid = _hidden(found, inside, -front)
    width, _ = _first_face(found, inside, -front, backs=True)
    narrow = solid & (width <= THIN * texel_size)
    behind = inside - (np.where(narrow, width, 0) + fine)[:, None] * front
    narrow[narrow] = ~_hidden(found, behind[narrow], -front)
    return behind, narrow, ~solid & _in_the_open(found, inside, -front)


def _length(found: Traces) -> np.ndarray:
    away = found.end - found.begin
    return np.asarray(np.sqrt(away[:, 0] ** 2 + away[:, 1] ** 2))


def _ends_of(found: Traces, needed: np.ndarray, thin: float) -> np.ndarray:
    """Short traces that close what is thin at its ends: both ends lie at those of needed ones, (S,) bool."""
    ends = np.concatenate([found.begin[needed], found.end[needed]])

    def touches(point: np.ndarray) -> np.ndarray:
        away = point[:, None] - ends[None]
        return np.asarray((np.abs(away).max(axis=2) < thin / 64).any(axis=1))

    if not len(ends):
        return np.zeros(len(found), dtype=np.bool_)
    return np.asarray(touches(found.begin) & touches(found.end) & (_length(found) <= thin))


def _hidden(found: Traces, points: np.ndarray, toward: np.ndarray) -> np.ndarray:
    """Whether points (M, 2) lie inside something: of five ways, all round `toward` (2,), three meet a back first."""
    return np.asarray(sum(back.astype(np.int64) for _, back in _faces(found, points, toward)) >= 3)


def _in_the_open(found: Traces, points: np.ndarray, toward: np.ndarray) -> np.ndarray:
    """Whether points (M, 2) are where something is to be seen: of the five ways three meet a front first."""
    faces = _faces(found, points, toward)
    return np.asarray(sum((np.isfinite(far) & ~back).astype(np.int64) for far, back in faces) >= 3)


def _faces(found: Traces, points: np.ndarray, toward: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """The first traces five ways from points (M, 2), all round `toward` (2,), as `_first_face` says."""
    side = np.array([-toward[1], toward[0]])
    ways = (toward, side, -side, toward + side, toward - side)
    return [_first_face(found, points, way) for way in ways]


def _first_face(
    found: Traces, points: np.ndarray, way: np.ndarray, *, backs: bool = False
) -> tuple[np.ndarray, np.ndarray]:
    """How far from points (M, 2) the first trace lies along `way` (2,), inf where none does; and if it shows its back.

    With `backs` only those that do are met.
    """
    facing = across(found.front, way)
    met = facing > 1e-9 if backs else np.abs(facing) > 1e-9
    begin, end, facing = found.begin[met], found.end[met], facing[met]
    if not len(begin):
        return np.full(len(points), np.inf), np.zeros(len(points), dtype=np.bool_)
    edge = end - begin
    slant = way[0] * edge[:, 1] - way[1] * edge[:, 0]
    toward = begin[None] - points[:, None]
    distance = (toward[..., 0] * edge[:, 1] - toward[..., 1] * edge[:, 0]) / slant
    place = (toward[..., 0] * way[1] - toward[..., 1] * way[0]) / slant
    distance = np.where((place >= 0) & (place <= 1) & (distance >= 0), distance, np.inf)
    nearest = distance.min(axis=1)
    # Where one solid ends and another one begins, both are met at once; who is in the first sees its back.
    at_once = distance <= nearest[:, None] * (1 + 1e-6)
    return nearest, np.isfinite(nearest) & (at_once & (facing > 0)).any(axis=1)
