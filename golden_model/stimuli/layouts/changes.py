"""Layouts whose light becomes different: movers, crossings, cuts, flicker, torch, dimmers, things that appear."""

import numpy as np

from lightloom.golden_model.stimuli.layouts.description import FRAMES, Description, colour, key
from lightloom.golden_model.stimuli.layouts.rooms import DAYLIGHT, WARM, plain

LAMP = (0.0, 2.56, -0.3)
"""The middle of the lamp of a plain room."""


def _movers(rng: np.random.Generator, count: int) -> Description:
    out = plain(rng)
    out.ceiling_lamp(LAMP, 0.9, 18 * WARM)
    for number in range(count):
        start, end = rng.uniform([-2, 0.2, -2], [2, 2, 1.2], (2, 3))
        begin = int(rng.integers(0, 16))
        path = [key(begin, translate=(0, 0, 0)), key(begin + int(rng.integers(16, 30)), translate=end - start)]
        out.box(f"mover {number}", start, rng.uniform(0.08, 0.2, 3), colour(rng), path=path)
    return out


def few_movers(rng: np.random.Generator) -> Description:
    """Eight small things fly about, more or less at once."""
    return _movers(rng, 8)


def many_movers(rng: np.random.Generator) -> Description:
    """Forty-eight small things: more than there are influence records."""
    return _movers(rng, 48)


def crossing(rng: np.random.Generator) -> Description:
    """A tall block crosses the room in four frames, twice."""
    out = plain(rng)
    out.ceiling_lamp(LAMP, 0.9, 18 * WARM)
    far = (3.4, 0, 0)
    path = [key(frame, translate=where) for frame, where in ((10, (0, 0, 0)), (14, far), (30, far), (34, (0, 0, 0)))]
    out.box("block", (-1.7, 0.801, rng.uniform(0, 0.8)), (0.5, 1.6, 0.4), colour(rng), path=path)
    return out


def cut(rng: np.random.Generator) -> Description:
    """The camera cuts between two places that see different walls, every twelve frames."""
    out = plain(rng)
    out.ceiling_lamp(LAMP, 0.9, 18 * WARM)
    here = {"position": (0.2, 1.5, 2.1), "target": (rng.uniform(-0.5, 0.5), 0.9, -1)}
    there = {"position": (rng.uniform(-1.5, 1.5), 1.7, -2.1), "target": (rng.uniform(-1, 1), 0.8, 1.5)}
    places = [here, there, here, there]
    path = [key(12 * number + offset, **place) for number, place in enumerate(places) for offset in (0, 11)]
    out.camera(here["position"], here["target"], 0.6, path)
    return out


def flicker(rng: np.random.Generator) -> Description:
    """A lamp that is another in every frame, beside a steady window."""
    out = plain(rng)
    path = [key(frame, emission=rng.uniform(0.2, 1.0)) for frame in range(FRAMES)]
    out.ceiling_lamp(LAMP, 0.7, 24 * WARM, path=path)
    out.lamp("window", (-2.26, 0.9, -1.2), (0, 1.1, 0), (0, 0, 1.6), 1.2 * DAYLIGHT)
    return out


def torch(rng: np.random.Generator) -> Description:
    """The only light is carried through the room."""
    out = plain(rng)
    corners = rng.uniform([-1.6, 0.8, -1.6], [1.6, 1.8, 0.8], (5, 3))
    frames = np.linspace(0, FRAMES - 8, len(corners)).astype(int)
    path = [key(int(frame), position=corner) for frame, corner in zip(frames, corners, strict=True)]
    out.point_light(corners[0], 5 * WARM, path)
    return out


def dimmer(rng: np.random.Generator) -> Description:
    """The lamp goes down to a tenth at frame 8 and up again at frame 28, within two frames."""
    out = plain(rng)
    level = rng.uniform(0.08, 0.12)
    path = [key(frame, emission=value) for frame, value in ((7, 1.0), (9, level), (27, level), (29, 1.0))]
    out.ceiling_lamp(LAMP, 0.8, 22 * WARM, path=path)
    out.lamp("window", (-2.26, 0.9, -1.2), (0, 1.1, 0), (0, 0, 1.2), 0.15 * DAYLIGHT)
    return out


def appearing(rng: np.random.Generator) -> Description:
    """A large block is there for ten frames and away for ten."""
    out = plain(rng)
    out.ceiling_lamp(LAMP, 0.9, 18 * WARM)
    path = [key(frame, present=frame // 10 % 2 == 1) for frame in range(0, FRAMES, 10)]
    place = (rng.uniform(-0.8, 0.8), 0.601, rng.uniform(0, 0.8))
    out.box("block", place, (0.9, 1.2, 0.7), colour(rng), path=path)
    return out


def door(rng: np.random.Generator) -> Description:
    """A dark room beside a lit one; the panel between them slides away from frame 10 to 30."""
    out = plain(rng)
    wall, z = 0.12, -0.9
    gap = rng.uniform(0.8, 1.1)
    side = (4.6 - gap) / 2
    for name, x in (("left of the gap", -(gap + side) / 2), ("right of the gap", (gap + side) / 2)):
        out.box(name, (x, 1.3, z), (side + 0.002, 2.602, wall), colour(rng))
    path = [key(10, translate=(0, 0, 0)), key(30, translate=(gap, 0, 0))]
    out.box("panel", (0, 1.3, z + wall), (gap + 0.2, 2.6, 0.06), colour(rng), path=path)
    out.ceiling_lamp((0, 2.56, -1.6), 0.7, 60 * WARM)
    out.lamp("window", (-2.26, 0.9, 0.4), (0, 1.1, 0), (0, 0, 1.0), 0.3 * DAYLIGHT)
    return out


def hundred_lights(rng: np.random.Generator) -> Description:
    """A hundred small lamps under the ceiling, of many colours and powers; a ball goes through below them."""
    out = plain(rng)
    for number in range(100):
        x, z = (number % 10 - 4.5) * 0.42, (number // 10 - 4.5) * 0.42
        out.ceiling_lamp((x, 2.55, z), 0.06, rng.uniform(4, 120) * rng.uniform(0.3, 1.0, 3), name=f"lamp {number}")
    path = [key(8, translate=(0, 0, 0)), key(36, translate=(3, 0, rng.uniform(-1, 1)))]
    out.sphere("ball", (-1.5, 1.2, 0.6), 0.3, colour(rng), path=path)
    return out
