"""a + b, or a - b."""

from typing import Any

from amaranth import Cat, Const, Module, Mux, Signal, Value

from lightloom.golden_model.contract.interfaces import PURE
from lightloom.rtl.fabric.float_format import FloatFormat
from lightloom.rtl.fabric.pipeline import Step, StepCore
from lightloom.rtl.operators.fields import add_with_carry, rounded, unpack
from lightloom.rtl.operators.shifts import leading_zeros, shift_left, shift_right


def order(m: Module, f: FloatFormat, *, a: Value, b: Value, subtract: Value) -> dict[str, Any]:
    """The operand of greater magnitude goes first, so that the difference below is never negative."""
    x, y = unpack(m, f, a, "x"), unpack(m, f, b, "y")
    sign_y = Signal()
    swap = Signal()
    differ = Signal()
    infinite = Signal()
    ahead = Signal(f.exponent_bits)
    behind = Signal(f.exponent_bits)
    distance = Signal(f.exponent_bits)
    greater = Signal(f.precision)
    smaller = Signal(f.precision)
    # So far, and the smaller operand is lost but for the sticky bit.
    places = (f.precision + 2).bit_length()
    m.d.comb += [
        sign_y.eq(y.sign ^ subtract),
        differ.eq(x.sign ^ sign_y),
        infinite.eq(x.infinite | y.infinite),
        swap.eq(a[:-1] < b[:-1]),
        # Both differences at once: neither waits for the comparison.
        ahead.eq(x.exponent - y.exponent),
        behind.eq(y.exponent - x.exponent),
        distance.eq(Mux(swap, behind, ahead)),
        greater.eq(Mux(swap, y.significand, x.significand)),
        smaller.eq(Mux(swap, x.significand, y.significand)),
    ]
    return {
        # A zero has no significand; where the greater operand is one, so is the smaller.
        "greater": greater & ~(x.zero & y.zero).replicate(f.precision),
        "smaller": smaller & ~(x.zero | y.zero).replicate(f.precision),
        "distance": distance[:places] | distance[places:].any().replicate(places),
        "exponent": Mux(swap, y.exponent, x.exponent),
        "sign": x.sign ^ (swap & differ),
        "differ": differ & ~infinite,
        "infinite": infinite,
        "nan": x.nan | y.nan | (x.infinite & y.infinite & differ),
    }


def align(m: Module, f: FloatFormat, *, smaller: Value, distance: Value, differ: Value, **rest: Any) -> dict[str, Any]:
    """Three bits below the significand (guard, round, sticky) are enough to round correctly.

    All are inverted where the smaller operand is to be subtracted.
    """
    shifted, lost = shift_right(m, Cat(Const(0, 2), smaller), distance, "align")
    aligned = Cat(lost, shifted)
    return {"addend": aligned ^ differ.replicate(len(aligned)), "differ": differ, **rest}


def add(m: Module, f: FloatFormat, *, greater: Value, addend: Value, differ: Value, **rest: Any) -> dict[str, Any]:
    width = len(addend)
    raw = Signal(width + 1)
    m.d.comb += raw.eq(add_with_carry(Cat(Const(0, 3), greater), addend, differ))
    # A difference always carries out, for it is not negative.
    return {"total": Cat(raw[:width], raw[width] & ~differ), "differ": differ, **rest}


def count(m: Module, f: FloatFormat, *, total: Value, **rest: Any) -> dict[str, Any]:
    return {"total": total, "zeros": leading_zeros(m, total, "zeros"), **rest}


def normalise(m: Module, f: FloatFormat, *, total: Value, zeros: Value, exponent: Value, **rest: Any) -> dict[str, Any]:
    scaled = shift_left(m, total, zeros, "scaled")
    biased = Signal(f.exponent)
    m.d.comb += biased.eq(exponent + 1 - zeros)
    return {"kept": scaled[4:], "guard": scaled[3], "sticky": scaled[:3].any(), "exponent": biased, **rest}


def round_sum(m: Module, f: FloatFormat, *, kept: Value, sign: Value, differ: Value, **rest: Any) -> dict[str, Any]:
    """Equal magnitudes of opposite signs give +0; a sum of zeros of one sign keeps it."""
    zero = ~kept[-1]
    return {"z": rounded(m, f, kept=kept, sign=sign & ~(zero & differ), zero=zero, **rest)}


class FloatAdd(StepCore):
    """Addition and subtraction; depth 0 to 6."""

    declared = PURE["float_add"]

    @classmethod
    def steps(cls, format: FloatFormat) -> list[tuple[Step, int]]:
        return [(order, 16), (align, 12), (add, 14), (count, 10), (normalise, 12), (round_sum, 14)]
