"""Sky and sun in scene descriptions (docs/scenes.md)."""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from lightloom.golden_model.host.errors import InputError
from lightloom.golden_model.numerics.affine import rotation_matrix
from lightloom.golden_model.numerics.vectors import vector
from lightloom.golden_model.scene.environment import Environment, Sky, Sun
from lightloom.golden_model.scene.files.exr import read_exr
from lightloom.golden_model.scene.files.named_files import lack
from lightloom.golden_model.scene.files.radiance_hdr import LARGEST_SIDE, read_hdr
from lightloom.golden_model.scene.files.toml.tables import Table

LARGEST_ANGLE = 90.0
"""Of a sun, in degrees; the real one has half a degree."""
READERS: dict[str, Callable[[Path], np.ndarray]] = {".exr": read_exr, ".hdr": read_hdr}
"""Of pictures of a sky, by their suffix."""


def environment(scene: Table, folder: Path) -> Environment:
    """What the tables [sky] and [sun] of a scene description say; paths are relative to `folder`."""
    return Environment(sky=_sky(scene, folder), sun=_sun(scene))


def _sky(scene: Table, folder: Path) -> Sky | None:
    if "sky" not in scene:
        return None
    table = Table(f"{scene.where}, [sky]", scene.values["sky"], ("radiance", "image", "scale", "rotate"))
    if ("radiance" in table) == ("image" in table):
        raise InputError(f"{table.where}: give either `radiance` or `image`")
    if "radiance" in table:
        for key in ("scale", "rotate"):
            if key in table:
                raise InputError(f"{table.where}: `{key}` is of use with an `image` only")
        radiance = np.array(table.not_negative("radiance"), dtype=np.float32).reshape(1, 1, 3)
    else:
        radiance = _image(table, folder)
    return Sky(radiance=radiance, rotation=rotation_matrix(*table.quaternion("rotate")).astype(np.float32))


def _image(table: Table, folder: Path) -> np.ndarray:
    """The picture of a sky times its scale, (H, 2 H, 3) float32."""
    file = folder / table.text("image")
    if lack(file):
        raise InputError(f"{table.where}: no such file: {file}")
    if file.suffix.lower() not in READERS:
        raise InputError(f"{table.where}: {file} is not linear light; give an .exr or .hdr file")
    several = isinstance(table.values.get("scale"), list)
    scale = table.numbers("scale", 3) if several else [table.number("scale", 1.0)] * 3
    if min(scale) <= 0:
        raise InputError(f"{table.where}: `scale` must be greater than 0, not {scale}")
    try:
        stored = READERS[file.suffix.lower()](file)
    except InputError as error:
        raise InputError(f"{table.where}: {error}") from error
    height, width = stored.shape[:2]
    if width != 2 * height or width > LARGEST_SIDE:
        raise InputError(
            f"{table.where}: {file} has {width}x{height} pixels; a sky by latitude and longitude is twice as wide as "
            f"high, and at most {LARGEST_SIDE} wide"
        )
    colour = np.repeat(stored[..., :1], 3, axis=-1) if stored.shape[-1] < 3 else stored[..., :3]
    with np.errstate(over="ignore", invalid="ignore"):
        radiance = (colour.astype(np.float64) * scale).astype(np.float32)
    usable = (np.isfinite(radiance) & (radiance >= 0)).all(axis=-1)
    if not usable.all():
        row, column = np.argwhere(~usable)[0]
        raise InputError(
            f"{table.where}: {file} is negative, not finite or too bright in row {row}, column {column}; mend it"
        )
    return radiance


def _sun(scene: Table) -> Sun | None:
    if "sun" not in scene:
        return None
    table = Table(f"{scene.where}, [sun]", scene.values["sun"], ("towards", "irradiance", "angle"))
    towards = direction(table, "towards")
    angle = table.number("angle", 0.53)
    if not 0 <= angle <= LARGEST_ANGLE:
        raise InputError(f"{table.where}: `angle` must lie within 0 to {LARGEST_ANGLE:g} degrees, not {angle:g}")
    return Sun(
        towards=towards,
        irradiance=vector(table.not_negative("irradiance")),
        angle=angle,
    )


def direction(table: Table, key: str) -> np.ndarray:
    """Three numbers as a unit vector, (3,) float32."""
    x, y, z = table.numbers(key, 3)
    largest = max(abs(x), abs(y), abs(z))
    if largest == 0:
        raise InputError(f"{table.where}: `{key}` must not be all zero; it is a direction")
    x, y, z = x / largest, y / largest, z / largest  # so that no square leaves the range
    length = np.sqrt(x * x + y * y + z * z)
    return np.array([x / length, y / length, z / length], dtype=np.float32)
