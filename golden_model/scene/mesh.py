"""What is done to every mesh: what of a part of a scene can be used, and normals for shading."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from lightloom.golden_model.host.errors import InputError, warn
from lightloom.golden_model.numerics.affine import cofactors, transformed
from lightloom.golden_model.numerics.equal_points import numbered
from lightloom.golden_model.scene.parts import Part

CREASE_COSINE = 0.7
"""Faces that meet at more than about 45 degrees keep an edge between them; flatter meetings are shaded smoothly."""

MANY = 64
"""Faces at one point beyond which they are compared by groups."""

GROUPS = 16
"""Groups of directions in a unit: their faces are within 0.11 of each other."""


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """a x b of (..., 3) float64, in plain multiplies and subtracts."""
    ax, ay, az = a[..., 0], a[..., 1], a[..., 2]
    bx, by, bz = b[..., 0], b[..., 1], b[..., 2]
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], axis=-1)


def dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(..., 3) and (..., 3) to (...), float64."""
    return a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1] + a[..., 2] * b[..., 2]


def area_vectors(corners: np.ndarray) -> np.ndarray:
    """(F, 3, 3) corners to (F, 3) float64 normals whose length is twice the triangle's area."""
    wide = corners.astype(np.float64)
    return cross(wide[:, 1] - wide[:, 0], wide[:, 2] - wide[:, 0])


def unit_normals(directions: np.ndarray) -> np.ndarray | None:
    """Directions (..., 3) float64 made float32 of unit length; None where one has none."""
    with np.errstate(all="ignore"):
        unit = directions / np.sqrt(dot(directions, directions))[..., None]
    return unit.astype(np.float32) if np.isfinite(unit).all() else None


def turned_normals(normals: np.ndarray, matrix: np.ndarray, mirrored: bool) -> np.ndarray | None:
    """Unit normals (..., 3) float32 after a map of the points by a matrix (3, 3); None where one has no direction."""
    return unit_normals(transformed(normals, cofactors(matrix) * (-1 if mirrored else 1), np.zeros(3)))


def _add_near(
    total: np.ndarray,
    corner: np.ndarray,
    first: np.ndarray,
    count: np.ndarray,
    order: np.ndarray,
    direction: np.ndarray,
    weighted: np.ndarray,
) -> None:
    """Adds to each of some corners (N,) what of `weighted` is near it, of the `count` corners from `first` in `order`.

    Round k adds, to every corner, the k-th of its corners: ordered sums, whatever the number of neighbours.
    """
    for k in range(int(count.max(initial=0))):
        more = count > k
        here, other = corner[more], order[first[more] + k]
        near = dot(direction[here], direction[other]) >= CREASE_COSINE
        total[here[near]] += weighted[other[near]]


def _add_near_of_many(total: np.ndarray, corners: np.ndarray, direction: np.ndarray, weighted: np.ndarray) -> None:
    """The same for all corners (N,) at one point, with fewer than N * N comparisons: the same sums in the same order.

    Faces of about one direction make a group, as those of a polygon of thousands of corners do, and its walls another.
    Where for every two groups it is sure whether their faces are near each other, all of a group have one sum.
    """
    here = direction[corners]
    _, first, group = np.unique(np.rint(here * GROUPS), axis=0, return_index=True, return_inverse=True)
    group = group.reshape(-1)
    middle = here[first]
    off = here - middle[group]
    radius = np.zeros(len(first))
    np.maximum.at(radius, group, np.sqrt(dot(off, off)))
    # The cosine of two faces differs from that of their groups' middles by the radii of both at most, and by rounding.
    cosine, slack = dot(middle[:, None], middle), radius[:, None] + radius + 2.0**-40
    surely = cosine - slack >= CREASE_COSINE
    doubtful: np.ndarray = np.any(~surely & ~(cosine + slack < CREASE_COSINE), axis=1)
    for k in np.flatnonzero(~doubtful):
        near = weighted[corners[surely[k][group]]]
        total[corners[group == k]] = np.cumsum(np.concatenate([np.zeros((1, 3)), near]), axis=0)[-1]
    # All others, as around the tip of a cone, one by one.
    rest = corners[doubtful[group]]
    everything = np.full(len(rest), len(corners))
    _add_near(total, rest, np.zeros_like(everything), everything, corners, direction, weighted)


