"""What a frame costs on a machine, in cycles: its units, and the work that the counts of a frame give each of them.

The machine has an application processor, a builder of acceleration structures, a rasterizer, programmable shader cores,
a ray tracer, the lightmap engine (selection, blending, publishing) and an output unit ([0089], claim 19). All numbers
are integers: a count times its cycles, divided by the units that share the work, rounded up.
`golden_model.machine.schedule` lays the work of many frames out in time.
"""

from dataclasses import dataclass, field, fields
from types import MappingProxyType
from typing import Any

from lightloom.golden_model.host.errors import InputError

APPLICATION, STRUCTURE, RASTERIZER, SHADER, TRACER, ENGINE, OUTPUT = (
    "application",
    "structure",
    "rasterizer",
    "shader",
    "tracer",
    "engine",
    "output",
)

STAGES = MappingProxyType(
    {
        "input": APPLICATION,
        "geometry": APPLICATION,
        "structure": STRUCTURE,
        "visible surfaces": RASTERIZER,
        "fragment shading": SHADER,
        "fragment rays": TRACER,
        "frame shader": SHADER,
        "frame rays": TRACER,
        "ray shading": SHADER,
        "blending": SHADER,
        "output": OUTPUT,
        "selection": ENGINE,
        "lightmap rays": TRACER,
        "lightmap shading": SHADER,
        "lightmap update": ENGINE,
    }
)
"""The stages of a frame and the unit that does each."""

MAINTENANCE = ("selection", "lightmap rays", "lightmap shading", "lightmap update")
"""The stages that maintain the lightmaps; the others make the picture."""

RESOURCES = tuple(dict.fromkeys(STAGES.values()))


def ranged(default: int, low: int, high: int) -> Any:
    """A field of a dataclass of integer options, with the range that `check_ranges` holds it to."""
    return field(default=default, metadata={"range": (low, high)})


def check_ranges(options: Any, name: str) -> None:
    """InputError where a field of dataclass `options` leaves the range in its metadata."""
    for item in fields(options):
        low, high = item.metadata["range"]
        value = getattr(options, item.name)
        if not low <= value <= high:
            raise InputError(f"{name} {item.name} {value}: must be {low} to {high}")


@dataclass(frozen=True, kw_only=True)
class Machine:
    """A machine: clock, units, cycles that one unit takes for one item. The defaults are a small embedded GPU."""

    clock_hz: int = ranged(500_000_000, 1, 10_000_000_000)
    """Cycles a second; only for figures in seconds."""
    refresh_cycles: int = ranged(8_333_333, 0, 1 << 40)
    """Cycles from one display time to the next (60 Hz); 0: a frame is shown as soon as it is done."""
    frames_in_flight: int = ranged(2, 1, 8)
    """Frames that are worked on at the same time ([0048])."""
    versions: int = ranged(2, 1, 8)
    """Length of the flip chain: what frame k's updates write is read by frame k + versions - 1."""
    overlap_shading: int = ranged(0, 0, 1)
    """1: shading of a tile starts when its surfaces are known; 0: when those of the whole frame are."""

    raster_share: int = ranged(192, 1, 255)
    """Part of the ray tracer, in 1/256, that lightmap rays get beside the frame's rays while the rasterizer works."""
    other_share: int = ranged(64, 1, 255)
    """The same while the rasterizer rests."""
    shader_share: int = ranged(64, 1, 255)
    """Part of the shader cores that lightmap shading gets beside the frame's shading."""

    shader_cores: int = ranged(64, 1, 65536)
    """Fragments, pixels or rays shaded at a time."""
    tracer_units: int = ranged(4, 1, 1024)
    """Traversal units; each starts one node test a cycle and triangle tests beside it."""
    raster_units: int = ranged(4, 1, 1024)
    """Fragments tested in a cycle."""
    builder_units: int = ranged(1, 1, 1024)
    """Triangles that the builder works on at a time."""
    engine_units: int = ranged(1, 1, 1024)
    """Texels that the lightmap engine works on at a time."""
    output_units: int = ranged(4, 1, 1024)
    """Pixels written in a cycle."""

    input_cycles: int = ranged(20_000, 0, 1 << 40)
    """Physics and input of a frame."""
    geometry_cycles: int = ranged(8, 0, 65535)
    """A triangle that has moved."""
    refit_cycles: int = ranged(4, 0, 65535)
    """A triangle of a refitted object."""
    build_cycles: int = ranged(64, 0, 65535)
    """A triangle of a rebuilt object."""
    setup_cycles: int = ranged(4, 0, 65535)
    """A triangle set up by the rasterizer (all of its units together take one)."""
    test_cycles: int = ranged(1, 0, 65535)
    """A fragment tested."""
    fragment_cycles: int = ranged(60, 0, 65535)
    """A fragment shaded, lightmap and textures read."""
    frame_shader_cycles: int = ranged(30, 0, 65535)
    """A pixel for which the frame shader runs."""
    ray_shading_cycles: int = ranged(60, 0, 65535)
    """A ray's result shaded."""
    blend_cycles: int = ranged(8, 0, 65535)
    """A pixel blended."""
    output_cycles: int = ranged(1, 0, 65535)
    """A pixel written."""
    node_cycles: int = ranged(1, 0, 65535)
    """A node test."""
    triangle_cycles: int = ranged(2, 0, 65535)
    """A triangle test; they run beside the node tests."""
    closest_cycles: int = ranged(13, 0, 65535)
    """A nearest-hit ray whose tests were not counted."""
    any_hit_cycles: int = ranged(9, 0, 65535)
    """An any-hit ray whose tests were not counted."""
    scan_cycles: int = ranged(1, 0, 65535)
    """A texel that selection looks at."""
    select_cycles: int = ranged(4, 0, 65535)
    """A texel selected, its rays generated."""
    update_cycles: int = ranged(8, 0, 65535)
    """A texel blended."""
    publish_cycles: int = ranged(1, 0, 65535)
    """A texel of any level published."""

    def __post_init__(self) -> None:
        check_ranges(self, "machine")

    def seconds(self, cycles: int) -> float:
        return cycles / self.clock_hz


