"""Operands for a unit that has no vectors of its own: every field by its type, special values and any bits mixed."""

import numpy as np

from lightloom.golden_model.contract import bitpack
from lightloom.golden_model.contract.formats import field_width

SPECIAL = 0.25
"""What part of the values is special."""


def any_vectors(dtype: np.dtype, count: int, seed: int) -> np.ndarray:
    """`count` operands of a structured dtype; the same for the same seed."""
    rng = np.random.default_rng([seed, *str(dtype).encode()])
    out = np.zeros(count, dtype)
    for name in dtype.names or ():
        base, shape = dtype[name].base, (count, *dtype[name].shape)
        bits = rng.integers(0, 1 << field_width(base), shape, dtype=np.uint64)
        bits = np.where(rng.random(shape) < SPECIAL, rng.choice(_special(base), shape), bits)
        raw = bits.astype(f"<u{base.itemsize}")
        out[name] = raw.astype(bool) if base == np.bool_ else raw.view(base)
    return bitpack.unpack(bitpack.pack(out), dtype)  # signed fields may be narrower than their type


def _special(base: np.dtype) -> np.ndarray:
    """Of a number: zeros, subnormals, the ends of the normal numbers, ones, infinities, NaN. Of an integer: all zeros,
    all ones, the sign alone. As uint64."""
    if base.kind != "f":
        width = field_width(base)
        return np.array([0, (1 << width) - 1, 1 << (width - 1)], dtype=np.uint64)
    info = np.finfo(base)
    positive = np.array([0, info.smallest_subnormal, info.tiny, 1, info.max, np.inf, np.nan], dtype=base)
    return np.concatenate([positive, -positive]).view(f"<u{base.itemsize}").astype(np.uint64)
