"""The triangles that rays meet in a frame and their materials, as the engine reads them from its memory image."""

from dataclasses import dataclass

import numpy as np

from lightloom.golden_model.contract.engine_image import DIFFUSE
from lightloom.golden_model.numerics.structured import take


@dataclass(frozen=True, kw_only=True)
class Geometry:
    """T triangles of M materials, as in `golden_model.contract.engine_image`."""

    surfaces: np.ndarray
    """SURFACE (T,)."""
    shapes: np.ndarray
    """SHAPE (T,)."""
    materials: np.ndarray
    """MATERIAL (M,)."""

    def material(self, primitive: np.ndarray) -> np.ndarray:
        """The materials of triangles (N,), MATERIAL (N,)."""
        return take(self.materials, self.surfaces["material"][primitive])

    def reflects(self, primitive: np.ndarray, front: np.ndarray) -> np.ndarray:
        """Whether triangles (N,) are diffuse, and reflect on the side that is seen, their front or not (N,): bool."""
        material = self.material(primitive)
        return np.asarray((material["surface"] == DIFFUSE) & (front | (material["two_sided"] > 0)))
