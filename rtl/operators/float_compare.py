"""Less, equal, greater, unordered."""

from typing import Any

from amaranth import Module, Mux, Signal, Value

from rtl.operators.fields import unpack
from rtl.pipeline import Step, StepCore


def magnitude_less(a: Value, b: Value) -> Value:
    """|a| < |b| by their bits; of two zeros or subnormals, which the contract makes equal, it says anything."""
    return a[:31] < b[:31]


def compare(m: Module, *, a: Value, b: Value) -> dict[str, Any]:
    x, y = unpack(m, a, "x"), unpack(m, b, "y")
    equal = Signal()
    less = Signal()
    unordered = Signal()
    m.d.comb += [
        unordered.eq(x.nan | y.nan),
        equal.eq((x.zero & y.zero) | (Value.cast(a) == b)),
        less.eq(Mux(x.sign ^ y.sign, x.sign, magnitude_less(Mux(x.sign, b, a), Mux(x.sign, a, b)))),
    ]
    ordered = ~unordered
    return {
        "less": ordered & ~equal & less,
        "equal": ordered & equal,
        "greater": ordered & ~equal & ~less,
        "unordered": unordered,
    }


class FloatCompare(StepCore):
    """float32 comparison; depth 0 to 1."""

    unit_name = "float_compare"

    @classmethod
    def steps(cls) -> list[Step]:
        return [compare]
