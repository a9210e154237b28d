"""Counts the operations of the model by running its own functions on arrays that count.

A `Counted` array is an array of NumPy's; what is computed from it is counted, element by element, and is such an array
again. An operation of a number unit counts as that unit, whether the model calls the unit's twin or writes the
operator; NumPy's arithmetic on whole numbers counts with the width that the values of the run need. Logic of single
bits, choices between two values, signs, shifts by constants and products with powers of two are wires or nearly so and
do not count. float64 is refused: hardware has none.
"""

import sys
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from typing import Any
from unittest.mock import patch

import numpy as np

from lightloom.golden_model.contract.interfaces import OPERATORS
from lightloom.golden_model.engine.selection.neighbourhoods import Windows
from lightloom.golden_model.numerics import counter_rng, floats, logarithm
from lightloom.golden_model.tables import filters

Operation = tuple[str, *tuple[int, ...]]
"""The name of a number unit, or of an operation on whole numbers and its widths in bits."""

Tally = Counter[Operation]

MODEL = "lightloom.golden_model."
FREE = {
    *("negative", "positive", "sign", "signbit", "copysign", "isnan", "isfinite", "ldexp", "rint"),
    *("invert", "bitwise_and", "bitwise_or", "bitwise_xor", "logical_not", "logical_and", "logical_or"),
}
FLOATS = {
    "add": "float_add",
    "subtract": "float_add",
    "multiply": "float_multiply",
    "divide": "float_divide",
    "sqrt": "float_sqrt",
    "absolute": "",
    "maximum": "float_minmax",
    "minimum": "float_minmax",
}
COMPARISONS = {"less", "less_equal", "greater", "greater_equal", "equal", "not_equal"}
KEEPING = {"where", "concatenate", "append", "stack", "broadcast_to", "repeat", "clip", "roll"}
"""Functions of NumPy whose results hold values; those of others are places."""

_tally: Tally | None = None


class Counted(np.ndarray):
    """An array whose operations are counted; as any other where nobody counts."""

    def __array_ufunc__(self, ufunc: Any, method: str, *inputs: Any, out: Any = None, **options: Any) -> Any:
        if out is not None:
            options["out"] = tuple(map(bare, out))
        result = getattr(ufunc, method)(*map(bare, inputs), **options)
        if _tally is not None:
            _note(ufunc.__name__, method, [bare(each) for each in inputs], result)
        return out[0] if out is not None else counted(result)

    def __array_function__(self, function: Any, types: Any, args: Any, options: Any) -> Any:
        result = super().__array_function__(function, types, args, options)
        return counted(result) if function.__name__ in KEEPING else _bare(result)

    def astype(self, dtype: Any, *args: Any, **options: Any) -> Any:
        made = bare(self).astype(dtype, *args, **options)
        kinds = self.dtype.kind, made.dtype.kind
        if _tally is not None and kinds in (("i", "f"), ("u", "f")):
            _tally["fixed64_to_float" if bits(bare(self)) > 32 else "fixed_to_float",] += made.size
        assert _tally is None or kinds != ("f", "i") or not made.any(), "a cast of float32 to integers"
        return counted(made)


def bare(value: Any) -> Any:
    """Without counting."""
    return value.view(np.ndarray) if isinstance(value, Counted) else value


def _bare(result: Any) -> Any:
    return type(result)(map(bare, result)) if isinstance(result, list | tuple) else bare(result)


def counted(value: Any) -> Any:
    """An array, or a number of NumPy's, that counts."""
    return np.asanyarray(value).view(Counted)


@contextmanager
def counting(integers: bool = False) -> Iterator[Tally]:
    """What the model computes of `Counted` arrays within, by operation.

    All arrays of float32 and of records that the model makes there count too, and with `integers` those of whole
    numbers: for functions in which these are values, not places.
    """
    global _tally
    tally: Tally = Counter()
    with ExitStack() as stack:
        for module, name, function in _replacements(integers):
            stack.enter_context(patch.object(module, name, function))
        _tally = tally
        try:
            yield tally
        finally:
            _tally = None


def bits(values: np.ndarray) -> int:
    """Width that whole numbers need."""
    if not values.size or values.dtype == np.bool_:
        return 1
    low, high = int(values.min()), int(values.max())
    return max(high.bit_length(), (-low - 1).bit_length() if low < 0 else 0, 1) + (low < 0)


def _note(name: str, method: str, inputs: list[Any], result: Any) -> None:
    """One call of a ufunc."""
    assert _tally is not None
    operands = [np.asarray(each) for each in inputs[: 1 if method == "reduce" else None]]
    if method == "at":
        operands, result = [operands[0], operands[-1]], operands[-1]
    times = operands[0].size - result.size if method == "reduce" else np.size(result)
    kinds = {(each.dtype.kind, each.dtype.itemsize) for each in operands}
    if ("f", 8) in kinds and any(each.ndim and each.dtype == np.float64 for each in operands):
        assert name == "multiply", f"float64 on the way: {name}"
        return
    if name == "clip":
        name, times = "maximum", 2 * times
    if name in FREE or not times:
        return
    if any(kind == "f" for kind, _ in kinds):
        unit = "float_compare" if name in COMPARISONS else FLOATS[name]
        if unit and not (name == "multiply" and any(_power_of_two(each) for each in operands)):
            _tally[unit,] += times
    else:
        for operation in _whole(name, operands, np.asarray(result)):
            _tally[operation] += times