def shading_normals(corners: np.ndarray) -> np.ndarray:
    """(F, 3, 3) corners to unit normals at the corners, (F, 3, 3) float32.

    The normal at a corner is the mean over the faces that touch the same point and are less steep than CREASE_COSINE
    against its own face, so a box stays sharp and a scanned mesh becomes smooth. Faces are weighted as in Max, Weights
    for Computing Vertex Normals from Facet Normals, 1999 (exact where the points lie on a sphere, and no arc cosine).
    """
    wide = corners.astype(np.float64)
    area = area_vectors(corners)
    unit = area / np.sqrt(dot(area, area))[:, None]
    following, preceding = np.roll(wide, -1, axis=1) - wide, np.roll(wide, 1, axis=1) - wide
    weight = 1.0 / (dot(following, following) * dot(preceding, preceding))
    weighted = (area[:, None, :] * weight[..., None]).reshape(-1, 3)

    point, order = numbered(corners.reshape(-1, 3))
    count = np.bincount(point)
    start = np.cumsum(count) - count
    direction = np.repeat(unit, 3, axis=0)
    total = np.zeros((len(point), 3))
    few = np.flatnonzero(count[point] <= MANY)
    _add_near(total, few, start[point[few]], count[point[few]], order, direction, weighted)
    for one in np.flatnonzero(count > MANY):
        _add_near_of_many(total, order[start[one] : start[one] + count[one]], direction, weighted)
    # Only the direction counts; the largest component becomes 1 first, so that no square leaves the range.
    total /= np.abs(total).max(axis=1)[:, None]
    return (total / np.sqrt(dot(total, total))[:, None]).reshape(corners.shape).astype(np.float32)


def closed(corners: np.ndarray) -> bool:
    """Whether triangles (F, 3, 3) enclose something: nobody sees their backs from outside.

    Along each edge as many go one way as the other.
    """
    point, _ = numbered(corners.reshape(-1, 3))
    begin = point.reshape(-1, 3).astype(np.int64)
    end, count = np.roll(begin, -1, axis=1), int(point.max()) + 1
    return bool((np.sort((begin * count + end).reshape(-1)) == np.sort((end * count + begin).reshape(-1))).all())


def without_area(corners: np.ndarray) -> np.ndarray:
    """Which triangles (F, 3, 3) have their points on a line as far as float32 coordinates can tell, (F,) bool."""
    area = area_vectors(corners)
    edges = corners.astype(np.float64) - np.roll(corners, 1, axis=1).astype(np.float64)
    return np.sqrt(dot(area, area)) <= dot(edges, edges).max(axis=1) * 2.0**-40


def with_area(part: Part) -> Part:
    """The part without its triangles without area, of which real meshes have some."""
    keep = ~without_area(part.corners)
    if keep.all():
        return part
    return replace(
        part,
        corners=part.corners[keep],
        material=part.material[keep],
        normals=None if part.normals is None else part.normals[keep],
        texture_uv=None if part.texture_uv is None else part.texture_uv[keep],
    )


def usable_parts(parts: Sequence[Part], where: str) -> list[Part]:
    """Parts without their triangles without area, and without those that then have none; what is left out is said.

    Raises InputError for vertices and materials that cannot be used, and where nothing is left; `where` begins it.
    """
    forms = [(part.name, form) for part in parts for form in (part, part.coarse) if form is not None]
    for name, form in forms:
        check_part(form, f"{where}: {name}" if len(parts) > 1 else where)
    flat = [(name, without_area(form.corners)) for name, form in forms]
    total = sum(int(mask.sum()) for _, mask in flat)
    left = [replace(with_area(part), coarse=_coarse_with_area(part)) for part in parts]
    if total:
        name, first = next((name, _first(mask)) for name, mask in flat if mask.any())
        said = f"{where}: {total} triangle{'s' if total > 1 else ''} without area (first: triangle {first} of {name})"
        gone = ", ".join(part.name for part in left if not len(part.corners))
        if not any(len(part.corners) for part in left):
            raise InputError(f"{said} and no other; a scene needs at least one")
        warn(f"{said} left out{gone and f', with which nothing is left of {gone}'}")
    return [part for part in left if len(part.corners)]


def _coarse_with_area(part: Part) -> Part | None:
    coarse = None if part.coarse is None else with_area(part.coarse)
    return coarse if coarse is not None and len(coarse.corners) else None


def check_part(part: Part, where: str) -> None:
    """Raises InputError for vertices and materials that cannot be used; `where` begins the message."""
    finite = np.isfinite(part.corners).all(axis=(1, 2))
    if not finite.all():
        raise InputError(
            f"{where}: {_count(~finite)} with a vertex that is NaN or infinite "
            f"(first: triangle {_first(~finite)}); correct or remove the vertices"
        )
    if not (np.isfinite(part.albedo).all() and (part.albedo >= 0).all() and (part.albedo <= 1).all()):
        raise InputError(f"{where}: an albedo lies outside 0 to 1")
    if not (np.isfinite(part.emission).all() and (part.emission >= 0).all()):
        raise InputError(f"{where}: an emission is negative or not finite")


def _count(mask: np.ndarray) -> str:
    number = int(mask.sum())
    return f"{number} triangle{'s' if number > 1 else ''}"


def _first(mask: np.ndarray) -> int:
    return int(np.argmax(mask))
