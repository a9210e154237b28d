"""Parts: objects on their way into a scene, as files and shapes make them."""

from dataclasses import dataclass

import numpy as np

from lightloom.golden_model.contract.engine_image import DIFFUSE
from lightloom.golden_model.scene.keyframes import ObjectPath

DEFAULT_IOR = 1.5
"""Index of refraction of glass whose file names none."""

DEFAULT_ALBEDO = (0.7, 0.7, 0.7)
"""Of surfaces whose file names no material."""


@dataclass(frozen=True, kw_only=True)
class Part:
    """One object on its way into a scene."""

    name: str
    """Unique in the scene after `assemble`, which numbers equal names."""
    corners: np.ndarray
    """Corners of the triangles, (F, 3, 3) float32."""
    albedo: np.ndarray
    """Of its materials, (M, 3) float32, 0 to 1."""
    emission: np.ndarray
    """Radiance of its materials, (M, 3) float32."""
    material: np.ndarray
    """Material of each triangle, (F,) int32, an index into its own materials."""
    normals: np.ndarray | None = None
    """Unit normals at the corners, (F, 3, 3) float32, or None: derived by `shading_normals`."""
    surface: int = DIFFUSE
    """DIFFUSE, MIRROR or GLASS, of all its materials."""
    two_sided: bool = False
    """Whether its diffuse surfaces reflect on their backs, too, with maps of their own."""
    ior: float = DEFAULT_IOR
    """Index of refraction, where it is glass."""
    texture: np.ndarray | None = None
    """Linear RGB, (H, W, 3) float32, of all its materials; multiplies the albedo."""
    emission_texture: np.ndarray | None = None
    """Linear RGB, (H, W, 3) float32, of all its materials, as large as `texture` if there are both; multiplies the
    emission."""
    texture_uv: np.ndarray | None = None
    """Texture coordinates at the corners, (F, 3, 2) float32; None: (0, 0) everywhere."""
    path: ObjectPath | None = None
    """Its motion; None: it stays."""
    section: np.ndarray | None = None
    """The chart of each triangle, (F,) int32 from 0, where it has been cut (`cuts`); None: charts are to be found."""
    coarse: "Part | None" = None
    """The same object of fewer triangles, with the same materials, for `Scene.coarse`; None: it has no other form."""
