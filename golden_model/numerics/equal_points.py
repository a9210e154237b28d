"""Points that are the same point."""

import numpy as np


def numbered(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points (N, 3) to a number of each, equal for equal points, and their order by it: (N,) int64 each.

    Numbers go from 0 without gaps; points of one number keep their order. -0 equals 0.
    """
    order = np.lexsort(points.T)
    number = np.zeros(len(order), dtype=np.intp)
    number[order[1:]] = np.cumsum((points[order][1:] != points[order][:-1]).any(axis=1))
    return number, order
