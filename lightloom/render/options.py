"""What `lightloom render` can be told."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from lightloom.golden_model.host.errors import InputError
from lightloom.shared.inputs import at_least, choose, require_exposure, require_samples, seed_value
from lightloom.shared.options import (
    Directions,
    Exposure,
    Folder,
    Json,
    LightSamples,
    Scene,
    Seed,
    Threads,
    Traversal,
)


@dataclass(frozen=True, kw_only=True)
class RenderOptions:
    """The options, in the order of the help text."""

    scene: Scene
    frames: Annotated[
        int | None, typer.Option("--frames", metavar="N", help="Frames to render; else the scene's own number, or 16.")
    ] = None
    budget: Annotated[
        int | None,
        typer.Option(
            "--budget",
            metavar="RAYS",
            help="Rays a frame may spend on the lightmaps; else the scene's, or 200000.",
        ),
    ] = None
    size: Annotated[
        str | None,
        typer.Option("--size", metavar="WxH", help="Width and height of a frame; else the scene's, or 512x512."),
    ] = None
    out: Folder = Path("build/render")
    seed: Seed = 0
    backend: Traversal = "auto"
    threads: Threads = 1
    policy: Annotated[
        str,
        typer.Option("--policy", metavar="NAME", help="What decides which texels are sampled; see below."),
    ] = "influence"
    directions: Directions = 16
    light_samples: LightSamples = 4
    direct: Annotated[
        str,
        typer.Option(
            "--direct", metavar="maps|rays", help="Direct light from the lightmaps, or by shadow rays from every pixel."
        ),
    ] = "maps"
    surfaces: Annotated[
        str, typer.Option("--surfaces", metavar="MODE", help="How visible surfaces are determined; see below.")
    ] = "tile-deferred"
    versions: Annotated[
        int, typer.Option("--versions", metavar="N", help="Versions of the lightmaps in the flip chain, 1 to 8.")
    ] = 2
    hold: Annotated[
        float | None,
        typer.Option(
            "--hold", metavar="FPS", help="Adapt the budget so that the modelled machine holds so many frames a second."
        ),
    ] = None
    view: Annotated[
        list[str] | None,
        typer.Option("--view", metavar="NAME", help="Show this on the scene too, as a film (repeatable); see below."),
    ] = None
    supersample: Annotated[
        int, typer.Option("--supersample", metavar="K", help="A PNG pixel is the mean of K x K rendered ones.")
    ] = 1
    exposure: Exposure = None
    exr: Annotated[bool, typer.Option("--exr", help="Write the radiance of each frame as EXR too.")] = False
    json: Json = False

    def check(self) -> None:
        """Raises InputError for what no scene can be rendered with."""
        from lightloom.golden_model.engine.publishing.flip_chain import LONGEST
        from lightloom.golden_model.engine.selection.policy import policy_of
        from lightloom.golden_model.frame.rasterizer import MODES
        from lightloom.golden_model.structures.structure import require_threads
        from lightloom.golden_model.tracing.bvh.traversal import BACKENDS
        from lightloom.render.policy_pictures import QUANTITIES

        choose(self.backend, BACKENDS, "backend")
        policy_of(self.policy)
        choose(self.surfaces, MODES, "mode of --surfaces")
        choose(self.direct, ("maps", "rays"), "value of --direct")
        for name in self.view or ():
            choose(name, [quantity.name for quantity in QUANTITIES], "view")
        require_threads(self.threads, "--threads")
        at_least(self.supersample, 1, "--supersample")
        if not 1 <= self.versions <= LONGEST:
            raise InputError(f"--versions {self.versions}: must be 1 to {LONGEST}")
        if self.hold is not None and not 0.01 <= self.hold <= 1e6:
            raise InputError(f"--hold {self.hold:g}: must be 0.01 to 1000000 frames a second")
        require_exposure(self.exposure)
        require_samples(self.directions, self.light_samples)
        seed_value(self.seed)
