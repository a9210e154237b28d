"""binary16 to float32."""

from typing import Any

from amaranth import Cat, Const, Module, Mux, Signal, Value

from lightloom.golden_model.contract.interfaces import PURE
from lightloom.rtl.fabric.float_format import FloatFormat
from lightloom.rtl.fabric.pipeline import Step, StepCore
from lightloom.rtl.operators.fields import packed
from lightloom.rtl.operators.float_to_half import REBIAS
from lightloom.rtl.operators.shifts import leading_zeros, shift_left


def count(m: Module, f: FloatFormat, *, a: Value) -> dict[str, Any]:
    raw = Value.cast(a)
    fraction, exponent = raw[:10], raw[10:15]
    return {
        "fraction": fraction,
        "exponent": exponent,
        "sign": raw[15],
        "zeros": leading_zeros(m, fraction, "zeros"),
        "subnormal": exponent == 0,
        "infinite": exponent.all() & (fraction == 0),
        "nan": exponent.all() & (fraction != 0),
    }


def widen(
    m: Module,
    f: FloatFormat,
    *,
    fraction: Value,
    exponent: Value,
    sign: Value,
    zeros: Value,
    subnormal: Value,
    infinite: Value,
    nan: Value,
) -> dict[str, Any]:
    """A subnormal's highest one becomes the hidden one; everything else keeps its fraction."""
    scaled = shift_left(m, fraction, zeros, "scaled")
    biased = Signal(8)
    digits = Signal(10)
    m.d.comb += [
        biased.eq(REBIAS + Mux(subnormal, -zeros, exponent)),
        digits.eq(Mux(subnormal, Cat(Const(0, 1), scaled), fraction)),
    ]
    zero = subnormal & (fraction == 0)
    widened = Cat(Const(0, 13), digits)
    return {"z": packed(m, f, sign=sign, exponent=biased, fraction=widened, nan=nan, infinite=infinite, zero=zero)}


class HalfToFloat(StepCore):
    """binary16 to float32, exact; depth 0 to 2."""

    declared = PURE["half_to_float"]

    @classmethod
    def steps(cls, format: FloatFormat) -> list[tuple[Step, int]]:
        return [(count, 8), (widen, 12)]
