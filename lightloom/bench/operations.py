"""What maintenance computes: operations of a texel, an update and a region, counted in the model's own functions.

The scene is the Cornell box, the states are those that a settled frame could have; how many operations there are hardly
depends on either.
"""

from collections import Counter
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from lightloom.bench.counting import Operation, Tally, counted, counting, paused
from lightloom.golden_model.charts.unwrap import unwrap
from lightloom.golden_model.contract.formats import (
    CHANGE_LEVELS,
    COUNT_MAX,
    INFLUENCE,
    ONE_SAMPLE,
    SHADOW,
    TEXEL_STATE,
    VOLUME,
)
from lightloom.golden_model.driver.geometry import Geometries
from lightloom.golden_model.driver.report import Reporter
from lightloom.golden_model.engine.drift import departures
from lightloom.golden_model.engine.publishing.filling import Filler
from lightloom.golden_model.engine.publishing.mipmaps import renew_levels
from lightloom.golden_model.engine.publishing.publisher import Publisher, publish
from lightloom.golden_model.engine.publishing.smoothing import STEPS, Smoother
from lightloom.golden_model.engine.sampling.confidence import lower
from lightloom.golden_model.engine.sampling.gather import World, gather
from lightloom.golden_model.engine.sampling.running_average import blend_texels
from lightloom.golden_model.engine.sampling.settings import Sampling
from lightloom.golden_model.engine.sampling.texel_rays import Update
from lightloom.golden_model.engine.selection.culling import region_boxes
from lightloom.golden_model.engine.selection.influence.reach import texel_changes
from lightloom.golden_model.engine.selection.intervals import Interval
from lightloom.golden_model.engine.selection.policy import Policy
from lightloom.golden_model.engine.selection.screen_test import pixels_of, screen_test, to_match, to_project
from lightloom.golden_model.engine.selection.selector import FrameContext, Report, Selector
from lightloom.golden_model.engine.selection.texel_match import texel_match
from lightloom.golden_model.engine.selection.texel_project import texel_project
from lightloom.golden_model.frame.rasterizer import rasterize
from lightloom.golden_model.host.stopwatch import Stopwatch
from lightloom.golden_model.rays.surface_shading import Surfaces, readable
from lightloom.golden_model.scene.files.cornell_box import cornell_box
from lightloom.golden_model.scene.light_unit import fraction_bits
from lightloom.golden_model.scene.lights import lights_of
from lightloom.golden_model.scene.scene import Scene
from lightloom.golden_model.structures.structure import Structure
from lightloom.golden_model.tables.geometry import Geometry
from lightloom.golden_model.tables.lightmap import Lightmaps
from lightloom.golden_model.tables.pinhole import View, look_at

SEED = 5
TEXEL = 16.0
"""Side of a texel: the room's floor has regions with neighbours all around."""
UPDATES = 256
SIDE = 64
"""Of the picture that selection looks at."""


@dataclass(frozen=True, kw_only=True)
class Step:
    """What is done for each texel, update, … (`of`) in a step of a frame."""

    name: str
    function: str
    """That says it, below `golden_model/engine/`."""
    of: str
    tally: dict[Operation, float]
    """Operations of one."""


@dataclass(frozen=True, kw_only=True)
class Work:
    """What maintenance does."""

    stages: dict[str, list[Step]]
    rays: float
    """Of an update."""


@dataclass(frozen=True, kw_only=True)
class Room:
    """The scene and its maps, as a settled frame finds them."""

    scene: Scene
    maps: Lightmaps
    state: np.ndarray
    """TEXEL_STATE (N,)."""
    view: View
    gbuffer: np.ndarray
    """GBUFFER (H, W)."""


def room() -> Room:
    """The Cornell box; texels are known by one sample up to as many as count, their light is as bright as can be."""
    scene = cornell_box()
    maps = unwrap(scene, TEXEL)
    rng, count = np.random.default_rng(SEED), len(maps.texels)
    state = np.zeros(count, dtype=TEXEL_STATE)
    state["count"] = rng.integers(ONE_SAMPLE << 7, COUNT_MAX, count) >> rng.integers(0, 8, count)
    state["spread"], state["deviation"] = rng.integers(1, 600, count), rng.integers(1, 300, count)
    state["bias"] = rng.integers(-200, 200, count)
    state["noticed"] = rng.random(count) < 0.01
    state["irradiance"] = 50_000 * rng.uniform(0.7, 1.3, (count, 3))
    camera = scene.camera
    view = look_at(camera.position, camera.target, camera.up, camera.fov_y_tan, SIDE, SIDE)
    gbuffer = rasterize(view, scene.triangles, scene.normals, scene.object_id, maps.uv)
    return Room(scene=scene, maps=maps, state=state, view=view, gbuffer=gbuffer)


