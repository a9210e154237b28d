"""Pictures of the maintenance itself ([0046]): any quantity of the texels, on the surfaces of the scene or as maps.

A preview shows the scene as the G-buffer sees it, every pixel in the colour of the nearest texel, shaded a little by
the normal and outlined where one object ends, so that the geometry reads. Pixels without a texel are grey. These
pictures are for the eye; nothing of the frame loop depends on them.
"""

import numpy as np

from lightloom.golden_model.pictures.images import atlas
from lightloom.golden_model.tables.lightmap import VALID, Lightmaps

BACKGROUND = (22, 24, 28)
NO_TEXEL = (112, 114, 118)
PALETTES = {
    # Perceptually even and readable without colour vision; matplotlib's, at ten places.
    "viridis": "440154 482878 3e4989 31688e 26828e 1f9e89 35b779 6ece58 b5de2b fde725",
    "inferno": "000004 1b0c41 4a0c6b 781c6d a52c60 cf4446 ed6925 fb9b06 f7d13d fcffa4",
    "magma": "000004 180f3d 440f76 721f81 9e2f7f cd4071 f1605d fd9668 feca8d fcfdbf",
    # For what departs to either side of a middle.
    "blue-red": "2166ac 4393c3 92c5de d1e5f0 f7f7f7 fddbc7 f4a582 d6604d b2182b",
    # For numbers that are names, such as charts and regions: neighbours differ.
    "names": "4e79a7 f28e2b 59a14f e15759 76b7b2 edc948 b07aa1 9c755f ff9da7 bab0ac",
}
"""Colours from low to high, hexadecimal sRGB."""
LIGHT = (0.36, 0.80, 0.48)
"""Direction from which the shading comes, in world space."""
DARKEST = 0.62
"""Part of its colour that a surface keeps that faces away from it."""
OUTLINE = 0.45
"""Part of its colour that a pixel keeps at the border of an object."""


def anchors(palette: str) -> np.ndarray:
    """The colours of a palette, (K, 3) float64, 0 to 255. Raises ValueError for an unknown one."""
    if palette not in PALETTES:
        raise ValueError(f"palette {palette}: unknown; choose one of {', '.join(PALETTES)}")
    return np.array([list(bytes.fromhex(colour)) for colour in PALETTES[palette].split()], dtype=np.float64)


def colours(quantity: np.ndarray, low: float, high: float, palette: str = "viridis") -> np.ndarray:
    """(N,) numbers to 8-bit sRGB (N, 3): `low` and less the first colour, `high` and more the last; NaN as low.

    With the palette "names" numbers are rounded and take their colours in turn; `low` and `high` do not matter.
    """
    table = anchors(palette)
    values = np.nan_to_num(np.asarray(quantity, dtype=np.float64), nan=low)
    if palette == "names":
        return table[np.rint(values).astype(np.int64) % len(table)].astype(np.uint8)
    span = high - low if high > low else 1.0
    place = np.clip((values - low) / span, 0, 1) * (len(table) - 1)
    first = np.minimum(place.astype(np.int64), len(table) - 2)
    part = (place - first)[:, None]
    return np.rint(table[first] * (1 - part) + table[first + 1] * part).astype(np.uint8)


def nearest_texels(lightmaps: Lightmaps, gbuffer: np.ndarray) -> np.ndarray:
    """The texel that each pixel of GBUFFER (H, W) lies on, (H, W) int64, by way of `fill`; -1 where there is none.

    Backs have none, nor have mirrors, glass and the background.
    """
    out = np.full(gbuffer.shape, -1, dtype=np.int64)
    seen = (gbuffer["object"] >= 0) & gbuffer["front"]
    pixel = gbuffer[seen]
    owner = pixel["object"]
    width, height = lightmaps.width[owner].astype(np.int64), lightmaps.height[owner].astype(np.int64)
    column = np.clip(np.floor(pixel["lightmap"][:, 0]).astype(np.int64), 0, width - 1)
    row = np.clip(np.floor(pixel["lightmap"][:, 1]).astype(np.int64), 0, height - 1)
    out[seen] = lightmaps.fill[lightmaps.offset[owner] + row * width + column]
    return out


def preview(
    lightmaps: Lightmaps,
    gbuffer: np.ndarray,
    quantity: np.ndarray,
    low: float,
    high: float,
    palette: str = "viridis",
    *,
    grid: bool = False,
) -> np.ndarray:
    """Numbers (N,) of the texels on the surfaces that GBUFFER (H, W) sees, 8-bit sRGB (H, W, 3).

    `low` and `high` are the ends of the palette. With `grid` every other texel is a little darker, like a chessboard.
    """
    return preview_colours(lightmaps, gbuffer, colours(quantity, low, high, palette), grid=grid)


def preview_colours(lightmaps: Lightmaps, gbuffer: np.ndarray, colour: np.ndarray, *, grid: bool = False) -> np.ndarray:
    """As `preview`, with the texels' colours given, 8-bit sRGB (N, 3)."""
    texel = nearest_texels(lightmaps, gbuffer)
    picture = np.where((texel >= 0)[..., None], colour[np.maximum(texel, 0)], np.array(NO_TEXEL)).astype(np.float64)
    if grid:
        odd = np.floor(gbuffer["lightmap"]).astype(np.int64).sum(axis=-1) & 1
        picture *= np.where((odd == 1) & (texel >= 0), 0.82, 1.0)[..., None]
    towards = np.array(LIGHT) / np.sqrt((np.array(LIGHT) ** 2).sum())
    facing = (gbuffer["normal"].astype(np.float64) * towards).sum(axis=-1)
    # From 0 on the far side to 1, so that no two differently turned faces look alike.
    picture *= (DARKEST + (1 - DARKEST) * (facing * 0.5 + 0.5))[..., None]
    picture[_borders(gbuffer)] *= OUTLINE
    picture[gbuffer["primitive"] < 0] = BACKGROUND
    return np.rint(picture).astype(np.uint8)


def _borders(gbuffer: np.ndarray) -> np.ndarray:
    """Pixels whose neighbour to the right or below is of another object, (H, W) bool."""
    owner = gbuffer["object"]
    border = np.zeros(owner.shape, dtype=bool)
    border[:, :-1] |= owner[:, 1:] != owner[:, :-1]
    border[:-1] |= owner[1:] != owner[:-1]
    return border


def map_view(
    lightmaps: Lightmaps, quantity: np.ndarray, low: float, high: float, palette: str = "viridis", pixels: int = 1
) -> np.ndarray:
    """The maps themselves as one picture, 8-bit sRGB (H, W, 3), a texel `pixels` pixels wide; empty texels are dark."""
    colour = colours(quantity, low, high, palette).astype(np.float32)
    colour[lightmaps.texels["state"] != VALID] *= np.float32(0.25)
    picture = atlas(lightmaps, np.concatenate([colour, np.full((len(colour), 1), 255, dtype=np.float32)], axis=1))
    flat = np.where(picture[..., 3:] > 0, picture[..., :3], np.array(BACKGROUND, dtype=np.float32)).astype(np.uint8)
    return flat.repeat(pixels, axis=0).repeat(pixels, axis=1)
