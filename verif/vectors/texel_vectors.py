"""Seeded operands for the units that see to texels: plausible ones, and every kind of corner case.

A family is a function of (count, generator); the functions at the end mix those of a unit.
"""

import numpy as np

from lightloom.golden_model.contract import bitpack
from lightloom.golden_model.contract.formats import (
    F2,
    ONE_SAMPLE,
    PIXEL_BITS,
    RAY_GROUPS,
    RELATIVE_MAX,
    SCREEN_BITS,
    TAPS,
    TEXEL_BLEND,
    TEXEL_MATCH,
    TEXEL_PROJECT,
    field_width,
)
from lightloom.golden_model.engine.selection.texel_match import depth_tolerance
from lightloom.golden_model.numerics.floats import quiet
from lightloom.verif.vectors.ray_vectors import Family, Generator, mixture, raw, specials

SIDES = np.array([0, 1, 2, 3, 160, 1080, 1920, 16384, (1 << SCREEN_BITS) - 1])
"""Of pictures, ends and odd ones among them."""


def unit_vectors_of(shape: tuple[int, ...], rng: Generator) -> np.ndarray:
    """(…, 3) float64 of length 1."""
    out = rng.normal(size=(*shape, 3))
    return out / np.linalg.norm(out, axis=-1, keepdims=True)


def specials_in(family: Family, dtype: np.dtype, fields: int = 3) -> Family:
    """A family with up to `fields` of each operand's float32 numbers replaced by special values."""
    scalars = [(name, index) for name, index, base, _, _ in bitpack.fields(dtype) if base == np.dtype("<f4")]

    def mixed(count: int, rng: Generator) -> np.ndarray:
        out = family(count, rng)
        for _ in range(fields):
            which = rng.integers(0, 2 * len(scalars), count)
            for number, (name, index) in enumerate(scalars):
                rows = np.flatnonzero(which == number)
                out[name][(rows, *index)] = specials((len(rows),), rng)
        return out

    return mixed


# --- texel_project --------------------------------------------------------------------------------------------------


def _seen_at(x: np.ndarray, y: np.ndarray, depth: np.ndarray, size: np.ndarray, rng: Generator) -> np.ndarray:
    """Texels at places of the screen (in parts of its sides, 0 to 1) of depths, from views anywhere."""
    count = len(x)
    out = np.zeros(count, dtype=TEXEL_PROJECT)
    forward = unit_vectors_of((count,), rng)
    right = np.cross(forward, unit_vectors_of((count,), rng))
    right /= np.linalg.norm(right, axis=1, keepdims=True)
    up = np.cross(right, forward)
    eye = rng.normal(size=(count, 3)) * 4
    width, height = size.T
    focal = np.maximum(height, 1) * rng.uniform(0.4, 3, count)
    across, along = (x - 0.5) * width / focal * depth, (0.5 - y) * height / focal * depth
    position = eye + forward * depth[:, None] + right * across[:, None] + up * along[:, None]
    toward = eye - position
    normal = unit_vectors_of((count,), rng)
    normal *= np.where((normal * toward).sum(axis=1) < 0, -1, 1)[:, None] * rng.choice([1, 1, 1, -1], (count, 1))
    # Some are seen edge-on: the sine above the horizon is about as large as the slack.
    unit = toward / np.maximum(np.linalg.norm(toward, axis=1, keepdims=True), 1e-30)
    flat = normal - unit * (normal * unit).sum(axis=1, keepdims=True) * (1 - rng.uniform(-0.05, 0.05, (count, 1)))
    edge = rng.random(count) < 0.2
    normal[edge] = (flat / np.linalg.norm(flat, axis=1, keepdims=True))[edge]
    values = {"position": position, "normal": normal, "eye": eye, "right": right, "up": up, "forward": forward}
    for name, value in values.items():
        out[name] = value
    out["focal"], out["near"] = focal, np.abs(depth) * rng.choice([0.001, 0.5, 1.0], count, p=[0.9, 0.05, 0.05])
    out["width"], out["height"] = width, height
    out["texel_size"] = np.abs(depth) / focal * np.exp2(rng.uniform(-10, 3, count))
    out["facing_shift"] = rng.choice([31, 4, 0], count, p=[0.1, 0.8, 0.1])
    return out


def _depths(count: int, rng: Generator) -> np.ndarray:
    return np.exp2(rng.uniform(-6, 8, count))


