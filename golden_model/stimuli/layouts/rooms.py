"""Layouts whose light stays as it is: rooms, arcades, corridors round corners, thin walls, boxes that meet, curves."""

import numpy as np

from lightloom.golden_model.stimuli.layouts.description import (
    BLUE,
    FRAMES,
    GREEN,
    GREY,
    RED,
    WHITE,
    WOOD,
    Description,
    colour,
    key,
    rotation,
)

DAYLIGHT, WARM = np.array([0.8, 1.0, 1.3]), np.array([1.3, 1.0, 0.65])


def room(rng: np.random.Generator) -> Description:
    """A furnished room under a lamp; the camera walks through it, and stands still from frame 28 on."""
    size = rng.uniform([4.5, 2.6, 5.5], [6.5, 3.2, 7.5])
    out = Description(0.2)
    out.room(size, {"left": colour(rng), "right": colour(rng)})
    out.ceiling_lamp((rng.uniform(-1, 1), size[1] - 0.05, rng.uniform(-1.5, 1)), 0.8, 22 * WARM)
    out.furnish(rng, 6, size)
    start, end = (0, 1.5, size[2] / 2 - 0.3), (rng.uniform(-0.5, 0.5), 1.4, size[2] / 2 - 2)
    looks = (rng.uniform(-1, 1), 1, -size[2] / 2)
    out.camera(start, looks, path=[key(4, position=start, target=looks), key(28, position=end, target=looks)])
    return out


def _arcade(rng: np.random.Generator) -> Description:
    """Columns along a hall; daylight falls in between them from a long window behind."""
    out = Description(0.22)
    size = (6.0, 3.2, 9.0)
    out.room(size, {"back": colour(rng)})
    window = (-size[0] / 2 + 0.04, 0.9, -size[2] / 2 + 0.5)
    out.lamp("window", window, (0, 1.9, 0), (0, 0, size[2] - 1), rng.uniform(4, 8) * DAYLIGHT)
    count = int(rng.integers(5, 8))
    for number, z in enumerate(np.linspace(-size[2] / 2 + 0.8, size[2] / 2 - 1, count)):
        width = rng.uniform(0.35, 0.55)
        out.box(f"column {number}", (-1.2, size[1] / 2, z), (width, size[1] - 0.002, width), WHITE)
    out.camera((1.6, 1.6, size[2] / 2 - 0.3), (-1, 1.1, -2), 0.6)
    return out


def arcade(rng: np.random.Generator) -> Description:
    """An arcade, and nothing moves."""
    return _arcade(rng)


def arcade_walk(rng: np.random.Generator) -> Description:
    """An arcade, and someone walks through the light between the columns."""
    out = _arcade(rng)
    path = [key(6, translate=(0, 0, 0)), key(40, translate=(0.3, 0, rng.uniform(-5.5, -4)))]
    out.box("walker", (0.2, 0.851, 3), (0.45, 1.7, 0.35), colour(rng), path=path)
    return out


def _corridor(rng: np.random.Generator) -> tuple[Description, float]:
    """Two arms that meet at a right angle, the lamp at the end of the one that is not seen; and the arm's length."""
    out = Description(0.2)
    width, height, arm = rng.uniform(1.7, 2.3), 2.6, rng.uniform(5, 6.5)
    x, end = width / 2, -arm
    far = -arm - width
    out.quad("floor 1", (-x, 0, far), (0, 0, arm + width), (width, 0, 0), WOOD)
    out.quad("ceiling 1", (-x, height, far), (width, 0, 0), (0, 0, arm + width))
    out.quad("left", (-x, 0, far), (0, height, 0), (0, 0, arm + width), colour(rng))
    out.quad("right", (x, 0, end), (0, 0, arm), (0, height, 0))
    out.quad("near", (-x, 0, 0), (0, height, 0), (width, 0, 0))
    out.quad("floor 2", (x, 0, far), (0, 0, width), (arm, 0, 0), WOOD)
    out.quad("ceiling 2", (x, height, far), (arm, 0, 0), (0, 0, width))
    out.quad("far", (-x, 0, far), (width + arm, 0, 0), (0, height, 0), colour(rng))
    out.quad("beside", (x, 0, end), (0, height, 0), (arm, 0, 0))
    out.quad("end", (x + arm, 0, far), (0, 0, width), (0, height, 0), WHITE)
    lamp = (x + arm * rng.uniform(0.55, 0.8), height - 0.04, (end + far) / 2)
    out.ceiling_lamp(lamp, 0.7, rng.uniform(40, 70) * WARM)
    out.box("chest", (-x + 0.35, 0.301, end * 0.6), (0.6, 0.6, 0.8), colour(rng), rotate=rotation(rng))
    return out, arm


def corridor(rng: np.random.Generator) -> Description:
    """A corridor round a corner, lit from behind the corner; nothing moves."""
    out, arm = _corridor(rng)
    out.camera((0, 1.5, -0.3), (0, 1.1, -arm), 0.6)
    return out


def corridor_walk(rng: np.random.Generator) -> Description:
    """The same, walked down to the corner, where the camera turns into the lit arm."""
    out, arm = _corridor(rng)
    start, corner = (0, 1.5, -0.3), (0, 1.5, -arm - 0.6)
    path = [
        key(0, position=start, target=(0, 1.1, -arm)),
        key(30, position=corner, target=(0.6, 1.1, -arm - 2)),
        key(40, position=corner, target=(4, 1.1, -arm - 1)),
    ]
    out.camera(start, (0, 1.1, -arm), 0.6, path)
    return out


