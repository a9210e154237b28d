"""Rays with a spreading factor from what moved, whose footprints are the texels that it influences ([0083]).

The other way to find what is near an object, instead of its volume: it looks through no wall, but takes rays.
"""

import numpy as np

from lightloom.golden_model.contract.formats import FOOTPRINT, INFLUENCE, RAY
from lightloom.golden_model.driver.changes import Table, moved_objects
from lightloom.golden_model.driver.volumes import (
    LOOSE,
    level_of,
    octaves_of,
    reflecting_reach,
    remembered,
)
from lightloom.golden_model.engine.selection.policy import Policy
from lightloom.golden_model.numerics.floats import flush, quiet
from lightloom.golden_model.numerics.vectors import add, cross, dot, normalize, scale, subtract
from lightloom.golden_model.scene.scene import Scene
from lightloom.golden_model.tables.ray_offset import ray_start
from lightloom.golden_model.tracing.trace_protocol import Trace

TILTS = ((0.0, 0.0), (1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0))
"""Directions of the rays of a face: its normal plus so much along and across its first edge, so straight out and at 45
degrees to four sides."""


@quiet
def footprints(
    table: Table, before: Scene, after: Scene, policy: Policy, trace: Trace, rays: int
) -> tuple[np.ndarray, int]:
    """What lies around objects that moved: INFLUENCE (K,) of kind FOOTPRINT, and the rays traced: at most `rays`.

    From the face that looks most to each of six sides, as far as the object's influence reaches to that side. `trace`
    traces the scene `after`; an object that vanished sends its rays from where it was. Where rays run out, objects of
    higher number send none.
    """
    most = min(rays, policy.footprint_rays)
    start, reach, level, octaves, number = _faces(table, before, after, policy, most)
    if not len(start):
        return np.zeros(0, dtype=INFLUENCE), 0
    hits = trace(start)
    distance = flush(hits["t"] * np.sqrt(dot(start["direction"], start["direction"])))
    met = np.flatnonzero((hits["primitive"] >= 0) & (distance <= reach))
    out = np.zeros(len(met), dtype=INFLUENCE)
    out["kind"], out["object"] = FOOTPRINT, number[met]
    out["surface"] = after.object_id[hits["primitive"][met]]
    out["low"] = out["high"] = add(start["origin"][met], scale(start["direction"][met], hits["t"][met]))
    out["reach_low"] = out["reach_high"] = flush(distance[met] * np.float32(policy.footprint_spread))[:, None]
    # Half the distance is four times the effect, as with volumes.
    nearer = [distance[met] <= flush(reach[met] * np.float32(part)) for part in (0.5, 0.25)]
    out["level"] = np.minimum(1 + nearer[0] + nearer[1], level[met])
    out["octaves"] = octaves[met]
    return out, len(start)


def _faces(table: Table, before: Scene, after: Scene, policy: Policy, most: int) -> tuple[np.ndarray, ...]:
    """RAY (R,), how far each matters (R,) float32; its highest level, octaves and object, (R,); R at most `most`."""
    rays, reaches = np.zeros(0, dtype=RAY), np.zeros(0, np.float32)
    levels, octaves, numbers = np.zeros((3, 0), dtype=int)
    for item in moved_objects(table, before, after):
        scene = after if after.present[item.object] else before
        sides = np.flatnonzero(table.faces[item.object] >= 0)
        corners = scene.corners[table.faces[item.object][sides]]
        first, second = subtract(corners[:, 1], corners[:, 0]), subtract(corners[:, 2], corners[:, 0])
        normal = normalize(cross(normalize(first), normalize(second)))
        along = normalize(first)
        across = cross(normal, along)
        middle = add(corners[:, 0], scale(add(first, second), np.float32(1 / 3)))
        reach = _toward(normal, reflecting_reach(table, before, after, item, policy))
        own = np.zeros((len(sides), len(TILTS)), dtype=RAY)
        own["origin"] = ray_start(middle, normal, scene.spans[table.faces[item.object][sides]])[:, None]
        own["t_max"] = np.inf
        for k, (u, v) in enumerate(TILTS):
            own["direction"][:, k] = add(add(normal, scale(along, np.float32(u))), scale(across, np.float32(v)))
        rays = np.concatenate([rays, own.reshape(-1)])
        reaches = np.concatenate([reaches, np.repeat(reach, len(TILTS))])
        part = remembered(item.motion, policy)
        levels = np.concatenate([levels, np.full(own.size, level_of(part, policy))])
        octaves = np.concatenate([octaves, np.full(own.size, octaves_of(part, item.motion, LOOSE))])
        numbers = np.concatenate([numbers, np.full(own.size, item.object)])
    return rays[:most], reaches[:most], levels[:most], octaves[:most], numbers[:most]


def _toward(normal: np.ndarray, reach: np.ndarray) -> np.ndarray:
    """The reach (6,) to the side of the world that each normal (N, 3) looks to most, (N,) float32."""
    axis = np.argmax(np.abs(normal), axis=1)
    return reach[2 * axis + (normal[np.arange(len(normal)), axis] > 0)].astype(np.float32)
