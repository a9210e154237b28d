"""The surface where a ray has hit: the point, the normals there, and where rays go on from it."""

from dataclasses import dataclass

import numpy as np

from lightloom.golden_model.numerics.floats import float_minmax, flush, quiet
from lightloom.golden_model.numerics.structured import take
from lightloom.golden_model.numerics.vectors import add, cross, interpolate, normalize, scale, subtract
from lightloom.golden_model.tables.ray_offset import ray_start


@dataclass(frozen=True, kw_only=True)
class HitSurface:
    """Of N hits."""

    place: np.ndarray
    """The points, (N, 3) float32."""
    facing: np.ndarray
    """Interpolated unit normals, on the side that was hit, (N, 3) float32."""
    wall: np.ndarray
    """The triangles' own unit normals, on that side, (N, 3) float32."""
    span: np.ndarray
    """Of the triangles (`ray_offset`), (N,) float32."""

    @property
    def start(self) -> np.ndarray:
        """Where rays start that leave on the side that was hit, (N, 3) float32."""
        return ray_start(self.place, self.wall, self.span)

    @property
    def start_behind(self) -> np.ndarray:
        """Where rays start that pass through, (N, 3) float32."""
        return ray_start(self.place, -self.wall, self.span)


@quiet
def surface_at(shapes: np.ndarray, hits: np.ndarray) -> HitSurface:
    """The surface at HIT (N,), each of a triangle of SHAPE (T,)."""
    shape = take(shapes, hits["primitive"])
    corner, normal = shape["corner"], shape["normal"]
    edge1, edge2 = subtract(corner[:, 1], corner[:, 0]), subtract(corner[:, 2], corner[:, 0])
    wall = unit_normal(edge1, edge2)
    facing = normalize(interpolate(normal[:, 0], normal[:, 1], normal[:, 2], hits["u"], hits["v"]))
    facing = np.where(np.isfinite(facing), facing, wall)  # normals that cancel in the middle of a triangle
    side = np.where(hits["front"], np.float32(1), np.float32(-1))
    return HitSurface(
        # From the first vertex along the edges, so that its rounding goes with the triangle's size and only the last
        # sum's with the coordinates.
        place=add(corner[:, 0], add(scale(edge1, hits["u"]), scale(edge2, hits["v"]))),
        facing=scale(facing, side),
        wall=scale(wall, side),
        span=shape["span"],
    )


@quiet
def unit_normal(edge1: np.ndarray, edge2: np.ndarray) -> np.ndarray:
    """Unit normals (N, 3) float32 of triangles with these edges (N, 3) from their first corners."""
    area = cross(edge1, edge2)
    # Its largest component made 1 first: the square of a small triangle's area would be flushed.
    size = np.abs(area)
    largest = float_minmax(float_minmax(size[:, 0], size[:, 1], True), size[:, 2], True)
    return normalize(flush(area / largest[:, None]))
