"""The whole chain on real input: a render, its Verilog, and the proof that the two agree, in one folder."""

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lightloom.golden_model.driver.limits import require_affordable
from lightloom.golden_model.host.outputs import whole_folder
from lightloom.shared.console import Progress, json_text

if TYPE_CHECKING:
    from lightloom.golden_model.engine.sampling.settings import Sampling
    from lightloom.golden_model.scene.scene import Scene
    from lightloom.golden_model.tracing.recorder import TestRecorder

UNIT = "ray_triangle"
PRESET = "base"


@dataclass(frozen=True, kw_only=True)
class DemoOptions:
    """What `lightloom demo` can be told."""

    frames: int = 30
    width: int = 480
    height: int = 480
    supersample: int = 2
    budget: int = 400_000
    """Rays a frame."""
    directions: int = 64
    """Rays for indirect light in a texel update."""
    light_samples: int = 8
    """Shadow rays in a texel update."""
    replay_limit: int = 2_000_000
    """Tests replayed at most; of more, a seeded sample of this size."""
    seed: int = 1

    @property
    def command(self) -> str:
        """The command line that does the same again."""
        return (
            f"lightloom demo --frames {self.frames} --size {self.width}x{self.height} --budget {self.budget} "
            f"--replay-limit {self.replay_limit} --seed {self.seed}"
        )


def demo(options: DemoOptions, out: Path, progress: Progress) -> dict[str, Any]:
    """Writes the demo's folder, whole or not at all, and returns what is in its report.json."""
    from lightloom.gen.pages.report import report_page
    from lightloom.golden_model.engine.sampling.settings import Sampling
    from lightloom.golden_model.scene.files.load import load_scene
    from lightloom.golden_model.tracing.bvh.traversal import backend_of
    from lightloom.golden_model.tracing.recorder import TestRecorder
    from lightloom.hardware.describe import emit_units
    from lightloom.hardware.replay import replay
    from lightloom.render.sequence import looped
    from lightloom.rtl.catalogue import CATALOGUE
    from lightloom.rtl.config import PRESETS
    from lightloom.shared.provenance import machine, versions
    from lightloom.sim.bulk import BulkUnit
    from lightloom.sim.toolchain import compiler, verilator

    sampling = Sampling(directions=options.directions, light_samples=options.light_samples)
    scene = looped(load_scene("cornell-box"), options.frames)
    require_affordable(sampling, options.budget, scene)
    verilator(), compiler()  # what is missing is better known before the render than after it
    with whole_folder(out) as folder:
        recorder = TestRecorder(options.replay_limit, options.seed)
        rendered = _rendered(options, scene, sampling, recorder, folder, progress)
        units = list(CATALOGUE)
        with progress.stage("Verilog of all units", len(units)) as advance:
            emitted = emit_units(units, PRESET, folder / "verilog", advance)
        with progress.stage("Simulator of ray_triangle"):
            simulated = BulkUnit(UNIT, PRESETS[PRESET])

        with progress.stage("Replay through the Verilog", min(recorder.total, options.replay_limit)) as advance:
            outcome = replay(UNIT, recorder.sample(), simulated, advance)

        report = {
            "replayed": outcome.replayed,
            "mismatches": outcome.mismatches,
            "tests": recorder.total,
            "rays_traced": recorder.rays,
            "nodes_visited": recorder.nodes,
            "sampled": recorder.total > outcome.replayed,
            "replay": outcome.as_dict(),
            "render": {**rendered, "backend": backend_of("auto")},
            "units": emitted,
            "preset": PRESET,
            "config": asdict(PRESETS[PRESET]),
            "options": asdict(options),
            "command": options.command,
            "seconds": dict(progress.seconds),
            "versions": versions(),
            "machine": machine(),
        }
        with progress.stage("Report"):
            (folder / "report.json").write_text(json_text(report))
            (folder / "report.html").write_text(report_page(report, folder), encoding="utf-8")
    return report


def _rendered(
    options: DemoOptions,
    scene: "Scene",
    sampling: "Sampling",
    recorder: "TestRecorder",
    folder: Path,
    progress: Progress,
) -> dict[str, Any]:
    """Renders the frames into the folder, while the recorder takes down tests; the figures of the render."""
    from lightloom.golden_model.renderer import Renderer
    from lightloom.render.sequence import Pictures, contact_sheet, render_sequence

    with progress.stage("Charts and first light"):
        renderer = Renderer(
            scene,
            width=options.width * options.supersample,
            height=options.height * options.supersample,
            budget=options.budget,
            seed=options.seed,
            sampling=sampling,
            recorder=recorder,
        )
    with progress.stage("Frames", options.frames) as advance:
        pictures = Pictures(supersample=options.supersample)
        rendered = render_sequence(renderer, options.frames, folder, pictures, advance)
        contact_sheet(folder).save(folder / "contact-sheet.png")
    return rendered
