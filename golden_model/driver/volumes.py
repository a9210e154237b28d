"""Volumes of influence: where what moved, appeared, vanished or changed its light can matter ([0079] to [0082]).

A volume is a box around an object with a reach of its own to each of six sides: as far as the faces on that side can
change the light by the part `influence_least`. Two smaller volumes of the same record, of half and a quarter of the
reach, bound four and sixteen times the effect: change levels 2 and 3. A shadow is a box around a moved object and a
light: texels between which and the light the box lies are influenced too.

Records are made by whoever moves the objects (physics, or the builder of the acceleration structure, [0081]): float64,
rounded once. `golden_model.engine.selection.influence.reach` compares them with maps and texels.
"""

import numpy as np

from lightloom.golden_model.contract.formats import CHANGE_LEVELS, INFLUENCE, MOST_OCTAVES, SHADOW, VOLUME
from lightloom.golden_model.driver.changes import (
    NOWHERE,
    PI,
    Box,
    Moved,
    Relit,
    Source,
    Table,
    grey,
    moved_objects,
    relit_sources,
)
from lightloom.golden_model.driver.changes import sides as facing_areas
from lightloom.golden_model.driver.changes import sources as sources_of
from lightloom.golden_model.engine.selection.policy import Policy
from lightloom.golden_model.scene.scene import Scene

LOOSE = 3
"""Octaves by which bounds of what an object reflects, hides or shadows are larger than what it is seen to change …"""
TIGHT = -1
"""… and bounds of what a light brings, at the highest level, which has no upper bound."""
JOINED_LEVEL = 1
"""The change level of what stands for several changes."""


