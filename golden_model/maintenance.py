"""Lightmap maintenance: texels are chosen, sampled by rays, and blended ([0042], [0058], FIG. 7, claims 1 to 8)."""

from dataclasses import dataclass

import numpy as np

from golden_model.blend import blend_texels
from golden_model.collector import Collector
from golden_model.formats import TEXEL_STATE
from golden_model.gather import Sampling, World, gather
from golden_model.lightmap import Lightmaps
from golden_model.sampling import Update
from golden_model.selection import RoundRobin, coarse_to_fine
from golden_model.stopwatch import Stopwatch
from golden_model.waves import Waves


@dataclass(frozen=True, kw_only=True)
class Maintenance:
    """What one frame did to the lightmaps."""

    texels: np.ndarray
    """Numbers of the texels updated, each once, in the order of their updates, (M,) int64."""
    rays: dict[str, int]
    """Rays traced by kind: "indirect", "shadow"; together at most the budget."""


class Maintainer:
    """The maintained texels of a scene's lightmaps and the policy that chooses among them."""

    def __init__(self, lightmaps: Lightmaps, sampling: Sampling, seed: int):
        self.sampling, self.seed = sampling, seed
        self.state = np.zeros(len(lightmaps.texels), dtype=TEXEL_STATE)
        """TEXEL_STATE (N,)."""
        self._selection = RoundRobin(coarse_to_fine(lightmaps))

    def prime(self, world: World, budget: int, collector: Collector, clock: Stopwatch) -> Waves[Maintenance]:
        """One round before the first frame: the first texels of the order, as many as a frame pays for, sampled anew.

        Values of an earlier round are dropped.
        """
        self.state["count"] = 0
        self.state["number"] = 0
        self._selection.next = 0
        return self.run(world, 0, budget, collector, clock)

    def run(self, world: World, frame: int, budget: int, collector: Collector, clock: Stopwatch) -> Waves[Maintenance]:
        """Updates texels by at most `budget` rays."""
        reserve = self.sampling.reserve(world.scene.specular)
        with clock("select"):
            texel = self._selection.select(budget, reserve)
        rays = yield from self._update(world, texel, frame, collector, clock)
        return Maintenance(texels=texel, rays=rays)

    def _update(
        self, world: World, texel: np.ndarray, frame: int, collector: Collector, clock: Stopwatch
    ) -> Waves[dict[str, int]]:
        """Samples and blends texels (M,), all different; returns the rays traced by kind."""
        update = Update(
            texel=texel,
            record=world.lightmaps.texels[texel],
            number=self.state["number"][texel],
            seed=self.seed,
        )
        gathered = yield from gather(world, update, self.sampling, collector, clock)
        with clock("blend"):
            blend_texels(self.state, texel, gathered.irradiance, self.sampling.blending, frame, gathered.spread)
        return gathered.rays
