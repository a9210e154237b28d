"""Light that comes from beyond the scene: a sky, and a sun."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, kw_only=True)
class Sky:
    """Radiance from every direction, as far off as can be."""

    radiance: np.ndarray
    """(H, 2 H, 3) float32, 0 or more, by latitude and longitude: the first row is up (+y), the last down; the middle
    column lies towards -z, and those to the right of it go on towards +x. (1, 1, 3) for one that is the same all over.
    """
    rotation: np.ndarray
    """Of the sky: what the picture has in direction d comes from direction rotation d; (3, 3) float32."""


@dataclass(frozen=True, kw_only=True)
class Sun:
    """A disc of even radiance, as far off as can be."""

    towards: np.ndarray
    """Unit vector from the scene to its middle, (3,) float32."""
    irradiance: np.ndarray
    """Of a surface that faces it, (3,) float32, 0 or more."""
    angle: float
    """Its diameter in degrees, 0 to 90; 0: light from one direction."""


@dataclass(frozen=True, kw_only=True)
class Environment:
    """What a scene lies in."""

    sky: Sky | None = None
    sun: Sun | None = None

    def __bool__(self) -> bool:
        return self.sky is not None or self.sun is not None
