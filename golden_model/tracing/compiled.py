"""How the twins are compiled, and how their machine code is kept on disk. Needs numba.

Scalars in the twins are float32 throughout: constants are made float32 (or uint64), because a Python literal would make
numba compute in float64. Without `fastmath`, LLVM neither reorders nor fuses operations.
"""

from collections.abc import Callable
from functools import partial
from typing import Any

import numba
import numpy as np

from lightloom.golden_model.host.fingerprint import fingerprint

compiled = numba.njit(error_model="numpy")


def cached(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compiles like `compiled`, with the cache on disk if there is a place for it: compiling takes some seconds.

    numba's cache notices a change of the function's own file alone, and not of the functions and constants that are
    compiled in from others. So the function gets a first argument that callers leave out, of a type that bears the
    `fingerprint` of its module: after a change of what that imports, it is compiled again. For the same reason only
    functions that no compiled one calls may be cached.
    """
    try:
        machine_code = numba.njit(cache=True, nogil=True, error_model="numpy")(function)
    except RuntimeError:  # neither the package's folder nor the user's cache folder can be written
        machine_code = compiled(function)
    return partial(machine_code, np.empty(0, [(f"sources_{fingerprint(function.__module__)}", np.uint8)]))


def plain(dtype: np.dtype) -> np.dtype:
    """A structured dtype with bytes for bools: numba knows no fields of several bools."""
    fields = [(name, dtype[name].base, dtype[name].shape) for name in dtype.names or ()]
    return np.dtype([(name, np.uint8 if base == np.bool_ else base, shape) for name, base, shape in fields])
