"""What layouts are built of: a scene description (docs/scenes.md), piece by piece. Metres; y is up."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

Vector = Sequence[float] | np.ndarray
Table = dict[str, Any]

FRAMES = 48
SIZE = [120, 80]
WHITE, GREY, RED, GREEN, BLUE, WOOD = (
    [0.74, 0.73, 0.7],
    [0.5, 0.5, 0.5],
    [0.6, 0.12, 0.08],
    [0.2, 0.46, 0.16],
    [0.15, 0.25, 0.55],
    [0.45, 0.32, 0.2],
)
COLOURS = (WHITE, GREY, RED, GREEN, BLUE, WOOD)
DIGITS = 4
"""Of all numbers in a description: a tenth of a millimetre."""


class Description:
    """A scene in the making: the tables of its file, and mesh files beside it.

    Its texels have a side of `texel_size`; a light whose emission is not said gives `emission`.
    """

    def __init__(self, texel_size: float):
        self.tables: Table = {
            "texel_size": texel_size,
            "render": {"frames": FRAMES, "size": SIZE},
            "camera": {},
            "quad": [],
            "box": [],
            "sphere": [],
            "mesh": [],
            "point_light": [],
        }
        self.files: dict[str, str] = {}
        """Name of a mesh file to its text."""

    def quad(self, name: str, corner: Vector, u: Vector, v: Vector, albedo: Vector = WHITE, **keys: Any) -> Table:
        """The parallelogram from `corner` along `u` and `v`, seen from where u x v points."""
        o, a, b = (np.asarray(each, dtype=float) for each in (corner, u, v))
        return self._add("quad", name, keys, corners=[o, o + a, o + a + b, o + b], albedo=albedo)

    def box(self, name: str, center: Vector, size: Vector, albedo: Vector = GREY, **keys: Any) -> Table:
        return self._add("box", name, keys, center=center, size=size, albedo=albedo)

    def sphere(self, name: str, center: Vector, radius: float, albedo: Vector = GREY, **keys: Any) -> Table:
        return self._add("sphere", name, {"subdivisions": 2} | keys, center=center, radius=radius, albedo=albedo)

    def mesh(self, name: str, text: str, albedo: Vector = GREY, **keys: Any) -> Table:
        """A mesh file of that text beside the scene."""
        self.files[f"{name}.obj"] = text
        return self._add("mesh", None, keys, file=f"{name}.obj", albedo=albedo)

    def lamp(self, name: str, corner: Vector, u: Vector, v: Vector, emission: Vector, **keys: Any) -> Table:
        """A parallelogram that shines where u x v points."""
        return self.quad(name, corner, u, v, GREY, emission=emission, **keys)

    def point_light(self, position: Vector, intensity: Vector, path: Sequence[Table] = ()) -> None:
        light = {"position": position, "intensity": intensity} | ({"path": path} if path else {})
        self.tables["point_light"].append(_plain(light))

    def camera(self, position: Vector, target: Vector, fov_y_tan: float = 0.55, path: Sequence[Table] = ()) -> None:
        self.tables["camera"] = _plain({"position": position, "target": target, "fov_y_tan": fov_y_tan})
        if path:
            self.tables["camera"]["path"] = _plain(list(path))

    def room(self, size: Vector, albedo: Mapping[str, Vector] | None = None, without: Sequence[str] = ()) -> None:
        """A room whose floor's middle is the origin, seen from within; `size` is width (x), height and depth (z).

        Its sides are floor, ceiling, left, right, back (where z is least) and front.
        """
        (w, h, d), colours = size, albedo or {}
        left, right, back, front = -w / 2, w / 2, -d / 2, d / 2
        sides: dict[str, tuple[Vector, Vector, Vector]] = {
            "floor": ((left, 0, back), (0, 0, d), (w, 0, 0)),
            "ceiling": ((left, h, back), (w, 0, 0), (0, 0, d)),
            "left": ((left, 0, back), (0, h, 0), (0, 0, d)),
            "right": ((right, 0, back), (0, 0, d), (0, h, 0)),
            "back": ((left, 0, back), (w, 0, 0), (0, h, 0)),
            "front": ((left, 0, front), (0, h, 0), (w, 0, 0)),
        }
        for name, (corner, u, v) in sides.items():
            if name not in without:
                self.quad(name, corner, u, v, colours.get(name, WOOD if name == "floor" else WHITE))

    def ceiling_lamp(self, middle: Vector, side: float, emission: Vector, **keys: Any) -> Table:
        """A square that shines downwards, its middle given."""
        x, y, z = middle
        corner = (x - side / 2, y, z - side / 2)
        return self.lamp(keys.pop("name", "lamp"), corner, (side, 0, 0), (0, 0, side), emission, **keys)

    def furnish(self, rng: np.random.Generator, count: int, size: Vector, keep_off: float = 0.8) -> None:
        """Boxes of any size and rotation on the floor of a room of that size, none within `keep_off` of its middle."""
        for number in range(count):
            sides = rng.uniform([0.3, 0.3, 0.3], [0.9, 1.4, 0.9])
            side = rng.choice([-1, 1])
            x = side * rng.uniform(keep_off, max(size[0] / 2 - 0.7, keep_off + 0.01))
            z = rng.uniform(-size[2] / 2 + 0.7, size[2] / 2 - 1.2)
            # A millimetre above the floor, so that no two surfaces lie in one plane.
            middle = (x, sides[1] / 2 + 0.001, z)
            self.box(f"box {number}", middle, sides, colour(rng), rotate=rotation(rng))

    def _add(self, kind: str, name: str | None, keys: Mapping[str, Any], **own: Any) -> Table:
        table = _plain({**({"name": name} if name else {}), **own, **keys})
        self.tables[kind].append(table)
        return table

    def finished(self) -> Table:
        """The description, without tables of which there are none."""
        return {name: table for name, table in self.tables.items() if table not in ([], {})}


def key(frame: int, **values: Any) -> Table:
    """A keyframe."""
    return _plain({"frame": frame, **values})


def colour(rng: np.random.Generator) -> Vector:
    return COLOURS[rng.integers(len(COLOURS))]


def rotation(rng: np.random.Generator) -> list[float]:
    """A rotation about the vertical by up to a quarter either way, as a quaternion."""
    return [1.0, 0.0, round(float(rng.uniform(-1, 1)), DIGITS), 0.0]


def _plain(value: Any) -> Any:
    """Plain numbers of few digits, as a file has them."""
    if isinstance(value, Mapping):
        return {name: _plain(each) for name, each in value.items()}
    if isinstance(value, bool | str | int):
        return value
    if isinstance(value, float | np.floating):
        return round(float(value), DIGITS)
    if isinstance(value, np.integer):
        return int(value)
    return [_plain(each) for each in value]
