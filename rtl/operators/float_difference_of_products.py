"""a*b - c*d, exact, rounded once.

The products (48 bits each) are formed in full. The one with the smaller exponent is moved right by the distance of the
exponents and subtracted from the other. Two places below the larger product and a sticky bit keep that exact enough:

- distance 0, 1 or 2: nothing falls out at the low end, so the difference is exact however far it cancels;
- distance 3 or more: in units of the larger product's last place that product is at least 2**46 and the other less than
  2**48 / 2**3 = 2**45, so the difference is at least 2**45 and its 24 bits and the guard bit all lie above bit 20; what
  fell out matters only as the sticky bit.
"""

from typing import Any

from amaranth import Cat, Const, Module, Mux, Signal, Value, signed

from rtl.operators.fields import add_with_carry, unpack
from rtl.operators.float_add import count, round_sum
from rtl.operators.float_multiply import rows, sum_of_rows
from rtl.operators.shifts import shift_left, shift_right
from rtl.pipeline import Step, StepCore

WIDTH = 48 + 3
"""A product, two exact places below it and the sticky bit."""


def multiply(m: Module, *, a: Value, b: Value, c: Value, d: Value) -> dict[str, Any]:
    """Both products, p = a*b and q = -c*d, each as two rows."""
    x, y, z, w = unpack(m, a, "x"), unpack(m, b, "y"), unpack(m, c, "z"), unpack(m, d, "w")
    p_low, p_high = rows(m, x.significand, y.significand, "p")
    q_low, q_high = rows(m, z.significand, w.significand, "q")
    p_zero, q_zero = x.zero | y.zero, z.zero | w.zero
    p_infinite, q_infinite = x.infinite | y.infinite, z.infinite | w.infinite
    p_sign = Signal()
    q_sign = Signal()
    differ = Signal()
    infinite = Signal()
    p_exponent = Signal(9)
    q_exponent = Signal(9)
    m.d.comb += [
        p_sign.eq(x.sign ^ y.sign),
        q_sign.eq(~(z.sign ^ w.sign)),
        differ.eq(p_sign ^ q_sign),
        infinite.eq(p_infinite | q_infinite),
        # A zero product counts as the smallest of all, so that it never shifts the other one out.
        p_exponent.eq(Mux(p_zero, 0, x.exponent + y.exponent)),
        q_exponent.eq(Mux(q_zero, 0, z.exponent + w.exponent)),
    ]
    return {
        "p_low": p_low,
        "p_high": p_high,
        "q_low": q_low,
        "q_high": q_high,
        "p_exponent": p_exponent,
        "q_exponent": q_exponent,
        # An infinite result has the sign of the infinite product, whatever the rest of the datapath finds.
        "sign": Mux(q_infinite, q_sign, p_sign),
        "differ": differ & ~infinite,
        "infinite": infinite,
        "nan": (
            (x.nan | y.nan | z.nan | w.nan)
            | (p_infinite & p_zero)
            | (q_infinite & q_zero)
            | (p_infinite & q_infinite & differ)
        ),
    }


def add_rows(
    m: Module,
    *,
    p_low: Value,
    p_high: Value,
    q_low: Value,
    q_high: Value,
    p_exponent: Value,
    q_exponent: Value,
    sign: Value,
    differ: Value,
    **rest: Any,
) -> dict[str, Any]:
    """The products, and which of them has the greater exponent; `sign` becomes that of the greater one."""
    p = Signal(48)
    q = Signal(48)
    ahead = Signal(10)
    behind = Signal(10)
    swap = Signal()
    distance = Signal(9)
    m.d.comb += [
        p.eq(sum_of_rows(p_low, p_high)),
        q.eq(sum_of_rows(q_low, q_high)),
        ahead.eq(p_exponent - q_exponent),
        behind.eq(q_exponent - p_exponent),
        swap.eq(ahead[9]),
        distance.eq(Mux(swap, behind, ahead)),
    ]
    return {
        "p": p,
        "q": q,
        "swap": swap,
        "distance": distance[:6] | distance[6:].any().replicate(6),  # 63 or more: beyond the 50 bits below
        "exponent": Mux(swap, q_exponent, p_exponent),
        "sign": sign ^ (swap & differ),
        "differ": differ,
        **rest,
    }


def align(m: Module, *, p: Value, q: Value, swap: Value, distance: Value, **rest: Any) -> dict[str, Any]:
    greater = Signal(48)
    smaller = Signal(48)
    m.d.comb += [greater.eq(Mux(swap, q, p)), smaller.eq(Mux(swap, p, q))]
    shifted, lost = shift_right(m, Cat(Const(0, 2), smaller), distance, "align")
    return {"greater": greater, "smaller": Cat(lost, shifted), **rest}


def add(m: Module, *, greater: Value, smaller: Value, differ: Value, sign: Value, **rest: Any) -> dict[str, Any]:
    """The product with the greater exponent may still be the smaller one: both differences, then the positive one."""
    forward = Signal(WIDTH + 1)
    backward = Signal(WIDTH)
    negative = Signal()
    total = Signal(WIDTH + 1)
    wide = Cat(Const(0, 3), greater)
    m.d.comb += [
        forward.eq(add_with_carry(wide, smaller ^ differ.replicate(WIDTH), differ)),
        backward.eq(smaller - wide),
        negative.eq(differ & ~forward[WIDTH]),
        # The carry out of a difference is not one of its digits.
        total.eq(Cat(Mux(negative, backward, forward[:WIDTH]), forward[WIDTH] & ~differ)),
    ]
    return {"total": total, "differ": differ, "sign": sign ^ negative, **rest}


def normalise(m: Module, *, total: Value, zeros: Value, exponent: Value, **rest: Any) -> dict[str, Any]:
    scaled = shift_left(m, total, zeros, "scaled")
    biased = Signal(signed(10))
    m.d.comb += biased.eq(exponent - 125 - zeros)
    return {"kept": scaled[28:], "guard": scaled[27], "sticky": scaled[:27].any(), "exponent": biased, **rest}


class FloatDifferenceOfProducts(StepCore):
    """a*b - c*d of float32 numbers with a single rounding, so that its sign is exact; depth 0 to 7."""

    unit_name = "float_difference_of_products"

    @classmethod
    def steps(cls) -> list[Step]:
        return [multiply, add_rows, align, add, count, normalise, round_sum]