def work() -> Work:
    """All that a frame does: its selection, its rays, and publishing, of which fills are no part of a settled frame."""
    found = room()
    rays, sampling = _sampling(found)
    stages = {"selection": _selection(found), "rays": sampling, "publishing": _publishing(found)}
    return Work(stages=stages, rays=rays)


def _step(name: str, function: str, of: str, tally: Tally, times: float) -> Step:
    return Step(name=name, function=function, of=of, tally={key: value / times for key, value in tally.items()})


def _selection(room: Room) -> list[Step]:
    maps, policy, size = room.maps, Policy(), room.scene.texel_size
    valid = maps.texels["state"] == 1
    where = maps.texels["position"][valid], maps.texels["normal"][valid]
    projected = to_project(*where, room.view, size, policy)
    seen = texel_project(projected)["visible"]
    place = texel_project(projected[seen])
    matched = to_match(where[1][seen], place, room.view, pixels_of(room.gbuffer), size, policy)
    with counting() as project:
        _called(texel_project)(counted(projected[seen]))
    with counting() as match:
        _called(texel_match)(counted(matched))
    context = FrameContext(
        frame=9,
        report=_report(room),
        lightmaps=replace(maps, texels=counted(maps.texels)),
        state=counted(room.state),
        view=room.view,
        gbuffer=counted(room.gbuffer),
        predicted=(room.view, counted(room.gbuffer)),
    )
    selector = Selector(maps, replace(policy, cull=False))
    with counting() as whole:
        selector.plan(context, budget=20 * UPDATES, cost=20)
    with counting() as sight:
        for _ in range(2):
            _called(screen_test)(counted(where[0]), counted(where[1]), room.view, counted(room.gbuffer), size, policy)
    count = int(valid.sum())
    return [
        *_regions(room),
        _step("to the screen", "selection/texel_project", "texel and view", project, int(seen.sum())),
        _step("the four pixels", "selection/texel_match", "texel on the screen and view", match, len(place)),
        _step("windows, tracking, class", "selection/selector.Selector.plan", "texel", whole - sight, count),
        *_influence(room, valid),
    ]


def _report(room: Room) -> Report:
    """Of a frame in which nothing has changed."""
    return Reporter(room.scene, Policy()).report(room.scene, room.scene, None, 0)


def _regions(room: Room) -> list[Step]:
    """Of what leaves regions out."""
    regions = region_boxes(room.maps)
    position, normal = (Interval(counted(box.low), counted(box.high)) for box in (regions.position, regions.normal))
    regions = replace(regions, position=position, normal=normal)
    count, name = len(regions.filled), "selection/culling.RegionBoxes"
    with counting() as posed:
        regions.posed(room.scene.rotation, room.scene.translation)
    with counting() as seen:
        regions.on_screen(room.view, room.scene.texel_size, Policy())
    return [
        _step("regions: their pose", name, "region of all", posed, count),
        _step("regions: on the screen", name, "region and view", seen, count),
    ]


def _influence(room: Room, valid: np.ndarray) -> list[Step]:
    """Of records that reach all of the room."""
    maps, count, steps = replace(room.maps, texels=counted(room.maps.texels)), int(valid.sum()), []
    boxes = _report(room).boxes
    for name, kind in (("a volume's reach", VOLUME), ("a shadow's reach", SHADOW)):
        record = np.zeros(1, dtype=INFLUENCE)
        record["kind"], record["facing"], record["level"], record["surface"] = kind, kind == VOLUME, CHANGE_LEVELS, -1
        record["low"], record["high"], record["light"], record["light_half"] = 200, 300, 250, 10
        record["reach_low"] = record["reach_high"] = 1000
        with counting() as tally:
            _called(texel_changes)(counted(record), boxes, maps, valid)
        steps.append(_step(name, "selection/influence/reach.texel_changes", "texel and record", tally, count))
    state = counted(room.state.copy())
    with counting() as tally:
        lower(state, np.where(valid, 6, 0).astype(np.uint8))
    return [*steps, _step("worth less", "sampling/confidence.lower", "texel reached", tally, count)]


def _called(function: Any) -> Any:
    """A function of the model as it is named in its module now."""
    return getattr(__import__(function.__module__, fromlist=["_"]), function.__name__)


class _Tracer:
    """Stands in for the ray collector: traces at once, and does not count."""

    def __init__(self, scene: Scene):
        self.trace, self.found = Structure(scene, "numpy").trace, list[np.ndarray]()
        self.rays = 0

    def emit(self, emitter: str, rays: np.ndarray, *, any_hit: bool = False) -> int:
        self.rays += len(rays)
        self.found.append(paused(self.trace)(np.ascontiguousarray(rays), any_hit=any_hit))
        return len(self.found) - 1

    def hits(self, ticket: int) -> np.ndarray:
        return counted(self.found[ticket])


