"""Amaranth layouts derived from the NumPy formats of the golden model."""

import numpy as np
from amaranth import unsigned
from amaranth.lib import data

from lightloom.golden_model.contract.formats import F4, field_width


def layout_of(dtype: np.dtype, float_width: int = 32) -> data.StructLayout:
    """The StructLayout of a structured dtype: the same names, a vector field as an ArrayLayout, raw unsigned bits.

    A float32 field is `float_width` bits wide: units of a narrower format are made to be proved.
    """
    assert dtype.names is not None, "a structured dtype is needed"
    members = {}
    for name in dtype.names:
        base, shape = dtype[name].base, dtype[name].shape
        scalar = unsigned(float_width if base == F4 else field_width(base))
        members[name] = data.ArrayLayout(scalar, shape[0]) if shape else scalar
    return data.StructLayout(members)


def packet_of(dtype: np.dtype, tag_width: int, float_width: int = 32) -> data.StructLayout:
    """A stream payload: the data in the low bits, the operation's tag above."""
    return data.StructLayout({"data": layout_of(dtype, float_width), "tag": unsigned(tag_width)})
