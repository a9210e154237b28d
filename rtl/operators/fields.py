"""Taking floating-point numbers apart and putting them together again, under the numeric contract."""

from typing import Any

from amaranth import Cat, Const, Module, Mux, Signal, Value, unsigned
from amaranth.lib import data

from lightloom.rtl.fabric.float_format import FloatFormat


def operand_layout(f: FloatFormat) -> data.StructLayout:
    """An operand, classified. `zero` includes subnormals, whose `significand` is as unspecified as a zero's."""
    flags = dict.fromkeys(("zero", "infinite", "nan"), 1)
    return data.StructLayout(
        {"sign": 1, "exponent": unsigned(f.exponent_bits), "significand": unsigned(f.precision), **flags}
    )


def unpack(m: Module, f: FloatFormat, bits: Any, name: str) -> data.View:
    """Raw bits to a classified operand; `significand` has its hidden one always, also where the number is zero."""
    raw = Value.cast(bits)
    fraction, exponent, sign = raw[: f.fraction_bits], raw[f.fraction_bits : -1], raw[-1]
    out = Signal(operand_layout(f), name=name)
    special, whole = exponent.all(), ~fraction.any()
    m.d.comb += [
        out.sign.eq(sign),
        out.exponent.eq(exponent),
        out.zero.eq(~exponent.any()),
        out.significand.eq(Cat(fraction, Const(1, 1))),
        out.infinite.eq(special & whole),
        out.nan.eq(special & ~whole),
    ]
    return out


def rounded(
    m: Module,
    f: FloatFormat,
    *,
    sign: Value,
    exponent: Value,
    kept: Value,
    guard: Value,
    sticky: Value,
    nan: Value,
    infinite: Value,
    zero: Value,
) -> Signal:
    """Rounds to nearest even and packs, with overflow to infinity and underflow to zero of the same sign.

    `kept` is the significand with its leading one, `exponent` its biased exponent (signed, any width), `guard` the next
    bit and `sticky` the or of all below it. `nan`, `infinite` and `zero` say that the result is one of these, whatever
    the others hold; the first of them counts.

    The flush comes after IEEE rounding: of the values below the least normal number, those that IEEE rounds up to it
    (in its subnormal range that is a tie, resolved to even) are kept.
    """
    up = Signal(name="up")
    carry = Signal(name="carry")
    total = Signal(f.precision, name="rounded_significand")
    over = Signal(name="over")
    under = Signal(name="under")
    least = exponent == 0
    m.d.comb += [
        up.eq(guard & (sticky | kept[0])),
        total.eq(kept + up),
        # Out of a significand of ones; it is known before the sum is.
        carry.eq(kept.all() & (guard | least)),
        over.eq((exponent >= f.infinity) | (carry & (exponent == f.infinity - 1))),
        under.eq((exponent < 0) | (least & ~carry)),
    ]
    final = Mux(carry, (exponent + 1)[: f.exponent_bits], exponent[: f.exponent_bits])
    return packed(
        m,
        f,
        sign=sign,
        exponent=final,
        # What carries out leaves a fraction of zeros.
        fraction=total[: f.fraction_bits] & ~carry.replicate(f.fraction_bits),
        nan=nan,
        infinite=infinite | (over & ~zero),
        zero=zero | under,
    )


def packed(
    m: Module,
    f: FloatFormat,
    *,
    sign: Value,
    exponent: Value,
    fraction: Value,
    nan: Value,
    infinite: Value,
    zero: Value,
) -> Signal:
    """The result of an operation: sign, exponent and fraction, or the first of the special cases that holds."""
    z = Signal(f.width, name="z")
    special = nan | infinite
    plain = ~(special | zero)
    m.d.comb += z.eq(
        Cat(
            fraction[:-1] & plain.replicate(f.fraction_bits - 1),
            (fraction[-1] & plain) | nan,
            (exponent & plain.replicate(f.exponent_bits)) | special.replicate(f.exponent_bits),
            sign & ~nan,
        )
    )
    return z


def add_with_carry(a: Value, b: Value, carry: Value) -> Value:
    """a + b + carry with one adder: the carry enters through an extra lowest bit. One bit wider than the operands."""
    return (Cat(carry, a) + Cat(carry, b))[1:]
