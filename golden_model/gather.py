"""Samples of texels' irradiance: rays go out, radiance comes back, and what belongs to a texel is added up.

This is the ray work of lightmap maintenance ([0059], [0062] to [0065]), without any state: the same for the maps that
are kept alive frame by frame (`golden_model.maintenance`) and for those that are brought to convergence
(`golden_model.reference`).
"""

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from golden_model.accumulation import accumulate, irradiance, luminance_sums
from golden_model.blend import Blending
from golden_model.directions import COUNT
from golden_model.errors import InputError
from golden_model.lightmap import Lightmaps
from golden_model.lights import Lights
from golden_model.sampling import TexelRays, Update, indirect_share, light_met, texel_rays
from golden_model.scene import Scene
from golden_model.shading import shade_hits
from golden_model.statistics import relative_spread
from golden_model.stopwatch import Stopwatch
from golden_model.tracer import Trace
from golden_model.vectors import add


@dataclass(frozen=True, kw_only=True)
class Sampling:
    """What one texel update is made of."""

    directions: int = 16
    """Rays for indirect light, a power of two up to 4096."""
    light_samples: int = 4
    """Shadow rays at most, at least 1."""
    balanced: bool = True
    """Rays for indirect light count the area lights that they meet, shadow rays leave them their share (see
    `golden_model.sampling`): right beside a light too, for a division more a ray that meets one."""
    direct: Literal["maps", "rays"] = "maps"
    """Whether the maps hold direct and indirect light, or indirect light alone: then texels need no shadow rays, but
    the hits of their rays do."""
    blending: Blending = field(default_factory=Blending)
    """How it weighs against the old value."""
    priming: int = 32
    """Rounds before the first frame at most, each within one frame's budget; see `Renderer`."""

    def __post_init__(self) -> None:
        if self.directions & (self.directions - 1) or not 1 <= self.directions <= COUNT:
            raise InputError(f"directions {self.directions}: must be a power of two, 1 to {COUNT}")
        if self.light_samples < 1:
            raise InputError(f"light samples {self.light_samples}: must be 1 or more")
        if self.direct not in ("maps", "rays"):
            raise InputError(f'direct "{self.direct}": must be "maps" or "rays"')
        if self.priming < 0:
            raise InputError(f"priming {self.priming}: must be 0 or more")

    @property
    def cost(self) -> int:
        """Rays that the budget reserves for an update. Shadow rays that cannot carry light are not traced."""
        return self.directions + self.light_samples

    def require(self, budget: int) -> None:
        """Raises InputError for a budget of rays a frame that does not pay for one update."""
        if budget < self.cost:
            raise InputError(f"--budget {budget}: one texel update takes {self.cost} rays; give at least as many")


@dataclass(frozen=True, kw_only=True)
class World:
    """What rays meet in one frame."""

    scene: Scene
    """The frame's scene."""
    lightmaps: Lightmaps
    """With the records of the frame's pose."""
    values: np.ndarray
    """Irradiance that is read where rays arrive, (N, 3) float32: a published version."""
    lights: Lights
    trace: Trace
    fraction: int
    """Bits after the point of the accumulators."""


@dataclass(frozen=True, kw_only=True)
class Gathered:
    """What rays brought to M texels."""

    irradiance: np.ndarray
    """One sample of each texel's irradiance, (M, 3) float32."""
    spread: np.ndarray
    """Its relative standard error as its rays tell, (M,) int64, 0 to 4095 in 1/256ths."""
    rays: dict[str, int]
    """Rays traced by kind: "indirect", "shadow"."""


def gather(world: World, update: Update, sampling: Sampling, clock: Stopwatch) -> Gathered:
    """One sample of the irradiance of each of an update's M texels."""
    with clock("generate rays"):
        rays = texel_rays(update, world.lights, sampling.directions, sampling.light_samples, sampling.balanced)
    with clock("trace indirect"):
        hits = world.trace(rays.indirect)
    with clock("trace shadow"):
        arrived = world.trace(rays.shadow, any_hit=True)["primitive"] < 0
    with clock("shade rays"):
        radiance = shade_hits(world.scene, world.lightmaps, world.values, hits)
        if sampling.balanced:
            radiance = add(radiance, light_met(update, world.lights, rays, hits))
        indirect = indirect_share(radiance, sampling.directions)
    with clock("accumulate"):
        return _added_up(rays, indirect, arrived, world.fraction)


def _added_up(rays: TexelRays, indirect: np.ndarray, arrived: np.ndarray, fraction: int) -> Gathered:
    """Contributions (R, 3) of the rays over the hemisphere, and of the shadow rays that `arrived` (S,), by texel."""
    texels = len(rays.directions)
    slot, light = rays.shadow_slot[arrived], rays.light[arrived]
    total = accumulate(np.concatenate([rays.indirect_slot, slot]), np.concatenate([indirect, light]), texels, fraction)
    groups = [(*luminance_sums(rays.indirect_slot, indirect, texels, fraction), rays.directions)]
    if rays.light_samples:
        groups.append((*luminance_sums(slot, light, texels, fraction), rays.light_samples))
    return Gathered(
        irradiance=irradiance(total, fraction),
        spread=relative_spread(groups),
        rays={"indirect": len(rays.indirect), "shadow": len(rays.shadow)},
    )
