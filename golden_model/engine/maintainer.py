"""Lightmap maintenance: texels are chosen, sampled by rays, and blended ([0042], [0058], FIG. 7, claims 1 to 8)."""

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from lightloom.golden_model.contract.formats import TEXEL_STATE
from lightloom.golden_model.engine.drift import departures
from lightloom.golden_model.engine.kernels import Kernels
from lightloom.golden_model.engine.sampling.confidence import limit, lower
from lightloom.golden_model.engine.sampling.gather import Gathered, World, gather
from lightloom.golden_model.engine.sampling.running_average import blend_texels, drop, mark_heavy
from lightloom.golden_model.engine.sampling.settings import Sampling
from lightloom.golden_model.engine.sampling.texel_rays import Update
from lightloom.golden_model.engine.selection.policy import Policy
from lightloom.golden_model.engine.selection.selector import FrameContext, Plan, Selector
from lightloom.golden_model.host.stopwatch import Stopwatch
from lightloom.golden_model.numerics.floats import LARGEST_HALF
from lightloom.golden_model.rays.collector import Collector
from lightloom.golden_model.rays.waves import Waves
from lightloom.golden_model.tables.lightmap import VALID, Lightmaps
from lightloom.golden_model.tables.sides import firsts_first, sides_of


@dataclass(frozen=True, kw_only=True)
class Maintenance:
    """What one frame did to the lightmaps."""

    texels: np.ndarray
    """Numbers of the texels updated, each once, in the order of their updates, (M,) int64."""
    stale: np.ndarray
    """Texels of which little or nothing is known any more because their light has changed, (D,) int64, rising."""
    rays: dict[str, int]
    """Rays traced by kind: "indirect", "specular" (on from mirrors and glass), "shadow", "visibility", "footprints";
    together at most the budget."""
    clipped: int
    """Samples of rays, and averages of updated texels, that were brighter than the formats hold: light that is lost."""
    plan: Plan
    """Why these texels."""


@dataclass(frozen=True, kw_only=True)
class Primed:
    """What one round before the first frame did."""

    texels: np.ndarray
    """Numbers of the texels sampled, (M,) int64."""
    rays: int
    """Rays traced."""
    clipped: int
    """As `Maintenance.clipped`."""


@dataclass(kw_only=True)
class _Spent:
    """What a budget of rays was spent on."""

    updated: int = 0
    """Texels, the first ones of those that waited."""
    rays: Counter[str] = field(default_factory=Counter)
    clipped: int = 0
    samples: list[tuple[np.ndarray, np.ndarray, np.ndarray]]
    """In parts, the texels that had an average, (M,), these averages and their samples, (M, 3)."""


