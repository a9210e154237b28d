"""Pictures for people: reading PNG and EXR files, and sheets of captioned pictures."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont, UnidentifiedImageError

from lightloom.golden_model.host.errors import InputError
from lightloom.golden_model.scene.files.exr import read_exr

SUFFIXES = (".png", ".exr")


@dataclass(frozen=True)
class Picture:
    """A picture as it is stored and as light."""

    stored: np.ndarray
    """(H, W, C) as the file has it: uint8 or uint16 from PNG, float16 or float32 from EXR."""
    linear: np.ndarray
    """(H, W, 3) float64, linear light."""

    @property
    def high_range(self) -> bool:
        return self.stored.dtype.kind == "f"


def read_picture(path: Path) -> Picture:
    """Reads a .png (taken as sRGB) or .exr file. Raises InputError for one that is missing, damaged or has no RGB."""
    if not path.is_file():
        raise InputError(f"{path}: no such file")
    stored = read_exr(path) if path.suffix.lower() == ".exr" else _read_png(path)
    colour = np.repeat(stored[..., :1], 3, axis=-1) if stored.shape[-1] < 3 else stored[..., :3]
    if stored.dtype.kind == "f":
        return Picture(stored, colour.astype(np.float64))
    return Picture(stored, srgb_to_linear(colour / np.iinfo(stored.dtype).max))


def _read_png(path: Path) -> np.ndarray:
    try:
        with Image.open(path, formats=["PNG"]) as image:
            plain = image.mode in ("L", "RGB", "RGBA", "I;16")  # not a palette or the like
            array = np.asarray(image if plain else image.convert("RGBA"))
    except (UnidentifiedImageError, OSError, SyntaxError, ValueError) as error:
        raise InputError(f"{path}: not a readable PNG file; write it again") from error
    return array.reshape(*array.shape[:2], -1)


def srgb_to_linear(x: np.ndarray) -> np.ndarray:
    """IEC 61966-2-1, values in [0, 1]."""
    return np.where(x <= 0.04045, x / 12.92, ((x + 0.055) / 1.055) ** 2.4)


def linear_to_srgb(x: np.ndarray) -> np.ndarray:
    """IEC 61966-2-1; clips to [0, 1]."""
    x = np.clip(np.nan_to_num(x), 0, 1)
    return np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1 / 2.4) - 0.055)


def displayed(linear: np.ndarray) -> Image.Image:
    """Linear light (H, W, 3) as an 8-bit sRGB image, clipped."""
    return Image.fromarray(np.rint(255 * linear_to_srgb(linear)).astype(np.uint8))


def sheet(pictures: Sequence[Image.Image], captions: Sequence[str], columns: int, cell: int = 320) -> Image.Image:
    """Pictures in a grid, each scaled to `cell` pixels of width, with its caption below."""
    gap, line = 8, 22
    font = ImageFont.load_default(size=13)
    # Small pictures are enlarged by whole pixels, so that texels stay squares.
    scaled = [
        picture.convert("RGB").resize(
            (cell, max(1, round(picture.height * cell / picture.width))),
            Image.Resampling.NEAREST if picture.width <= cell // 2 else Image.Resampling.LANCZOS,
        )
        for picture in pictures
    ]
    columns = min(columns, len(scaled))
    rows = -(-len(scaled) // columns)
    height = max(picture.height for picture in scaled)
    page = Image.new("RGB", (gap + columns * (cell + gap), gap + rows * (height + line + gap)), "white")
    draw = ImageDraw.Draw(page)
    for index, (picture, caption) in enumerate(zip(scaled, captions, strict=True)):
        row, column = divmod(index, columns)
        x, y = gap + column * (cell + gap), gap + row * (height + line + gap)
        page.paste(picture, (x, y))
        draw.text((x, y + height + 4), _fitted(caption, font, cell), fill="black", font=font)
    return page


def _fitted(text: str, font: ImageFont.FreeTypeFont | ImageFont.ImageFont, width: int) -> str:
    """The text, or as much of its end as fits the width."""
    if font.getlength(text) <= width:
        return text
    while text and font.getlength(f"…{text}") > width:
        text = text[1:]
    return f"…{text}"
