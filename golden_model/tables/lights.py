"""The lights of a frame as they are read, and by which odds samples choose among them.

`golden_model.scene.lights` makes the tables, `golden_model.rays.light_samples` samples them.
"""

from dataclasses import dataclass

import numpy as np

from lightloom.golden_model.numerics.floats import flush, quiet
from lightloom.golden_model.numerics.vectors import cross, dot
from lightloom.golden_model.tables.sky import SkyTable

TRIANGLE, POINT, SUN, SKY = range(4)
"""Kinds of light; from SUN on they lie beyond the scene."""


@dataclass(frozen=True, kw_only=True)
class Disc:
    """A sun that can be met: a disc of even radiance, as far off as can be."""

    towards: np.ndarray
    """Unit vector from the scene to its middle, (3,) float32."""
    radius: np.float32
    """Tangent of its radius: that of the disc one unit off."""
    radiance: np.ndarray
    """(3,) float32."""

    @quiet
    def seen(self, direction: np.ndarray) -> np.ndarray:
        """Which directions (N, 3) float32, of any length, lead to it, (N,) bool."""
        along, off = dot(self.towards, direction), cross(self.towards[None], direction)
        reach = flush(along * self.radius)
        return np.asarray((along > 0) & (dot(off, off) <= flush(reach * reach)))


@dataclass(frozen=True, kw_only=True)
class Lights:
    """The K lights of a scene: its emissive triangles in their order, its point lights, its sun, its sky."""

    kind: np.ndarray
    """TRIANGLE, POINT, SUN or SKY, (K,) uint8."""
    origin: np.ndarray
    """First corner, position of a point light, direction to the middle of the sun, (K, 3) float32."""
    edge1: np.ndarray
    """Second corner minus the first, the sun's radius in one direction, (K, 3) float32, zero for others."""
    edge2: np.ndarray
    """Third corner minus the first, the sun's radius in the other direction, (K, 3) float32, zero for others."""
    doubled: np.ndarray
    """edge1 x edge2 of a triangle: its normal, as long as twice the area; (K, 3) float32, zero for others."""
    unit: np.ndarray
    """Unit normal of a triangle, (K, 3) float32, zero for others."""
    span: np.ndarray
    """`Scene.spans` of a triangle, (K,) float32, 0 for others."""
    emitted: np.ndarray
    """Radiance of a triangle or the sun (irradiance if it has no size), radiant intensity of a point light; (K, 3)
    float32, zero for the sky."""
    cone: np.ndarray | None
    """CONE (K,), all around for what is no spot light; None where there is none."""
    begin: np.ndarray
    """A light k is chosen for whole numbers begin[k] <= x < begin[k + 1], (K + 1,) uint64."""
    share: np.ndarray
    """One over the chance to be chosen, (K,) float32; for triangles halved, because `doubled` is twice the area; for a
    sun times the area of its disc one unit off."""
    of_triangle: np.ndarray
    """The light that each triangle of the scene is, (T,) int32, -1 where it does not shine."""
    sun: Disc | None
    """Where there is one that can be met."""
    sky: SkyTable | None

    def __len__(self) -> int:
        return len(self.kind)

    @property
    def distant(self) -> bool:
        """Whether rays that leave the scene can bring light."""
        return self.sun is not None or self.sky is not None
