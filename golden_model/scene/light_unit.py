"""The unit of light of a scene: a power of two, so that radiance and irradiance use the range of the formats that hold
them, however bright or dark the scene is.

Everything from the lights to the published maps is linear in the lights. So the lights of a scene that would leave the
range are divided by 2**exponent, once and exactly, all that maintains and reads the maps goes on without knowing, and
pictures are multiplied by it at the end. Hardware has nothing to do for it: the exponent belongs to whoever writes the
lights into memory and shows the picture.
"""

from dataclasses import replace

import numpy as np

from lightloom.golden_model.scene.keyframes import LightPath
from lightloom.golden_model.scene.scene import Scene

PI = 3.141592653589793
AREA_BITS = 14
"""Area lights shine with less than 2**14: they bring less than pi times as much, and binary16 ends at 65504."""
POINT_BITS = 6
"""All point lights together bring less than 2**6 half the scene's longest side away, and up to 2**10 times that near
them, where the maps saturate."""
SPAN_BITS = 18
"""Lights that are up to 2**18 times weaker than these stay as they are."""
HEADROOM_BITS = 10
"""Of contributions that have no bound: what point lights bring, and area lights that shadow rays alone find."""
BALANCED_HEADROOM_BITS = 6
"""Of contributions of area lights where both ways to find them are balanced: at most pi times the emission …

… over the number of rays, and as much again for each bounce, so that nothing saturates unless light adds up to more
than twenty times what the brightest light emits, in one ray."""


def light_exponent(scene: Scene) -> int:
    """Of the unit of light of a scene at rest, for all its frames: 0 where the lights are in range as they are."""
    above = []
    if scene.brightest > 0:
        above.append(int(np.frexp(scene.brightest)[1]) - AREA_BITS)
    if len(scene.point_lights):
        above.append(int(np.frexp(around_point_lights(scene))[1]) - POINT_BITS)
    if scene.environment.shines:
        # As much as an area light brings that is all that a surface sees.
        above.append(int(np.frexp(scene.environment.irradiance / PI)[1]) - AREA_BITS)
    most = max(above, default=0)
    return max(most, 0) + min(most + SPAN_BITS, 0)


def around_point_lights(scene: Scene) -> float:
    """The irradiance that all point lights together bring half the scene's longest side away."""
    return scene.brightest_lights / (scene.half_extent * scene.half_extent)


def in_unit(scene: Scene, exponent: int) -> Scene:
    """A scene at rest whose lights are given in units of 2**exponent; itself for 0."""
    if exponent == 0:
        return scene
    lights = scene.point_lights.copy()
    lights["intensity"] = np.ldexp(lights["intensity"], -exponent)
    paths = tuple(None if path is None else _path_in_unit(path, exponent) for path in scene.light_path)
    return replace(
        scene,
        emission=np.ldexp(scene.emission, -exponent),
        point_lights=lights,
        light_path=paths,
        environment=scene.environment.in_unit(exponent),
        coarse=None if scene.coarse is None else in_unit(scene.coarse, exponent),
    )


def _path_in_unit(path: LightPath, exponent: int) -> LightPath:
    keys = tuple(replace(key, intensity=np.ldexp(key.intensity, -exponent)) for key in path.keys)
    return replace(path, keys=keys)


def fraction_bits(scene: Scene, balanced: bool) -> int:
    """Bits after the binary point for the accumulators of a scene at rest, for all its frames: 0 to 31.

    A contribution saturates at 2**31 / 2**fraction: 2**6 times the brightest emission of an area light and of the sky,
    or more, where they are `balanced`, otherwise 2**10 times; and 2**10 times the irradiance of the sun, and of all
    point lights from half the scene's longest side away. It is resolved to 2**-25, 2**-21 and 2**-21 of these or finer.
    """
    exponents = []
    headroom = BALANCED_HEADROOM_BITS if balanced else HEADROOM_BITS
    for brightest in (scene.brightest, scene.environment.brightest):
        if brightest > 0:
            exponents.append(int(np.frexp(brightest)[1]) + headroom)
    if scene.environment.sun is not None and scene.environment.sun.irradiance.any():
        exponents.append(int(np.frexp(scene.environment.sun.irradiance.max())[1]) + HEADROOM_BITS)
    if len(scene.point_lights):
        exponents.append(int(np.frexp(around_point_lights(scene))[1]) + HEADROOM_BITS)
    return int(np.clip(31 - max(exponents, default=0), 0, 31))