def on_the_screen(count: int, rng: Generator) -> np.ndarray:
    """Nearly all of the places on it or just off it."""
    x, y = rng.uniform(-0.05, 1.05, (2, count))
    return _seen_at(x, y, _depths(count, rng), rng.choice([160, 321, 1080, 1920], (count, 2)), rng)


def at_the_border(count: int, rng: Generator) -> np.ndarray:
    """Within two pixels of an end of a row or a column, inside and outside, some by as little as a place may differ;
    pictures of any size."""
    size = rng.choice(SIDES, (count, 2))
    least = 1 / (1 << PIXEL_BITS)
    off = rng.choice([-2, -1, -0.5, -0.25, -2 * least, 0, 2 * least, 0.25, 0.5, 1, 2], (count, 2))
    off = (off + rng.uniform(-least, least, (count, 2))) / np.maximum(size, 1)
    place = rng.integers(0, 2, (count, 2)) + off
    middle = rng.random(count) < 0.5
    place[middle, rng.integers(0, 2, count)[middle]] = 0.5
    return _seen_at(place[:, 0], place[:, 1], _depths(count, rng), size, rng)


def behind_the_eye(count: int, rng: Generator) -> np.ndarray:
    """Behind it, on its plane, at the near plane."""
    depth = _depths(count, rng) * rng.choice([-1, -1e-6, 0, 1e-6, 1], count)
    x, y = rng.uniform(0, 1, (2, count))
    out = _seen_at(x, y, depth, rng.choice([320, 1080], (count, 2)), rng)
    seen = (out["position"] - out["eye"]).astype(np.float64) @ np.ones(3)
    out["near"] = np.where(rng.random(count) < 0.3, np.abs(seen).astype(np.float32), out["near"])
    return out


@quiet
def scaled_scenes(count: int, rng: Generator) -> np.ndarray:
    """The same in units of any size: products overflow and underflow."""
    out = on_the_screen(count, rng)
    scale = np.exp2(rng.integers(-70, 71, count)).astype(np.float32)
    for name in ("position", "eye"):
        out[name] *= scale[:, None]
    for name in ("near", "texel_size"):
        out[name] *= scale
    return out


PROJECT_FAMILIES: dict[str, Family] = {
    "raw": lambda count, rng: raw(TEXEL_PROJECT, count, rng),
    "screen": on_the_screen,
    "border": at_the_border,
    "behind": behind_the_eye,
    "scaled": scaled_scenes,
    "specials": specials_in(on_the_screen, TEXEL_PROJECT, fields=6),
}


# --- texel_match ----------------------------------------------------------------------------------------------------


SPECIAL_HALVES = np.array([0, 1, 0x3FF, 0x400, 0x7BFF, 0x7C00, 0x7E00, 0x8000, 0xFC00], dtype=np.uint16)


def _policies(out: np.ndarray, texel_size: np.ndarray, rng: Generator) -> None:
    """Tests and their bounds, in place: all kinds, the default mostly."""
    count = len(out)
    out["depth_slopes"] = rng.choice([0.0, 1.0, 16.0], count, p=[0.1, 0.8, 0.1])
    out["depth_limit"] = rng.choice([0.0, 0.03125, 1.0], count, p=[0.1, 0.7, 0.2])
    out["depth_relative"] = rng.choice([0.0, 2.0**-10, 1.0], count, p=[0.1, 0.8, 0.1])
    out["depth_fixed"] = texel_size * rng.choice([0.0, 0.25, 16.0], count)
    out["normal_test"], out["depth_test"] = rng.random((2, count)) < 0.8
    out["normal_cosine"] = rng.choice([-1.0, 0.875, 1.0], count, p=[0.1, 0.8, 0.1])
    out["depth_doubt"] = rng.choice([1.0, 4.0, 64.0], count, p=[0.1, 0.8, 0.1])
    out["lod_levels"] = rng.integers(0, 4, count)


def _seen_on_a_slope(out: np.ndarray, rng: Generator) -> None:
    """In place, how texels of a normal and a depth lie to the eye: straight ahead to edge-on, on the screen or off it;
    and what policies make of that.
    """
    count = len(out)
    out["right"] = right = unit_vectors_of((count,), rng)
    up = np.cross(right, unit_vectors_of((count,), rng))
    out["up"] = up / np.linalg.norm(up, axis=1, keepdims=True)
    focal = rng.uniform(60, 4000, count)
    out["focal"] = focal
    out["above"] = out["depth"] * np.exp2(rng.uniform(-8, 0.5, count)) * rng.choice([1, 1, 1, -0.1], count)
    out["outside"] = rng.choice([0.0, 0.25, 1.5, 20.0], count, p=[0.7, 0.1, 0.1, 0.1])
    _policies(out, out["depth"] / focal * np.exp2(rng.uniform(-4, 3, count)), rng)


