"""From the options of `lightloom render` to a renderer: what is rendered and how, decided before anything is made."""

from dataclasses import dataclass
from typing import Any

from lightloom.golden_model.charts.curved import default_cache
from lightloom.golden_model.charts.unwrap import unwrap
from lightloom.golden_model.driver.limits import require_affordable
from lightloom.golden_model.engine.sampling.settings import Sampling
from lightloom.golden_model.engine.selection.policy import policy_of
from lightloom.golden_model.frame.frame_rays import FrameShading
from lightloom.golden_model.frame.rasterizer import Rasterization
from lightloom.golden_model.machine.budget_controller import BudgetPolicy
from lightloom.golden_model.machine.cost_model import Machine
from lightloom.golden_model.renderer import Pipeline, Renderer
from lightloom.golden_model.scene.files.load import load_scene
from lightloom.golden_model.scene.scene import Scene, require_light
from lightloom.golden_model.structures.structure import Structure
from lightloom.golden_model.tables.lightmap import Lightmaps
from lightloom.render.options import RenderOptions
from lightloom.render.sequence import Pictures
from lightloom.shared.inputs import at_least, image_size

FRAMES, BUDGET, SIZE = 16, 200_000, (512, 512)
"""Where neither the options nor the scene say anything."""


@dataclass(frozen=True, kw_only=True)
class Plan:
    """A scene and what the options make of it."""

    options: RenderOptions
    scene: Scene
    frames: int
    size: tuple[int, int]
    """Width and height of a picture."""
    budget: int
    """Rays a frame; the first frame's, with `hold`."""
    sampling: Sampling

    def lightmaps(self) -> Lightmaps:
        """The scene's lightmaps, those of curved meshes from the cache where it has them."""
        return unwrap(self.scene, trace=Structure(self.scene, self.options.backend).trace, cache=default_cache())

    def renderer(self, lightmaps: Lightmaps) -> Renderer:
        """The renderer, with light in its first version of the lightmaps."""
        options, (width, height) = self.options, self.size
        machine = Machine(versions=max(options.versions, 2))
        return Renderer(
            self.scene,
            width=width * options.supersample,
            height=height * options.supersample,
            budget=self.budget,
            seed=options.seed,
            sampling=self.sampling,
            policy=policy_of(options.policy),
            pipeline=Pipeline(
                raster=Rasterization(mode=options.surfaces),
                shading=FrameShading(direct=self.sampling.direct),
                versions=options.versions,
            ),
            machine=machine,
            hold=self._hold(machine),
            lightmaps=lightmaps,
            backend=options.backend,
            threads=options.threads,
        )

    def _hold(self, machine: Machine) -> BudgetPolicy | None:
        """The policy by which the budget holds the frame rate that is asked for, if one is."""
        if self.options.hold is None:
            return None
        target = max(round(machine.clock_hz / self.options.hold), 1)
        return BudgetPolicy(target=target, least=self.sampling.reserve(self.scene.specular))

    @property
    def pictures(self) -> Pictures:
        """What is written of each frame."""
        options = self.options
        return Pictures(
            supersample=options.supersample,
            exposure=options.exposure,
            exr=options.exr,
            views=tuple(options.view or ()),
        )


def plan(options: RenderOptions) -> Plan:
    """Reads the scene and settles what the options leave to it. Raises InputError for what cannot be rendered."""
    options.check()
    direct: Any = options.direct
    sampling = Sampling(directions=options.directions, light_samples=options.light_samples, direct=direct)
    scene = load_scene(options.scene)
    own = scene.render
    planned = Plan(
        options=options,
        scene=scene,
        frames=at_least(options.frames if options.frames is not None else own.frames or FRAMES, 1, "--frames"),
        budget=options.budget if options.budget is not None else own.budget or BUDGET,
        size=image_size(options.size or "{}x{}".format(*(own.size or SIZE)), options.supersample),
        sampling=sampling,
    )
    require_light(scene)  # before the charts, which may take a while
    require_affordable(sampling, planned.budget, scene)
    return planned
