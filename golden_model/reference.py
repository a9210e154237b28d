"""Converged lightmaps of the frames of a scene: what maintenance under a budget is compared with.

Every valid texel is sampled in rounds, each of which reads the maps that the rounds before have made: a bounce of light
a round. With few rays first, until the light of all maps together hardly changes any more, then with many: the mean of
these rounds counts. A frame starts from the maps of the frame that was asked for before it, so asking in order is
cheapest. This is no part of the frame loop and knows no budget.
"""

from dataclasses import replace

import numpy as np

from golden_model.accumulation import fraction_bits, light_of
from golden_model.collector import Collector
from golden_model.errors import InputError
from golden_model.formats import TEXEL_STATE
from golden_model.gather import Sampling, World, gather
from golden_model.lightmap import VALID, Lightmaps
from golden_model.lights import lights_of
from golden_model.motion import moved_records
from golden_model.publish import Publisher
from golden_model.sampling import Update
from golden_model.scene import Scene
from golden_model.shading import Surfaces, readable
from golden_model.stopwatch import Stopwatch
from golden_model.structure import Structure
from golden_model.textures import build_textures
from golden_model.waves import run_together

ROUNDS = 8
"""That are averaged."""
SETTLING = 32
"""Rounds before them, at most."""
SETTLING_DIRECTIONS = 16
"""Rays of a texel in each of those, at most."""
SETTLED_BITS = 11
"""They end when the light of all maps changes by less than 2**-SETTLED_BITS in a round."""
BATCH = 4096
"""Texels sampled at a time: bounds the memory."""


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

        Half as many light samples are taken. In a scene in which nothing but the camera moves, one frame serves for
        all. Raises InputError for another number of rays.
        """
        if rays & (rays - 1) or not ROUNDS <= rays <= ROUNDS * 4096:
            raise InputError(f"reference rays {rays}: must be a power of two, {ROUNDS} to {ROUNDS * 4096}")
        self.scene, self.lightmaps, self.seed = scene, lightmaps, seed
        directions = rays // ROUNDS
        self.sampling = Sampling(directions=directions, light_samples=max(directions // 2, 1))
        few = min(directions, SETTLING_DIRECTIONS)
        self.settling = replace(self.sampling, directions=few, light_samples=max(few // 2, 1))
        self.structure = Structure(scene.at(0), backend, None, threads)
        self.fraction = fraction_bits(scene, self.sampling.balanced)
        self.publisher = Publisher(lightmaps)
        self._published = self.publisher.everything(np.zeros(len(lightmaps.texels), dtype=TEXEL_STATE))
        self._frame: int | None = None

    def published(self, frame: int) -> np.ndarray:
        """The converged maps of a frame: PUBLISHED_TEXEL (texels of all levels,)."""
        if self._frame is None or (self.scene.dynamic and frame != self._frame):
            self._settle(frame)
            self._frame = frame
        return self._published

    def _settle(self, frame: int) -> None:
        scene = self.scene.at(frame)
        self.structure.update(scene)
        lightmaps = moved_records(self.lightmaps, scene)
        texel = np.flatnonzero(lightmaps.texels["state"] == VALID)
        state = np.zeros(len(lightmaps.texels), dtype=TEXEL_STATE)
        state["count"][texel] = 1
        surfaces = Surfaces(
            scene=scene,
            lightmaps=self.lightmaps,
            irradiance=readable(self._published),
            textures=build_textures(scene.textures),
        )
        lights = lights_of(scene)
        corners = scene.corners[scene.present[scene.object_id]]
        collector = Collector(self.structure.trace, corners.min(axis=(0, 1)), corners.max(axis=(0, 1)))
        total = np.zeros((len(texel), 3))
        light, settled, rounds = 0, False, 0
        number = 0
        while rounds < ROUNDS:
            world = World(surfaces=surfaces, lightmaps=lightmaps, lights=lights, fraction=self.fraction)
            settled = settled or number == SETTLING
            sample = self._round(world, collector, texel, number, self.sampling if settled else self.settling)
            if settled:
                total = total + sample
                rounds += 1
                sample = (total / rounds).astype(np.float32)
            before, light = light, light_of(sample, self.fraction)
            settled = settled or abs(light - before) << SETTLED_BITS <= light
            state["irradiance"][texel] = sample
            self._published = self.publisher.everything(state)
            surfaces = replace(surfaces, irradiance=readable(self._published))
            number += 1

    def _round(
        self, world: World, collector: Collector, texel: np.ndarray, number: int, sampling: Sampling
    ) -> np.ndarray:
        """A sample of the irradiance of each texel (M,), (M, 3) float32."""
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
