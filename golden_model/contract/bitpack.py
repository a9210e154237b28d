"""Packs structured arrays into the bits that a unit's payload port carries, and back.

Used by the simulation harness and the cocotb drivers, so that Python never touches one field at a time.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np

from lightloom.golden_model.contract.formats import field_width


def fields(dtype: np.dtype) -> Iterator[tuple[str, tuple[Any, ...], np.dtype, int, int]]:
    """Yields (name, index, scalar dtype, bit offset, bit width) of every scalar of a structured dtype.

    The lowest bit comes first. `index` is () for a plain field and (k,) for element k of a vector field.
    """
    offset = 0
    assert dtype.names is not None, "a structured dtype is needed"
    for name in dtype.names:
        base, shape = dtype[name].base, dtype[name].shape
        width = field_width(base)
        for index in np.ndindex(*shape):
            yield name, index, base, offset, width
            offset += width


def width(dtype: np.dtype) -> int:
    """Width in bits of a structured dtype's payload."""
    return sum(entry[4] for entry in fields(dtype))


def words(dtype: np.dtype) -> int:
    """Number of 32-bit words that hold a payload."""
    return -(-width(dtype) // 32)


BLOCK = 1 << 15
"""Records worked on at a time, so that they stay in the processor's cache while field after field goes by."""


def _pieces(offset: int, bit_width: int) -> Iterator[tuple[int, int, int, int]]:
    """Yields (word, shift in it, place in the field, width) of the parts of a field that no word's end cuts, from the
    lowest on.
    """
    place = 0
    while place < bit_width:
        word, shift = divmod(offset + place, 32)
        size = min(32 - shift, bit_width - place)
        yield word, shift, place, size
        place += size


def _raw(values: np.ndarray) -> np.ndarray:
    """The field's bits, unsigned, in 32 bits or in 64; what is above the field is left as it is."""
    if values.dtype == np.bool_:
        return values.astype(np.uint32)
    unsigned = np.ascontiguousarray(values).view(f"<u{values.dtype.itemsize}")
    return unsigned if unsigned.itemsize == 8 else unsigned.astype(np.uint32, copy=False)


def _value(raw: np.ndarray, base: np.dtype, bit_width: int) -> np.ndarray:
    """The inverse of `_raw`; what is above the field is zero."""
    if base == np.bool_:
        return raw.astype(np.bool_)
    value = raw.astype(f"<u{base.itemsize}").view(base)
    unused = 8 * base.itemsize - bit_width
    return value << unused >> unused if base.kind == "i" and unused else value


def pack(array: np.ndarray) -> np.ndarray:
    """Structured array (N,) to uint32 words (N, words(dtype)), least significant word first."""
    out = np.zeros((array.shape[0], words(array.dtype)), dtype=np.uint32)
    for start in range(0, len(out), BLOCK):
        source, target = array[start : start + BLOCK], out[start : start + BLOCK]
        for name, index, _, offset, bit_width in fields(array.dtype):
            raw = _raw(source[name][(slice(None), *index)])
            for word, shift, place, size in _pieces(offset, bit_width):
                piece = (raw >> raw.dtype.type(place)).astype(np.uint32, copy=False) & np.uint32((1 << size) - 1)
                target[:, word] |= piece << np.uint32(shift)
    return out


def unpack(packed: np.ndarray, dtype: np.dtype) -> np.ndarray:
    """Inverse of `pack`: uint32 words (N, >= words(dtype)) to a structured array (N,); higher bits are ignored."""
    out = np.zeros(packed.shape[0], dtype=dtype)
    for start in range(0, len(out), BLOCK):
        source, target = packed[start : start + BLOCK], out[start : start + BLOCK]
        for name, index, base, offset, bit_width in fields(dtype):
            raw = np.zeros(len(source), dtype=np.uint64 if bit_width > 32 else np.uint32)
            for word, shift, place, size in _pieces(offset, bit_width):
                piece = source[:, word] >> np.uint32(shift) & np.uint32((1 << size) - 1)
                raw = raw | piece.astype(raw.dtype, copy=False) << raw.dtype.type(place)
            target[name][(slice(None), *index)] = _value(raw, base, bit_width)
    return out


def equal(left: np.ndarray, right: np.ndarray) -> np.ndarray:
    """(N,) bool: whether two structured arrays agree in all bits, record by record (NaN equals the same NaN)."""
    return (pack(left) == pack(right)).all(axis=1)