class Maintainer:
    """The maintained texels of a scene's lightmaps and the policy that chooses among them."""

    def __init__(
        self,
        lightmaps: Lightmaps,
        sampling: Sampling,
        policy: Policy,
        seed: int,
        kernels: Kernels | None = None,
    ):
        """Lightmaps at rest; without `kernels` NumPy's."""
        self.sampling, self.policy, self.seed = sampling, policy, seed
        self.state = np.zeros(len(lightmaps.texels), dtype=TEXEL_STATE)
        """TEXEL_STATE (N,)."""
        self.selector = Selector(lightmaps, policy, (kernels or Kernels()).screen_test)
        self._owner = lightmaps.texels["object"]
        self._maps = len(lightmaps.width)
        self._side = sides_of(lightmaps)
        self._departures = np.zeros((2, self._maps), dtype=np.int8)
        """To which side the samples of each map departed from their averages, in the last two frames."""

    def prime(
        self, world: World, waiting: np.ndarray, anew: bool, budget: int, collector: Collector, clock: Stopwatch
    ) -> Waves[Primed]:
        """One round before the first frame: the first of the texels `waiting` (M,), as many as a frame pays for.

        `anew` they lose what earlier rounds found of them, which lacks bounces of light that have come since; else it
        is averaged.
        """
        chosen = waiting[: budget // self.sampling.directions]
        prepare = partial(drop, self.state) if anew else _keep
        spent = yield from self._spend(world, chosen, budget, 0, collector, clock, prepare)
        return Primed(texels=chosen[: spent.updated], rays=spent.rays.total(), clipped=spent.clipped)

    def priming_order(self, world: World) -> np.ndarray:
        """The texels that are valid in a frame, (V,) int64, in the order in which priming takes them.

        First comes one of each side, because no other shows what it finds (`filling`), then the others.
        """
        return firsts_first(self._side, self.present(world))

    def present(self, world: World) -> np.ndarray:
        """The texels that are valid in a frame, (V,) int64, in the order of their turns."""
        order = self.selector.order
        return order[world.lightmaps.texels["state"][order] == VALID]

    def run(
        self, world: World, context: FrameContext, budget: int, collector: Collector, clock: Stopwatch
    ) -> Waves[Maintenance]:
        """Updates texels by at most `budget` rays.

        The texels of the plan are admitted in its order: one more as long as the rays that those before it took, and
        the most that it can take itself, are within the budget. So less than one reserve is left, or no texel is.
        """
        with clock("select"):
            reserve = self.sampling.reserve(world.specular)
            plan = self.selector.plan(context, budget, reserve, self.sampling.directions)
            plan.mark(self.state, self.policy.heavy_updates)
            limit(self.state, plan.most)
            stale = lower(self.state, plan.expected)
        drifting = self._drifting_maps()
        waiting = np.concatenate([plan.texel, plan.spare])

        def prepare(texel: np.ndarray) -> None:
            plan.forget_old(self.state, texel)
            in_drift = drifting[self._owner[texel]]
            mark_heavy(self.state, texel[in_drift & (self.state["heavy"][texel] == 0)], 1)

        left = budget - sum(plan.rays.values())
        spent = yield from self._spend(world, waiting, left, context.frame, collector, clock, prepare)
        if self.policy.drift:
            with clock("blend"):
                self._observe_departures(spent.samples, world.fraction)
        self.selector.spend(plan, spent.updated - len(plan.texel))
        rays = Counter(plan.rays)
        rays.update(spent.rays)
        return Maintenance(
            texels=waiting[: spent.updated], stale=stale, rays=dict(rays), clipped=spent.clipped, plan=plan
        )

    def _spend(
        self,
        world: World,
        waiting: np.ndarray,
        budget: int,
        frame: int,
        collector: Collector,
        clock: Stopwatch,
        prepare: Callable[[np.ndarray], None],
    ) -> Waves[_Spent]:
        """Samples and blends `waiting` (M,), all different, in their order, as far as `budget` rays admit them.

        `prepare` is told of texels about to be sampled, (K,).
        """
        spent = _Spent(samples=[(waiting[:0], self.state["irradiance"][:0], self.state["irradiance"][:0])])
        while count := self._admitted(world, budget - spent.rays.total(), len(waiting) - spent.updated):
            texel = waiting[spent.updated : spent.updated + count]
            prepare(texel)
            known = self.state["count"][texel] > 0
            before = self.state["irradiance"][texel]
            gathered = yield from self._update(world, texel, frame, collector, clock)
            spent.samples.append((texel[known], before[known], gathered.irradiance[known]))
            spent.rays.update(gathered.rays)
            spent.clipped += self._clipped(gathered, texel)
            spent.updated += count
        return spent

    def _admitted(self, world: World, rays: int, waiting: int) -> int:
        """Of `waiting` texels, how many are surely admitted if `rays` are left, whatever each of them takes.

        Those that follow depend on what these take. To ask again until it is 0 admits each texel for which the rays of
        all before it and its own reserve are within the budget, and no other: texels need not go one by one for that.
        """
        return min(rays // self.sampling.reserve(world.specular), waiting)

    def _clipped(self, gathered: Gathered, texel: np.ndarray) -> int:
        """Samples of rays, and averages of texels (M,) just blended, that were brighter than the formats hold."""
        return gathered.clipped + int((self.state["irradiance"][texel] > LARGEST_HALF).any(axis=1).sum())

    def _drifting_maps(self) -> np.ndarray:
        """Whether each map departed to the same side in the last two frames, (O,) bool."""
        before, now = self._departures
        return (before == now) & (now != 0)

    def _observe_departures(self, samples: list[tuple[np.ndarray, np.ndarray, np.ndarray]], fraction: int) -> None:
        """Takes the samples of a frame: texels (M,), their averages before and their samples (M, 3), in parts."""
        texel, before, sample = (np.concatenate(parts) for parts in zip(*samples, strict=True))
        policy, owner = self.policy, self._owner[texel]
        now = departures(owner, before, sample, self._maps, fraction, policy.drift_least, policy.drift_certainty)
        self._departures = np.stack([self._departures[1], now])

    def _update(
        self, world: World, texel: np.ndarray, frame: int, collector: Collector, clock: Stopwatch
    ) -> Waves[Gathered]:
        """Samples and blends texels (M,), all different."""
        update = Update(
            texel=texel,
            record=world.lightmaps.texels[texel],
            number=self.state["number"][texel],
            seed=self.seed,
        )
        gathered = yield from gather(world, update, self.sampling, collector, clock)
        with clock("blend"):
            blend_texels(self.state, texel, gathered.sums, gathered.fraction, self.sampling.blending, frame)
        return gathered


def _keep(texel: np.ndarray) -> None:
    """What is known of texels (M,) about to be sampled stays as it is."""
