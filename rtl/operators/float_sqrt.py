"""Square root."""

from typing import Any

from amaranth import Cat, Const, Module, Mux, Signal, Value

from lightloom.golden_model.contract.interfaces import PURE
from lightloom.rtl.fabric.float_format import FloatFormat
from lightloom.rtl.fabric.pipeline import Step, StepCore
from lightloom.rtl.operators.fields import rounded, unpack


def classify(m: Module, f: FloatFormat, *, a: Value) -> dict[str, Any]:
    """An odd power of two is taken into the radicand, so that the exponent is even and halves."""
    x = unpack(m, f, a, "x")
    odd = ~x.exponent[0]  # of the exponent without its bias, which is odd
    radicand = Signal(f.precision + 1)
    exponent = Signal(f.exponent)
    m.d.comb += [
        radicand.eq(Mux(odd, Cat(Const(0, 1), x.significand), x.significand)),
        exponent.eq((x.exponent + f.bias) >> 1),
    ]
    return {
        "radicand": radicand,
        "root": Const(0, 0),
        "remainder": Const(0, 0),
        "exponent": exponent,
        "sign": x.sign,
        "zero": x.zero,
        "infinite": x.infinite,
        "nan": x.nan | (x.sign & ~x.zero),
    }


def root_bit(
    m: Module, f: FloatFormat, *, radicand: Value, root: Value, remainder: Value, **rest: Any
) -> dict[str, Any]:
    """One bit of the restoring square root: the next two bits of the radicand come down, and 4 * root + 1 is tried.

    The remainder is at most 2 * root, one bit longer than the root.
    """
    index = len(root)
    # The radicand has two bits before the point and an odd number after it; beyond them come zeros.
    padded = Cat(Const(0, 2), radicand) if len(radicand) < 2 else radicand
    brought, radicand = (padded[-2:], padded[:-2]) if len(radicand) else (Const(0, 2), radicand)
    trial = Signal(index + 4, name=f"trial{index}")
    left = Signal(index + 2, name=f"remainder{index}")
    partial = Cat(brought, remainder)
    m.d.comb += [trial.eq(partial - Cat(Const(1, 2), root)), left.eq(Mux(trial[-1], partial, trial))]
    return {"radicand": radicand, "root": Cat(~trial[-1], root), "remainder": left, **rest}


def round_root(
    m: Module, f: FloatFormat, *, radicand: Value, root: Value, remainder: Value, **rest: Any
) -> dict[str, Any]:
    return {"z": rounded(m, f, kept=root[1:], guard=root[0], sticky=remainder.any(), **rest)}


class FloatSqrt(StepCore):
    """Square root, one bit of the root a step; depth 0 to 27."""

    declared = PURE["float_sqrt"]

    @classmethod
    def steps(cls, format: FloatFormat) -> list[tuple[Step, int]]:
        # The root of a number in [1, 4) is in [1, 2): a significand and the guard bit.
        return [(classify, 6), *[(root_bit, 17)] * (format.precision + 1), (round_root, 18)]
