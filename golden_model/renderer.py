"""The frame loop: each frame is rasterized and shaded from the lightmaps, and some of their texels are sampled anew.

A frame reads one version of the published maps and its rays' results go into a later one ([0085], a flip chain). So it
does not matter in which order shading and maintenance are done or how they overlap, and the hardware that does both at
once has the same bits. docs/renderer.md describes every stage.
"""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np

from lightloom.golden_model.charts.unwrap import unwrap
from lightloom.golden_model.driver.geometry import Geometries, collector_of
from lightloom.golden_model.driver.limits import require_affordable
from lightloom.golden_model.driver.predicted_view import predicted_view
from lightloom.golden_model.driver.report import Reporter
from lightloom.golden_model.driver.rest import at_rest, dark, settled
from lightloom.golden_model.engine.kernels import Kernels
from lightloom.golden_model.engine.maintainer import Maintainer, Maintenance
from lightloom.golden_model.engine.publishing.flip_chain import LONGEST, FlipChain
from lightloom.golden_model.engine.publishing.publisher import Publisher
from lightloom.golden_model.engine.sampling.accumulate import brightness_of, light_of
from lightloom.golden_model.engine.sampling.gather import World
from lightloom.golden_model.engine.sampling.settings import Sampling
from lightloom.golden_model.engine.selection.policy import Policy
from lightloom.golden_model.engine.selection.selector import FrameContext
from lightloom.golden_model.frame.compositor import MODES, blend_frame, show_beyond
from lightloom.golden_model.frame.frame_rays import FrameRayFigures, FrameRays, FrameShading
from lightloom.golden_model.frame.rasterizer import Mesh, RasterFigures, Rasterization, draw
from lightloom.golden_model.host.errors import InputError
from lightloom.golden_model.host.parameters import check, choice, number
from lightloom.golden_model.host.stopwatch import Stopwatch
from lightloom.golden_model.machine.budget_controller import BudgetController, BudgetPolicy, measure
from lightloom.golden_model.machine.cost_model import FrameCounts, Machine, RayCounts
from lightloom.golden_model.rays.collector import MAINTENANCE, Collector, Packing
from lightloom.golden_model.rays.surface_shading import Surfaces, ray_weights, readable, shade_fragments, shade_pixels
from lightloom.golden_model.rays.waves import Waves, run_together
from lightloom.golden_model.scene.light_unit import fraction_bits, in_unit, light_exponent
from lightloom.golden_model.scene.lights import lights_of
from lightloom.golden_model.scene.pose import back_rows_of, entrances, moved_records, scene_at
from lightloom.golden_model.scene.scene import Scene, require_light
from lightloom.golden_model.scene.textures import build_textures, texel_coordinates
from lightloom.golden_model.structures.forest import ForestOptions
from lightloom.golden_model.structures.structure import Structure
from lightloom.golden_model.tables.lightmap import Lightmaps
from lightloom.golden_model.tables.lights import Lights
from lightloom.golden_model.tables.pinhole import View, look_at
from lightloom.golden_model.tracing.recorder import TestRecorder


@dataclass(frozen=True, kw_only=True)
class Pipeline:
    """How frames are made."""

    raster: Rasterization = field(default_factory=Rasterization)
    """How visible surfaces are determined."""
    structure: ForestOptions = field(default_factory=ForestOptions)
    """How the acceleration structure follows what moves."""
    shading: FrameShading = field(default_factory=FrameShading)
    """The rays of the frame itself. Its `direct` must be that of the `Sampling`."""
    filtered: bool = True
    """Whether pixels read the lightmaps with their level of detail."""
    smoothing: bool = True
    """Whether pixels and rays read the maps smoothed by as much as each texel is uncertain; their averages are not."""
    packing: Packing = field(default_factory=Packing)
    """How the collector groups rays."""
    blend: str = choice("both", MODES, "Which parts of a picture the blender adds up.")
    versions: int = number(2, 1, LONGEST, "Length of the flip chain.")
    """What frame k's rays find is shown in frame k + versions - 1: 1 samples before the frame is shaded ([0085]), 2
    beside it, and each further one leaves a frame more time for it."""
    selects_by: str = choice("this", ("this", "before"), "Frame whose view and G-buffer selection looks at.")
    """As `Machine.early_selection` of the schedule. By the one before it waits for no rasterizer ([0052]), and misses
    what comes into sight with this one."""

    def __post_init__(self) -> None:
        check(self, "pipeline")


