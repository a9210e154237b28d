"""Light that comes from beyond the scene: a sky, and a sun."""

import functools
from dataclasses import dataclass, replace

import numpy as np

from lightloom.golden_model.numerics.directions import sine_cosine_of
from lightloom.golden_model.numerics.floats import flush, quiet
from lightloom.golden_model.scene.sky import fine_side, laid_out, table_of
from lightloom.golden_model.tables.lights import Disc
from lightloom.golden_model.tables.octahedral import on_octahedron
from lightloom.golden_model.tables.sky import TABLE_SIDE, SkyMap, SkyTable

_PI = 3.141592653589793
LEAST_ANGLE = 1e-3
"""Of a sun, in degrees: a smaller one has no size, because its radiance would leave the range."""


@dataclass(frozen=True, kw_only=True)
class Sky:
    """Radiance from every direction, as far off as can be."""

    radiance: np.ndarray
    """(H, 2 H, 3) float32, 0 or more, by latitude and longitude: the first row is up (+y), the last down; the middle
    column lies towards -z, and those to the right of it go on towards +x. (1, 1, 3) for one that is the same all over.
    """
    rotation: np.ndarray
    """Of the sky: what the picture has in direction d comes from direction rotation d; (3, 3) float32."""

    @functools.cached_property
    def map(self) -> SkyMap:
        """What pixels, mirrors and glass see of it."""
        if self.radiance.shape[:2] == (1, 1):
            return SkyMap(radiance=flush(self.radiance))
        return laid_out(self.radiance, self.rotation, fine_side(len(self.radiance)))

    @functools.cached_property
    def table(self) -> SkyTable:
        """What texels see of it."""
        return table_of(self.map)

    def finer_table(self, side: int) -> SkyTable:
        """The table that it would have if hardware had room for `side` squared cells."""
        return self.table if side == TABLE_SIDE else table_of(self.map, side)


@dataclass(frozen=True, kw_only=True)
class Sun:
    """A disc of even radiance, as far off as can be."""

    towards: np.ndarray
    """Unit vector from the scene to its middle, (3,) float32."""
    irradiance: np.ndarray
    """Of a surface that faces it, (3,) float32, 0 or more."""
    angle: float
    """Its diameter in degrees, 0 to 90; 0: light from one direction."""

    @functools.cached_property
    def _half(self) -> tuple[float, float]:
        """Sine and cosine of its radius."""
        angle = self.angle if self.angle >= LEAST_ANGLE else 0.0
        sine, cosine = sine_cosine_of(np.array([angle * (_PI / 360)]))
        return float(sine[0]), float(cosine[0])

    @property
    def radius(self) -> np.float32:
        """Tangent of its radius: that of the disc one unit off."""
        return np.float32(self._half[0] / self._half[1])

    @property
    def area(self) -> float:
        """Of that disc."""
        return _PI * float(self.radius) ** 2

    @property
    def radiance(self) -> np.ndarray:
        """Of the disc, (3,) float32; zero for one without size, which nothing can see."""
        square = self._half[0] * self._half[0]
        if square == 0:
            return np.zeros(3, dtype=np.float32)
        return (self.irradiance.astype(np.float64) / (_PI * square)).astype(np.float32)

    @property
    def disc(self) -> Disc | None:
        """What can be met of it; None of one without size."""
        return Disc(towards=self.towards, radius=self.radius, radiance=self.radiance) if self.radius > 0 else None


@dataclass(frozen=True, kw_only=True)
class Environment:
    """What a scene lies in."""

    sky: Sky | None = None
    sun: Sun | None = None

    def __bool__(self) -> bool:
        return self.sky is not None or self.sun is not None

    @property
    def arrays(self) -> tuple[np.ndarray, ...]:
        """All that it is."""
        sky = () if self.sky is None else (self.sky.radiance, self.sky.rotation)
        sun = () if self.sun is None else (self.sun.towards, self.sun.irradiance, np.array(self.sun.angle))
        return sky + sun

    @property
    def shines(self) -> bool:
        """Whether any light comes from it."""
        sky, sun = self.sky is not None and self.sky.radiance.any(), self.sun is not None and self.sun.irradiance.any()
        return bool(sky or sun)

    @quiet
    def seen(self, direction: np.ndarray) -> np.ndarray:
        """What an eye sees in directions (N, 3) float32 of any length: radiance (N, 3) float32."""
        radiance = np.zeros(direction.shape, dtype=np.float32)
        if self.sky is not None:
            radiance = flush(radiance + self.sky.map.between(on_octahedron(direction)))
        if self.sun is not None and (disc := self.sun.disc) is not None:
            met = disc.seen(direction)
            radiance[met] = flush(radiance[met] + disc.radiance)
        return radiance

    @functools.cached_property
    def brightest(self) -> float:
        """The largest radiance that a ray of a texel counts of the sky, of any colour."""
        return 0.0 if self.sky is None else float(self.sky.table.map.radiance.max())

    @functools.cached_property
    def irradiance(self) -> float:
        """No less than what sky and sun bring to any surface, of any colour; both at full strength from all sides."""
        total = np.zeros(3)
        if self.sky is not None:
            total = total + 4 * _PI * self.sky.table.mean_colour
        if self.sun is not None:
            total = total + self.sun.irradiance.astype(np.float64)
        return float(total.max())

    def in_unit(self, exponent: int) -> "Environment":
        """The same with its light in units of 2**exponent."""
        sky, sun = self.sky, self.sun
        return Environment(
            sky=None if sky is None else replace(sky, radiance=np.ldexp(sky.radiance, -exponent)),
            sun=None if sun is None else replace(sun, irradiance=np.ldexp(sun.irradiance, -exponent)),
        )
