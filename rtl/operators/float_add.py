"""a + b, or a - b."""

from typing import Any

from amaranth import Cat, Const, Module, Mux, Signal, Value, signed

from rtl.operators.fields import add_with_carry, rounded, unpack, with_specials
from rtl.operators.shifts import leading_zeros, shift_left, shift_right
from rtl.pipeline import Step, StepCore


def order(m: Module, *, a: Value, b: Value, subtract: Value) -> dict[str, Any]:
    """The operand of greater magnitude goes first, so that the difference below is never negative."""
    x, y = unpack(m, a, "x"), unpack(m, b, "y")
    sign_y = Signal()
    swap = Signal()
    differ = Signal()
    infinite = Signal()
    ahead = Signal(9)
    behind = Signal(9)
    distance = Signal(8)
    greater = Signal(24)
    smaller = Signal(24)
    m.d.comb += [
        sign_y.eq(y.sign ^ subtract),
        differ.eq(x.sign ^ sign_y),
        infinite.eq(x.infinite | y.infinite),
        swap.eq(a[:31] < b[:31]),
        # Both differences at once: neither waits for the comparison.
        ahead.eq(x.exponent - y.exponent),
        behind.eq(y.exponent - x.exponent),
        distance.eq(Mux(swap, behind, ahead)),
        greater.eq(Mux(swap, y.significand, x.significand)),
        smaller.eq(Mux(swap, x.significand, y.significand)),
    ]
    return {
        "greater": greater,
        "smaller": smaller,
        "distance": distance[:5] | distance[5:].any().replicate(5),  # 31 or more: beyond the 27 bits below
        "exponent": Mux(swap, y.exponent, x.exponent),
        "sign": x.sign ^ (swap & differ),
        "differ": differ & ~infinite,
        "infinite": infinite,
        "nan": x.nan | y.nan | (x.infinite & y.infinite & differ),
    }


def align(m: Module, *, smaller: Value, distance: Value, **rest: Any) -> dict[str, Any]:
    """Three bits below the significand (guard, round, sticky) are enough to round correctly."""
    shifted, lost = shift_right(m, Cat(Const(0, 2), smaller), distance, "align")
    return {"smaller": Cat(lost, shifted), **rest}


def add(m: Module, *, greater: Value, smaller: Value, differ: Value, **rest: Any) -> dict[str, Any]:
    raw = Signal(28)
    m.d.comb += raw.eq(add_with_carry(Cat(Const(0, 3), greater), smaller ^ differ.replicate(27), differ))
    # A difference always carries out of the 27 bits, for it is not negative.
    return {"total": Cat(raw[:27], raw[27] & ~differ), "differ": differ, **rest}


def count(m: Module, *, total: Value, **rest: Any) -> dict[str, Any]:
    return {"total": total, "zeros": leading_zeros(m, total, "zeros"), **rest}


def normalise(m: Module, *, total: Value, zeros: Value, exponent: Value, **rest: Any) -> dict[str, Any]:
    scaled = shift_left(m, total, zeros, "scaled")
    biased = Signal(signed(10))
    m.d.comb += biased.eq(exponent + 1 - zeros)
    return {"kept": scaled[4:], "guard": scaled[3], "sticky": scaled[:3].any(), "exponent": biased, **rest}


def round_sum(
    m: Module,
    *,
    kept: Value,
    guard: Value,
    sticky: Value,
    exponent: Value,
    sign: Value,
    differ: Value,
    infinite: Value,
    nan: Value,
) -> dict[str, Any]:
    """Equal magnitudes of opposite signs give +0; a sum of zeros of one sign keeps it."""
    finite = rounded(m, sign=sign, exponent=exponent, kept=kept, guard=guard, sticky=sticky, name="finite")
    zero = ~kept[23]
    return {"z": with_specials(m, finite=finite, sign=sign & ~(zero & differ), nan=nan, infinite=infinite, zero=zero)}


class FloatAdd(StepCore):
    """float32 addition and subtraction; depth 0 to 6."""

    unit_name = "float_add"

    @classmethod
    def steps(cls) -> list[Step]:
        return [order, align, add, count, normalise, round_sum]
