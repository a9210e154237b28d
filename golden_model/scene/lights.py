"""The lights of a scene, and by which odds samples choose among them.

There are area lights, point lights (with a cone: spot lights), the sun, and the sky where that is worth it
(`SkyTable.sampled`). What lies beyond the scene is a direction instead of a place: its rays have no end.
`golden_model.rays.light_samples` samples them.
"""

import numpy as np

from lightloom.golden_model.contract.formats import CONE
from lightloom.golden_model.numerics.floats import flush
from lightloom.golden_model.numerics.vectors import cross, subtract
from lightloom.golden_model.scene.distant_lights import distant_lights
from lightloom.golden_model.scene.mesh import area_vectors, dot
from lightloom.golden_model.scene.scene import Scene
from lightloom.golden_model.tables.lights import POINT, TRIANGLE, Lights
from lightloom.golden_model.tables.sky import TABLE_SIDE, luminance

WEIGHT_BITS = 31
"""The whole-number weights by which lights are chosen add up to less than 2**WEIGHT_BITS."""


def lights_of(scene: Scene, sky_side: int = TABLE_SIDE) -> Lights:
    """The lights of a scene (K may be 0). The chance of a light goes with its power: area or 4, times luminance.

    What a triangle emits is the mean over it, where its emission has a texture.

    `sky_side` is that of the table of its sky, a power of two: larger than hardware's for converged answers.
    """
    emission = scene.emission[scene.material]
    if scene.emission_share is not None:
        emission = flush(emission * scene.emission_share)
    shining = np.flatnonzero((emission > 0).any(axis=1))
    corners = scene.corners[shining]
    lit = (scene.point_lights["intensity"] > 0).any(axis=1)
    points, cones = scene.point_lights[lit], scene.cones[lit] if len(scene.cones) else None
    sky, distant = distant_lights(scene, sky_side)
    nothing = np.zeros((len(points), 3), dtype=np.float32)
    none = np.zeros((len(points) + len(distant), 3), dtype=np.float32)
    edge1 = np.concatenate([subtract(corners[:, 1], corners[:, 0]), nothing])
    edge2 = np.concatenate([subtract(corners[:, 2], corners[:, 0]), nothing])
    doubled = cross(edge1, edge2)
    emitted = np.concatenate([emission[shining], points["intensity"]]).astype(np.float32)

    vectors = area_vectors(corners)
    size = np.concatenate([np.sqrt(dot(vectors, vectors)) / 2, _balls(points, cones)])
    power = np.concatenate([size * luminance(emitted.astype(np.float64)), [each.power for each in distant]])
    begin = _begin(power)
    kind = [TRIANGLE] * len(shining) + [POINT] * len(points) + [each.kind for each in distant]
    measure = [0.5] * len(shining) + [1.0] * len(points) + [each.area for each in distant]
    share = begin[-1].astype(np.float64) / np.diff(begin).astype(np.float64) * np.array(measure)
    # Unit normals by way of float64: the squares of small triangles' areas would be flushed.
    unit = vectors / np.sqrt(dot(vectors, vectors))[:, None]
    of_triangle = np.full(len(scene.triangles), -1, dtype=np.int32)
    of_triangle[shining] = np.arange(len(shining))
    sun = scene.environment.sun
    return Lights(
        kind=np.array(kind, dtype=np.uint8),
        origin=_rows(corners[:, 0], points["position"], [each.towards for each in distant]),
        edge1=_rows(edge1, [each.edge1 for each in distant]),
        edge2=_rows(edge2, [each.edge2 for each in distant]),
        doubled=np.concatenate([doubled, none[len(points) :]]),
        unit=np.concatenate([unit.astype(np.float32), none]),
        span=np.concatenate([scene.spans[shining], none[:, 0]]),
        emitted=_rows(emitted, [each.emitted for each in distant]),
        cone=None if cones is None else _all_around(len(shining), cones, len(distant)),
        begin=begin,
        share=share.astype(np.float32),
        of_triangle=of_triangle,
        sun=None if sun is None else sun.disc,
        sky=sky,
    )


def light_count(scene: Scene) -> int:
    """The lights that a scene has in any frame, K at most."""
    shining = int((scene.emission[scene.material] > 0).any(axis=1).sum())
    return shining + len(scene.point_lights) + len(distant_lights(scene, TABLE_SIDE)[1])


def _balls(points: np.ndarray, cones: np.ndarray | None) -> np.ndarray:
    """What power goes with for POINT_LIGHT (P,): 4, and of a spot light the part of all directions that it has."""
    if cones is None:
        return np.full(len(points), 4.0)
    middle = cones["outer"].astype(np.float64) + 0.5 / cones["steepness"].astype(np.float64)
    return np.where(cones["axis"].any(axis=1), 2 * (1 - middle), 4.0)


def _all_around(before: int, cones: np.ndarray, after: int) -> np.ndarray:
    """CONE (P,) between so many lights that are no spot lights."""
    out = np.zeros(before + len(cones) + after, dtype=CONE)
    out["outer"], out["steepness"] = -1, 1
    out[before : before + len(cones)] = cones
    return out


def _rows(*parts: np.ndarray | list[np.ndarray]) -> np.ndarray:
    """Vectors (n, 3), in arrays and lists, below each other: (N, 3) float32."""
    return np.concatenate([np.asarray(part, dtype=np.float32).reshape(-1, 3) for part in parts])


def _begin(power: np.ndarray) -> np.ndarray:
    """Sums of whole-number weights (K + 1,) uint64 that go with powers (K,)."""
    # The strongest gets 2**bits, the weakest at least 1, and together they stay below 2**WEIGHT_BITS.
    bits = WEIGHT_BITS - 1 - int(np.frexp(max(len(power), 1))[1])
    weight = np.maximum(np.rint(power / power.max(initial=1e-300) * 2.0**bits), 1).astype(np.uint64)
    return np.concatenate([[0], np.cumsum(weight)]).astype(np.uint64)
