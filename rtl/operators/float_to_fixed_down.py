"""float32 to int32 with a binary point, rounded down."""

from typing import Any

from amaranth import Module, Value

from lightloom.golden_model.contract.interfaces import PURE
from lightloom.rtl.fabric.float_format import FloatFormat
from lightloom.rtl.fabric.pipeline import Step, StepCore
from lightloom.rtl.operators.float_to_fixed import align, fixed


def align_whole(m: Module, f: FloatFormat, *, a: Value, fraction: Value) -> dict[str, Any]:
    """As for rounding to nearest; a zero, which has no significand of its own, leaves no remainder."""
    aligned = align(m, f, a=a, fraction=fraction)
    remains = aligned.pop("guard") | aligned.pop("sticky")
    return aligned | {"remains": remains & Value.cast(a)[f.fraction_bits : -1].any()}


def round_down(
    m: Module, f: FloatFormat, *, kept: Value, remains: Value, saturate: Value, nan: Value, sign: Value
) -> dict[str, Any]:
    """Of a negative number the magnitude is rounded up."""
    return {"z": fixed(m, kept=kept, up=remains & sign, saturate=saturate, nan=nan, sign=sign)}


class FloatToFixedDown(StepCore):
    """float32 to fixed point, rounded down, saturating; depth 0 to 2."""

    declared = PURE["float_to_fixed_down"]

    @classmethod
    def steps(cls, format: FloatFormat) -> list[tuple[Step, int]]:
        return [(align_whole, 24), (round_down, 16)]
