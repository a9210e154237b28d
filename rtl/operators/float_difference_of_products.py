"""a*b - c*d, exact, rounded once.

The products are formed in full (48 bits each; all numbers here are float32's). The one with the smaller exponent is
moved right by the distance of the exponents and subtracted from the other. Two places below the larger product and a
sticky bit keep that exact enough:

- distance 0, 1 or 2: nothing falls out at the low end, so the difference is exact however far it cancels;
- distance 3 or more: in units of the larger product's last place that product is at least 2**46 and the other less than
  2**48 / 2**3 = 2**45, so the difference is at least 2**45 and its 24 bits and the guard bit all lie above bit 20; what
  fell out matters only as the sticky bit.
"""

from functools import partial
from typing import Any

from amaranth import Cat, Const, Module, Mux, Signal, Value

from lightloom.golden_model.contract.interfaces import PURE
from lightloom.rtl.fabric.float_format import FLOAT32, FloatFormat
from lightloom.rtl.fabric.pipeline import Step, StepCore
from lightloom.rtl.operators import product
from lightloom.rtl.operators.fields import add_with_carry, unpack
from lightloom.rtl.operators.float_add import count, round_sum
from lightloom.rtl.operators.shifts import shift_left, shift_right


def classify(m: Module, f: FloatFormat, *, blocks: bool, a: Value, b: Value, c: Value, d: Value) -> dict[str, Any]:
    """The factors of both products, p = a*b and q = -c*d, and what is known of the products without forming them."""
    x, y, z, w = unpack(m, f, a, "x"), unpack(m, f, b, "y"), unpack(m, f, c, "z"), unpack(m, f, d, "w")
    p_zero, q_zero = x.zero | y.zero, z.zero | w.zero
    p_infinite, q_infinite = x.infinite | y.infinite, z.infinite | w.infinite
    p_sign = Signal()
    q_sign = Signal()
    differ = Signal()
    infinite = Signal()
    p_exponent = Signal(f.exponent_bits + 1)
    q_exponent = Signal(f.exponent_bits + 1)
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
        "x": x.significand,
        "triple_x": Const(0, 0) if blocks else product.triple(m, x.significand, "triple_x"),
        "y": y.significand & ~p_zero.replicate(f.precision),
        "z": z.significand,
        "triple_z": Const(0, 0) if blocks else product.triple(m, z.significand, "triple_z"),
        "w": w.significand & ~q_zero.replicate(f.precision),
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


def multiply(
    m: Module,
    f: FloatFormat,
    *,
    blocks: bool,
    x: Value,
    triple_x: Value,
    y: Value,
    z: Value,
    triple_z: Value,
    w: Value,
    p_exponent: Value,
    q_exponent: Value,
    sign: Value,
    differ: Value,
    **rest: Any,
) -> dict[str, Any]:
    """Both products, each as two rows, and which has the greater exponent; `sign` becomes that of the greater one."""
    if blocks:
        p_low, p_high = product.block_rows(m, x, y, "p")
        q_low, q_high = product.block_rows(m, z, w, "q")
    else:
        p_low, p_high = product.product_rows(m, x, triple_x, y, "p")
        q_low, q_high = product.product_rows(m, z, triple_z, w, "q")
    ahead = Signal(f.exponent_bits + 2)
    behind = Signal(f.exponent_bits + 2)
    swap = Signal()
    distance = Signal(f.exponent_bits + 1)
    # So far, and the smaller product is lost but for the sticky bit.
    places = (2 * f.precision + 2).bit_length()
    m.d.comb += [
        ahead.eq(p_exponent - q_exponent),
        behind.eq(q_exponent - p_exponent),
        swap.eq(ahead[-1]),
        distance.eq(Mux(swap, behind, ahead)),
    ]
    return {
        "p_low": p_low,
        "p_high": p_high,
        "q_low": q_low,
        "q_high": q_high,
        "swap": swap,
        "distance": distance[:places] | distance[places:].any().replicate(places),
        "exponent": Mux(swap, q_exponent, p_exponent),
        "sign": sign ^ (swap & differ),
        "differ": differ,
        **rest,
    }


def add_rows(
    m: Module, f: FloatFormat, *, p_low: Value, p_high: Value, q_low: Value, q_high: Value, swap: Value, **rest: Any
) -> dict[str, Any]:
    p = Signal(2 * f.precision)
    q = Signal(2 * f.precision)
    m.d.comb += [p.eq(p_low + p_high), q.eq(q_low + q_high)]
    return {"greater": Mux(swap, q, p), "smaller": Mux(swap, p, q), **rest}


def align(m: Module, f: FloatFormat, *, smaller: Value, distance: Value, differ: Value, **rest: Any) -> dict[str, Any]:
    """The smaller product with the guard, round and sticky bits, all of them inverted where it is to be subtracted."""
    shifted, lost = shift_right(m, Cat(Const(0, 2), smaller), distance, "align")
    aligned = Cat(lost, shifted)
    return {"addend": aligned ^ differ.replicate(len(aligned)), "differ": differ, **rest}


def add(
    m: Module, f: FloatFormat, *, greater: Value, addend: Value, differ: Value, sign: Value, **rest: Any
) -> dict[str, Any]:
    """The product with the greater exponent may still be the smaller one: both differences, then the positive one."""
    width = len(addend)
    forward = Signal(width + 1)
    backward = Signal(width)
    negative = Signal()
    total = Signal(width + 1)
    wide = Cat(Const(0, 3), greater)
    m.d.comb += [
        forward.eq(add_with_carry(wide, addend, differ)),
        backward.eq(~(wide + addend)),  # -(wide - smaller), as addend is -smaller - 1
        negative.eq(differ & ~forward[width]),
        # The carry out of a difference is not one of its digits.
        total.eq(Cat(Mux(negative, backward, forward[:width]), forward[width] & ~differ)),
    ]
    return {"total": total, "differ": differ, "sign": sign ^ negative, **rest}


def normalise(m: Module, f: FloatFormat, *, total: Value, zeros: Value, exponent: Value, **rest: Any) -> dict[str, Any]:
    scaled = shift_left(m, total, zeros, "scaled")
    biased = Signal(f.exponent)
    m.d.comb += biased.eq(exponent - (f.bias - 2) - zeros)
    kept = scaled[-f.precision :]
    below = scaled[: -f.precision]
    return {"kept": kept, "guard": below[-1], "sticky": below[:-1].any(), "exponent": biased, **rest}


class FloatDifferenceOfProducts(StepCore):
    """a*b - c*d with a single rounding, so that its sign is exact; depth 0 to 8. `blocks` as in `FloatMultiply`."""

    declared = PURE["float_difference_of_products"]

    def __init__(self, depth: int, format: FloatFormat = FLOAT32, *, blocks: bool = False):
        self.blocks = blocks
        super().__init__(depth, format)

    @classmethod
    def steps(cls, format: FloatFormat, *, blocks: bool = False) -> list[tuple[Step, int]]:
        return [
            (partial(classify, blocks=blocks), 14),
            (partial(multiply, blocks=blocks), 26),
            (add_rows, 22),
            (align, 14),
            (add, 20),
            (count, 12),
            (normalise, 14),
            (round_sum, 14),
        ]

    def chain(self) -> list[tuple[Step, int]]:
        return self.steps(self.format, blocks=self.blocks)
