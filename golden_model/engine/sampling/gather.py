"""Samples of texels' irradiance: rays go out, radiance comes back, and what belongs to a texel is added up.

This is the ray work of lightmap maintenance ([0059], [0062] to [0065]), without any state: the same for the maps that
are kept alive frame by frame (`golden_model.engine.maintainer`) and for those that are brought to convergence
(`golden_model.oracle.converged_maps`). It proceeds in waves of the ray collector, which other emitters share: a
generator that yields where its rays wait to be traced (`golden_model.rays.waves`).

A ray over the hemisphere and what goes on from it is a path. It carries what it has brought so far, and its weight,
from one ray to the next; what it has brought at its end is one contribution to its texel. A shadow ray's is another.
Contributions are added up in fixed point, so it does not matter in which order they come in.
"""

from dataclasses import dataclass

import numpy as np

from lightloom.golden_model.contract.formats import SAMPLE_SUMS
from lightloom.golden_model.engine.sampling.accumulate import accumulate, beyond, irradiance, luminance_sums
from lightloom.golden_model.engine.sampling.settings import Sampling
from lightloom.golden_model.engine.sampling.texel_rays import (
    TexelRays,
    Update,
    indirect_share,
    light_met,
    texel_rays,
)
from lightloom.golden_model.host.stopwatch import Stopwatch
from lightloom.golden_model.numerics.counter_rng import hash_u32
from lightloom.golden_model.numerics.vectors import add, multiply
from lightloom.golden_model.rays.collector import MAINTENANCE, Collector
from lightloom.golden_model.rays.hit_shading import Onward, direct_at_hits, shade_rays
from lightloom.golden_model.rays.surface_shading import Surfaces
from lightloom.golden_model.rays.waves import Waves
from lightloom.golden_model.tables.lightmap import Lightmaps
from lightloom.golden_model.tables.lights import Lights
from lightloom.golden_model.tables.octahedral import on_octahedron

_LIT = 1  # what a path's key is hashed with for the shadow ray of its hit


@dataclass(frozen=True, kw_only=True)
class World:
    """What rays meet in one frame."""

    surfaces: Surfaces
    """What they read where they arrive."""
    lightmaps: Lightmaps
    """With the records of the frame's pose."""
    lights: Lights
    fraction: int
    """Bits after the point of the accumulators."""
    specular: bool
    """Whether any triangle is a mirror or glass."""

    def sky(self, direction: np.ndarray) -> np.ndarray:
        """What rays of `direction` (N, 3) bring that leave the scene behind mirrors and glass: radiance (N, 3) float32.

        The sky alone: so few would meet the sun that each would be a spark of ten thousand.
        """
        if self.lights.sky is None:
            return np.zeros(direction.shape, dtype=np.float32)
        return self.lights.sky.map.nearest(on_octahedron(direction))


@dataclass(frozen=True, kw_only=True)
class Gathered:
    """What rays brought to M texels."""

    sums: np.ndarray
    """What it adds up to at each, SAMPLE_SUMS (M,)."""
    fraction: int
    """Bits after the point of the totals."""
    rays: dict[str, int]
    """Rays traced by kind: "indirect", "specular" (on from mirrors and glass), "shadow"."""
    clipped: int
    """Contributions of rays that were brighter than the accumulators hold."""

    @property
    def irradiance(self) -> np.ndarray:
        """One sample of each texel's irradiance, (M, 3) float32."""
        return irradiance(self.sums["total"], self.fraction)


