"""Minimum or maximum number."""

from typing import Any

from amaranth import Cat, Const, Module, Mux, Signal, Value

from rtl.operators.fields import CANONICAL_NAN, unpack
from rtl.pipeline import Step, StepCore


def select(m: Module, *, a: Value, b: Value, maximum: Value) -> dict[str, Any]:
    """By sign and magnitude, so -0 is less than +0; a NaN is never taken while the other operand is a number.

    Subnormals are zeros: of two zeros of one sign either may be taken, as both have the same bits in the end.
    """
    x, y = unpack(m, a, "x"), unpack(m, b, "y")
    below = Signal()
    take_b = Signal()
    z = Signal(32)
    magnitude_below = a[:31] < b[:31]
    m.d.comb += [
        below.eq(Mux(x.sign ^ y.sign, x.sign, magnitude_below ^ x.sign)),  # a < b
        take_b.eq(x.nan | (~y.nan & (below == maximum))),
    ]
    with m.If(x.nan & y.nan):
        m.d.comb += z.eq(CANONICAL_NAN)
    with m.Else():
        taken, zero = Mux(take_b, b, a), Mux(take_b, y.zero, x.zero)
        m.d.comb += z.eq(Cat(Mux(zero, Const(0, 31), taken[:31]), taken[31]))
    return {"z": z}


class FloatMinmax(StepCore):
    """float32 minimumNumber and maximumNumber of IEEE 754-2019; depth 0 to 1."""

    unit_name = "float_minmax"

    @classmethod
    def steps(cls) -> list[Step]:
        return [select]
