"""The frame loop: each frame is rasterized and shaded from the lightmaps, and some of their texels are sampled anew.

Shading and indirect rays of a frame read the version of the maps published before it; what the frame's rays find goes
into the version after it ([0085]). So it does not matter which of the two is done first or how they overlap, and the
hardware that does both at once has the same bits. docs/renderer.md describes every stage.
"""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np

from golden_model.accumulation import accumulate, fraction_bits, irradiance
from golden_model.blend import ALPHA_MIN, blend_texels
from golden_model.bvh import build
from golden_model.camera import look_at
from golden_model.charts import unwrap
from golden_model.directions import COUNT
from golden_model.errors import InputError
from golden_model.formats import TEXEL_STATE
from golden_model.lightmap import Lightmaps
from golden_model.lights import lights_of
from golden_model.publish import publish
from golden_model.rasterizer import rasterize
from golden_model.recorder import TestRecorder
from golden_model.sampling import Update, indirect_rays, indirect_share, shadow_rays
from golden_model.scene import Scene, require_light
from golden_model.selection import RoundRobin, coarse_to_fine
from golden_model.shading import readable, shade_hits, shade_pixels
from golden_model.traversal import trace


@dataclass(frozen=True, kw_only=True)
class Sampling:
    """What one texel update is made of."""

    directions: int = 16
    """Rays for indirect light, a power of two up to 4096."""
    light_samples: int = 4
    """Shadow rays at most, at least 1."""
    alpha_min: np.float32 = ALPHA_MIN
    """Smallest weight of a new sample against the old value, 0 to 1."""
    priming: int = 5
    """Rounds before the first frame, each within one frame's budget; see `Renderer`."""

    def __post_init__(self) -> None:
        if self.directions & (self.directions - 1) or not 1 <= self.directions <= COUNT:
            raise InputError(f"directions {self.directions}: must be a power of two, 1 to {COUNT}")
        if self.light_samples < 1:
            raise InputError(f"light samples {self.light_samples}: must be 1 or more")
        if self.priming < 0:
            raise InputError(f"priming {self.priming}: must be 0 or more")
        if not 0 <= self.alpha_min <= 1:
            raise InputError(f"alpha_min {self.alpha_min}: must be 0 to 1")

    @property
    def cost(self) -> int:
        """Rays that the budget reserves for an update. Shadow rays that cannot carry light are not traced."""
        return self.directions + self.light_samples

    def require(self, budget: int) -> None:
        """Raises InputError for a budget of rays a frame that does not pay for one update."""
        if budget < self.cost:
            raise InputError(f"--budget {budget}: one texel update takes {self.cost} rays; give at least as many")


@dataclass(frozen=True, kw_only=True)
class Maintenance:
    """What one frame did to the lightmaps."""

    texels: np.ndarray
    """Numbers of the texels updated, (M,) int64."""
    rays: dict[str, int]
    """Rays traced by kind: "indirect", "shadow"; together at most the budget."""


@dataclass(frozen=True, kw_only=True)
class FrameResult:
    """One frame."""

    frame: int
    image: np.ndarray
    """Linear radiance, (H, W, 3) float32."""
    gbuffer: np.ndarray
    """GBUFFER (H, W)."""
    maintenance: Maintenance
    """The update made beside this frame; the next frame shows it."""
    lightmap: np.ndarray
    """The version that this frame read: PUBLISHED_TEXEL (N,)."""
    seconds: dict[str, float] = field(default_factory=dict)
    """Time taken by stage, in order."""


