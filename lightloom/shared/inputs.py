"""Options and array files that the user hands in, and array files written for them.

Everything unusable becomes an InputError that names it and says what to do.
"""

import difflib
import zipfile
import zlib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import IO

import numpy as np

from lightloom.golden_model.host.errors import InputError


def choose(value: str, known: Iterable[str], what: str) -> str:
    """`value` if it is one of `known`; otherwise an error with the close matches, or with all there are."""
    known = list(known)
    if value in known:
        return value
    close = difflib.get_close_matches(value, known, n=3, cutoff=0.5)
    advice = f"did you mean {' or '.join(close)}?" if close else f"choose from {', '.join(known)}"
    raise InputError(f"unknown {what} '{value}'; {advice}")


def image_size(text: str, supersample: int = 1) -> tuple[int, int]:
    """'320x240' to (320, 240): width, height in pixels, each drawn from `supersample` rendered ones a side."""
    from lightloom.golden_model.tables.pinhole import LARGEST_SIDE

    largest = LARGEST_SIDE // supersample
    width, separator, height = text.lower().partition("x")
    if separator and width.isdecimal() and height.isdecimal():
        size = int(width), int(height)
        if all(1 <= side <= largest for side in size):
            return size
    raise InputError(f"--size {text}: give width x height in pixels, 1 to {largest} each, such as 320x240")


def at_least(value: int, least: int, option: str, why: str = "") -> int:
    """`value` if it is no less than `least`."""
    if value < least:
        raise InputError(f"{option} {value}: must be at least {least}{why and f' ({why})'}")
    return value


def whole_numbers(text: str, option: str) -> tuple[int, ...]:
    """'3,8,20' to (3, 8, 20), none below 0."""
    parts = [part.strip() for part in text.split(",")]
    if not all(part.isdecimal() for part in parts):
        raise InputError(f"{option} {text}: give whole numbers with commas between, such as 4,8,16")
    return tuple(int(part) for part in parts)


def seed_value(value: int) -> int:
    """`value` if it fits in 32 bits without a sign."""
    if not 0 <= value < 2**32:
        raise InputError(f"--seed {value}: must be 0 to {2**32 - 1}")
    return value


def require_exposure(value: float | None) -> None:
    """Raises InputError for a factor from radiance to display that is not above 0; None is no factor."""
    if value is not None and not 0 < value < float("inf"):
        raise InputError(f"--exposure {value:g}: must be greater than 0")


def require_samples(directions: int, light_samples: int) -> None:
    """Raises InputError for numbers of rays that no texel update can be made of."""
    from lightloom.golden_model.engine.sampling.settings import Sampling
    from lightloom.golden_model.host.parameters import parameters

    known = parameters(Sampling)
    known["directions"].check(directions, "--directions")
    known["light_samples"].check(light_samples, "--light-samples")


def load_npz(path: Path, names: Iterable[str] | None = None) -> dict[str, np.ndarray]:
    """The arrays of an .npz file, those of `names` that are there or all.

    Raises InputError for a file that is missing or no .npz.
    """
    try:
        with path.open("rb") as source:
            file = np.load(source, allow_pickle=False)
            if not isinstance(file, np.lib.npyio.NpzFile):
                raise InputError(f"{path}: is a single .npy array; save arrays by name, with numpy.savez")
            return {name: file[name] for name in file.files if names is None or name in names}
    except FileNotFoundError:
        raise InputError(f"{path}: no such file") from None
    # Whatever a damaged archive makes NumPy, zipfile and zlib raise.
    except (OSError, ValueError, EOFError, KeyError, NotImplementedError, zipfile.BadZipFile, zlib.error) as error:
        reason = getattr(error, "strerror", None) or "not a readable .npz file"
        raise InputError(f"{path}: {reason}; save arrays by name, with numpy.savez") from error


def read_arrays(path: Path, wanted: Mapping[str, int], option: str) -> dict[str, np.ndarray]:
    """Reads float32 arrays of one length N from an .npz file.

    `wanted` gives, for each name, the number of columns: 0 means shape (N,), k means shape (N, k). Further arrays in
    the file are left alone. Raises InputError for a file that is missing or no .npz, and for an array that is missing
    or has another type, shape or length.
    """
    where = f"{option} {path}"
    shapes = ", ".join(f"{name} ({f'N,{columns}' if columns else 'N'})" for name, columns in wanted.items())
    try:
        arrays = load_npz(path, wanted)
    except InputError as error:
        raise InputError(f"{option} {error}") from error
    for name in wanted:
        if name not in arrays:
            raise InputError(f"{where}: array '{name}' is missing; save {shapes} as float32")
    length = next((len(array) for array in arrays.values() if array.ndim), 0)
    for name, columns in wanted.items():
        array = arrays[name]
        if array.dtype != np.float32:
            raise InputError(f"{where}: array '{name}' is {array.dtype}; save it as float32")
        expected = (length, columns) if columns else (length,)
        if array.shape != expected:
            raise InputError(f"{where}: array '{name}' has shape {array.shape}, not {expected}; save {shapes}")
    return arrays


def save_arrays(file: IO[bytes], arrays: Mapping[str, np.ndarray]) -> None:
    """Writes an .npz file whose bytes depend on the arrays alone (numpy.savez writes the time of day into it)."""
    with zipfile.ZipFile(file, "w") as archive:
        for name, array in arrays.items():
            with archive.open(zipfile.ZipInfo(f"{name}.npy"), "w", force_zip64=True) as member:
                np.lib.format.write_array(member, np.ascontiguousarray(array), allow_pickle=False)
