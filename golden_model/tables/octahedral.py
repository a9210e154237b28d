"""Directions on a square: the octahedral map (Praun and Hoppe 2003), which takes no angle.

The direction is scaled to |x| + |y| + |z| = 1, which puts it on an octahedron; the upper half, +y, is seen from above,
the lower one is folded out over its four edges. So a place (x, z) of the square from -1 to 1 is a direction, and the
solid angle of a piece of the square around the point p of the octahedron is its area over |p|**3.
"""

import numpy as np

from lightloom.golden_model.numerics.floats import flush, quiet


def _over_the_edges(x: np.ndarray, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Places of the lower half to those of the upper half above them, and back."""
    one = x.dtype.type(1)
    return np.copysign(flush(one - np.abs(z)), x), np.copysign(flush(one - np.abs(x)), z)


@quiet
def on_octahedron(direction: np.ndarray) -> np.ndarray:
    """Directions (..., 3) float32 of any length to the points of the octahedron there, (..., 3) float32."""
    size = np.abs(direction)
    return flush(direction / flush(flush(size[..., 0] + size[..., 1]) + size[..., 2])[..., None])


@quiet
def folded(point: np.ndarray) -> np.ndarray:
    """Points of the octahedron (..., 3) to places on the square, (..., 2), -1 to 1."""
    x, z = point[..., 0], point[..., 2]
    outer = _over_the_edges(x, z)
    lower = point[..., 1] < 0
    return np.stack([np.where(lower, outer[0], x), np.where(lower, outer[1], z)], axis=-1)


@quiet
def unfolded(place: np.ndarray) -> np.ndarray:
    """Places on the square (..., 2), -1 to 1, to points of the octahedron, (..., 3)."""
    x, z = place[..., 0], place[..., 1]
    height = flush(flush(x.dtype.type(1) - np.abs(x)) - np.abs(z))
    outer = _over_the_edges(x, z)
    lower = height < 0
    return np.stack([np.where(lower, outer[0], x), height, np.where(lower, outer[1], z)], axis=-1)
