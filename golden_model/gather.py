"""Samples of texels' irradiance: rays go out, radiance comes back, and what belongs to a texel is added up.

This is the ray work of lightmap maintenance ([0059], [0062] to [0065]), without any state: the same for the maps that
are kept alive frame by frame (`golden_model.maintenance`) and for those that are brought to convergence
(`golden_model.reference`).
"""

from dataclasses import dataclass, field

import numpy as np

from golden_model.accumulation import accumulate, irradiance
from golden_model.blend import Blending
from golden_model.directions import COUNT
from golden_model.errors import InputError
from golden_model.lightmap import Lightmaps
from golden_model.lights import Lights
from golden_model.sampling import Update, indirect_rays, indirect_share, shadow_rays
from golden_model.scene import Scene
from golden_model.shading import shade_hits
from golden_model.stopwatch import Stopwatch
from golden_model.tracer import Trace


@dataclass(frozen=True, kw_only=True)
class Sampling:
    """What one texel update is made of."""

    directions: int = 16
    """Rays for indirect light, a power of two up to 4096."""
    light_samples: int = 4
    """Shadow rays at most, at least 1."""
    blending: Blending = field(default_factory=Blending)
    """How it weighs against the old value."""
    priming: int = 5
    """Rounds before the first frame, each within one frame's budget; see `Renderer`."""

    def __post_init__(self) -> None:
        if self.directions & (self.directions - 1) or not 1 <= self.directions <= COUNT:
            raise InputError(f"directions {self.directions}: must be a power of two, 1 to {COUNT}")
        if self.light_samples < 1:
            raise InputError(f"light samples {self.light_samples}: must be 1 or more")
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


def gather(world: World, update: Update, sampling: Sampling, clock: Stopwatch) -> tuple[np.ndarray, dict[str, int]]:
    """One sample of the irradiance of each of M texels, (M, 3) float32, and the rays traced for it by kind."""
    slot = np.arange(len(update.texel))
    with clock("generate rays"):
        rays = indirect_rays(update, sampling.directions, world.lights.offset)
        shadow, light = shadow_rays(update, world.lights, sampling.light_samples)
        carrying = np.flatnonzero(light.any(axis=1))
    with clock("trace indirect"):
        hits = world.trace(rays)
    with clock("trace shadow"):
        blocked = world.trace(shadow[carrying], any_hit=True)["primitive"] >= 0
    with clock("shade rays"):
        radiance = shade_hits(world.scene, world.lightmaps, world.values, hits)
        indirect = indirect_share(radiance, sampling.directions)
    with clock("accumulate"):
        arrived = carrying[~blocked]
        total = accumulate(
            np.concatenate([np.repeat(slot, sampling.directions), arrived // sampling.light_samples]),
            np.concatenate([indirect, light[arrived]]),
            len(slot),
            world.fraction,
        )
        sample = irradiance(total, world.fraction)
    return sample, {"indirect": len(rays), "shadow": len(carrying)}