def around_the_texel(count: int, rng: Generator) -> np.ndarray:
    """Pixels whose normals and depths are about the texel's: some match, some nearly, some see something else."""
    out = np.zeros(count, dtype=TEXEL_MATCH)
    normal = unit_vectors_of((count,), rng)
    bent = normal[:, None] + rng.normal(size=(count, TAPS, 3)) * rng.choice([0.0, 0.1, 0.5, 2.0], (count, TAPS, 1))
    out["normal"] = normal
    out["pixel_normal"] = (bent / np.linalg.norm(bent, axis=2, keepdims=True)).reshape(count, -1).astype(F2)
    out["depth"] = _depths(count, rng)
    _seen_on_a_slope(out, rng)
    steps = rng.choice([-8, -1.5, -1, -0.5, 0, 0.5, 1, 2, 4, 8, 100], (count, TAPS)).astype(np.float32)
    out["pixel_depth"] = out["depth"][:, None] + steps * depth_tolerance(out)[:, None]
    out["pixel_depth"][rng.random((count, TAPS)) < 0.1] = np.inf
    out["pixel_lod"] = rng.choice([-32768, -300, -129, -128, 127, 128, 383, 384, 900, 32767], (count, TAPS))
    return out


def exactly_at_the_bounds(count: int, rng: Generator) -> np.ndarray:
    """Small whole numbers: differences equal to the tolerance, the doubt, the cosine, or a unit beside them."""
    out = around_the_texel(count, rng)
    out["depth"], out["depth_fixed"], out["depth_doubt"] = 64, rng.integers(0, 3, count), rng.integers(1, 4, count)
    out["depth_limit"], out["depth_relative"] = 0, 0  # so the tolerance is `depth_fixed`
    out["pixel_depth"] = 64 - rng.integers(-8, 9, (count, TAPS))
    axis = np.eye(3)[rng.integers(0, 3, count)]
    out["normal"] = axis
    part = rng.choice([0.875, 0.87451171875, 0.87548828125, -0.875, 1.0], (count, TAPS, 1))
    out["pixel_normal"] = (axis[:, None] * part).reshape(count, -1)
    out["normal_cosine"] = 0.875
    return out


def with_special_halves(count: int, rng: Generator) -> np.ndarray:
    """Normals of any binary16 numbers, infinities, NaN and subnormal ones among them; one texel in four."""
    out = specials_in(around_the_texel, TEXEL_MATCH)(count, rng)
    shape = out["pixel_normal"].shape
    bits = rng.integers(0, 1 << 16, shape, dtype=np.uint16)
    bits = np.where(rng.random(shape) < 0.5, rng.choice(SPECIAL_HALVES, shape), bits)
    chosen = rng.random(shape) < 0.05
    out["pixel_normal"] = np.where(chosen, bits, out["pixel_normal"].view(np.uint16)).view(F2)
    return out


MATCH_FAMILIES: dict[str, Family] = {
    "raw": lambda count, rng: raw(TEXEL_MATCH, count, rng),
    "around": around_the_texel,
    "bounds": exactly_at_the_bounds,
    "specials": with_special_halves,
}


# --- texel_blend ----------------------------------------------------------------------------------------------------


def _settings(out: np.ndarray, rng: Generator) -> None:
    """In place: all kinds, the default mostly."""
    count = len(out)
    out["alpha_min"] = rng.choice([0.0, 1 / 32, 0.1, 1.0], count, p=[0.1, 0.1, 0.7, 0.1])
    out["alpha_heavy"] = rng.choice([0.0, 0.5, 1.0], count, p=[0.1, 0.8, 0.1])
    out["notice_factor"] = rng.choice([0, 64, 255], count, p=[0.1, 0.8, 0.1])
    out["notice_floor"] = rng.choice([0, 13, RELATIVE_MAX], count, p=[0.1, 0.8, 0.1])
    out["notice_count"] = rng.choice([0, 1, 8, 255], count, p=[0.1, 0.1, 0.7, 0.1])


