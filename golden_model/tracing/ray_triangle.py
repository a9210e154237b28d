"""Watertight ray-triangle intersection (Woop, Benthin, Wald: Watertight Ray/Triangle Intersection, JCGT 2013).

The vertices are moved to the ray's origin, sheared so that the ray becomes the z axis, and the three edge functions are
evaluated in the plane. Each edge function is computed exactly and rounded once, so its sign is the exact one: the
double-precision fallback of the paper is not needed, and two triangles that share an edge never both miss a ray
between them.
"""

import numpy as np

from lightloom.golden_model.contract.formats import RAY_TRIANGLE, TRIANGLE_HIT
from lightloom.golden_model.numerics.floats import difference_of_products, flush, quiet
from lightloom.golden_model.tracing.ray_setup import NEXT_AXES

ONE = np.float32(1)

# A determinant (twice the projected area) must have a reciprocal below this, so be greater than about 2**-97. Beneath
# that, underflow in the edge functions could report a hit far outside the triangle, and no box could be conservative
# (docs/traversal.md). A float32 is below it unless the top three bits of its exponent are all ones.
RECIPROCAL_LIMIT = np.float32(2.0**97)


@quiet
def ray_triangle(tests: np.ndarray) -> np.ndarray:
    """RAY_TRIANGLE (N,) to TRIANGLE_HIT (N,): one test a record.

    A hit has t_min < t <= t_max, t finite, and all edge functions of one sign (zero belongs to both). `front` says that
    the triangle's vertices run counter-clockwise as the ray sees them; where `cull` is set, back faces miss. Triangles
    with two equal vertices, with a vertex that is not finite, or whose determinant (twice the area as the ray sees it)
    is zero or so small that its reciprocal reaches 2**97, or infinite or beyond 2**126 (where its reciprocal is flushed
    to zero) miss.
    """
    row = np.arange(len(tests))
    axis = tests["axis"].astype(np.intp) % 3
    kx, ky = NEXT_AXES[axis].T
    kx, ky = np.where(tests["flip"], ky, kx), np.where(tests["flip"], kx, ky)
    origin = flush(tests["origin"])
    sx, sy, sz = flush(tests["shear"]).T

    def sheared(vertex: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        moved = flush(flush(vertex) - origin)
        z = moved[row, axis]
        return flush(moved[row, kx] - flush(sx * z)), flush(moved[row, ky] - flush(sy * z)), z

    ax, ay, az = sheared(tests["v0"])
    bx, by, bz = sheared(tests["v1"])
    cx, cy, cz = sheared(tests["v2"])

    # Edge functions, each opposite the vertex that it weights.
    edge_a = difference_of_products(cx, by, cy, bx)
    edge_b = difference_of_products(ax, cy, ay, cx)
    edge_c = difference_of_products(bx, ay, by, ax)
    negative = (edge_a < 0) | (edge_b < 0) | (edge_c < 0)
    positive = (edge_a > 0) | (edge_b > 0) | (edge_c > 0)

    determinant = flush(flush(edge_a + edge_b) + edge_c)
    reciprocal = flush(ONE / determinant)
    depth = flush(flush(flush(edge_a * az) + flush(edge_b * bz)) + flush(edge_c * cz))
    t = flush(flush(depth * sz) * reciprocal)

    # The reciprocal of a zero determinant is infinite, of an infinite one (or one beyond 2**126) zero, of a NaN a NaN.
    usable = (np.abs(reciprocal) < RECIPROCAL_LIMIT) & (reciprocal != 0)
    inside = ~(negative & positive) & ~(tests["cull"] & negative)
    t_min, t_max = flush(tests["t_min"]), flush(tests["t_max"])
    hit = usable & inside & np.isfinite(t) & (t_min < t) & (t <= t_max)

    out = np.zeros(len(tests), dtype=TRIANGLE_HIT)
    out["hit"] = hit
    out["front"] = hit & positive
    out["t"] = np.where(hit, t, 0)
    # In a hit the edge functions and the determinant are of one sign; abs makes -0 (zero times a negative) +0.
    out["u"] = np.where(hit, np.abs(flush(edge_b * reciprocal)), 0)
    out["v"] = np.where(hit, np.abs(flush(edge_c * reciprocal)), 0)
    return out


def triangle_tests(prepared: np.ndarray, triangles: np.ndarray, cull: np.ndarray | bool = False) -> np.ndarray:
    """PREPARED_RAY (N,) and TRIANGLE (N,), record by record, to RAY_TRIANGLE (N,)."""
    tests = np.zeros(len(prepared), dtype=RAY_TRIANGLE)
    for name in ("origin", "shear", "t_min", "t_max", "axis", "flip"):
        tests[name] = prepared[name]
    for name in ("v0", "v1", "v2"):
        tests[name] = triangles[name]
    tests["cull"] = cull
    return tests
