"""How two results differ: in bits, in energy, and to the eye. The reference is B throughout."""

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from lightloom.golden_model.host.errors import InputError
from lightloom.shared.inputs import load_npz
from lightloom.shared.pictures import SUFFIXES, Picture, displayed, read_picture, sheet

RELATIVE_MSE_FLOOR = 0.01
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])


@dataclass(frozen=True, kw_only=True)
class Difference:
    """The outcome of one comparison; a measure that does not apply is None."""

    name: str
    """The file's name in a folder, the array's name in an .npz file."""
    identical: bool
    """Same type, shape and bits."""
    values: int = 0
    """Values compared."""
    differing: int = 0
    """Values whose bits differ."""
    first: dict[str, Any] | None = None
    """The first difference: index, and both values as numbers and in hex."""
    relative_mse: float | None = None
    """Mean of (A-B)^2 / (B^2 + 0.01) in linear light, over the values finite in both."""
    energy_ratio: float | None = None
    """Sum of A over sum of B, in linear light (of luminance, in pictures)."""
    flip: float | None = None
    """Mean FLIP error, 0 to 1 (LDR-FLIP for PNG, HDR-FLIP for EXR)."""
    note: str = ""
    """Why the two could not be compared value by value."""

    def as_dict(self) -> dict[str, Any]:
        return asdict(self)


def raw_bits(array: np.ndarray) -> np.ndarray:
    """The values' bits as unsigned integers of their size."""
    return np.ascontiguousarray(array).view(f"u{array.dtype.itemsize}")


def compare_bits(name: str, a: np.ndarray, b: np.ndarray, **measures: Any) -> Difference:
    """Compares two arrays of plain numbers bit by bit (a NaN equals only the same NaN, -0 is not +0)."""
    if a.dtype != b.dtype or a.shape != b.shape:
        note = f"{a.dtype} {_size(a)} against {b.dtype} {_size(b)}"
        return Difference(name=name, identical=False, values=b.size, differing=b.size, note=note)
    if not a.size:
        return Difference(name=name, identical=True)
    bits_a, bits_b = raw_bits(a).reshape(-1), raw_bits(b).reshape(-1)
    different = np.flatnonzero(bits_a != bits_b)
    first = None
    if len(different):
        at = different[0]
        digits = 2 * a.dtype.itemsize
        first = {
            "index": [int(i) for i in np.unravel_index(at, a.shape)],
            "a": a.reshape(-1)[at].item(),
            "b": b.reshape(-1)[at].item(),
            "a_hex": f"0x{bits_a[at]:0{digits}X}",
            "b_hex": f"0x{bits_b[at]:0{digits}X}",
        }
    return Difference(
        name=name,
        identical=not len(different),
        values=a.size,
        differing=len(different),
        first=first,
        **measures,
    )


