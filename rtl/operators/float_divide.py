"""a / b."""

from typing import Any

from amaranth import Cat, Const, Module, Mux, Signal, Value

from lightloom.golden_model.contract.interfaces import PURE
from lightloom.rtl.fabric.float_format import FloatFormat
from lightloom.rtl.fabric.pipeline import Step, StepCore
from lightloom.rtl.operators.fields import rounded, unpack


def classify(m: Module, f: FloatFormat, *, a: Value, b: Value) -> dict[str, Any]:
    x, y = unpack(m, f, a, "x"), unpack(m, f, b, "y")
    exponent = Signal(f.exponent)
    m.d.comb += exponent.eq(x.exponent - y.exponent + f.bias)
    return {
        "remainder": Cat(x.significand, Const(0, 1)),
        "divisor": y.significand,
        "quotient": Const(0, 0),
        "exponent": exponent,
        "sign": x.sign ^ y.sign,
        "zero": x.zero | y.infinite,
        "infinite": x.infinite | y.zero,
        "nan": x.nan | y.nan | (x.zero & y.zero) | (x.infinite & y.infinite),
    }


def quotient_bit(
    m: Module, f: FloatFormat, *, remainder: Value, divisor: Value, quotient: Value, **rest: Any
) -> dict[str, Any]:
    """One bit of the restoring division: subtract where it fits, then double. The remainder stays below 2 * divisor."""
    index = len(quotient)
    difference = Signal(f.precision + 2, name=f"difference{index}")
    doubled = Signal(f.precision + 1, name=f"remainder{index}")
    m.d.comb += [
        difference.eq(remainder - divisor),
        doubled.eq(Cat(Const(0, 1), Mux(difference[-1], remainder, difference))),
    ]
    return {"remainder": doubled, "divisor": divisor, "quotient": Cat(~difference[-1], quotient), **rest}


def round_quotient(
    m: Module, f: FloatFormat, *, remainder: Value, divisor: Value, quotient: Value, exponent: Value, **rest: Any
) -> dict[str, Any]:
    below = ~quotient[-1]  # the quotient is less than one
    kept = Signal(f.precision + 1)
    biased = Signal(f.exponent)
    m.d.comb += [kept.eq(Mux(below, quotient, quotient[1:])), biased.eq(exponent - below)]
    sticky = remainder.any() | (~below & quotient[0])
    return {"z": rounded(m, f, exponent=biased, kept=kept[1:], guard=kept[0], sticky=sticky, **rest)}


class FloatDivide(StepCore):
    """Division, one bit of the quotient a step; depth 0 to 28."""

    declared = PURE["float_divide"]

    @classmethod
    def steps(cls, format: FloatFormat) -> list[tuple[Step, int]]:
        # The significands' quotient is in (1/2, 2): one bit before the point, then those of a significand and the guard
        # bit in either case.
        return [(classify, 12), *[(quotient_bit, 17)] * (format.precision + 2), (round_quotient, 18)]
