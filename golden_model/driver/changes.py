"""What differs between the scenes of two frames, as whoever moves the objects knows it: boxes, areas, lights ([0081]).

From a table of every object at rest and its pose alone; no vertex is touched. float64, in a fixed order.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from lightloom.golden_model.contract.engine_image import DIFFUSE
from lightloom.golden_model.scene.mesh import area_vectors
from lightloom.golden_model.scene.scene import Scene

PI = 3.141592653589793
SUN_DISTANCE = 64.0
"""Of the box that stands for the sun, in sizes of the scene: its direction is right to half a degree."""


@dataclass(frozen=True, kw_only=True)
class Table:
    """O objects of M materials at rest. Made once a scene."""

    low: np.ndarray
    """Corner of each object's box at rest, (O, 3) float64."""
    high: np.ndarray
    """The opposite corner, (O, 3) float64."""
    area: np.ndarray
    """Of each material the area that faces -x, +x, -y, +y, -z, +z, foreshortened, (M, 6) float64."""
    faces: np.ndarray
    """Of each object the triangle that faces each of these sides most, (O, 6) int64; -1 where none does."""
    total: float
    """Area of all surfaces."""
    extent: float
    """Longest side of the box around all objects."""


def table_of(scene: Scene) -> Table:
    """From the scene at rest that `scene` is a frame of."""
    rest = scene if scene.rest is None else scene.rest
    objects, corners = len(rest.object_names), rest.corners.astype(np.float64)
    vectors = area_vectors(rest.corners) / 2
    lengths = np.sqrt(vectors[:, 0] * vectors[:, 0] + vectors[:, 1] * vectors[:, 1] + vectors[:, 2] * vectors[:, 2])
    area = np.zeros((len(rest.albedo), 6))
    faces = np.full((objects, 6), -1)
    first = np.searchsorted(rest.object_id, np.arange(objects + 1))
    for side in range(6):
        facing = vectors[:, side // 2] * (1 if side % 2 else -1)
        np.add.at(area[:, side], rest.material, np.maximum(facing, 0))
        for number in range(objects):
            own = facing[first[number] : first[number + 1]]
            if own.max() > 0:
                faces[number, side] = first[number] + int(np.argmax(own))
    low, high = np.full((objects, 3), np.inf), np.full((objects, 3), -np.inf)
    np.minimum.at(low, rest.object_id, corners.min(axis=1))
    np.maximum.at(high, rest.object_id, corners.max(axis=1))
    return Table(
        low=low,
        high=high,
        area=area,
        faces=faces,
        total=float(np.cumsum(lengths)[-1]),
        extent=float((high.max(axis=0) - low.min(axis=0)).max()),
    )


@dataclass(frozen=True, kw_only=True)
class Box:
    """An axis-parallel box in world space; empty where `low` exceeds `high`."""

    low: np.ndarray
    """(3,) float64."""
    high: np.ndarray
    """(3,) float64."""

    def joined(self, other: "Box") -> "Box":
        """The smallest box around both."""
        return Box(low=np.minimum(self.low, other.low), high=np.maximum(self.high, other.high))


NOWHERE = Box(low=np.full(3, np.inf), high=np.full(3, -np.inf))


def bounds(table: Table, scene: Scene, number: int) -> Box:
    """The box of object `number` at rest, carried to its pose and bounded again: loose. Empty for an absent object."""
    if not scene.present[number]:
        return NOWHERE
    rotation = scene.rotation[number].astype(np.float64)
    middle, half = (table.low[number] + table.high[number]) / 2, (table.high[number] - table.low[number]) / 2
    centre = scene.translation[number] + _turned(rotation, middle)
    size = _turned(np.abs(rotation), half)
    return Box(low=centre - size, high=centre + size)


def _turned(rotation: np.ndarray, vector: np.ndarray) -> np.ndarray:
    """Rotation times vector, (x + y) + z."""
    return rotation[:, 0] * vector[0] + rotation[:, 1] * vector[1] + rotation[:, 2] * vector[2]


def sides(table: Table, scene: Scene, number: int, weight: np.ndarray) -> np.ndarray:
    """Areas of an object's materials, times `weight` (M,), that face the world's -x, +x, -y, +y, -z, +z: (6,).

    The sides of the object at rest are turned with it, as if it were a box.
    """
    own = np.zeros(6)
    for material in np.flatnonzero(scene.material_object == number):
        own = own + table.area[material] * weight[material]
    rotation, out = scene.rotation[number].astype(np.float64), np.zeros(6)
    for axis in range(3):
        for side in range(6):
            along = rotation[axis, side // 2] * (1 if side % 2 else -1)
            out[2 * axis] += own[side] * max(-along, 0.0)
            out[2 * axis + 1] += own[side] * max(along, 0.0)
    return out


def grey(rgb: np.ndarray) -> np.ndarray:
    """(..., 3) to (...): (R + 2 G + B) / 4."""
    wide = rgb.astype(np.float64)
    return (wide[..., 0] + 2 * wide[..., 1] + wide[..., 2]) / 4


@dataclass(frozen=True, kw_only=True)
class Moved:
    """An object that is somewhere else than in the frame before, or there in one of the two only."""

    object: int
    before: Box
    after: Box
    motion: float
    """How far a corner of its box moved, as a part of its size; 1 for what appeared or vanished."""
    shiny: bool
    """A mirror or glass."""

    @property
    def swept(self) -> Box:
        """The box around both places."""
        return self.before.joined(self.after)


def moved_objects(table: Table, before: Scene, after: Scene) -> list[Moved]:
    """All that moved, appeared or vanished, by object number."""
    out: list[Moved] = []
    if before is after:
        return out
    for number in range(len(after.object_names)):
        there = before.present[number], after.present[number]
        motion = 1.0 if there[0] != there[1] else _motion(table, before, after, number) if all(there) else 0.0
        if motion > 0:
            out.append(
                Moved(
                    object=number,
                    before=bounds(table, before, number),
                    after=bounds(table, after, number),
                    motion=motion,
                    shiny=bool((after.surface[after.material_object == number] != DIFFUSE).any()),
                )
            )
    return out


def _motion(table: Table, before: Scene, after: Scene, number: int) -> float:
    turned = after.rotation[number].astype(np.float64) - before.rotation[number].astype(np.float64)
    shifted = after.translation[number].astype(np.float64) - before.translation[number].astype(np.float64)
    if not (turned.any() or shifted.any()):
        return 0.0
    low, high = table.low[number], table.high[number]
    furthest = 0.0
    for corner in range(8):
        point = np.where([corner & 1, corner & 2, corner & 4], high, low)
        furthest = max(furthest, float(np.abs(_turned(turned, point) + shifted).max()))
    return furthest / float((high - low).max())


@dataclass(frozen=True, kw_only=True)
class Source:
    """What sends out light at one frame: an object that shines, a point light, sun or sky."""

    object: int
    """-1 where it is none."""
    box: Box
    """Where it is; NOWHERE for a sky, of which nothing casts a shadow."""
    power: float
    """What it sends out, in W."""


def sources(table: Table, scene: Scene) -> list[Source]:
    """The sources of light of a scene: objects by number, then point lights, sun and sky."""
    emission = grey(scene.emission)
    out = []
    for number in np.unique(scene.material_object[emission > 0]):
        area = sides(table, scene, int(number), emission)
        if scene.present[number] and area.any():
            # Opposite sides of a closed thing are equal, one of a plate's is empty: the larger of each two counts.
            size = float(max(area[0], area[1]) + max(area[2], area[3]) + max(area[4], area[5]))
            out.append(Source(object=int(number), box=bounds(table, scene, int(number)), power=PI * size))
    for light in scene.point_lights:
        place, intensity = light["position"].astype(np.float64), float(grey(light["intensity"]))
        if intensity > 0:
            out.append(Source(object=-1, box=Box(low=place, high=place), power=4 * PI * intensity))
    return out + _distant_sources(table, scene)


def _distant_sources(table: Table, scene: Scene) -> list[Source]:
    """Sun and sky, as far as there are; what they send is what a ball around all objects gets.

    The sun is a box that is far off, as large as its shadows' edges are wide across the scene.
    """
    sky, sun = scene.environment.sky, scene.environment.sun
    middle, radius = (table.low.min(axis=0) + table.high.max(axis=0)) / 2, table.extent / 2
    out = []
    if sun is not None and sun.irradiance.any():
        place = middle + sun.towards.astype(np.float64) * (table.extent * SUN_DISTANCE)
        half = np.full(3, table.extent * float(sun.radius))
        power = PI * radius * radius * float(grey(sun.irradiance))
        out.append(Source(object=-1, box=Box(low=place - half, high=place + half), power=power))
    if sky is not None:
        power = 4 * PI * PI * radius * radius * float(grey(sky.table.mean_colour))
        out.append(Source(object=-1, box=NOWHERE, power=power))
    return out


@dataclass(frozen=True, kw_only=True)
class Relit:
    """A source of light that changed: moved, brighter, darker, on or off."""

    object: int
    """-1 for a point light."""
    box: Box
    """Around both places."""
    strength: np.ndarray
    """Change of the radiant intensity to -x, +x, -y, +y, -z, +z, (6,) float64: area times radiance, W/sr."""
    part: float
    """The change as a part of the whole, 0 to 1; motion counts over the frames that an average remembers."""
    sudden: float
    """The same of this frame alone; more than 0."""


def relit_sources(
    table: Table, before: Scene, after: Scene, moved: list[Moved], remembered: Callable[[float], float]
) -> list[Relit]:
    """All sources that changed: objects by number, then point lights. `remembered` takes motion to a part, 0 to 1.

    What moved counts by its motion, what became brighter or darker by the difference.
    """
    out: list[Relit] = []
    if before is after:
        return out
    motion = {item.object: item.motion for item in moved}
    shine = [grey(scene.emission) * scene.present[scene.material_object] for scene in (before, after)]
    for number in np.unique(after.material_object[(shine[0] > 0) | (shine[1] > 0)]):
        own = after.material_object == number
        brightest = np.maximum(shine[0], shine[1])
        far = motion.get(int(number), 0.0)
        sudden, change = (np.maximum(np.abs(shine[1] - shine[0]), part * brightest) for part in (far, remembered(far)))
        if change[own].any():
            strength = np.maximum(*(sides(table, scene, int(number), change) for scene in (before, after)))
            box = bounds(table, before, int(number)).joined(bounds(table, after, int(number)))
            part, now = (float(each[own].max() / brightest[own].max()) for each in (change, sudden))
            out.append(Relit(object=int(number), box=box, strength=strength, part=part, sudden=now))
    for number in range(max(len(before.point_lights), len(after.point_lights))):
        lights = [scene.point_lights[number] for scene in (before, after) if number < len(scene.point_lights)]
        places = [light["position"].astype(np.float64) for light in lights]
        bright = [float(grey(light["intensity"])) for light in lights]
        apart = float(np.abs(places[0] - places[-1]).max()) / table.extent
        difference = abs(bright[0] - bright[-1]) if len(bright) == 2 else bright[0]
        now, strong = (max(difference, part * max(bright)) for part in (min(apart, 1.0), remembered(apart)))
        if strong > 0:
            box = Box(low=np.minimum(places[0], places[-1]), high=np.maximum(places[0], places[-1]))
            part, sudden = strong / max(bright), now / max(bright)
            out.append(Relit(object=-1, box=box, strength=np.full(6, strong), part=part, sudden=sudden))
    return out
