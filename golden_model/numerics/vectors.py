"""Vectors of three float32 (last axis 3): every operation rounds once and is flushed.

Under the numeric contract for operands that are flushed already, up to the payload of a NaN (`floats.flush`). What
takes operands as they come, as the model of a unit does, calls `floats.float_add` and its like.
"""

from collections.abc import Sequence

import numpy as np

from lightloom.golden_model.numerics.floats import difference_of_products, flush, quiet


def vector(values: Sequence[float] | np.ndarray) -> np.ndarray:
    """(3,) float32."""
    return np.array(values, dtype=np.float32)


@quiet
def dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(..., 3) and (..., 3) to (...): (x + y) + z of the products."""
    products = flush(a * b)
    return flush(flush(products[..., 0] + products[..., 1]) + products[..., 2])


@quiet
def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """a x b; each component is a difference of products, rounded once."""
    components = [
        difference_of_products(a[..., i], b[..., j], a[..., j], b[..., i]) for i, j in ((1, 2), (2, 0), (0, 1))
    ]
    return np.stack(components, axis=-1)


@quiet
def scale(a: np.ndarray, factor: np.ndarray | np.float32) -> np.ndarray:
    """a * factor, with one factor (...) a vector."""
    return flush(a * np.asarray(factor, dtype=np.float32)[..., None])


@quiet
def add(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """a + b."""
    return flush(a + b)


@quiet
def subtract(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """a - b."""
    return flush(a - b)


@quiet
def multiply(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """a * b, component by component."""
    return flush(a * b)


@quiet
def normalize(a: np.ndarray) -> np.ndarray:
    """a / |a|, each component divided by the root; for lengths between 1e-18 and 1e18, a zero vector gives NaN."""
    return flush(a / np.sqrt(dot(a, a))[..., None])


@quiet
def interpolate(c0: np.ndarray, c1: np.ndarray, c2: np.ndarray, u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Values at three corners (N, K) and barycentrics (N,) to (N, K): ((1-u-v) c0 + u c1) + v c2."""
    first = flush(flush(np.float32(1) - u) - v)
    return flush(flush(flush(c0 * first[..., None]) + flush(c1 * u[..., None])) + flush(c2 * v[..., None]))