def gather(world: World, update: Update, sampling: Sampling, collector: Collector, clock: Stopwatch) -> Waves[Gathered]:
    """One sample of the irradiance of each of an update's M texels."""
    samples = sampling.light_samples if sampling.direct == "maps" else 0
    with clock("generate rays"):
        rays = texel_rays(update, world.lights, sampling.directions, samples, sampling.balanced)
        path = _Paths.begin(rays, update)
    nearest = collector.emit(MAINTENANCE, path.rays)
    shadow = collector.emit(MAINTENANCE, rays.shadow, any_hit=True)
    yield
    arrived = collector.hits(shadow)["primitive"] < 0
    direct = [(rays.shadow_slot[arrived], rays.light[arrived])]
    traced = {"indirect": len(rays.indirect), "specular": 0, "shadow": len(rays.shadow)}
    radiance = np.zeros((len(rays.indirect), 3), dtype=np.float32)
    for bounce in range(sampling.bounces + 1):
        with clock("shade rays"):
            hits = collector.hits(nearest)
            # What shines counts where no shadow ray can have brought it: behind mirrors and glass.
            shaded = shade_rays(
                world.surfaces, path.rays, hits, path.key, emission=bounce > 0, beyond=world.sky if bounce else None
            )
            path.add(radiance, shaded.radiance)
            if bounce == 0 and (sampling.balanced or world.lights.distant):
                radiance = add(radiance, light_met(update, world.lights, rays, hits))
            lit = path.lit(world, rays, hits) if sampling.direct == "rays" else None
            path = path.follow(shaded.onward) if bounce < sampling.bounces else path.none()
        if not len(path.rays) and lit is None:
            break
        nearest = collector.emit(MAINTENANCE, path.rays)
        traced["specular"] += len(path.rays)
        if lit is not None:
            shadow = collector.emit(MAINTENANCE, lit.rays, any_hit=True)
            traced["shadow"] += len(lit.rays)
        yield
        if lit is not None:
            arrived = collector.hits(shadow)["primitive"] < 0
            direct.append((lit.slot[arrived], lit.light[arrived]))
        if not len(path.rays):
            break
    with clock("accumulate"):
        indirect = indirect_share(radiance, sampling.directions)
        slot, light = (np.concatenate(parts) for parts in zip(*direct, strict=True))
        groups = (rays.indirect_slot, indirect), (slot, light)
        planned = rays.directions, samples if sampling.direct == "maps" else rays.directions
        return _added_up(groups, planned, len(update.texel), world.fraction, traced)


@dataclass(frozen=True, kw_only=True)
class _Lit:
    """Shadow rays from what rays have met, K of them."""

    slot: np.ndarray  # (K,): which of the update's texels each belongs to
    rays: np.ndarray  # RAY (K,)
    light: np.ndarray  # (K, 3): what each contributes to the texel's irradiance if nothing blocks it


@dataclass(frozen=True, kw_only=True)
class _Paths:
    """Rays over the hemisphere on their way, each by itself: at most one of a wave belongs to a root."""

    root: np.ndarray  # (K,): the ray over the hemisphere that it goes on from
    rays: np.ndarray  # RAY (K,)
    weight: np.ndarray  # (K, 3): factor on what it brings
    key: np.ndarray  # (K,) uint32

    @classmethod
    def begin(cls, rays: TexelRays, update: Update) -> "_Paths":
        slot = rays.indirect_slot
        within = np.arange(len(slot)) - (np.cumsum(rays.directions) - rays.directions)[slot]
        return cls(
            root=np.arange(len(slot)),
            rays=rays.indirect,
            weight=np.ones((len(slot), 3), dtype=np.float32),
            key=hash_u32(update.texel[slot], update.number[slot], within, update.seed),
        )

    def add(self, radiance: np.ndarray, brought: np.ndarray) -> None:
        """Adds what they bring, (K, 3), to the radiance (R, 3) of the rays over the hemisphere."""
        radiance[self.root] = add(radiance[self.root], multiply(self.weight, brought))

    def lit(self, world: World, rays: TexelRays, hits: np.ndarray) -> _Lit:
        """The shadow rays of what they have met, HIT (K,): at most one of a path, which ends there."""
        direct = direct_at_hits(world.surfaces, world.lights, hits, hash_u32(self.key, _LIT))
        slot = rays.indirect_slot[self.root[direct.parent]]
        radiance = multiply(self.weight[direct.parent], direct.value)
        return _Lit(slot=slot, rays=direct.rays, light=indirect_share(radiance, rays.directions[slot]))

    def follow(self, onward: Onward) -> "_Paths":
        """The rays that go on from them."""
        weight = multiply(self.weight[onward.parent], onward.weight)
        return _Paths(root=self.root[onward.parent], rays=onward.rays, weight=weight, key=onward.key)

    def none(self) -> "_Paths":
        return _Paths(root=self.root[:0], rays=self.rays[:0], weight=self.weight[:0], key=self.key[:0])


def _added_up(
    groups: tuple[tuple[np.ndarray, np.ndarray], ...],
    planned: tuple[np.ndarray | int, ...],
    texels: int,
    fraction: int,
    traced: dict[str, int],
) -> Gathered:
    """Contributions by texel: of the paths, and of the shadow rays that arrived; slots (R,) and values (R, 3) of each.

    `planned`, (M,) or one for all, is how many of each kind a texel may have; those that are not there bring nothing.
    """
    sums = np.zeros(texels, dtype=SAMPLE_SUMS)
    slot, contribution = (np.concatenate(parts) for parts in zip(*groups, strict=True))
    sums["total"] = accumulate(slot, contribution, texels, fraction)
    for k, group in enumerate(groups):
        sums["sums"][:, k], sums["squares"][:, k] = luminance_sums(*group, texels, fraction)
        sums["rays"][:, k] = planned[k]
    return Gathered(sums=sums, fraction=fraction, rays=traced, clipped=beyond(contribution, fraction))
