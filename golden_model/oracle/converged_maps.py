"""Converged lightmaps of the frames of a scene: what maintenance under a budget is compared with.

Every valid texel is sampled in rounds, each of which reads the maps that the rounds before have made: a bounce of light
a round. With few rays first, until the light of all maps together hardly changes any more; then the mean of further
rounds counts, of many rays for the texels that are looked at. A frame starts from the maps of the frame that was asked
for before it, so asking in order is cheapest. This is no part of the frame loop and knows no budget.
"""

from dataclasses import replace

import numpy as np

from lightloom.golden_model.contract.formats import TEXEL_STATE
from lightloom.golden_model.driver.geometry import Geometries, collector_of
from lightloom.golden_model.engine.publishing.publisher import Publisher
from lightloom.golden_model.engine.sampling.accumulate import light_of
from lightloom.golden_model.engine.sampling.gather import World, gather
from lightloom.golden_model.engine.sampling.settings import Sampling
from lightloom.golden_model.engine.sampling.texel_rays import Update
from lightloom.golden_model.host.errors import InputError
from lightloom.golden_model.host.stopwatch import Stopwatch
from lightloom.golden_model.rays.surface_shading import Surfaces, readable
from lightloom.golden_model.rays.waves import run_together
from lightloom.golden_model.scene.light_unit import fraction_bits, in_unit, light_exponent
from lightloom.golden_model.scene.lights import lights_of
from lightloom.golden_model.scene.pose import moved_records, scene_at, state_of
from lightloom.golden_model.scene.scene import Scene
from lightloom.golden_model.scene.textures import build_textures
from lightloom.golden_model.structures.structure import Structure
from lightloom.golden_model.tables.lightmap import VALID, Lightmaps

ROUNDS = 8
"""That are averaged."""
SETTLING = 32
"""Rounds before them, at most."""
COARSE_RAYS = 128
"""Rays for indirect light of a texel that nobody looks at, in all rounds that are averaged."""
SETTLED_BITS = 11
"""They end when the light of all maps changes by less than 2**-SETTLED_BITS in a round."""
BATCH = 4096
"""Texels sampled at a time: bounds the memory."""


def require_rays(rays: int, called: str) -> None:
    """Raises InputError for a number of rays that a reference cannot have; `called` is what the user knows it by."""
    if rays & (rays - 1) or not ROUNDS <= rays <= ROUNDS * 4096:
        raise InputError(f"{called} {rays}: must be a power of two, {ROUNDS} to {ROUNDS * 4096}")


class Reference:
    """Converged maps, frame by frame."""

    def __init__(
        self,
        scene: Scene,
        lightmaps: Lightmaps,
        *,
        rays: int = 512,
        seed: int = 0,
        backend: str = "auto",
        threads: int = 1,
    ):
        """`lightmaps` as for `Renderer`. `rays` for indirect light a texel and frame: a power of two, 8 to 32768.

        Half as many light samples are taken. A frame that differs in nothing but the camera from the one that was asked
        for before it is served by the same maps. Raises InputError for another number of rays.
        """
        require_rays(rays, "reference rays")
        scene = in_unit(scene, light_exponent(scene))
        self.scene, self.lightmaps, self.seed = scene, lightmaps, seed
        directions = rays // ROUNDS
        self.sampling = Sampling(directions=directions, light_samples=max(directions // 2, 1))
        few = min(directions, COARSE_RAYS // ROUNDS)
        self.coarse = replace(self.sampling, directions=few, light_samples=max(few // 2, 1))
        self.structure = Structure(scene_at(scene, 0), backend, None, threads)
        self.fraction = fraction_bits(scene, self.sampling.balanced)
        self._geometries = Geometries(scene, lightmaps)
        self.publisher = Publisher(lightmaps)
        self._published = self.publisher.everything(np.zeros(len(lightmaps.texels), dtype=TEXEL_STATE))
        self._settled: tuple[bytes, ...] | None = None
        """What the maps are settled for (`state_of`)."""
        self._state = np.zeros(len(lightmaps.texels), dtype=TEXEL_STATE)

    def published(self, frame: int, precise: np.ndarray | None = None) -> np.ndarray:
        """The converged maps of a frame: PUBLISHED_TEXEL (texels of all levels,), in the scene's unit of light.

        `precise` names the texels that are looked at, (K,): these get all rays, the others `COARSE_RAYS` at most,
        enough for what they send on to many. None: all texels are precise.
        """
        now = state_of(scene_at(self.scene, frame))
        if now != self._settled:
            self._settle(frame)
            self._settled = now
        wanted = self._valid.copy()
        if precise is not None:
            wanted[:] = False
            wanted[precise] = True
            wanted &= self._valid
        texel = np.flatnonzero(wanted & ~self._precise)
        if len(texel):
            # They read the settled maps, not each other.
            self._state["irradiance"][texel] = self._mean(self._world, texel, self.sampling)
            self._precise[texel] = True
            self._published = self.publisher.everything(self._state)
        return self._published

    def _settle(self, frame: int) -> None:
        scene = scene_at(self.scene, frame)
        self._scene = scene
        self.structure.update(scene)
        lightmaps = moved_records(self.lightmaps, scene)
        self._valid = lightmaps.texels["state"] == VALID
        self._precise = np.zeros_like(self._valid)
        texel = np.flatnonzero(self._valid)
        self._state["count"] = self._valid
        world = World(
            surfaces=Surfaces(
                geometry=self._geometries.at(scene)[0],
                lightmaps=self.lightmaps,
                irradiance=readable(self._published),
                textures=build_textures(scene.textures),
            ),
            lightmaps=lightmaps,
            lights=lights_of(scene),
            fraction=self.fraction,
            specular=scene.specular,
        )
        light = 0
        for number in range(SETTLING):
            sample = self._round(world, texel, number, self.coarse)
            world = self._with_maps(world, texel, sample)
            before, light = light, light_of(sample, self.fraction)
            if abs(light - before) << SETTLED_BITS <= light:
                break
        self._world = self._with_maps(world, texel, self._mean(world, texel, self.coarse))

    def _with_maps(self, world: World, texel: np.ndarray, irradiance: np.ndarray) -> World:
        """The world whose maps hold the irradiance (M, 3) of texels (M,)."""
        self._state["irradiance"][texel] = irradiance
        self._published = self.publisher.everything(self._state)
        return replace(world, surfaces=replace(world.surfaces, irradiance=readable(self._published)))

    def _mean(self, world: World, texel: np.ndarray, sampling: Sampling) -> np.ndarray:
        """The mean of `ROUNDS` samples of each texel (M,), (M, 3) float32."""
        total = np.zeros((len(texel), 3))
        for number in range(ROUNDS):
            total = total + self._round(world, texel, number, sampling)
        return (total / ROUNDS).astype(np.float32)

    def _round(self, world: World, texel: np.ndarray, number: int, sampling: Sampling) -> np.ndarray:
        """A sample of the irradiance of each texel (M,), (M, 3) float32."""
        collector = collector_of(self._scene, self.structure.trace)
        parts = [np.zeros((0, 3), dtype=np.float32)]
        for begin in range(0, len(texel), BATCH):
            part = texel[begin : begin + BATCH]
            update = Update(
                texel=part,
                record=world.lightmaps.texels[part],
                number=np.full(len(part), number),
                seed=self.seed,
            )
            clock = Stopwatch()
            (gathered,) = run_together(collector, clock, gather(world, update, sampling, collector, clock))
            parts.append(gathered.irradiance)
        return np.concatenate(parts)