def finite_in_both(a: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The values of two arrays of one shape that are finite in both, (V,) of each array's type."""
    finite = np.isfinite(a) & np.isfinite(b)
    return a[finite], b[finite]


def relative_mse(a: np.ndarray, b: np.ndarray) -> float | None:
    """Mean of (A-B)^2 / (B^2 + 0.01) over the values that are finite in both; None if there are none."""
    a, b = (values.astype(np.float64) for values in finite_in_both(a, b))
    return float(np.mean((a - b) ** 2 / (b**2 + RELATIVE_MSE_FLOOR))) if a.size else None


def energy_ratio(a: np.ndarray, b: np.ndarray) -> float | None:
    """Sum of A over sum of B over the values that are finite in both; None where B has no energy."""
    a, b = finite_in_both(a, b)
    total = float(np.sum(b, dtype=np.float64))
    return float(np.sum(a, dtype=np.float64)) / total if total else None


def flip_error(a: Picture, b: Picture) -> tuple[float, np.ndarray] | None:
    """Mean FLIP and its map (H, W, 3) in [0, 1]; None where a value is not finite (FLIP is not defined there).

    Andersson et al., FLIP: A Difference Evaluator for Alternating Images (2020), and its HDR form (2021), as its
    authors implement it.
    """
    import flip_evaluator

    if not (np.isfinite(a.linear).all() and np.isfinite(b.linear).all()):
        return None
    if not b.high_range:
        test, reference = (np.asarray(displayed(x.linear), dtype=np.float32) / 255 for x in (a, b))
        heat, mean, _ = flip_evaluator.evaluate(reference, test, "LDR")
        return float(mean), heat
    test, reference = (np.maximum(x.linear, 0).astype(np.float32) for x in (a, b))
    # HDR-FLIP takes its exposures from the reference, and the library ends the process when it is black.
    black = float(np.max(reference)) < 1e-6
    exposures = {"startExposure": 0.0, "stopExposure": 1.0, "numExposures": 2} if black else {}
    heat, mean, _ = flip_evaluator.evaluate(reference, test, "HDR", parameters=exposures)
    return float(mean), heat


def compare_pictures(path_a: Path, path_b: Path, name: str) -> tuple[Difference, Image.Image | None]:
    """Compares two picture files; the image shows A, B, where they differ, and the FLIP map."""
    a, b = read_picture(path_a), read_picture(path_b)
    if a.stored.shape != b.stored.shape or a.stored.dtype != b.stored.dtype:
        return compare_bits(name, a.stored, b.stored), None
    flip = flip_error(a, b)
    result = compare_bits(
        name,
        a.stored,
        b.stored,
        relative_mse=relative_mse(a.linear, b.linear),
        energy_ratio=energy_ratio(a.linear @ LUMINANCE, b.linear @ LUMINANCE),
        flip=flip[0] if flip else None,
    )
    signed, scale = signed_map(a.linear, b.linear)
    views = [displayed(a.linear), displayed(b.linear), signed]
    captions = [f"A  {path_a}", f"B  {path_b}", f"A - B, full colour at {scale:.3g}: red A, blue B brighter"]
    if flip:
        views.append(Image.fromarray(np.rint(255 * np.clip(flip[1], 0, 1)).astype(np.uint8)))
        captions.append(f"FLIP, mean {flip[0]:.4f}")
    return result, sheet(views, captions, columns=2, cell=max(320, a.linear.shape[1]))


def signed_map(a: np.ndarray, b: np.ndarray) -> tuple[Image.Image, float]:
    """A - B (luminance) from blue over white to red, and the difference that has full colour.

    The square root of the share is shown, so that small differences are seen.
    """
    difference = np.nan_to_num((a - b) @ LUMINANCE, posinf=0, neginf=0)
    scale = float(np.max(np.abs(difference)))
    share = np.sqrt(np.abs(difference) / scale) if scale else np.zeros_like(difference)
    red, blue = np.array([0.70, 0.09, 0.17]), np.array([0.13, 0.40, 0.67])
    ends = np.where((difference > 0)[..., None], red, blue)
    colour = 1 + share[..., None] * (ends - 1)
    return Image.fromarray(np.rint(255 * colour).astype(np.uint8)), scale


def compare_arrays(path_a: Path, path_b: Path) -> list[Difference]:
    """Compares two .npz files array by array (fields of structured arrays one by one)."""
    a, b = _plain_arrays(path_a), _plain_arrays(path_b)
    results = []
    for name in [*b, *(name for name in a if name not in b)]:
        if name not in a or name not in b:
            present, where = (b[name], "B") if name in b else (a[name], "A")
            results.append(
                Difference(
                    name=name, identical=False, values=present.size, differing=present.size, note=f"only in {where}"
                )
            )
            continue
        left, right = a[name], b[name]
        measures = {}
        if left.dtype.kind == right.dtype.kind == "f" and left.shape == right.shape:
            measures = {"relative_mse": relative_mse(left, right), "energy_ratio": energy_ratio(left, right)}
        results.append(compare_bits(name, left, right, **measures))
    return results


def _plain_arrays(path: Path) -> dict[str, np.ndarray]:
    """The arrays of an .npz file, structured ones field by field."""
    arrays: dict[str, np.ndarray] = {}
    for name, array in load_npz(path).items():
        fields = array.dtype.names or ()
        leaves = [array.dtype[field].base for field in fields] or [array.dtype]
        if any(leaf.kind not in "biuf" or leaf.itemsize > 8 for leaf in leaves):
            raise InputError(f"{path}: array '{name}' is {array.dtype}; only numbers can be compared")
        arrays |= {f"{name}.{field}": array[field] for field in fields} or {name: array}
    if not arrays:
        raise InputError(f"{path}: holds no arrays")
    return arrays


def compare_folders(folder_a: Path, folder_b: Path) -> list[tuple[Difference, Image.Image | None]]:
    """Compares the pictures of two folders pairwise by name."""
    names_a, names_b = (
        {path.name for path in folder.iterdir() if path.suffix.lower() in SUFFIXES} for folder in (folder_a, folder_b)
    )
    for folder, names in ((folder_a, names_a), (folder_b, names_b)):
        if not names:
            raise InputError(f"{folder}: holds no .png or .exr files to compare")
    results: list[tuple[Difference, Image.Image | None]] = []
    for name in sorted(names_a | names_b):
        if name in names_a and name in names_b:
            results.append(compare_pictures(folder_a / name, folder_b / name, name))
        else:
            note = f"only in {'A' if name in names_a else 'B'}"
            results.append((Difference(name=name, identical=False, note=note), None))
    return results


def _size(array: np.ndarray) -> str:
    return "x".join(map(str, array.shape)) or "scalar"
