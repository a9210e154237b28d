"""What lies beyond a scene, as lights among the others: the sun, and the sky where light samples choose from it."""

from dataclasses import dataclass, field

import numpy as np

from lightloom.golden_model.numerics.directions import tangent_of
from lightloom.golden_model.numerics.vectors import cross, scale
from lightloom.golden_model.scene.scene import Scene
from lightloom.golden_model.tables.lights import SKY, SUN
from lightloom.golden_model.tables.sky import SkyTable, luminance


@dataclass(frozen=True, kw_only=True)
class DistantLight:
    """A row of `Lights` for what lies beyond the scene."""

    kind: int
    power: float
    area: float = 1.0
    towards: np.ndarray = field(default_factory=lambda: np.zeros(3, dtype=np.float32))
    edge1: np.ndarray = field(default_factory=lambda: np.zeros(3, dtype=np.float32))
    edge2: np.ndarray = field(default_factory=lambda: np.zeros(3, dtype=np.float32))
    emitted: np.ndarray = field(default_factory=lambda: np.zeros(3, dtype=np.float32))


def distant_lights(scene: Scene, sky_side: int) -> tuple[SkyTable | None, list[DistantLight]]:
    """The table of the scene's sky, and the lights beyond the scene: the sun, then the sky, as far as they are some."""
    sky, sun = scene.environment.sky, scene.environment.sun
    around = scene.half_extent * scene.half_extent
    rows = []
    if sun is not None and sun.irradiance.any():
        tangent = tangent_of(sun.towards[None])[0]
        rows.append(
            DistantLight(
                kind=SUN,
                power=around * float(luminance(sun.irradiance.astype(np.float64))),
                area=sun.area if sun.radius > 0 else 1.0,
                towards=sun.towards,
                edge1=scale(tangent, sun.radius),
                edge2=scale(cross(sun.towards, tangent), sun.radius),
                emitted=sun.radiance if sun.radius > 0 else sun.irradiance,
            )
        )
    if sky is None:
        return None, rows
    table = sky.finer_table(sky_side)
    if table.sampled:
        rows.append(DistantLight(kind=SKY, power=4 * around * table.mean))
    return table, rows
