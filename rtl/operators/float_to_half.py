"""float32 to binary16."""

from typing import Any

from amaranth import Cat, Const, Module, Mux, Signal, Value, signed

from lightloom.golden_model.contract.interfaces import PURE
from lightloom.rtl.fabric.float_format import FloatFormat
from lightloom.rtl.fabric.pipeline import Step, StepCore
from lightloom.rtl.operators.fields import unpack
from lightloom.rtl.operators.shifts import shift_right

HALF_NAN = 0x7E00
HALF_INFINITY = 0x7C00
REBIAS = 127 - 15


def align(m: Module, f: FloatFormat, *, a: Value) -> dict[str, Any]:
    """The significand moved to where binary16 has its last place: below 2**-14 that place is fixed."""
    x = unpack(m, f, a, "x")
    exponent = Signal(signed(9))
    distance = Signal(4)
    m.d.comb += exponent.eq(x.exponent - REBIAS)
    subnormal = exponent <= 0
    # 1 - exponent places; 13 and more give the same as 13: nothing but the sticky bit.
    m.d.comb += distance.eq(Mux(subnormal, Mux(exponent < -12, 13, (1 - exponent)[:4]), 0))
    shifted, lost = shift_right(m, x.significand, distance, "align")
    return {
        "kept": shifted[13:23],  # without the leading one, which a subnormal number does not have here
        "guard": shifted[12],
        "sticky": shifted[:12].any() | lost,
        "exponent": Mux(subnormal, 0, exponent[:5]),
        "infinite": x.infinite | (exponent > 30),
        "nan": x.nan,
        "sign": x.sign,
    }


def round_half(
    m: Module,
    f: FloatFormat,
    *,
    kept: Value,
    guard: Value,
    sticky: Value,
    exponent: Value,
    infinite: Value,
    nan: Value,
    sign: Value,
) -> dict[str, Any]:
    """Rounding may carry into the exponent: from subnormal to normal, and from 65504 to infinity."""
    magnitude = Signal(15)
    z = Signal(16)
    m.d.comb += magnitude.eq(Cat(kept, exponent) + (guard & (sticky | kept[0])))
    with m.If(nan):
        m.d.comb += z.eq(HALF_NAN)
    with m.Elif(infinite):
        m.d.comb += z.eq(Cat(Const(HALF_INFINITY, 15), sign))
    with m.Else():
        m.d.comb += z.eq(Cat(magnitude, sign))
    return {"z": z}


class FloatToHalf(StepCore):
    """float32 to binary16, subnormal results kept; depth 0 to 2."""

    declared = PURE["float_to_half"]

    @classmethod
    def steps(cls, format: FloatFormat) -> list[tuple[Step, int]]:
        return [(align, 20), (round_half, 12)]
