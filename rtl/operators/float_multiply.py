"""a * b."""

from typing import Any

from amaranth import Cat, Const, Module, Mux, Signal, Value, signed

from rtl.operators.fields import CANONICAL_NAN, INFINITY, rounded, unpack
from rtl.pipeline import Step, StepCore


def classify(m: Module, a: Value, b: Value) -> dict[str, Any]:
    x, y = unpack(m, a, "x"), unpack(m, b, "y")
    exponent = Signal(signed(11))
    m.d.comb += exponent.eq(x.exponent + y.exponent - 127)
    return {
        "sign": x.sign ^ y.sign,
        "exponent": exponent,
        "x": x.significand,
        "y": y.significand,
        "zero": x.zero | y.zero,
        "infinite": x.infinite | y.infinite,
        "nan": x.nan | y.nan | (x.infinite & y.zero) | (x.zero & y.infinite),
    }


def multiply(m: Module, *, x: Value, y: Value, **rest: Any) -> dict[str, Any]:
    """The 24x24 product, as two rows, so that a register stage may stand between them and their sum."""
    low, high = Signal(36), Signal(36)
    m.d.comb += [low.eq(x * y[:12]), high.eq(x * y[12:])]
    return {"low": low, "high": high, **rest}


def add_rows(m: Module, *, low: Value, high: Value, **rest: Any) -> dict[str, Any]:
    product = Signal(48)
    m.d.comb += product.eq(low + Cat(Const(0, 12), high))
    return {"product": product, **rest}


def round_product(
    m: Module, *, product: Value, sign: Value, exponent: Value, zero: Value, infinite: Value, nan: Value
) -> dict[str, Any]:
    top = product[47]  # the product of two significands in [1, 2) is in [1, 4)
    scaled, biased = Signal(48), Signal(signed(11))
    m.d.comb += [scaled.eq(Mux(top, product, Cat(Const(0, 1), product))), biased.eq(exponent + top)]
    finite = rounded(
        m, sign=sign, exponent=biased, kept=scaled[24:], guard=scaled[23], sticky=scaled[:23].any(), name="finite"
    )
    z = Signal(32)
    with m.If(nan):
        m.d.comb += z.eq(CANONICAL_NAN)
    with m.Elif(infinite):
        m.d.comb += z.eq(Cat(Const(0, 23), Const(INFINITY, 8), sign))
    with m.Elif(zero):
        m.d.comb += z.eq(Cat(Const(0, 31), sign))
    with m.Else():
        m.d.comb += z.eq(finite)
    return {"z": z}


class FloatMultiply(StepCore):
    """float32 multiplication; depth 0 to 4."""

    unit_name = "float_multiply"

    @classmethod
    def steps(cls) -> list[Step]:
        return [classify, multiply, add_rows, round_product]
