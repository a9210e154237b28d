"""Shapes that scene descriptions name: quads, boxes and spheres, in ordered float64 arithmetic."""

import numpy as np

from lightloom.golden_model.scene.mesh import cross, dot

GOLDEN = (1.0 + np.sqrt(5.0)) / 2.0

QUAD_UV = ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0))
"""Texture coordinates of a quad's corners, counter-clockwise."""

# The corners of a box by the signs of x, y, z, each face counter-clockwise as seen from outside.
_BOX_FACES = (
    ((-1, -1, 1), (1, -1, 1), (1, 1, 1), (-1, 1, 1)),
    ((1, -1, -1), (-1, -1, -1), (-1, 1, -1), (1, 1, -1)),
    ((1, -1, 1), (1, -1, -1), (1, 1, -1), (1, 1, 1)),
    ((-1, -1, -1), (-1, -1, 1), (-1, 1, 1), (-1, 1, -1)),
    ((-1, 1, 1), (1, 1, 1), (1, 1, -1), (-1, 1, -1)),
    ((-1, -1, -1), (1, -1, -1), (1, -1, 1), (-1, -1, 1)),
)


def quad_triangles(quads: np.ndarray) -> np.ndarray:
    """Quads (Q, 4, K) to two triangles each with a common first corner: (2 Q, 3, K)."""
    return quads[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3, quads.shape[2])


def quad_coordinates(quads: int) -> np.ndarray:
    """Texture coordinates at the corners of `quad_triangles`, each quad the whole picture: (2 Q, 3, 2) float32."""
    return quad_triangles(np.tile(np.array(QUAD_UV, dtype=np.float32), (quads, 1, 1)))


def box(size: np.ndarray) -> np.ndarray:
    """Corners (12, 3, 3) float64 of a box about the origin with sides `size` (3,); fronts outside."""
    return quad_triangles(np.array(_BOX_FACES, dtype=np.float64) * (size * 0.5))


def icosphere(subdivisions: int) -> np.ndarray:
    """Corners (20 * 4**subdivisions, 3, 3) float64 of a closed unit sphere about the origin, fronts outside.

    An icosahedron whose triangles are split in four and whose points are brought to the sphere, again and again.
    Neighbours compute their common points with the same operands, so they agree in all bits.
    """
    signs = ((-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0), (1.0, 1.0))
    points = np.array(
        [np.roll((0.0, a, b * GOLDEN), places) for places in range(3) for a, b in signs],
        dtype=np.float64,
    )
    # Faces are the triples of points two apart from each other, ordered to face outward.
    near = np.abs(_square(points[:, None] - points[None]) - 4.0) < 0.1
    faces = []
    for i in range(12):
        for j in range(i + 1, 12):
            for k in range(j + 1, 12):
                if near[i, j] and near[j, k] and near[k, i]:
                    a, b, c = points[[i, j, k]]
                    outward = float(dot(cross(b - a, c - a), a)) > 0
                    faces.append([a, b, c] if outward else [a, c, b])
    corners = _unit(np.array(faces))
    for _ in range(subdivisions):
        a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
        ab, bc, ca = _unit(a + b), _unit(b + c), _unit(c + a)
        quarters = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
        corners = np.concatenate([np.stack(quarter, axis=1) for quarter in quarters])
    return corners


def _square(vectors: np.ndarray) -> np.ndarray:
    return dot(vectors, vectors)


def _unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.sqrt(_square(vectors))[..., None]
