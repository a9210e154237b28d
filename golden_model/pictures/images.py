"""Pictures for people and for other programs: display mapping, PNG, EXR, films, the lightmaps as one picture.

The frame loop's numbers stay exact; what is here is for the eye (and uses NumPy's powers), so an 8-bit picture may
differ by one step between hosts. EXR files hold the frame loop's own bits.
"""

import io
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from PIL import Image

from lightloom.golden_model.host.outputs import whole_file
from lightloom.golden_model.tables.lightmap import Lightmaps

SHOULDER = 0.75  # display values above it are compressed
FILM_SUFFIXES = (".webp", ".gif", ".png")


def exposure_for(image: np.ndarray, percentile: float = 98.0, level: float = 0.8) -> float:
    """The factor that takes a percentile of the lit pixels of (H, W, 3) linear light to a display level.

    Lights themselves are a small part of a picture, so they do not count for much. 1 for a black picture.
    """
    brightest = image.max(axis=-1)
    lit = brightest[np.isfinite(brightest) & (brightest > 0)]
    return float(level / np.percentile(lit, percentile)) if lit.size else 1.0


def tonemap(image: np.ndarray, exposure: float = 1.0, pixels: int = 1) -> np.ndarray:
    """Linear light (H, W, 3) to 8-bit sRGB (H // pixels, W // pixels, 3).

    With `pixels` > 1 each square of so many pixels a side becomes one: edges become smooth. They are averaged as
    displayed, so that the edge of a light is smooth too.

    The brightest channel stays linear up to `SHOULDER` and from there approaches 1 without reaching it; the others
    keep their ratio to it. So bright walls keep their colour and their gradients, and lights are not merely white.
    """
    linear = np.nan_to_num(image.astype(np.float64), posinf=3e38, neginf=0.0) * exposure
    linear = np.maximum(linear, 0)
    peak = linear.max(axis=-1, keepdims=True)
    over = np.maximum(peak - SHOULDER, 0)
    room = 1 - SHOULDER
    display = linear * np.where(over > 0, (SHOULDER + room * over / (over + room)) / np.maximum(peak, 1e-30), 1.0)
    if pixels > 1:
        height, width = display.shape[0] // pixels, display.shape[1] // pixels
        squares = display[: height * pixels, : width * pixels].reshape(height, pixels, width, pixels, 3)
        display = squares.mean(axis=(1, 3))
    encoded = np.where(
        display <= 0.0031308, 12.92 * display, 1.055 * np.maximum(display, 0.0031308) ** (1 / 2.4) - 0.055
    )
    return np.rint(255 * encoded).astype(np.uint8)


def write_png(path: Path | str, image: np.ndarray) -> None:
    """Writes 8-bit (H, W, 3) sRGB, (H, W, 4) or (H, W)."""
    with whole_file(path) as scratch:
        Image.fromarray(image).save(scratch, format="PNG")


def write_exr(path: Path | str, image: np.ndarray) -> None:
    """Writes linear light (H, W, 3) or (H, W, 4), float32 or float16, lossless."""
    import OpenEXR  # large: not needed by those who write no EXR

    if image.dtype not in (np.float32, np.float16) or image.ndim != 3 or image.shape[2] not in (3, 4):
        raise ValueError(f"an EXR picture is (H, W, 3 or 4) float32 or float16, not {image.shape} {image.dtype}")
    name = "RGB" if image.shape[2] == 3 else "RGBA"
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    packed = io.BytesIO()  # the library's own files lose the end without a word where the disk is full
    with OpenEXR.File(header, {name: np.ascontiguousarray(image)}) as file:
        file.write(packed)
    with whole_file(path) as scratch:
        scratch.write_bytes(packed.getvalue())


def write_film(path: Path | str, frames: Sequence[np.ndarray], frames_per_second: float = 12.0) -> None:
    """Writes 8-bit frames (H, W, 3) as an endless animation, by the suffix of `path`: .webp, .gif or .png (APNG).

    WebP is small and has all colours; GIF is shown everywhere, with one palette for the whole film.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix not in FILM_SUFFIXES or not len(frames):
        raise ValueError(f"{path}: a film has at least one frame and ends in {', '.join(FILM_SUFFIXES)}")
    images = [Image.fromarray(frame) for frame in frames]
    duration = round(1000 / frames_per_second)
    with whole_file(path) as scratch:
        if suffix == ".webp":
            images[0].save(
                scratch, format="WEBP", save_all=True, append_images=images[1:], duration=duration, loop=0, quality=90
            )
        elif suffix == ".gif":
            # The palette of a strip of several frames: with one palette a film does not flicker.
            strip = np.concatenate([frames[round(k)] for k in np.linspace(0, len(frames) - 1, min(len(frames), 6))])
            palette = Image.fromarray(strip).quantize(256, method=Image.Quantize.MEDIANCUT)
            images = [image.quantize(palette=palette, dither=Image.Dither.FLOYDSTEINBERG) for image in images]
            images[0].save(
                scratch,
                format="GIF",
                save_all=True,
                append_images=images[1:],
                duration=duration,
                loop=0,
                optimize=False,
            )
        else:
            images[0].save(scratch, format="PNG", save_all=True, append_images=images[1:], duration=duration, loop=0)


def atlas(lightmaps: Lightmaps, values: np.ndarray, background: float = 0.0, gap: int = 2) -> np.ndarray:
    """All maps in one picture: values (N, K) to (H, W, K), the maps on shelves, the tallest first, `gap` texels apart.

    Rows of a map run downwards as they are stored.
    """
    width, height = lightmaps.width, lightmaps.height
    order = sorted(range(len(width)), key=lambda o: (-height[o], -width[o], o))
    row_length = max(int(width.max()), int(np.sqrt((width.astype(float) * height).sum()) * 1.2))
    places: dict[int, tuple[int, int]] = {}
    x = y = shelf = extent = 0
    for o in order:
        if x and x + width[o] > row_length:
            x, y = 0, y + shelf + gap
            shelf = 0
        places[o] = (x, y)
        shelf = max(shelf, int(height[o]))
        x += int(width[o]) + gap
        extent = max(extent, x - gap)
    picture = np.full((y + shelf, extent, values.shape[1]), background, dtype=values.dtype)
    for o, (left, top) in places.items():
        first = int(lightmaps.offset[o])
        part = values[first : first + width[o] * height[o]].reshape(height[o], width[o], -1)
        picture[top : top + height[o], left : left + width[o]] = part
    return picture
