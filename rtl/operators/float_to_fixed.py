"""float32 to int32 with a binary point."""

from typing import Any

from amaranth import Cat, Const, Module, Mux, Signal, Value, signed

from lightloom.golden_model.contract.interfaces import PURE
from lightloom.rtl.fabric.float_format import FloatFormat
from lightloom.rtl.fabric.pipeline import Step, StepCore
from lightloom.rtl.operators.fields import unpack
from lightloom.rtl.operators.shifts import shift_right


def align(m: Module, f: FloatFormat, *, a: Value, fraction: Value) -> dict[str, Any]:
    """Only right shifts: the significand starts at the top of 32 bits, where its value would be 2**31 and more."""
    x = unpack(m, f, a, "x")
    distance = Signal(signed(10))
    m.d.comb += distance.eq(158 - x.exponent - fraction)  # 158: exponent 31 and the bias
    amount = distance[:6] | (distance > 63).replicate(6)
    # One place below the integer: the guard bit.
    # The highest place is left by all that does not saturate.
    shifted, lost = shift_right(m, Cat(Const(0, 9), x.significand), amount, "align", width=32)
    return {
        "kept": shifted[1:32],
        "guard": shifted[0],
        "sticky": lost,
        "saturate": distance <= 0,
        "nan": x.nan,
        "sign": x.sign,
    }


def round_fixed(
    m: Module, f: FloatFormat, *, kept: Value, guard: Value, sticky: Value, saturate: Value, nan: Value, sign: Value
) -> dict[str, Any]:
    """Rounds and negates with one adder: -(n + up) = ~n + (1 - up).

    Rounding never overflows: where bits fall out, the magnitude is below 2**23.
    """
    return {"z": fixed(m, kept=kept, up=guard & (sticky | kept[0]), saturate=saturate, nan=nan, sign=sign)}


def fixed(m: Module, *, kept: Value, up: Value, saturate: Value, nan: Value, sign: Value) -> Signal:
    """The integer of a magnitude, one more where `up`, and a sign."""
    z = Signal(32)
    with m.If(nan):
        m.d.comb += z.eq(0)
    with m.Elif(saturate):
        m.d.comb += z.eq(Mux(sign, 0x80000000, 0x7FFFFFFF))
    with m.Else():
        m.d.comb += z.eq((Cat(kept, Const(0, 1)) ^ sign.replicate(32)) + (up ^ sign))
    return z


class FloatToFixed(StepCore):
    """float32 to fixed point, nearest even, saturating; depth 0 to 2."""

    declared = PURE["float_to_fixed"]

    @classmethod
    def steps(cls, format: FloatFormat) -> list[tuple[Step, int]]:
        return [(align, 24), (round_fixed, 16)]
