"""int32 with a binary point to float32; the steps are those of any width."""

from typing import Any

from amaranth import Cat, Module, Signal, Value

from lightloom.golden_model.contract.interfaces import PURE
from lightloom.rtl.fabric.float_format import FloatFormat
from lightloom.rtl.fabric.pipeline import Step, StepCore
from lightloom.rtl.operators.shifts import leading_zeros, shift_left


def magnitude(m: Module, f: FloatFormat, *, a: Value, fraction: Value) -> dict[str, Any]:
    raw = Value.cast(a)
    sign = raw[-1]
    absolute = Signal(len(raw))
    m.d.comb += absolute.eq((raw ^ sign.replicate(len(raw))) + sign)
    return {"absolute": absolute, "sign": sign, "fraction": fraction}


def count(m: Module, f: FloatFormat, *, absolute: Value, **rest: Any) -> dict[str, Any]:
    return {"absolute": absolute, "zeros": leading_zeros(m, absolute, "zeros"), **rest}


def normalise(
    m: Module, f: FloatFormat, *, absolute: Value, zeros: Value, fraction: Value, sign: Value
) -> dict[str, Any]:
    scaled = shift_left(m, absolute, zeros, "scaled")
    exponent = Signal(8)
    m.d.comb += exponent.eq(len(absolute) - 1 + f.bias - zeros - fraction)
    return {"scaled": scaled, "exponent": exponent, "sign": sign}


def round_float(m: Module, f: FloatFormat, *, scaled: Value, exponent: Value, sign: Value) -> dict[str, Any]:
    """The exponent stays between 96 and 191, so there is neither overflow nor underflow."""
    lost = len(scaled) - f.precision
    kept, guard, sticky = scaled[lost:-1], scaled[lost - 1], scaled[: lost - 1].any()
    packed = Signal(31)
    z = Signal(32)  # z stays 0 for 0
    m.d.comb += packed.eq(Cat(kept, exponent) + (guard & (sticky | kept[0])))
    with m.If(scaled[-1]):
        m.d.comb += z.eq(Cat(packed, sign))
    return {"z": z}


class FixedToFloat(StepCore):
    """Fixed point to float32; depth 0 to 4."""

    declared = PURE["fixed_to_float"]

    @classmethod
    def steps(cls, format: FloatFormat) -> list[tuple[Step, int]]:
        return [(magnitude, 12), (count, 10), (normalise, 10), (round_float, 12)]
