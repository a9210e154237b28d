"""Textures of a scene: pictures of 8 bits a channel in sRGB, decoded to linear float32 through a table.

Arrays are (H, W, 3) float32 with row 0 at the bottom of the picture, as texture coordinates run: v = 0 below, 1 above.
"""

import functools
from pathlib import Path

import numpy as np

from lightloom.golden_model.host.errors import InputError, warn
from lightloom.golden_model.scene.files.named_files import lack

LARGEST_SIDE = 16384

CHECKER_SIDE = 64
CHECKER_DARK = 0.25
"""Dark squares of the built-in checker, as a part of the albedo; the light ones have all of it."""

BUILTIN = ("checker",)

NARROW_MODES = frozenset(
    ("1", "L", "LA", "La", "P", "PA", "RGB", "RGBA", "RGBa", "RGBX", "CMYK", "YCbCr", "LAB", "HSV")
)
"""Pillow's names for pictures of 8 bits a channel or fewer; it cuts the values of others off at 255."""


@functools.cache
def srgb_table() -> np.ndarray:
    """Linear values of the sRGB codes 0 to 255 (IEC 61966-2-1), (256,) float32.

    The curve's power of 12/5 is an exact integer root here, so no library's `pow` decides over a bit.
    """
    out = np.zeros(256, dtype=np.float32)
    for code in range(256):
        if code / 255 <= 0.04045:
            out[code] = code / 255 / 12.92
        else:
            # ((code / 255 + 0.055) / 1.055) ** (12 / 5), as the fifth root of a fraction scaled by 2**300
            out[code] = _fifth_root((1000 * code + 14025) ** 12 * 2**300 // 269025**12) / 2.0**60
    return out


def _fifth_root(number: int) -> int:
    """The greatest integer whose fifth power is not above `number`."""
    low, high = 0, 1 << (number.bit_length() // 5 + 1)
    while high - low > 1:
        middle = (low + high) // 2
        if middle**5 <= number:
            low = middle
        else:
            high = middle
    return low


@functools.cache
def checker() -> np.ndarray:
    """The built-in `checker`: two by two squares, the lower left one light."""
    square = np.arange(CHECKER_SIDE) >= CHECKER_SIDE // 2
    grey = np.where(square[:, None] != square[None, :], CHECKER_DARK, 1.0)
    return np.repeat(grey[..., None], 3, axis=2).astype(np.float32)


def load_texture(path: Path, where: str) -> np.ndarray:
    """The picture of a file; of what it has besides colours it is said that it is left out.

    `where` begins that line, and the message of the InputError for a picture that cannot be used.
    """
    from PIL import Image  # only scenes with textures need it

    if lack(path):
        raise InputError(f"{where}: no such file: {path}")
    try:
        with Image.open(path) as picture:
            if max(picture.size) > LARGEST_SIDE:
                raise InputError(f"{where}: {path} is larger than {LARGEST_SIDE} pixels a side")
            if picture.mode not in NARROW_MODES:
                raise InputError(f"{where}: {path} has more than 8 bits a channel ({picture.mode}); save it with 8")
            if picture.has_transparency_data and np.asarray(picture.convert("RGBA"))[..., 3].min() < 255:
                warn(f"{where}: {path}: left out: alpha")
            codes = np.asarray(picture.convert("RGB"))
    except InputError:
        raise
    except Exception as error:  # whatever the reader meets in a damaged file
        reason = " ".join(str(error).split())[:100] or "no reason given"
        raise InputError(f"{where}: {path} cannot be read as a picture, damaged or cut off ({reason})") from error
    return srgb_table()[codes[::-1]]
