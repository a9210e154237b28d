"""a * b."""

from typing import Any

from amaranth import Cat, Module, Mux, Signal, Value, signed

from rtl.operators.fields import rounded, unpack, with_specials
from rtl.pipeline import Step, StepCore


def multiply(m: Module, *, a: Value, b: Value) -> dict[str, Any]:
    """The 24x24 product, as two rows, so that a register stage may stand between them and their sum."""
    x, y = unpack(m, a, "x"), unpack(m, b, "y")
    low, high = rows(m, x.significand, y.significand, "product")
    exponent = Signal(signed(10))
    m.d.comb += exponent.eq(x.exponent + y.exponent - 127)
    return {
        "low": low,
        "high": high,
        "sign": x.sign ^ y.sign,
        "exponent": exponent,
        "zero": x.zero | y.zero,
        "infinite": x.infinite | y.infinite,
        "nan": x.nan | y.nan | (x.infinite & y.zero) | (x.zero & y.infinite),
    }


def rows(m: Module, x: Value, y: Value, name: str) -> tuple[Signal, Signal]:
    """x * y = low + (high << 12), each row one 24x12 multiplier: the size that FPGA multiplier blocks take."""
    low, high = Signal(36, name=f"{name}_low"), Signal(36, name=f"{name}_high")
    m.d.comb += [low.eq(x * y[:12]), high.eq(x * y[12:])]
    return low, high


def sum_of_rows(low: Value, high: Value) -> Value:
    """48 bits; the low 12 need no adder."""
    return Cat(low[:12], (low[12:] + high)[:36])


def add_rows(m: Module, *, low: Value, high: Value, **rest: Any) -> dict[str, Any]:
    product = Signal(48)
    m.d.comb += product.eq(sum_of_rows(low, high))
    return {"product": product, **rest}


def normalise(m: Module, *, product: Value, exponent: Value, **rest: Any) -> dict[str, Any]:
    """The product of two significands in [1, 2) is in [1, 4): at most one place to move."""
    top = product[47]
    kept = Signal(25)
    biased = Signal(signed(10))
    m.d.comb += [kept.eq(Mux(top, product[23:], product[22:])), biased.eq(exponent + top)]
    sticky = product[:22].any() | (top & product[22])
    return {"kept": kept, "sticky": sticky, "exponent": biased, **rest}


def round_product(
    m: Module,
    *,
    kept: Value,
    sticky: Value,
    sign: Value,
    exponent: Value,
    zero: Value,
    infinite: Value,
    nan: Value,
) -> dict[str, Any]:
    finite = rounded(m, sign=sign, exponent=exponent, kept=kept[1:], guard=kept[0], sticky=sticky, name="finite")
    return {"z": with_specials(m, finite=finite, sign=sign, nan=nan, infinite=infinite, zero=zero)}


class FloatMultiply(StepCore):
    """float32 multiplication; depth 0 to 4."""

    unit_name = "float_multiply"

    @classmethod
    def steps(cls) -> list[Step]:
        return [multiply, add_rows, normalise, round_product]