def _power_of_two(value: np.ndarray) -> bool:
    return value.ndim == 0 and value != 0 and abs(np.frexp(float(value))[0]) == 0.5


def _whole(name: str, operands: list[np.ndarray], result: np.ndarray) -> Iterator[Operation]:
    """Operations on whole numbers; none: it is free."""
    widths = [bits(each) for each in operands]
    if name in COMPARISONS:
        if max(widths) > 1:
            yield "compare", max(widths)
    elif name in ("maximum", "minimum"):
        yield "larger", max(widths)
    elif name in ("left_shift", "right_shift"):
        if operands[1].ndim and (most := int(operands[1].max(initial=0))):
            yield "shift", max(widths[0], bits(result)), most.bit_length()
    elif name in ("floor_divide", "remainder"):
        if not _power_of_two(operands[1]):
            yield "divide", *widths
    elif name == "multiply":
        yield from _product(operands, widths, bits(result))
    else:
        assert name in ("add", "subtract", "absolute"), name
        if name != "absolute" or widths[0] > 1:
            yield "sum", bits(result)


def _product(operands: list[np.ndarray], widths: list[int], width: int) -> Iterator[Operation]:
    """A product; one with a factor of few bits and zeros below them is that with these bits, and a shift."""
    if any(_power_of_two(each) for each in operands) or 1 in widths:
        return
    narrow = widths.index(min(widths))
    factors = [int(each) for each in np.unique(operands[narrow]) if each]
    least = [factor & -factor for factor in factors]
    yield (
        "product",
        *sorted((max(f // p for f, p in zip(factors, least, strict=True)).bit_length(), widths[1 - narrow])),
    )
    if stages := (max(least).bit_length() - min(least).bit_length()).bit_length():
        yield "shift", width, stages


def _replacements(integers: bool) -> Iterator[tuple[Any, str, Callable[..., Any]]]:
    """What stands in a module's place while it is counted: (where, name, function)."""
    wanted: dict[Any, Callable[..., Any]] = {
        getattr(floats, name): _instead(getattr(floats, name), _always(name)) for name in OPERATORS
    }
    exact = floats.difference_of_products
    wanted[exact] = _instead(exact, _always("float_difference_of_products"))
    wanted[floats.flush] = wanted[floats.canonical] = lambda x: x
    wanted[logarithm.half_octaves] = _instead(logarithm.half_octaves, lambda number: ("logarithm", bits(number)))
    wanted[filters.in_fixed] = _instead(filters.in_fixed, _always("half to whole"))
    wanted[counter_rng.uniform] = _instead(counter_rng.uniform, _always("fixed_to_float"))
    wanted[counter_rng.hash_u32] = _instead(counter_rng.hash_u32, lambda *counters: ("hash", len(counters)))
    for key, module in list(sys.modules.items()):
        if key.startswith(MODEL):
            for name, value in list(vars(module).items()):
                if callable(value) and getattr(value, "__hash__", None) and value in wanted:
                    yield module, name, wanted[value]
    for name in ("zeros", "empty", "full", "ones", "zeros_like"):
        yield np, name, _maker(getattr(np, name), "fVi" if integers else "fV")
    for name in ("asarray", "ascontiguousarray"):
        yield np, name, _keeper(getattr(np, name))
    for name in ("largest", "total"):
        yield Windows, name, _window(getattr(Windows, name))


def _always(name: str) -> Callable[..., Operation]:
    return lambda *_: (name,)


def _instead(function: Callable[..., Any], operation: Callable[..., Operation]) -> Callable[..., Any]:
    """A function that is one operation, which its first operands may tell more of; whatever it is called with."""

    whole = paused(function)

    def call(*args: Any, **options: Any) -> Any:
        result = whole(*args, **options)
        several = isinstance(result, tuple)
        if _tally is not None:
            _tally[operation(*map(bare, args))] += np.size(result[0] if several else result)
        return tuple(map(counted, result)) if several else counted(result)

    return call


def _window(function: Callable[..., Any]) -> Callable[..., Any]:
    def call(windows: Windows, values: Any, *args: Any) -> Any:
        return bare(function(windows, counted(values), *args))

    return call


def _maker(function: Callable[..., Any], kinds: str) -> Callable[..., Any]:
    def call(*args: Any, **options: Any) -> Any:
        made = function(*args, **options)
        return counted(made) if made.dtype.kind in kinds and made.dtype != np.float64 else made

    return call


def _keeper(function: Callable[..., Any]) -> Callable[..., Any]:
    def call(value: Any, *args: Any, **options: Any) -> Any:
        made = function(bare(value), *args, **options)
        return counted(made) if isinstance(value, Counted) else made

    return call


def paused(function: Callable[..., Any]) -> Callable[..., Any]:
    """The same without being counted, on arrays that do not count."""

    def call(*args: Any, **options: Any) -> Any:
        global _tally
        tally, _tally = _tally, None
        try:
            return bare(function(*map(bare, args), **{key: bare(each) for key, each in options.items()}))
        finally:
            _tally = tally

    return call
