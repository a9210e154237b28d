"""Minimum or maximum number."""

from typing import Any

from amaranth import Cat, Module, Mux, Signal, Value

from lightloom.golden_model.contract.interfaces import PURE
from lightloom.rtl.fabric.float_format import FloatFormat
from lightloom.rtl.fabric.pipeline import Step, StepCore
from lightloom.rtl.operators.fields import unpack


def select(m: Module, f: FloatFormat, *, a: Value, b: Value, maximum: Value) -> dict[str, Any]:
    """By sign and magnitude, so -0 is less than +0; a NaN is never taken while the other operand is a number.

    Subnormals are zeros: of two zeros of one sign either may be taken, as both have the same bits in the end.
    """
    x, y = unpack(m, f, a, "x"), unpack(m, f, b, "y")
    below = Signal()
    take_b = Signal()
    z = Signal(f.width)
    magnitude_below = a[:-1] < b[:-1]
    m.d.comb += [
        below.eq(Mux(x.sign ^ y.sign, x.sign, magnitude_below ^ x.sign)),  # a < b
        take_b.eq(x.nan | (~y.nan & (below == maximum))),
    ]
    with m.If(x.nan & y.nan):
        m.d.comb += z.eq(f.nan_bits)
    with m.Else():
        taken, zero = Mux(take_b, b, a), Mux(take_b, y.zero, x.zero)
        m.d.comb += z.eq(Cat(Mux(zero, 0, taken[:-1]), taken[-1]))
    return {"z": z}


class FloatMinmax(StepCore):
    """minimumNumber and maximumNumber of IEEE 754-2019; depth 0 to 1."""

    declared = PURE["float_minmax"]

    @classmethod
    def steps(cls, format: FloatFormat) -> list[tuple[Step, int]]:
        return [(select, 20)]
