"""a * b."""

from functools import partial
from typing import Any

from amaranth import Const, Module, Mux, Signal, Value

from lightloom.golden_model.contract.interfaces import PURE
from lightloom.rtl.fabric.float_format import FLOAT32, FloatFormat
from lightloom.rtl.fabric.pipeline import Step, StepCore
from lightloom.rtl.operators import product
from lightloom.rtl.operators.fields import rounded, unpack


def classify(m: Module, f: FloatFormat, *, blocks: bool, a: Value, b: Value) -> dict[str, Any]:
    x, y = unpack(m, f, a, "x"), unpack(m, f, b, "y")
    exponent = Signal(f.exponent)
    m.d.comb += exponent.eq(x.exponent + y.exponent - f.bias)
    return {
        "x": x.significand,
        "triple": Const(0, 0) if blocks else product.triple(m, x.significand, "triple"),
        "y": y.significand,
        "sign": x.sign ^ y.sign,
        "exponent": exponent,
        "zero": x.zero | y.zero,
        "infinite": x.infinite | y.infinite,
        "nan": x.nan | y.nan | (x.infinite & y.zero) | (x.zero & y.infinite),
    }


def multiply(
    m: Module, f: FloatFormat, *, blocks: bool, x: Value, triple: Value, y: Value, **rest: Any
) -> dict[str, Any]:
    low, high = product.block_rows(m, x, y, "product") if blocks else product.product_rows(m, x, triple, y, "product")
    return {"low": low, "high": high, **rest}


def add_rows(m: Module, f: FloatFormat, *, low: Value, high: Value, exponent: Value, **rest: Any) -> dict[str, Any]:
    """The product of two significands in [1, 2) is in [1, 4): at most one place to move."""
    whole = Signal(2 * f.precision, name="product")
    kept = Signal(f.precision + 1)
    biased = Signal(f.exponent)
    m.d.comb += whole.eq(low + high)
    top, below = whole[-1], f.precision - 2
    m.d.comb += [kept.eq(Mux(top, whole[below + 1 :], whole[below:-1])), biased.eq(exponent + top)]
    sticky = whole[:below].any() | (top & whole[below])
    return {"kept": kept, "sticky": sticky, "exponent": biased, **rest}


def round_product(m: Module, f: FloatFormat, *, kept: Value, **rest: Any) -> dict[str, Any]:
    return {"z": rounded(m, f, kept=kept[1:], guard=kept[0], **rest)}


class FloatMultiply(StepCore):
    """Multiplication; depth 0 to 4. With `blocks` the products are written for an FPGA's multiplier blocks."""

    declared = PURE["float_multiply"]

    def __init__(self, depth: int, format: FloatFormat = FLOAT32, *, blocks: bool = False):
        self.blocks = blocks
        super().__init__(depth, format)

    @classmethod
    def steps(cls, format: FloatFormat, *, blocks: bool = False) -> list[tuple[Step, int]]:
        return [
            (partial(classify, blocks=blocks), 14),
            (partial(multiply, blocks=blocks), 26),
            (add_rows, 20),
            (round_product, 16),
        ]

    def chain(self) -> list[tuple[Step, int]]:
        return self.steps(self.format, blocks=self.blocks)
