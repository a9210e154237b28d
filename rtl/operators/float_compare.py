"""Less, equal, greater, unordered."""

from typing import Any

from amaranth import Module, Mux, Signal, Value

from lightloom.golden_model.contract.interfaces import PURE
from lightloom.rtl.fabric.float_format import FLOAT32, FloatFormat
from lightloom.rtl.fabric.pipeline import Step, StepCore
from lightloom.rtl.operators.fields import unpack


def compare(m: Module, f: FloatFormat = FLOAT32, *, a: Value, b: Value) -> dict[str, Any]:
    x, y = unpack(m, f, a, "x"), unpack(m, f, b, "y")
    equal = Signal()
    less = Signal()
    unordered = Signal()
    m.d.comb += [
        unordered.eq(x.nan | y.nan),
        equal.eq((x.zero & y.zero) | (Value.cast(a) == b)),
        # Of unequal operands; bits without the sign order like numbers.
        less.eq(Mux(x.sign ^ y.sign, x.sign, (a[:-1] < b[:-1]) ^ x.sign)),
    ]
    ordered = ~unordered
    return {
        "less": ordered & ~equal & less,
        "equal": ordered & equal,
        "greater": ordered & ~equal & ~less,
        "unordered": unordered,
    }


class FloatCompare(StepCore):
    """Comparison; depth 0 to 1."""

    declared = PURE["float_compare"]

    @classmethod
    def steps(cls, format: FloatFormat) -> list[tuple[Step, int]]:
        return [(compare, 20)]