def _sampling(room: Room) -> tuple[float, list[Step]]:
    scene, maps, sampling = room.scene, room.maps, Sampling()
    dim = room.state.copy()
    dim["irradiance"] = np.random.default_rng(SEED).uniform(0.5, 20, (len(dim), 3))
    geometry = Geometries(scene, maps).at(scene)[0]
    geometry = Geometry(**{name: counted(getattr(geometry, name)) for name in ("surfaces", "shapes", "materials")})
    surfaces = Surfaces(
        geometry=geometry,
        lightmaps=_watched(maps),
        irradiance=counted(readable(publish(maps, dim))),
    )
    fraction = fraction_bits(scene, balanced=True)
    world = World(
        surfaces=surfaces, lightmaps=maps, lights=_watched(lights_of(scene)), fraction=fraction, specular=False
    )
    texel = np.random.default_rng(SEED).choice(np.flatnonzero(maps.texels["state"] == 1), UPDATES, replace=False)
    update = Update(texel=texel, record=counted(maps.texels[texel]), number=np.full(UPDATES, 3), seed=SEED)
    tracer: Any = _Tracer(scene)
    with counting() as rays:
        waves = gather(world, update, sampling, tracer, Stopwatch())
        try:
            while True:
                next(waves)
        except StopIteration as end:
            gathered = end.value
    owner, before = maps.texels["object"][texel], dim["irradiance"][texel]
    with counting() as blend:
        blend_texels(counted(dim), texel, counted(gathered.sums), fraction, sampling.blending, 9)
    with counting() as drift:
        _called(departures)(owner, counted(before), counted(gathered.irradiance), len(maps.width), fraction, 3, 2)
    return tracer.rays / UPDATES, [
        _step("made, shaded, added up", "sampling/gather.gather", "ray", rays, tracer.rays),
        _step("blend", "sampling/texel_blend", "update", blend, UPDATES),
        _step("drift", "drift.departures", "update", drift, UPDATES),
    ]


def _watched(item: Any) -> Any:
    """A dataclass with its arrays of float32 counted."""
    arrays = {each.name: getattr(item, each.name) for each in fields(item) if each.init}
    return replace(
        item,
        **{
            name: counted(value)
            for name, value in arrays.items()
            if isinstance(value, np.ndarray) and (value.dtype == np.float32 or value.dtype.names)
        },
    )


class _Parts(Smoother):
    """A smoother that tells the parts of its work apart."""

    tally: Tally
    parts: dict[str, Tally]

    def _field(self, *args: Any) -> Any:
        return self._part("light, noise and mass", super()._field, *args)

    def _mean(self, *args: Any) -> Any:
        return self._part("means of nine", super()._mean, *args)

    def _pass(self, *args: Any) -> Any:
        name = "first pass" if args[-1] == STEPS[0] else "second pass"
        return self._part(name, super()._pass, *args)

    def _part(self, name: str, function: Any, *args: Any) -> Any:
        before = self.tally.copy()
        result = function(*args)
        self.parts[name] = self.parts.get(name, Counter()) + (self.tally - before)
        return result


def whole_region(publisher: Publisher, smoother: Smoother) -> int:
    """A region whose texels and neighbours are all there."""
    for region in range(publisher.regions.count):
        first = smoother.around(publisher.regions.texels(np.array([region])), STEPS[1])
        if len(first) == 12 * 12 and len(smoother.around(smoother.around(first, 1), 1)) == 16 * 16:
            return region
    raise ValueError("no region of the room has neighbours all around")


def _publishing(room: Room) -> list[Step]:
    smoother = _Parts(room.maps)
    publisher = Publisher(room.maps, smoother)
    region = whole_region(publisher, Smoother(room.maps))
    smoother.tally, smoother.parts = Counter(), {}
    before = publisher.everything(room.state)
    texel = publisher.regions.texels(np.array([region]))[:1]
    smoother.parts = {}
    with counting(integers=True) as whole:
        smoother.tally = whole
        publisher.difference(before, counted(room.state), texel)
    rgba = counted(before["rgba"].copy())
    with counting() as levels:
        written = _called(renew_levels)(publisher.regions, rgba, np.array([region]))
    smoothing = sum(smoother.parts.values(), Counter())
    found = [
        _step(f"smoothing: {name}", "publishing/smoothing.Smoother", "region", part, 1)
        for name, part in smoother.parts.items()
    ]
    packing = whole - smoothing - levels
    found.append(_step("packing", "publishing/publisher.Publisher.difference", "region", packing, 1))
    found.append(_step("levels", "publishing/mipmaps.renew_levels", "texel of a coarser level", levels, len(written)))
    number = int(publisher.regions.object[region])
    part = room.maps.texels["object"] == number
    known = np.random.default_rng(SEED).random(int(part.sum())) < 0.5
    filler, value = Filler(room.maps), room.state["irradiance"][part]
    filler.fill(number, value, known, known)  # makes its tables
    with counting(integers=True) as fill:
        filler.fill(number, counted(value), known, known)
    found.append(_step("fills", "publishing/filling.Filler", "texel of a map not all sampled", fill, len(value)))
    return found
