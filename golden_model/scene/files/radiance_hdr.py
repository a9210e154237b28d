"""Radiance pictures (.hdr): linear light, three mantissas of 8 bits with one exponent a pixel.

As Ward's format is described in Radiance's own filefmts.pdf: plain pixels, or run lengths component by component; the
old run lengths, which nobody writes any more, are refused.
"""

from pathlib import Path

import numpy as np

from lightloom.golden_model.host.errors import InputError
from lightloom.golden_model.scene.files.remarks import Remarks

LARGEST_SIDE = 16384
USUAL_PRIMARIES = "0.640 0.330 0.290 0.600 0.150 0.060 0.333 0.333"
"""Chromaticities that a file without PRIMARIES has; others are taken for these."""
SAID = {"FORMAT", "EXPOSURE", "COLORCORR", "PRIMARIES", "PIXASPECT", "SOFTWARE", "VIEW", "CAPDATE", "GMT", "OWNER"}
"""Lines of the head that are looked at, or say nothing of the light."""
LONGEST_NAME = 20
_BIAS = 136
"""A component is mantissa * 2**(exponent - _BIAS); all are 0 where the exponent is."""
_LONGEST_RUN = 128
_RUNS = (8, 0x7FFF)
"""Widths between which scanlines may have runs."""


def read_hdr(path: Path) -> np.ndarray:
    """The picture of a file, (H, W, 3) float32, its first row on top. Raises InputError for a damaged one."""
    try:
        return _picture(path.read_bytes(), Remarks(path))
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from error
    except (ValueError, IndexError) as error:
        raise InputError(f"{path}: not a readable Radiance picture ({error}); write it again, or as EXR") from error


def _picture(data: bytes, remarks: Remarks) -> np.ndarray:
    head, found, rest = data.partition(b"\n\n")
    lines = head.decode("latin-1").splitlines()
    if not found or not lines or lines[0] not in ("#?RADIANCE", "#?RGBE"):
        raise ValueError("it does not begin as one")
    given = dict(line.split("=", 1) for line in lines[1:] if "=" in line and not line.startswith("#"))
    if given.get("FORMAT", "").strip() != "32-bit_rle_rgbe":
        raise ValueError("its FORMAT is not 32-bit_rle_rgbe")
    if {"EXPOSURE", "COLORCORR"} & set(given):
        raise ValueError("it has an EXPOSURE or COLORCORR, which would have to be undone")
    for name in set(given) - SAID:
        remarks.leave_out(f"`{name[:LONGEST_NAME]}`")
    if given.get("PRIMARIES", USUAL_PRIMARIES).split() != USUAL_PRIMARIES.split():
        remarks.leave_out("`PRIMARIES`")
    if float(given.get("PIXASPECT", 1)) != 1:
        remarks.leave_out("`PIXASPECT`")
    remarks.say()
    size, _, pixels = rest.partition(b"\n")
    words = size.split()
    if len(words) != 4 or words[0] != b"-Y" or words[2] != b"+X":
        raise ValueError("its rows do not run downwards and to the right (-Y H +X W)")
    height, width = int(words[1]), int(words[3])
    if not (1 <= height <= LARGEST_SIDE and 1 <= width <= LARGEST_SIDE):
        raise ValueError(f"it is larger than {LARGEST_SIDE} pixels a side, or empty")
    rgbe, at = np.zeros((height, width, 4), dtype=np.uint8), 0
    for row in rgbe:
        at = _scanline(pixels, at, row)
    mantissa, exponent = rgbe[..., :3].astype(np.float32), rgbe[..., 3:].astype(np.int32)
    return np.where(exponent > 0, np.ldexp(mantissa, exponent - _BIAS), np.float32(0)).astype(np.float32)


def _scanline(data: bytes, at: int, row: np.ndarray) -> int:
    """Reads a scanline from `data` at `at` into `row`, (W, 4) uint8; returns where the next one begins."""
    width = len(row)
    if not (_RUNS[0] <= width <= _RUNS[1] and data[at : at + 2] == b"\x02\x02"):
        plain = np.frombuffer(_bytes(data, at, 4 * width), dtype=np.uint8).reshape(width, 4)
        if (plain[:, :3] == 1).all(axis=1).any():
            raise ValueError("it has run lengths of the old kind")
        row[:] = plain
        return at + 4 * width
    if int.from_bytes(_bytes(data, at + 2, 2), "big") != width:
        raise ValueError("a scanline has another width")
    at += 4
    for component in range(4):
        done = 0
        while done < width:
            count, at = data[at], at + 1
            repeated = count > _LONGEST_RUN
            count -= _LONGEST_RUN if repeated else 0
            if not 0 < count <= width - done:
                raise ValueError("a run is too long")
            step = 1 if repeated else count
            row[done : done + count, component] = np.frombuffer(_bytes(data, at, step), dtype=np.uint8)
            done, at = done + count, at + step
    return at


def _bytes(data: bytes, at: int, count: int) -> bytes:
    """`count` bytes of `data` from `at` on, which have to be there."""
    found = data[at : at + count]
    if len(found) < count:
        raise ValueError("it ends too early")
    return found