def samples_in(whole: np.ndarray, rng: Generator) -> np.ndarray:
    """Counts of whole samples, and in a third of the cases any number of 16ths more."""
    parts = rng.integers(0, ONE_SAMPLE, len(whole)) * (rng.random(len(whole)) < 1 / 3)
    return whole * ONE_SAMPLE + parts


def updates(count: int, rng: Generator) -> np.ndarray:
    """Texels on their way: samples of some rays, about as bright as the average."""
    out = np.zeros(count, dtype=TEXEL_BLEND)
    out["fraction"] = rng.integers(12, 29, count)
    level = np.exp2(rng.uniform(8, 26, (count, 1)))
    sample = level * rng.uniform(0.2, 1.8, (count, 3))
    out["rays"] = rng.choice([1, 2, 4, 16, 1024], (count, RAY_GROUPS))
    out["rays"][rng.random(count) < 0.1, 1] = 0
    out["total"] = sample * out["rays"].sum(axis=1, keepdims=True)
    mean = level / 16 * rng.uniform(0.2, 1.8, (count, RAY_GROUPS))
    out["sums"] = mean * out["rays"]
    out["squares"] = out["sums"] * mean * rng.choice([0.9, 1, 1.1, 4], (count, RAY_GROUPS))
    ratio = rng.choice([0.25, 0.9, 1, 1.02, 2], (count, 1))
    out["irradiance"] = np.ldexp(out["total"] * ratio, -out["fraction"][:, None].astype(np.int32))
    out["count"] = samples_in(rng.choice([0, 1, 2, 3, 4, 7, 8, 9, 40, 254, 255], count), rng)
    out["heavy"] = rng.choice([0, 0, 1, 7], count)
    out["deviation"] = rng.choice([0, 1, 20, 60, 200, RELATIVE_MAX], count)
    out["bias"] = rng.choice([0, 1, 20, 60, 200, RELATIVE_MAX], count) * rng.choice([-1, 1], count)
    _settings(out, rng)
    return out


def dark_and_glaring(count: int, rng: Generator) -> np.ndarray:
    """Nothing has come, or nothing was there, or as much as the accumulators hold."""
    out = updates(count, rng)
    for name in ("irradiance", "total", "sums", "squares"):
        width = field_width(TEXEL_BLEND[name].base)
        most = np.float32(3e38) if name == "irradiance" else (1 << (width - (name == "total"))) - 1
        out[name][rng.random(count) < 0.3] = 0
        out[name][rng.random(count) < 0.1] = most
    out["total"][rng.random(count) < 0.1] = -(1 << 44)
    return out


def dropped(count: int, rng: Generator) -> np.ndarray:
    """Texels of which nothing is known hold anything."""
    out = specials_in(updates, TEXEL_BLEND)(count, rng)
    out["count"] = 0
    return out


def suddenly_bright(count: int, rng: Generator) -> np.ndarray:
    """Samples that are a power of two times the average, and a little more: each bit of a deviation set alone."""
    out = updates(count, rng)
    out["fraction"] = 12
    sample = (1 << rng.integers(0, 24, (count, 1))) + rng.integers(0, 17, (count, 1))
    out["total"] = sample << 12
    out["irradiance"] = 1
    out["count"] = samples_in(rng.choice([1, 2, 4, 8, 255], count), rng)
    return out


BLEND_FAMILIES: dict[str, Family] = {
    "raw": lambda count, rng: raw(TEXEL_BLEND, count, rng),
    "updates": updates,
    "dark": dark_and_glaring,
    "dropped": dropped,
    "bright": suddenly_bright,
    "specials": specials_in(updates, TEXEL_BLEND),
}


# --- all of them ----------------------------------------------------------------------------------------------------


def texel_project_vectors(count: int, seed: int) -> np.ndarray:
    """TEXEL_PROJECT (count,); about two in five are visible."""
    return mixture(PROJECT_FAMILIES, count, seed)


def texel_match_vectors(count: int, seed: int) -> np.ndarray:
    """TEXEL_MATCH (count,); all degrees, with all of the tests."""
    return mixture(MATCH_FAMILIES, count, seed)


def texel_blend_vectors(count: int, seed: int) -> np.ndarray:
    """TEXEL_BLEND (count,); a texel in three is dropped or new."""
    return mixture(BLEND_FAMILIES, count, seed)
