"""Berkeley SoftFloat 3e as an oracle of the number units, over arrays.

SoftFloat is IEEE 754. What Lightloom's contract asks beyond it (operands and results flushed, one NaN) is done here on
the bits, sharing nothing with the golden model.
"""

import ctypes
import hashlib
from functools import cache
from pathlib import Path

import numpy as np
import softfloatpy._core

from lightloom.golden_model.contract.interfaces import OPERATORS
from lightloom.golden_model.host.outputs import whole_file
from lightloom.sim import toolchain

SOURCE = Path(__file__).with_suffix(".cpp")


@cache
def _library() -> ctypes.CDLL:
    """The loops of softfloat.cpp, compiled once and kept; they find SoftFloat's functions in the loaded module."""
    ctypes.CDLL(softfloatpy._core.__file__, mode=ctypes.RTLD_GLOBAL)
    key = hashlib.sha256(f"{toolchain.compiler_version()}\0{SOURCE.read_text()}".encode()).hexdigest()[:16]
    library = toolchain.cache_folder() / f"softfloat-{key}.so"
    with toolchain.locked(library):
        if not library.exists():
            with whole_file(library) as part:
                options = ["-std=c++17", "-O2", "-shared", "-fPIC", "-o", str(part)]
                toolchain.run([toolchain.compiler(), *options, str(SOURCE)])
    return ctypes.CDLL(str(library))


def _bits(column: np.ndarray) -> np.ndarray:
    """A field as uint32, or as uint64 where it is wider."""
    raw = column if column.dtype == np.bool_ else np.ascontiguousarray(column).view(f"<u{column.itemsize}")
    return np.ascontiguousarray(raw.astype(np.uint64 if column.itemsize > 4 else np.uint32))


def _flushed(bits: np.ndarray) -> np.ndarray:
    """binary32 subnormals to zeros of the same sign."""
    return np.where(bits & 0x7F800000 == 0, bits & 0x80000000, bits).astype(np.uint32)


def softfloat_results(name: str, operands: np.ndarray) -> np.ndarray:
    """Operands (N,) of a number unit to the results (N,) that SoftFloat gives, brought to the contract."""
    unit = OPERATORS[name]
    columns = []
    for field in unit.input.names or ():
        bits = _bits(operands[field])
        columns.append(_flushed(bits) if unit.input[field] == np.float32 else bits)
    z = np.zeros(len(operands), np.uint32)
    pointers = [ctypes.c_void_p(array.ctypes.data) for array in (*columns, z)]
    getattr(_library(), name)(ctypes.c_size_t(len(operands)), *pointers)

    out = np.zeros(len(operands), unit.output)
    if name == "float_compare":
        for position, field in enumerate(unit.output.names or ()):
            out[field] = z >> position & 1
    elif name == "float_to_half":
        out["z"] = np.where(z & 0x7FFF > 0x7C00, 0x7E00, z).astype(np.uint16).view(np.float16)
    elif name in ("float_to_fixed", "float_to_fixed_down"):
        out["z"] = z.view(np.int32)
    else:
        z = np.where(z & 0x7FFFFFFF > 0x7F800000, np.uint32(0x7FC00000), _flushed(z)).astype(np.uint32)
        out["z"] = z.view(np.float32)
    return out
