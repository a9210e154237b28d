"""The Cornell box: the measured data that the Cornell University Program of Computer Graphics publishes.

Lengths as there (about a millimetre). Two things are not as published: the light, which lies in the plane of the
ceiling there, hangs `LIGHT_DROP` below it so that it is seen, as other renderers have it too; and the measured spectra
are represented by their usual RGB values (those of the Cornell box in McGuire's Computer Graphics Archive and of many
renderers).
"""

import numpy as np

from lightloom.golden_model.numerics.vectors import vector
from lightloom.golden_model.scene.assemble import assemble
from lightloom.golden_model.scene.parts import Part
from lightloom.golden_model.scene.scene import Camera, Keyframe, Scene
from lightloom.golden_model.scene.shapes import quad_coordinates, quad_triangles

LIGHT_DROP = 0.5

WHITE = (0.725, 0.71, 0.68)
RED = (0.63, 0.065, 0.05)
GREEN = (0.14, 0.45, 0.091)
LIGHT = (0.78, 0.78, 0.78)  # published: 0.78 at all wavelengths
EMISSION = (17.0, 12.0, 4.0)
BLACK = (0.0, 0.0, 0.0)

Quad = tuple[tuple[float, float, float], ...]

# Corners counter-clockwise as seen from the visible side, which is the order of the published data.
_HANGING = 548.8 - LIGHT_DROP
ROOM: dict[str, tuple[Quad, tuple[float, ...], tuple[float, ...]]] = {
    "floor": (((552.8, 0, 0), (0, 0, 0), (0, 0, 559.2), (549.6, 0, 559.2)), WHITE, BLACK),
    "ceiling": (((556, 548.8, 0), (556, 548.8, 559.2), (0, 548.8, 559.2), (0, 548.8, 0)), WHITE, BLACK),
    "back wall": (((549.6, 0, 559.2), (0, 0, 559.2), (0, 548.8, 559.2), (556, 548.8, 559.2)), WHITE, BLACK),
    "right wall": (((0, 0, 559.2), (0, 0, 0), (0, 548.8, 0), (0, 548.8, 559.2)), GREEN, BLACK),
    "left wall": (((552.8, 0, 0), (549.6, 0, 559.2), (556, 548.8, 559.2), (556, 548.8, 0)), RED, BLACK),
    "light": (
        ((343, _HANGING, 227), (343, _HANGING, 332), (213, _HANGING, 332), (213, _HANGING, 227)),
        LIGHT,
        EMISSION,
    ),
}

# The published top faces; the sides go straight down to the floor, and there is no bottom.
BLOCKS: dict[str, Quad] = {
    "short block": ((130, 165, 65), (82, 165, 225), (240, 165, 272), (290, 165, 114)),
    "tall block": ((423, 330, 247), (265, 330, 296), (314, 330, 456), (472, 330, 406)),
}

CAMERA = Camera(
    position=vector((278, 273, -800)),
    target=vector((278, 273, 280)),
    up=vector((0, 1, 0)),
    # Focal length 0.035, film 0.025 x 0.025; correctly rounded.
    fov_y_tan=np.float32(0.0125 / 0.035),
)

# From the published place once around the middle of the open side, so that the blocks move against the walls.
PATH = tuple(
    Keyframe(frame=frame, position=vector(position), target=vector(target))
    for frame, position, target in (
        (0, (278, 273, -800), (278, 273, 280)),
        (30, (400, 330, -660), (278, 260, 280)),
        (60, (290, 400, -540), (278, 230, 280)),
        (90, (150, 300, -660), (278, 260, 280)),
        (120, (278, 273, -800), (278, 273, 280)),
    )
)


def _block(top: Quad) -> list[Quad]:
    def down(corner: tuple[float, float, float]) -> tuple[float, float, float]:
        return (corner[0], 0.0, corner[2])

    sides = [(down(b), b, a, down(a)) for a, b in zip(top, (*top[1:], top[0]), strict=True)]
    return [top, *sides]


def cornell_box_parts(names: list[str] | None = None) -> list[Part]:
    """The objects of the box, or those of the given names in the given order; KeyError for an unknown name."""

    def part(name: str) -> Part:
        quad, albedo, emission = ROOM.get(name, ((), WHITE, BLACK))
        quads = [quad] if quad else _block(BLOCKS[name])
        corners = quad_triangles(np.array(quads, dtype=np.float64)).astype(np.float32)
        return Part(
            name=name,
            corners=corners,
            albedo=np.array([albedo], dtype=np.float32),
            emission=np.array([emission], dtype=np.float32),
            material=np.zeros(len(corners), dtype=np.int32),
            texture_uv=quad_coordinates(len(quads)),
        )

    return [part(name) for name in (names if names is not None else PART_NAMES)]


PART_NAMES = [*ROOM, *BLOCKS]


def cornell_box() -> Scene:
    """The built-in scene `cornell-box`: 8 objects, 32 triangles."""
    return assemble(
        name="cornell-box",
        parts=cornell_box_parts(),
        where="cornell-box",
        camera=CAMERA,
        camera_path=PATH,
        texel_size=8.0,
    )
