"""a / b."""

from typing import Any

from amaranth import Cat, Const, Module, Mux, Signal, Value, signed

from rtl.operators.fields import rounded, unpack, with_specials
from rtl.pipeline import Step, StepCore

QUOTIENT_BITS = 26
"""The significands' quotient is in (1/2, 2): one bit before the point, then 24 and the guard bit in either case."""


def classify(m: Module, *, a: Value, b: Value) -> dict[str, Any]:
    x, y = unpack(m, a, "x"), unpack(m, b, "y")
    exponent = Signal(signed(10))
    m.d.comb += exponent.eq(x.exponent - y.exponent + 127)
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


def quotient_bit(m: Module, *, remainder: Value, divisor: Value, quotient: Value, **rest: Any) -> dict[str, Any]:
    """One bit of the restoring division: subtract where it fits, then double. The remainder stays below 2 * divisor."""
    index = len(quotient)
    difference = Signal(26, name=f"difference{index}")
    doubled = Signal(25, name=f"remainder{index}")
    m.d.comb += [
        difference.eq(remainder - divisor),
        doubled.eq(Cat(Const(0, 1), Mux(difference[25], remainder, difference))),
    ]
    return {"remainder": doubled, "divisor": divisor, "quotient": Cat(~difference[25], quotient), **rest}


def round_quotient(
    m: Module,
    *,
    remainder: Value,
    divisor: Value,
    quotient: Value,
    exponent: Value,
    sign: Value,
    zero: Value,
    infinite: Value,
    nan: Value,
) -> dict[str, Any]:
    below = ~quotient[-1]  # the quotient is less than one
    kept = Signal(25)
    biased = Signal(signed(10))
    m.d.comb += [kept.eq(Mux(below, quotient, quotient[1:])), biased.eq(exponent - below)]
    sticky = remainder.any() | (~below & quotient[0])
    finite = rounded(m, sign=sign, exponent=biased, kept=kept[1:], guard=kept[0], sticky=sticky, name="finite")
    return {"z": with_specials(m, finite=finite, sign=sign, nan=nan, infinite=infinite, zero=zero)}


class FloatDivide(StepCore):
    """float32 division, one bit of the quotient a step; depth 0 to 28."""

    unit_name = "float_divide"

    @classmethod
    def steps(cls) -> list[Step]:
        return [classify, *[quotient_bit] * QUOTIENT_BITS, round_quotient]
