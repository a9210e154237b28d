"""Affine maps of points in space, in ordered float64 multiplies and adds, so that every machine gets the same bits."""

import numpy as np

from lightloom.golden_model.numerics.floats import quiet


@quiet
def transformed(points: np.ndarray, matrix: np.ndarray, shift: np.ndarray) -> np.ndarray:
    """(..., 3) float64 points by a 3x3 matrix and a translation."""
    x, y, z = points[..., 0], points[..., 1], points[..., 2]
    return np.stack(
        [((row[0] * x + row[1] * y) + row[2] * z) + s for row, s in zip(matrix, shift, strict=True)], axis=-1
    )


def product(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """The matrix (3, 3) of first `second`, then `first`."""
    return transformed(second.T, first, np.zeros(3)).T


@quiet
def determinant(m: np.ndarray) -> float:
    """Of a 3x3 matrix; of one that is too large perhaps NaN, but its vertices will be refused."""
    return float(
        m[0, 0] * (m[1, 1] * m[2, 2] - m[1, 2] * m[2, 1])
        - m[0, 1] * (m[1, 0] * m[2, 2] - m[1, 2] * m[2, 0])
        + m[0, 2] * (m[1, 0] * m[2, 1] - m[1, 1] * m[2, 0])
    )


@quiet
def cofactors(m: np.ndarray) -> np.ndarray:
    """Of a 3x3 matrix: they take normals where it takes points, up to the length and the sign of its determinant."""
    rolled = [np.roll(np.roll(m, -i, axis=0), -j, axis=1) for i in (1, 2) for j in (1, 2)]
    return rolled[0] * rolled[3] - rolled[1] * rolled[2]


def rotation_matrix(w: float, x: float, y: float, z: float) -> np.ndarray:
    """(3, 3) float64 of a quaternion of any length but 0."""
    square = w * w + x * x + y * y + z * z
    rotation = np.array(
        [
            [w * w + x * x - y * y - z * z, 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), w * w - x * x + y * y - z * z, 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z],
        ]
    )
    return rotation / square
