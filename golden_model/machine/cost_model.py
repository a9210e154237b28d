"""What a frame costs on a machine, in cycles: its units, and the work that the counts of a frame give each of them.

The machine has an application processor, a builder of acceleration structures, a rasterizer, programmable shader cores,
a ray tracer, the lightmap engine (selection, blending, publishing) and an output unit ([0089], claim 19). All numbers
are integers: a count times its cycles, divided by the units that share the work, rounded up.
`golden_model.machine.schedule` lays the work of many frames out in time.
"""

from dataclasses import dataclass, fields
from types import MappingProxyType

from lightloom.golden_model.host.errors import InputError
from lightloom.golden_model.host.parameters import check, number

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


@dataclass(frozen=True, kw_only=True)
class Machine:
    """A machine: clock, units, cycles that one unit takes for one item. The defaults are a small embedded GPU."""

    clock_hz: int = number(500_000_000, 1, 10_000_000_000, "cycles a second; only for figures in seconds")
    refresh_cycles: int = number(
        8_333_333,
        0,
        1 << 40,
        "cycles from one display time to the next (60 Hz); 0: a frame is shown as soon as it is done",
    )
    frames_in_flight: int = number(2, 1, 8, "frames that are worked on at the same time ([0048])")
    versions: int = number(
        2, 1, 8, "length of the flip chain: what frame k's updates write is read by frame k + versions - 1"
    )
    overlap_shading: int = number(
        0, 0, 1, "1: shading of a tile starts when its surfaces are known; 0: when those of the whole frame are"
    )
    early_selection: int = number(
        0, 0, 1, "1: selection looks at the surfaces of the frame before; 0: it waits for those of its own frame"
    )

    raster_share: int = number(
        192,
        1,
        255,
        "part of the ray tracer, in 1/256, that lightmap rays get beside the frame's rays while the rasterizer works",
    )
    other_share: int = number(64, 1, 255, "the same while the rasterizer rests")
    shader_share: int = number(
        64, 1, 255, "part of the shader cores that lightmap shading gets beside the frame's shading"
    )

    shader_cores: int = number(64, 1, 65536, "fragments, pixels or rays shaded at a time")
    tracer_units: int = number(
        4, 1, 1024, "traversal units; each starts one node test a cycle and triangle tests beside it"
    )
    raster_units: int = number(4, 1, 1024, "fragments tested in a cycle")
    builder_units: int = number(1, 1, 1024, "triangles that the builder works on at a time")
    engine_units: int = number(1, 1, 1024, "texels that the lightmap engine works on at a time")
    output_units: int = number(4, 1, 1024, "pixels written in a cycle")

    input_cycles: int = number(20_000, 0, 1 << 40, "physics and input of a frame")
    geometry_cycles: int = number(8, 0, 65535, "a triangle that has moved")
    refit_cycles: int = number(4, 0, 65535, "a triangle of a refitted object")
    build_cycles: int = number(64, 0, 65535, "a triangle of a rebuilt object")
    setup_cycles: int = number(4, 0, 65535, "a triangle set up by the rasterizer (all of its units together take one)")
    test_cycles: int = number(1, 0, 65535, "a fragment tested")
    fragment_cycles: int = number(60, 0, 65535, "a fragment shaded, lightmap and textures read")
    frame_shader_cycles: int = number(30, 0, 65535, "a pixel for which the frame shader runs")
    ray_shading_cycles: int = number(60, 0, 65535, "a ray's result shaded")
    blend_cycles: int = number(8, 0, 65535, "a pixel blended")
    output_cycles: int = number(1, 0, 65535, "a pixel written")
    node_cycles: int = number(1, 0, 65535, "a node test")
    triangle_cycles: int = number(2, 0, 65535, "a triangle test; they run beside the node tests")
    closest_cycles: int = number(13, 0, 65535, "a nearest-hit ray whose tests were not counted")
    any_hit_cycles: int = number(9, 0, 65535, "an any-hit ray whose tests were not counted")
    scan_cycles: int = number(1, 0, 65535, "a texel that selection looks at")
    select_cycles: int = number(4, 0, 65535, "a texel selected, its rays generated")
    update_cycles: int = number(8, 0, 65535, "a texel blended")
    publish_cycles: int = number(1, 0, 65535, "a texel of any level published")

    def __post_init__(self) -> None:
        check(self, "machine")

    def seconds(self, cycles: int) -> float:
        return cycles / self.clock_hz


@dataclass(frozen=True, kw_only=True)
class RayCounts:
    """Rays of one emitter in a frame."""

    closest: int = number(0, 0, 1 << 40, "Rays that look for the nearest hit.")
    any_hit: int = number(0, 0, 1 << 40, "Rays that ask whether there is a hit: shadow and visibility rays.")
    nodes: int = number(0, 0, 1 << 44, "Node tests of all of them, 0 where they were not counted.")
    triangles: int = number(0, 0, 1 << 44, "Triangle tests of all of them, 0 where they were not counted.")

    def __post_init__(self) -> None:
        check(self, "rays")

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