@dataclass(frozen=True, kw_only=True)
class RayCounts:
    """Rays of one emitter in a frame."""

    closest: int = ranged(0, 0, 1 << 40)
    """Rays that look for the nearest hit."""
    any_hit: int = ranged(0, 0, 1 << 40)
    """Rays that ask whether there is a hit: shadow and visibility rays."""
    nodes: int = ranged(0, 0, 1 << 44)
    """Node tests of all of them, 0 where they were not counted."""
    triangles: int = ranged(0, 0, 1 << 44)
    """Triangle tests of all of them, 0 where they were not counted."""

    def __post_init__(self) -> None:
        check_ranges(self, "rays")

    @property
    def total(self) -> int:
        """Rays of both kinds."""
        return self.closest + self.any_hit


@dataclass(frozen=True, kw_only=True)
class FrameCounts:
    """What was done in one frame; counts, 0 unless given."""

    moved: int = 0
    """Triangles of objects that have moved."""
    refitted: int = 0
    """Triangles of objects whose acceleration structure was refitted."""
    rebuilt: int = 0
    """Triangles of objects whose acceleration structure was built."""
    triangles: int = 0
    """Triangles set up by the rasterizer."""
    fragments_tested: int = 0
    fragments_shaded: int = 0
    frame_shader_pixels: int = 0
    pixels: int = 0
    """Pixels blended and written."""
    fragment_rays: RayCounts = RayCounts()
    frame_rays: RayCounts = RayCounts()
    lightmap_rays: RayCounts = RayCounts()
    scanned: int = 0
    """Texels that selection looked at, all passes together."""
    updates: int = 0
    """Texels selected and blended."""
    published: int = 0
    """Texels of all levels published."""

    def __post_init__(self) -> None:
        for item in fields(self):
            value = getattr(self, item.name)
            if not isinstance(value, RayCounts) and value < 0:
                raise InputError(f"counts {item.name} {value}: must be 0 or more")


def work(machine: Machine, counts: FrameCounts) -> dict[str, int]:
    """Cycles that each of STAGES needs for a frame when its unit does nothing else."""

    def tracing(rays: RayCounts) -> int:
        if rays.nodes or rays.triangles:
            cycles = max(rays.nodes * machine.node_cycles, rays.triangles * machine.triangle_cycles)
        else:
            cycles = rays.closest * machine.closest_cycles + rays.any_hit * machine.any_hit_cycles
        return _shared(cycles, machine.tracer_units)

    def shading(count: int, cycles: int) -> int:
        return _shared(count * cycles, machine.shader_cores)

    rays = counts.fragment_rays.total + counts.frame_rays.total
    building = counts.refitted * machine.refit_cycles + counts.rebuilt * machine.build_cycles
    testing = _shared(counts.fragments_tested * machine.test_cycles, machine.raster_units)
    selecting = counts.scanned * machine.scan_cycles + counts.updates * machine.select_cycles
    updating = counts.updates * machine.update_cycles + counts.published * machine.publish_cycles
    return {
        "input": machine.input_cycles,
        "geometry": counts.moved * machine.geometry_cycles,
        "structure": _shared(building, machine.builder_units),
        "visible surfaces": counts.triangles * machine.setup_cycles + testing,
        "fragment shading": shading(counts.fragments_shaded, machine.fragment_cycles),
        "fragment rays": tracing(counts.fragment_rays),
        "frame shader": shading(counts.frame_shader_pixels, machine.frame_shader_cycles),
        "frame rays": tracing(counts.frame_rays),
        "ray shading": shading(rays, machine.ray_shading_cycles),
        "blending": shading(counts.pixels, machine.blend_cycles),
        "output": _shared(counts.pixels * machine.output_cycles, machine.output_units),
        "selection": _shared(selecting, machine.engine_units),
        "lightmap rays": tracing(counts.lightmap_rays),
        "lightmap shading": shading(counts.lightmap_rays.total, machine.ray_shading_cycles),
        "lightmap update": _shared(updating, machine.engine_units),
    }


def load(cycles: dict[str, int]) -> dict[str, int]:
    """Cycles by unit, from cycles by stage. The largest is what a frame takes with enough of them in flight."""
    total = dict.fromkeys(RESOURCES, 0)
    for stage, resource in STAGES.items():
        total[resource] += cycles[stage]
    return total


def _shared(cycles: int, units: int) -> int:
    return -(-cycles // units)
