"""Small scenes in which light must not come through: a shelf, a thin wall, a sealed room, a block through a table."""

import numpy as np

from lightloom.golden_model.scene.parts import Part
from lightloom.golden_model.scene.scene import Scene
from lightloom.golden_model.scene.shapes import box as box_about_origin
from tests.golden_model.frame_scenes import part, quad, scene_of


def box(name: str, low: tuple, high: tuple, albedo: float = 0.7, emission: float = 0.0) -> Part:
    """A box between two corners, fronts outside."""
    a, b = np.array(low, dtype=np.float64), np.array(high, dtype=np.float64)
    return part(name, box_about_origin(b - a) + (a + b) / 2, albedo, emission)


def room(low: tuple, high: tuple, prefix: str = "") -> list[Part]:
    """Six walls between two corners, each an object, seen from inside."""
    a, b = np.array(low, dtype=np.float64), np.array(high, dtype=np.float64)
    whole = box_about_origin(b - a)[:, ::-1] + (a + b) / 2
    names = []
    for first in whole[::2]:
        axis = int(np.ptp(first, axis=0).argmin())
        names.append(
            prefix + ("left", "floor", "back", "right", "ceiling", "front")[axis + 3 * (first[0, axis] > a[axis])]
        )
    return [part(name, whole[2 * k : 2 * k + 2], 0.7) for k, name in enumerate(names)]


def shelf(texel_size: float = 0.1) -> Scene:
    """A shelf as wide as the wall that it meets, between two rows of texels; a lamp above it, a floor below."""
    return scene_of(
        [
            quad("wall", [[-1, 0, 0], [1, 0, 0], [1, 2, 0], [-1, 2, 0]], 0.7),
            box("shelf", (-1, 1.07, 0), (1, 1.09, 1)),
            quad("floor", [[-1, 0, 1], [1, 0, 1], [1, 0, 0], [-1, 0, 0]], 0.7),
            quad("lamp", [[-0.3, 2, 0.6], [0.3, 2, 0.6], [0.3, 2, 1], [-0.3, 2, 1]], 0.5, 20),
        ],
        texel_size=texel_size,
    )


def thin_wall(texel_size: float = 0.1, reach: float = 1.0) -> Scene:
    """A room that a wall of a centimetre divides, all of it or less; a lamp on the left."""
    return scene_of(
        [
            *room((-1.5, 0, -1), (1.5, 1.6, 1)),
            box("wall", (-0.002, 0, -1), (0.008, 1.6, -1 + 2 * reach)),
            quad("lamp", [[-1, 1.59, -0.3], [-0.6, 1.59, -0.3], [-0.6, 1.59, 0.3], [-1, 1.59, 0.3]], 0.5, 20),
        ],
        texel_size=texel_size,
    )


def sealed_room(texel_size: float = 0.1) -> Scene:
    """A closed room of six boxes, 30 cm thick, in a lit one."""
    lamp = [[-0.5, 2.48, -0.5], [0.5, 2.48, -0.5], [0.5, 2.48, 0.5], [-0.5, 2.48, 0.5]]
    return scene_of(
        [
            *room((-1.6, -1.5, -1.6), (1.6, 2.5, 1.6), "outer "),
            box("floor", (-0.9, -0.3, -0.9), (0.9, 0, 0.9)),
            box("ceiling", (-0.9, 1.2, -0.9), (0.9, 1.5, 0.9)),
            box("left", (-0.9, 0, -0.9), (-0.6, 1.2, 0.9)),
            box("right", (0.6, 0, -0.9), (0.9, 1.2, 0.9)),
            box("back", (-0.6, 0, -0.9), (0.6, 1.2, -0.6)),
            box("front", (-0.6, 0, 0.6), (0.6, 1.2, 0.9)),
            quad("lamp", lamp, 0.5, 10),
        ],
        texel_size=texel_size,
    )


def block_through_table(texel_size: float = 0.125) -> Scene:
    """A block that stands a little in the floor, and through a plate that is thinner than a texel; a lamp above."""
    return scene_of(
        [
            *room((-1.5, 0, -1.5), (1.5, 2.4, 1.5)),
            box("plate", (-1, 1.06, -0.8), (1, 1.14, 0.8)),
            box("block", (-0.4, -0.02, -0.4), (0.45, 1.8, 0.45)),
            quad("lamp", [[-1.3, 2.3, 0.3], [-0.7, 2.3, 0.3], [-0.7, 2.3, 0.9], [-1.3, 2.3, 0.9]], 0.5, 20),
        ],
        texel_size=texel_size,
    )