def volumes(table: Table, before: Scene, after: Scene, policy: Policy) -> np.ndarray:
    """What became different from one frame's scene to the next: INFLUENCE (K,), K at most `influence_records`.

    First the volumes of what moved, then those of changed lights, then the shadows, each by object number. With
    "footprints" the first are left out: rays find what is near. Beyond the bound records are joined into the last one
    of their kind, which reaches more texels at a lower level. None between equal scenes, and none with influence "off".
    """
    if before is after or policy.influence == "off":
        return np.zeros(0, dtype=INFLUENCE)
    moved = moved_objects(table, before, after)
    relit = relit_sources(table, before, after, moved, lambda motion: remembered(motion, policy))
    old, new = sources_of(table, before), sources_of(table, after)
    records = [_lit(light, usual_light(table, old, new), policy) for light in relit]
    if policy.influence == "volumes":
        records = [_reflecting(table, before, after, item, policy) for item in moved] + records
    cast = []
    if policy.shadows:
        casting = [light for light in new if light.box is not NOWHERE]
        cast = [_shadow(item, light, policy) for item in moved for light in casting if light.object != item.object]
    # Half of the records for each kind, and what the other leaves.
    most = policy.influence_records
    records = joined(records, max(most - len(cast), most // 2))
    records += joined(cast, most - len(records))
    return np.stack(records) if records else np.zeros(0, dtype=INFLUENCE)


def remembered(motion: float, policy: Policy) -> float:
    """The motion of one frame to that of as many as an average remembers, 0 to 1: slow motion adds up in it."""
    return min(1.0, motion * policy.influence_memory)


def level_of(part: float, policy: Policy) -> int:
    """The highest level that something can cause that changed by a part of itself, 0 to 1."""
    return 1 + (part >= 4 * policy.influence_least) + (part >= 16 * policy.influence_least)


def octaves_of(part: float, sudden: float, bounds: int) -> int:
    """How many times light is expected to change by less in this frame than its bound says, as a power of two: 0 to 6.

    `part` of it changes over the frames that an average remembers and `sudden` of it in this one, so `part / sudden` is
    1 to `influence_memory`; of the bound itself `bounds` octaves are to be believed less.
    """
    frames = sum(part >= sudden * (1 << octave) for octave in range(1, MOST_OCTAVES + 1))
    return min(max(frames + bounds, 0), MOST_OCTAVES)


def usual_light(table: Table, *frames: list[Source]) -> float:
    """What a surface gets on average: power of all sources over area of all surfaces, in the brighter frame."""
    return max(_power(sources) for sources in frames) / table.total


def _power(sources: list[Source]) -> float:
    total = 0.0
    for source in sources:
        total += source.power
    return total


def reflecting_reach(table: Table, before: Scene, after: Scene, item: Moved, policy: Policy) -> np.ndarray:
    """How far an object that moved matters to -x, +x, -y, +y, -z, +z, by what it reflects and what it hides: (6,).

    A face of area A and reflectance rho that gets the usual irradiance E brings E A rho / (pi r**2) at distance r. What
    it hides, on either side, it takes away in the same measure.
    """
    area = np.zeros(6)
    for scene in (before, after):
        if scene.present[item.object]:
            outline = facing_areas(table, scene, item.object, np.ones(len(scene.albedo)))
            outline = np.maximum(outline, outline[[1, 0, 3, 2, 5, 4]])
            area = np.maximum(area, facing_areas(table, scene, item.object, grey(scene.albedo)))
            area = np.maximum(area, outline * policy.influence_hiding)
    reach = np.sqrt(area * (remembered(item.motion, policy) / (PI * policy.influence_least)))
    return reach * (policy.influence_shiny if item.shiny else 1.0)


def _record(kind: int, number: int, box: Box, level: int) -> np.ndarray:
    out = np.zeros((), dtype=INFLUENCE)
    out["kind"], out["object"], out["level"], out["surface"] = kind, number, level, -1
    out["low"], out["high"] = box.low, box.high
    return out


def _volume(number: int, box: Box, level: int, reach: np.ndarray) -> np.ndarray:
    out = _record(VOLUME, number, box, level)
    out["reach_low"], out["reach_high"] = reach[0::2], reach[1::2]
    return out


def _reflecting(table: Table, before: Scene, after: Scene, item: Moved, policy: Policy) -> np.ndarray:
    reach = reflecting_reach(table, before, after, item, policy)
    if before.present[item.object] and after.present[item.object]:
        # Where it is going to it is awaited.
        shift = (item.after.low + item.after.high - item.before.low - item.before.high) / 2
        reach[0::2] += np.maximum(-shift, 0) * policy.influence_ahead
        reach[1::2] += np.maximum(shift, 0) * policy.influence_ahead
    part = remembered(item.motion, policy)
    out = _volume(item.object, item.swept, level_of(part, policy), reach)
    out["facing"], out["octaves"] = True, octaves_of(part, item.motion, LOOSE)
    return out


def _lit(light: Relit, usual: float, policy: Policy) -> np.ndarray:
    """A face of area A and radiance L brings L A / r**2 at distance r, a point light of intensity I brings I / r**2.

    Light goes round corners once it is reflected, so no side's reach is less than half of the farthest.
    """
    reach = np.sqrt(light.strength / (usual * policy.influence_least))
    out = _volume(light.object, light.box, level_of(light.part, policy), np.maximum(reach, reach.max() / 2))
    out["octaves"] = octaves_of(light.part, light.sudden, TIGHT)
    return out


def _shadow(item: Moved, light: Source, policy: Policy) -> np.ndarray:
    """What moved between texels and the middle of a light; growing the box by half the light's size covers all of it.

    Direct light matters more than what is reflected: one level more.
    """
    box, half = item.swept, (light.box.high - light.box.low) / 2
    part = remembered(item.motion, policy)
    level = min(level_of(part, policy) + 1, CHANGE_LEVELS)
    out = _record(SHADOW, item.object, Box(low=box.low - half, high=box.high + half), level)
    out["octaves"] = octaves_of(part, item.motion, LOOSE)
    out["light"], out["light_half"] = (light.box.low + light.box.high) / 2, half
    return out


def joined(records: list[np.ndarray], most: int) -> list[np.ndarray]:
    """At most `most` records of one kind; the ones beyond are joined into the last, `most` >= 1 where there are any.

    What is around several things that changed is mostly empty: it reaches whom any of them reached, at the lowest
    level, which gives texels an earlier turn and takes nothing from what they know.
    """
    if len(records) <= most:
        return records
    last = records[most - 1].copy()
    for other in records[most:]:
        last["low"] = np.minimum(last["low"], other["low"])
        for name in ("high", "reach_low", "reach_high"):
            last[name] = np.maximum(last[name], other[name])
        last["facing"] &= other["facing"]
        last["object"] = -1
        # Two lights become one around both.
        low = np.minimum(last["light"] - last["light_half"], other["light"] - other["light_half"])
        high = np.maximum(last["light"] + last["light_half"], other["light"] + other["light_half"])
        last["light"], last["light_half"] = (low + high) / 2, (high - low) / 2
    last["level"], last["octaves"] = JOINED_LEVEL, MOST_OCTAVES
    if last["kind"] == SHADOW:
        last["low"] -= last["light_half"]
        last["high"] += last["light_half"]
    return [*records[: most - 1], last]
