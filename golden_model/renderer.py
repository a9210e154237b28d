"""The frame loop: each frame is rasterized and shaded from the lightmaps, and some of their texels are sampled anew.

A frame reads one version of the published maps and its rays' results go into a later one ([0085], a flip chain). So it
does not matter in which order shading and maintenance are done or how they overlap, and the hardware that does both at
once has the same bits. docs/renderer.md describes every stage.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from golden_model.accumulation import fraction_bits, light_of, settled
from golden_model.camera import View, look_at
from golden_model.charts import unwrap
from golden_model.flip_chain import FlipChain
from golden_model.forest import ForestOptions
from golden_model.gather import Sampling, World
from golden_model.lightmap import Lightmaps
from golden_model.lights import lights_of
from golden_model.maintenance import Maintainer, Maintenance
from golden_model.motion import moved_records
from golden_model.publish import Difference, Publisher
from golden_model.rasterizer import Mesh, Rasterization, draw
from golden_model.recorder import TestRecorder
from golden_model.scene import Scene, require_light
from golden_model.shading import readable, shade_pixels
from golden_model.stopwatch import Stopwatch
from golden_model.structure import Structure


@dataclass(frozen=True, kw_only=True)
class Pipeline:
    """How frames are made."""

    raster: Rasterization = field(default_factory=Rasterization)
    """How visible surfaces are determined."""
    structure: ForestOptions = field(default_factory=ForestOptions)
    """How the acceleration structure follows what moves."""
    versions: int = 2
    """Length of the flip chain, 1 to 8. What frame k's rays find is shown in frame k + versions - 1: 1 samples before
    the frame is shaded ([0085]), 2 beside it, and each further one leaves a frame more time for it."""


@dataclass(frozen=True, kw_only=True)
class FrameResult:
    """One frame."""

    frame: int
    image: np.ndarray
    """Linear radiance, (H, W, 3) float32."""
    scene: Scene
    """The scene of this frame."""
    view: View
    gbuffer: np.ndarray
    """GBUFFER (H, W)."""
    maintenance: Maintenance
    """The updates made beside this frame; a later frame shows them."""
    lightmap: np.ndarray
    """The version that this frame read: PUBLISHED_TEXEL (texels of all levels,), read-only."""
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
        pipeline: Pipeline | None = None,
        lightmaps: Lightmaps | None = None,
        backend: str = "auto",
        threads: int = 1,
        recorder: TestRecorder | None = None,
    ):
        """`budget` is the number of rays a frame; `lightmaps` default to `unwrap(scene)`; backend as for `trace`.

        The maps have no earlier version that the first frame could read, so it is made here: in up to `Sampling.priming`
        rounds, each within the budget of a frame. `priming` 0 starts with black maps.

        Raises InputError for a budget that does not pay for one texel update, for a scene without light, and for what
        the camera, the charts and the tracer refuse.
        """
        self.sampling = sampling or Sampling()
        self.pipeline = pipeline or Pipeline()
        self.sampling.require(budget)
        require_light(scene)
        self.scene, self.width, self.height, self.budget, self.seed = scene, width, height, budget, seed
        first = scene.at(0)
        self.structure = Structure(first, backend, recorder, threads, self.pipeline.structure)
        if lightmaps is None:
            # Looking for buried texels is no part of the render: its rays are not recorded.
            lightmaps = unwrap(scene, trace=Structure(scene, backend).trace)
        self.lightmaps = lightmaps
        self.fraction = fraction_bits(scene, self.sampling.balanced)
        self.maintainer = Maintainer(lightmaps, self.sampling, seed)
        self.publisher = Publisher(lightmaps)
        self.next_frame = 0
        """Number of the frame that `frame` renders next."""
        self.priming_rays = 0
        """Rays traced before the first frame."""
        self.chain = self._prime(first)

    @property
    def state(self) -> np.ndarray:
        """The maintained texels, TEXEL_STATE (N,)."""
        return self.maintainer.state

    @property
    def published(self) -> np.ndarray:
        """The newest version of the maps, PUBLISHED_TEXEL (texels of all levels,)."""
        return self.chain.read(self.chain.newest)

    def _prime(self, scene: Scene) -> FlipChain:
        """Makes the version that the first frames read.

        The texels that one frame's budget pays for, a coarse lattice over all maps, are sampled `priming` times over,
        each time anew from what the round before has published: one more bounce of light a round, until what is missing
        is too little to matter. Without this the texels of the first frames would hold less light than those sampled
        later, the lattice would be seen, and the averages would need a hundred updates to make up for it.
        """
        published = self.publisher.everything(self.state)
        totals: list[int] = []
        for _ in range(self.sampling.priming):
            done = self.maintainer.prime(self._world(scene, readable(published)), self.budget)
            published = self.publisher.everything(self.state)
            self.priming_rays += sum(done.rays.values())
            totals.append(light_of(self.state["irradiance"][done.texels], self.fraction))
            if settled(totals):
                break
        chain = FlipChain(published, self.pipeline.versions)
        nothing = np.zeros(0, dtype=np.int64)
        for version in range(1, self.pipeline.versions - 1):
            chain.begin(version)
            chain.write(version, self.publisher.difference(published, self.state, nothing))
            chain.commit(version)
        return chain

    def _world(self, scene: Scene, values: np.ndarray) -> World:
        return World(
            scene=scene,
            lightmaps=moved_records(self.lightmaps, scene),
            values=values,
            lights=lights_of(scene),
            trace=self.structure.trace,
            fraction=self.fraction,
        )

    def frame(self) -> FrameResult:
        """Renders the next frame of the sequence."""
        number = self.next_frame
        clock = Stopwatch()
        with clock("scene and structure"):
            scene = self.scene.at(number)
            self.structure.update(scene)
            before = self.published
            world = self._world(scene, readable(before))
        with clock("rasterize"):
            camera = scene.camera
            view = look_at(camera.position, camera.target, camera.up, camera.fov_y_tan, self.width, self.height)
            gbuffer = draw(view, self._mesh(scene), self.pipeline.raster).gbuffer
        maintenance = self.maintainer.run(world, number, self.budget, clock)
        with clock("publish"):
            self._commit(number, self.publisher.difference(before, self.state, maintenance.texels))
        with clock("shade pixels"):
            lightmap = self.chain.read(self._shown(number))
            image = shade_pixels(scene, self.lightmaps, readable(lightmap), gbuffer)
        self.next_frame += 1
        return FrameResult(
            frame=number,
            image=image,
            scene=scene,
            view=view,
            gbuffer=gbuffer,
            maintenance=maintenance,
            lightmap=lightmap,
            seconds=clock.seconds,
        )

    def _mesh(self, scene: Scene) -> Mesh:
        return Mesh(
            triangles=scene.triangles,
            normals=scene.normals,
            object_id=scene.object_id,
            lightmap_uv=self.lightmaps.uv,
        )

    def _shown(self, frame: int) -> int:
        """The version that a frame's shading reads: its own number, or with a chain of one what its own rays found."""
        return frame + (self.pipeline.versions == 1)

    def _commit(self, frame: int, difference: Difference) -> None:
        """Puts what frame `frame` has changed into the version after the newest; the frame before is done."""
        if self._shown(frame):
            self.chain.release(self._shown(frame) - 1)
        version = self.chain.newest + 1
        self.chain.begin(version)
        self.chain.write(version, difference)
        self.chain.commit(version)


def render(scene: Scene, frames: int, **options: Any) -> Iterator[FrameResult]:
    """The first `frames` frames of a scene; options as for `Renderer`."""
    renderer = Renderer(scene, **options)
    for _ in range(frames):
        yield renderer.frame()
