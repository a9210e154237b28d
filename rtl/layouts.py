"""Amaranth layouts derived from the NumPy formats of the golden model."""

import numpy as np
from amaranth import unsigned
from amaranth.lib import data

from golden_model.formats import field_width


def layout_of(dtype: np.dtype) -> data.StructLayout:
    """The StructLayout of a structured dtype: the same names, a vector field as an ArrayLayout, raw unsigned bits."""
    assert dtype.names is not None, "a structured dtype is needed"
    members = {}
    for name in dtype.names:
        base, shape = dtype[name].base, dtype[name].shape
        scalar = unsigned(field_width(base))
        members[name] = data.ArrayLayout(scalar, shape[0]) if shape else scalar
    return data.StructLayout(members)


def packet_of(dtype: np.dtype, tag_width: int) -> data.StructLayout:
    """A stream payload: the data in the low bits, the operation's tag above."""
    return data.StructLayout({"data": layout_of(dtype), "tag": unsigned(tag_width)})