class Renderer:
    """A scene, its lightmaps and their state over a sequence of frames."""

    def __init__(
        self,
        scene: Scene,
        *,
        width: int,
        height: int,
        budget: int,
        seed: int = 0,
        sampling: Sampling | None = None,
        lightmaps: Lightmaps | None = None,
        backend: str = "auto",
        recorder: TestRecorder | None = None,
    ):
        """`budget` is the number of rays a frame; `lightmaps` default to `unwrap(scene)`; backend as for `trace`.

        The maps have no earlier version that the first frame could read, so it is made here: in `Sampling.priming`
        rounds, each within the budget of a frame. `priming` 0 starts with black maps.

        Raises InputError for a budget that does not pay for one texel update, for a scene without light, and for what
        the camera, the charts and the tracer refuse.
        """
        self.sampling = sampling or Sampling()
        self.sampling.require(budget)
        require_light(scene)
        self.scene, self.width, self.height, self.budget, self.seed = scene, width, height, budget, seed
        bvh = build(scene.triangles)
        self.trace = partial(trace, bvh, backend=backend, recorder=recorder)
        # Looking for buried texels is no part of the render: its rays are not recorded.
        self.lightmaps = unwrap(scene, trace=partial(trace, bvh, backend=backend)) if lightmaps is None else lightmaps
        self.lights = lights_of(scene)
        self.fraction = fraction_bits(scene)
        self.selection = RoundRobin(coarse_to_fine(self.lightmaps))
        self.state = np.zeros(len(self.lightmaps.texels), dtype=TEXEL_STATE)
        """The maintained texels, TEXEL_STATE (N,)."""
        self.published = publish(self.lightmaps, self.state)
        """The version that the next frame reads, PUBLISHED_TEXEL (N,)."""
        self.next_frame = 0
        """Number of the frame that `frame` renders next."""
        self.priming_rays = self._prime()
        """Rays traced before the first frame."""

    def _prime(self) -> int:
        """Makes the version that the first frame reads; returns the rays traced.

        The texels that one frame's budget pays for, a coarse lattice over all maps, are sampled `priming` times over,
        each time anew from what the round before has published: one more bounce of light a round. Without this the
        texels of the first frames would hold less light than those sampled later, and the lattice would be seen.
        """
        rays = 0
        for _ in range(self.sampling.priming):
            self.state["count"] = 0
            self.state["number"] = 0
            self.selection.next = 0
            done = self._maintain(readable(self.published), 0, _Stopwatch())
            self.published = publish(self.lightmaps, self.state)
            rays += sum(done.rays.values())
        return rays

    def frame(self) -> FrameResult:
        """Renders the next frame of the sequence."""
        number = self.next_frame
        clock = _Stopwatch()
        lightmap = self.published
        with clock("rasterize"):
            camera = self.scene.camera_at(number)
            view = look_at(camera.position, camera.target, camera.up, camera.fov_y_tan, self.width, self.height)
            scene, maps = self.scene, self.lightmaps
            gbuffer = rasterize(view, scene.triangles, scene.normals, scene.object_id, maps.uv)
        with clock("shade pixels"):
            values = readable(lightmap)
            image = shade_pixels(scene, maps, values, gbuffer)
        maintenance = self._maintain(values, number, clock)
        with clock("publish"):
            self.published = publish(maps, self.state)
        self.next_frame += 1
        return FrameResult(
            frame=number,
            image=image,
            gbuffer=gbuffer,
            maintenance=maintenance,
            lightmap=lightmap,
            seconds=clock.seconds,
        )

    def _maintain(self, values: np.ndarray, frame: int, clock: "_Stopwatch") -> Maintenance:
        """Updates texels within the budget; indirect rays read the maps `values` (N, 3) float32."""
        scene, sampling = self.scene, self.sampling
        with clock("select"):
            texel = self.selection.select(self.budget, sampling.cost)
            update = Update(
                texel=texel,
                record=self.lightmaps.texels[texel],
                number=self.state["number"][texel],
                seed=self.seed,
            )
        slot = np.arange(len(texel))
        with clock("generate rays"):
            rays = indirect_rays(update, sampling.directions, self.lights.offset)
            shadow, light = shadow_rays(update, self.lights, sampling.light_samples)
            carrying = np.flatnonzero(light.any(axis=1))
        with clock("trace indirect"):
            hits = self.trace(rays)
        with clock("trace shadow"):
            blocked = self.trace(shadow[carrying], any_hit=True)["primitive"] >= 0
        with clock("shade rays"):
            indirect = indirect_share(shade_hits(scene, self.lightmaps, values, hits), sampling.directions)
        with clock("accumulate"):
            arrived = carrying[~blocked]
            total = accumulate(
                np.concatenate([np.repeat(slot, sampling.directions), arrived // sampling.light_samples]),
                np.concatenate([indirect, light[arrived]]),
                len(texel),
                self.fraction,
            )
        with clock("blend"):
            sample = irradiance(total, self.fraction)
            blend_texels(self.state, texel, sample, sampling.alpha_min, frame)
        return Maintenance(texels=texel, rays={"indirect": len(rays), "shadow": len(carrying)})


def render(scene: Scene, frames: int, **options: Any) -> Iterator[FrameResult]:
    """The first `frames` frames of a scene; options as for `Renderer`."""
    renderer = Renderer(scene, **options)
    for _ in range(frames):
        yield renderer.frame()


class _Stopwatch:
    """Adds up the time of each stage."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}

    @contextmanager
    def __call__(self, stage: str) -> Iterator[None]:
        start = time.perf_counter()
        yield
        self.seconds[stage] = self.seconds.get(stage, 0.0) + time.perf_counter() - start