def thin_walls(rng: np.random.Generator) -> Description:
    """Rooms beside each other with walls of one to five centimetres, one of them lit; shelves that meet the walls."""
    out = Description(0.16)
    size = (6.0, 2.6, 5.0)
    out.room(size)
    for number, x in enumerate((-1.0, 1.0)):
        thick = rng.uniform(0.01, 0.05)
        reach = size[2] * (1 if number else rng.uniform(0.7, 0.8))
        z = -size[2] / 2 + reach / 2
        out.box(f"wall {number}", (x, size[1] / 2, z), (thick, size[1], reach), colour(rng))
    out.ceiling_lamp((-2, size[1] - 0.04, rng.uniform(-1.5, 0)), 0.6, rng.uniform(25, 40) * WARM)
    for number in range(3):
        height = rng.uniform(0.5, 1.9)
        out.box(f"shelf {number}", (-2.9, height, rng.uniform(-1.8, 1)), (0.4, 0.03, 1.1), WOOD)
    out.camera((-0.2, 1.6, size[2] / 2 - 0.2), (-0.6, 1.0, -1.5), 0.75)
    return out


def meeting_boxes(rng: np.random.Generator) -> Description:
    """Boxes that stand in each other, in the walls and in the floor."""
    out = Description(0.18)
    size = (5.0, 2.8, 5.0)
    out.room(size, {"left": RED, "right": GREEN})
    out.ceiling_lamp((0, size[1] - 0.04, 0), 1.0, 16 * WARM)
    for number in range(10):
        middle = rng.uniform([-2.3, 0.1, -2.3], [2.3, 1.0, 0.6])
        out.box(f"box {number}", middle, rng.uniform(0.4, 1.3, 3), colour(rng), rotate=rotation(rng))
    out.camera((0, 1.8, size[2] / 2 - 0.2), (0, 0.9, -1), 0.6)
    return out


def curves(rng: np.random.Generator) -> Description:
    """Vases and balls, whose charts are curved; the camera goes a quarter round them."""
    out = Description(0.14)
    size = (5.0, 2.8, 5.0)
    out.room(size, {"left": BLUE})
    out.ceiling_lamp((rng.uniform(-1, 1), size[1] - 0.04, 0.5), 0.9, 20 * WARM)
    for number in range(2):
        place = (rng.uniform(-1.4, -0.5) if number else rng.uniform(0.5, 1.4), 0.001, rng.uniform(-1.2, 0))
        out.mesh(f"vase-{number}", vase(rng), colour(rng), translate=place)
    for number in range(2):
        radius = rng.uniform(0.2, 0.4)
        place = (rng.uniform(-1.2, 1.2), radius + 0.001, rng.uniform(0.3, 0.9))
        out.sphere(f"ball {number}", place, radius, colour(rng), subdivisions=3)
    looks = (0, 0.6, -0.5)
    path = [key(0, position=(-1.6, 1.5, 2.2), target=looks), key(FRAMES - 12, position=(1.6, 1.5, 2.2), target=looks)]
    out.camera((-1.6, 1.5, 2.2), looks, 0.55, path)
    return out


def vase(rng: np.random.Generator, around: int = 24, along: int = 14) -> str:
    """An OBJ file of a closed surface of revolution about the y axis, a metre high or less, standing on y = 0."""
    height, belly, waist = rng.uniform([0.6, 0.1, -1.2], [1.0, 0.5, 1.2])
    s = np.linspace(0, 1, along + 1)
    radii = 0.15 + s * (1 - s) * (belly + waist * (s - 0.5) * 2)
    # Points of a quarter of a circle by fractions, which are the same on every machine; the others by turns of it.
    t = np.arange(around // 4) / (around // 4)
    circle = [((1 - t * t) / (1 + t * t), 2 * t / (1 + t * t))]
    for _ in range(3):
        circle.append((-circle[-1][1], circle[-1][0]))
    x, z = (np.concatenate(each) for each in zip(*circle, strict=True))
    lines = ["o vase", "v 0 0 0", f"v 0 {height:.4f} 0"]
    for radius, level in zip(radii, height * s, strict=True):
        lines += [f"v {radius * a:.4f} {level:.4f} {radius * b:.4f}" for a, b in zip(x, z, strict=True)]

    def at(ring: int, place: int) -> int:
        return 3 + ring * around + place % around

    for k in range(around):
        lines.append(f"f 1 {at(0, k)} {at(0, k + 1)}")
        lines.append(f"f 2 {at(along, k + 1)} {at(along, k)}")
        lines += [f"f {at(r, k)} {at(r + 1, k)} {at(r + 1, k + 1)} {at(r, k + 1)}" for r in range(along)]
    return "\n".join(lines) + "\n"


def plain(rng: np.random.Generator) -> Description:
    """A small room with three boxes, which layouts of changing light begin with; the camera stands still."""
    size = (4.6, 2.6, 4.6)
    out = Description(0.16)
    out.room(size, {"left": colour(rng), "right": colour(rng), "back": GREY})
    for number in range(3):
        sides = rng.uniform(0.4, 1.0, 3)
        middle = (rng.uniform(-1.5, 1.5), sides[1] / 2 + 0.001, rng.uniform(-1.6, 0.4))
        out.box(f"box {number}", middle, sides, colour(rng), rotate=rotation(rng))
    out.camera((0.2, 1.5, size[2] / 2 - 0.2), (0, 0.9, -1), 0.6)
    return out