@dataclass(frozen=True)
class _Drawn:
    """What is seen in a frame."""

    frame: int
    scene: Scene
    lights: Lights
    view: View
    gbuffer: np.ndarray


@dataclass(frozen=True, kw_only=True)
class FrameResult:
    """One frame."""

    frame: int
    image: np.ndarray
    """Linear radiance, (H, W, 3) float32."""
    scene: Scene
    """The scene of this frame; its lights are in units of 2**`Renderer.exponent`."""
    view: View
    gbuffer: np.ndarray
    """GBUFFER (H, W)."""
    budget: int
    """Rays that its maintenance could spend."""
    maintenance: Maintenance
    """The updates made beside this frame; a later frame shows them."""
    frame_rays: FrameRayFigures
    """The rays of its own, which are not of the budget."""
    counts: FrameCounts
    """Its work, for `golden_model.machine.schedule`."""
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
        policy: Policy | None = None,
        pipeline: Pipeline | None = None,
        lightmaps: Lightmaps | None = None,
        machine: Machine | None = None,
        hold: BudgetPolicy | None = None,
        backend: str = "auto",
        threads: int = 1,
        recorder: TestRecorder | None = None,
        like: "Renderer | None" = None,
    ):
        """`budget` is the number of rays a frame; `lightmaps` default to `unwrap(scene)`; backend as for `trace`.

        The maps have no earlier version that the first frame could read, so it is made here: in up to
        `Sampling.priming` rounds, each within the budget of a frame. `priming` 0 starts with black maps.

        What `like` found in these rounds is taken over, with the same bits: a renderer that has drawn no frame yet, of
        the same scene, lightmaps, budget, seed and sampling, in which texels take their turns in the same order.

        With `hold` the budget follows the load, so that `machine` keeps a frame time ([0010]); `budget` is the first.

        Raises InputError for a budget that does not pay for one texel update, for a scene without light, and for what
        the camera, the charts and the tracer refuse.
        """
        self.sampling = sampling or Sampling()
        self.policy = policy or Policy()
        self.pipeline = pipeline or Pipeline()
        require_affordable(self.sampling, budget, scene)
        require_light(scene)
        if self.sampling.direct != self.pipeline.shading.direct:
            raise InputError("direct: texels and pixels must find direct light in the same way, by maps or by rays")
        self.exponent = light_exponent(scene)
        """Of the unit in which `scene`, the maintained texels and the published maps hold light; pictures do not."""
        scene = in_unit(scene, self.exponent)
        self.scene, self.width, self.height, self.seed = scene, width, height, seed
        early = self.pipeline.selects_by == "before"
        self.machine = machine or Machine(early_selection=int(early))
        if self.machine.early_selection != early:
            raise InputError("early selection: machine and pipeline must agree on whose surfaces selection looks at")
        self.budget = budget
        """Rays that the maintenance of the next frame may spend."""
        self._hold = None
        if hold is not None:
            require_affordable(self.sampling, hold.least, scene)
            self._hold = BudgetController(hold, budget)
            self.budget = self._hold.budget
        first = scene_at(scene, 0)
        self.structure = Structure(first, backend, recorder, threads, self.pipeline.structure)
        if lightmaps is None:
            # Looking for buried texels is no part of the render: its rays are not recorded.
            lightmaps = unwrap(scene, trace=Structure(scene, backend).trace)
        self.lightmaps = lightmaps
        self.geometries = Geometries(scene, lightmaps)
        self.textures = build_textures(scene.textures)
        self.fraction = fraction_bits(scene, self.sampling.balanced)
        kernels = Kernels(backend, threads)
        self.maintainer = Maintainer(lightmaps, self.sampling, self.policy, seed, kernels)
        self.reporter = Reporter(scene, self.policy)
        self.publisher = Publisher(lightmaps, kernels.smoother(lightmaps) if self.pipeline.smoothing else None)
        self.next_frame = 0
        """Number of the frame that `frame` renders next."""
        self.priming_rays = 0
        """Rays traced before the first frame."""
        self.priming_clipped = 0
        """What was too bright for the formats then, as `Maintenance.clipped`."""
        self._latest: _Drawn | None = None
        """The last frame; None before the first."""
        published = self._prime(first) if like is None else self._primed_like(like)
        self.chain = self._begun(published)

    @property
    def state(self) -> np.ndarray:
        """The maintained texels, TEXEL_STATE (N,)."""
        return self.maintainer.state

    @property
    def published(self) -> np.ndarray:
        """The newest version of the maps, PUBLISHED_TEXEL (texels of all levels,), in units of 2**`exponent`."""
        return self.chain.read(self.chain.newest)

    def _prime(self, scene: Scene) -> np.ndarray:
        """Samples what the first frames read: PUBLISHED_TEXEL (texels of all levels,).

        First the texels that one frame's budget pays for, a coarse lattice over all maps, are sampled over and over,
        each time anew from what the round before has published: one more bounce of light a round, until what is missing
        is too little to matter. Without this the texels of the first frames would hold less light than those sampled
        later, the lattice would be seen, and the averages would need a hundred updates to make up for it. Then the
        rounds go on to the texels that follow, and sample all of them anew, again and again, until that changes their
        light no more: what lights a scene is often small, or seen by nobody, and a coarse lattice knows little of it.
        From then on samples are averaged, up to `Sampling.primed` a texel: frames would flicker with the noise of one.
        """
        published = self.publisher.everything(self.state)
        totals: list[int] = []
        sweeps: list[int] = []
        order = self.maintainer.priming_order(self._world(scene, published))
        first = resting = rounds = 0
        while len(order) and rounds < self.sampling.priming and resting < self.sampling.primed:
            if first == 0:
                # All these take the same rays, so that their light can be compared.
                self.state["number"] = 0
            waiting = np.roll(order, -(first % len(order)))
            texels, published = self._round(scene, published, waiting, anew=not resting)
            rounds += 1
            totals.append(light_of(self.state["irradiance"][texels], self.fraction))
            if first == 0 and not (settled(totals) or dark(totals)):
                continue
            first += len(texels)
            if first // len(order) > len(sweeps):
                sweeps.append(brightness_of(self.state["irradiance"][order], self.fraction))
                resting += bool(resting or at_rest(sweeps, len(order)))
        return self._introduced(published, order, self.sampling.priming - rounds)

    def _round(
        self, scene: Scene, published: np.ndarray, waiting: np.ndarray, anew: bool
    ) -> tuple[np.ndarray, np.ndarray]:
        """One round of `_prime` on the first of the texels `waiting`: those sampled, and what is published then."""
        collector, clock = self._collector(scene), Stopwatch()
        world = self._world(scene, published)
        prime = self.maintainer.prime(world, waiting, anew, self.budget, collector, clock)
        (primed,) = run_together(collector, clock, prime)
        self.priming_rays += primed.rays
        self.priming_clipped += primed.clipped
        return primed.texels, self.publisher.everything(self.state)

    def _introduced(self, published: np.ndarray, known: np.ndarray, rounds: int) -> np.ndarray:
        """Samples what only comes into the scene later, in the frame in which it does, by at most so many rounds.

        Nothing would be known of it, and the first frame that sees it would show it black. `known` are the texels of
        the first frame, (V,). Returns what is published then.
        """
        seen = np.zeros(len(self.state), dtype=np.bool_)
        seen[known] = True
        later = entrances(self.scene)
        for frame in later:
            scene = scene_at(self.scene, frame)
            self.structure.update(scene)
            order = self.maintainer.priming_order(self._world(scene, published))
            new = order[~seen[order]]
            seen[new] = True
            for waiting in [new] * self.sampling.primed:
                while len(waiting) and rounds:
                    texels, published = self._round(scene, published, waiting, anew=False)
                    waiting, rounds = waiting[len(texels) :], rounds - 1
        if later:
            self.structure.update(scene_at(self.scene, 0))
        return published

    def _primed_like(self, other: "Renderer") -> np.ndarray:
        """As `_prime`, taken from another renderer."""
        if other.next_frame or not np.array_equal(other.maintainer.selector.order, self.maintainer.selector.order):
            raise ValueError("like: has drawn frames, or its texels take their turns in another order")
        self.state[:] = other.state
        self.priming_rays, self.priming_clipped = other.priming_rays, other.priming_clipped
        return self.publisher.everything(self.state)

    def _begun(self, published: np.ndarray) -> FlipChain:
        """The versions that are there before the first frame: all of them `published`."""
        chain = FlipChain(published, self.pipeline.versions)
        nothing = np.zeros(0, dtype=np.int64)
        for version in range(1, self.pipeline.versions - 1):
            chain.begin(version)
            chain.write(version, self.publisher.difference(published, self.state, nothing))
            chain.commit(version)
        return chain

    def _surfaces(self, scene: Scene, published: np.ndarray) -> Surfaces:
        """What the frame `scene` shades with, from a version of the maps."""
        geometry, coarse = self.geometries.at(scene)
        return Surfaces(
            geometry=geometry,
            coarse=coarse,
            lightmaps=self.lightmaps,
            irradiance=readable(published),
            textures=self.textures,
            filtered=self.pipeline.filtered,
        )

    def _world(self, scene: Scene, published: np.ndarray) -> World:
        """What maintenance meets in the frame `scene`."""
        return World(
            surfaces=self._surfaces(scene, published),
            lightmaps=moved_records(self.lightmaps, scene),
            lights=lights_of(scene),
            fraction=self.fraction,
            specular=scene.specular,
        )

    def _collector(self, scene: Scene) -> Collector:
        return collector_of(scene, self.structure.trace, self.pipeline.packing)

    def frame(self) -> FrameResult:
        """Renders the next frame of the sequence."""
        number = self.next_frame
        clock = Stopwatch()
        with clock("scene and structure"):
            scene = scene_at(self.scene, number)
            self.structure.update(scene)
            before = self.published
            world = self._world(scene, before)
            collector = self._collector(scene)
        with clock("rasterize"):
            camera = scene.camera
            view = look_at(camera.position, camera.target, camera.up, camera.fov_y_tan, self.width, self.height)
            raster = draw(view, self._mesh(scene), self.pipeline.raster)
        drawn = _Drawn(number, scene, world.lights, view, raster.gbuffer)
        looked_at = drawn if self.pipeline.selects_by == "this" else self._latest or drawn
        self._latest = drawn
        with clock("predict"):
            context = self._context(scene, world, looked_at, collector)
        maintain = self.maintainer.run(world, context, self.budget, collector, clock)
        if self.pipeline.versions == 1:
            # What this frame shows is only made by its own maintenance.
            (maintenance,) = run_together(collector, clock, maintain)
            published = self._commit(number, before, maintenance, clock)
            lightmap = self.chain.read(self._shown(number))
            ((image, rays),) = run_together(collector, clock, self._picture(lightmap, collector, clock))
        else:
            lightmap = self.chain.read(self._shown(number))
            picture = self._picture(lightmap, collector, clock)
            maintenance, (image, rays) = run_together(collector, clock, maintain, picture)
            published = self._commit(number, before, maintenance, clock)
        counts = self._counts(scene, raster.figures, rays, maintenance, published)
        budget = self.budget
        if self._hold is not None:
            self.budget = self._hold.observe(measure(self.machine, counts))
        self.next_frame += 1
        return FrameResult(
            frame=number,
            image=image,
            scene=scene,
            view=view,
            gbuffer=raster.gbuffer,
            budget=budget,
            maintenance=maintenance,
            frame_rays=rays,
            counts=counts,
            lightmap=lightmap,
            seconds=clock.seconds,
        )

    def _context(self, scene: Scene, world: World, drawn: _Drawn, collector: Collector) -> FrameContext:
        """What the selection of the next frame looks at, with the surfaces of the frame `drawn`."""
        frame = self.next_frame
        trace = partial(collector.now, MAINTENANCE)
        allowed = self.policy.selection_rays(self.budget, self.sampling.reserve(scene.specular))
        report = self.reporter.report(scene_at(self.scene, max(frame - 1, 0)), scene, trace, allowed)
        coming = predicted_view(scene, frame, self.width, self.height, self.policy)
        return FrameContext(
            frame=frame,
            report=report,
            lightmaps=world.lightmaps,
            state=self.state,
            values=world.surfaces.irradiance[: len(self.state)],
            view=drawn.view,
            gbuffer=drawn.gbuffer,
            predicted=None if coming is None else (coming, draw(coming, self._mesh(scene)).gbuffer),
            trace=trace,
        )

    def picture(self, result: FrameResult, published: np.ndarray) -> np.ndarray:
        """The last frame, which `result` is, as it would be with other maps: (H, W, 3) float32.

        `published` is PUBLISHED_TEXEL (texels of all levels,).
        """
        if result.frame != self.next_frame - 1:
            raise ValueError(f"frame {result.frame} is over: {self.next_frame - 1} is the last one")
        collector, clock = self._collector(result.scene), Stopwatch()
        ((image, _),) = run_together(collector, clock, self._picture(published, collector, clock))
        return image

    def _picture(
        self, published: np.ndarray, collector: Collector, clock: Stopwatch
    ) -> Waves[tuple[np.ndarray, FrameRayFigures]]:
        """The picture of the frame just drawn: what fragment shading finds, and what its rays add."""
        drawn = self._latest
        assert drawn is not None
        surfaces = self._surfaces(drawn.scene, published)
        seed, options = self.seed, self.pipeline.shading
        with clock("shade pixels"):
            raster = self._fragments(surfaces, drawn)
            show_beyond(raster, drawn.scene.environment, drawn.view, drawn.gbuffer)
            rays = FrameRays(
                surfaces,
                drawn.view,
                drawn.gbuffer,
                drawn.lights,
                self.fraction,
                options,
                beyond=drawn.scene.environment.seen,
                seed=seed,
                frame=drawn.frame,
            )
        while rays.emit(collector):
            yield
            with clock("shade rays"):
                rays.receive(collector)
        with clock("blend picture"):
            weight = ray_weights(surfaces, drawn.gbuffer)
            image = blend_frame(raster, rays.buffer.values(), weight, self.pipeline.blend)
            return np.ldexp(image, self.exponent), rays.figures

    def _fragments(self, surfaces: Surfaces, drawn: "_Drawn") -> np.ndarray:
        """What fragment shading finds at each pixel, (H, W, 3) float32.

        An immediate rasterizer shades while it draws: only there does it meet the fragments that others cover later.
        """
        if not self.pipeline.raster.deferred:
            shade = partial(shade_fragments, surfaces)
            image = draw(drawn.view, self._mesh(drawn.scene), self.pipeline.raster, shade).image
            assert image is not None
            return image
        return shade_pixels(surfaces, drawn.gbuffer)

    def _mesh(self, scene: Scene) -> Mesh:
        textured = scene.textures and (np.maximum(scene.texture, scene.emission_texture) >= 0).any()
        return Mesh(
            triangles=scene.triangles,
            normals=scene.normals,
            object_id=scene.object_id,
            lightmap_uv=self.lightmaps.uv,
            back_rows=back_rows_of(self.lightmaps, scene),
            texture_uv=texel_coordinates(scene, np.arange(len(scene.triangles))) if textured else None,
        )

    def _shown(self, frame: int) -> int:
        """The version that a frame's shading reads: its own number, or with a chain of one what its own rays found."""
        return frame + (self.pipeline.versions == 1)

    def _commit(self, frame: int, before: np.ndarray, done: Maintenance, clock: Stopwatch) -> int:
        """Puts what frame `frame` has changed into the version after the newest, which was `before`.

        The frame before is done. Returns how many texels are published.
        """
        with clock("publish"):
            if self._shown(frame):
                self.chain.release(self._shown(frame) - 1)
            version = self.chain.newest + 1
            self.chain.begin(version)
            difference = self.publisher.difference(before, self.state, np.concatenate([done.stale, done.texels]))
            self.chain.write(version, difference)
            self.chain.commit(version)
        return len(difference.texel)

    def _counts(
        self, scene: Scene, raster: RasterFigures, rays: FrameRayFigures, done: Maintenance, published: int
    ) -> FrameCounts:
        """The work of the frame just done."""
        before = scene_at(self.scene, max(self.next_frame - 1, 0))
        moved = (scene.rotation != before.rotation).any(axis=(1, 2)) | (scene.translation != before.translation).any(
            axis=1
        )
        trees = self.structure.figures()
        spent = Counter(done.rays)
        pixels = self.width * self.height
        return FrameCounts(
            moved=int(moved[scene.object_id].sum()),
            refitted=trees.refitted_triangles,
            rebuilt=trees.built_triangles,
            triangles=raster.set_up,
            fragments_tested=raster.tested,
            fragments_shaded=raster.shaded,
            frame_shader_pixels=pixels if self.pipeline.shading.direct == "rays" else 0,
            pixels=pixels,
            fragment_rays=RayCounts(closest=rays.specular, any_hit=rays.hit_shadow),
            frame_rays=RayCounts(any_hit=rays.shadow),
            lightmap_rays=RayCounts(
                closest=spent["indirect"] + spent["specular"] + spent["footprints"],
                any_hit=spent["shadow"] + spent["visibility"],
            ),
            scanned=2 * len(self.maintainer.selector.order),
            updates=len(done.texels),
            published=published,
        )


def render(scene: Scene, frames: int, **options: Any) -> Iterator[FrameResult]:
    """The first `frames` frames of a scene; options as for `Renderer`."""
    renderer = Renderer(scene, **options)
    for _ in range(frames):
        yield renderer.frame()
