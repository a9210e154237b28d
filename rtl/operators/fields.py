"""Taking float32 numbers apart and putting them together again, under the numeric contract."""

from typing import Any

from amaranth import Cat, Const, Module, Mux, Signal, Value, unsigned
from amaranth.lib import data

CANONICAL_NAN = 0x7FC00000
INFINITY = 0xFF  # biased exponent of infinities and NaNs
INFINITE_BITS = INFINITY << 23  # an infinity without its sign

# A float32 operand, classified. `zero` includes subnormals; `significand` has the hidden one (0 for a zero).
Operand = data.StructLayout(
    {"sign": 1, "exponent": unsigned(8), "significand": unsigned(24), "zero": 1, "infinite": 1, "nan": 1}
)


def unpack(m: Module, bits: Any, name: str) -> data.View:
    """Raw float32 bits to an Operand."""
    raw = Value.cast(bits)
    fraction, exponent, sign = raw[:23], raw[23:31], raw[31]
    out = Signal(Operand, name=name)
    m.d.comb += [
        out.sign.eq(sign),
        out.exponent.eq(exponent),
        out.zero.eq(exponent == 0),
        out.significand.eq(Mux(exponent == 0, 0, Cat(fraction, Const(1, 1)))),
        out.infinite.eq(raw[:31] == INFINITE_BITS),
        out.nan.eq(raw[:31] > INFINITE_BITS),
    ]
    return out


def rounded(
    m: Module, *, sign: Value, exponent: Value, kept: Value, guard: Value, sticky: Value, name: str = "rounded"
) -> Signal:
    """Rounds to nearest even and packs: 32 bits, with overflow to infinity and underflow to zero of the same sign.

    `kept` is the 24-bit significand with its leading one, `exponent` its biased exponent (signed, any width), `guard`
    the next bit and `sticky` the or of all below it.

    The flush comes after IEEE rounding: of the values below the least normal number, those from 0xFFFFFF * 2**-150 up
    round to it (in IEEE's subnormal range that is a tie, resolved to even) and are kept.
    """
    up = Signal(name=f"{name}_up")
    total = Signal(25, name=f"{name}_total")
    final = Signal(exponent.shape(), name=f"{name}_exponent")
    out = Signal(32, name=name)
    m.d.comb += [
        up.eq((guard & (sticky | kept[0])) | ((exponent == 0) & kept.all())),
        total.eq(kept + up),
        final.eq(exponent + total[24]),
    ]
    with m.If(final <= 0):
        m.d.comb += out.eq(Cat(Const(0, 31), sign))
    with m.Elif(final >= INFINITY):
        m.d.comb += out.eq(Cat(Const(0, 23), Const(INFINITY, 8), sign))
    with m.Else():
        # Where rounding carried out, the fraction is zero either way.
        m.d.comb += out.eq(Cat(total[:23], final[:8], sign))
    return out


def with_specials(
    m: Module, *, finite: Value, sign: Value, nan: Value, infinite: Value, zero: Value | int, name: str = "z"
) -> Signal:
    """The result of an operation: 32 bits, `finite` unless one of the special cases holds (`nan` before the others)."""
    out = Signal(32, name=name)
    with m.If(nan):
        m.d.comb += out.eq(CANONICAL_NAN)
    with m.Elif(infinite):
        m.d.comb += out.eq(Cat(Const(0, 23), Const(INFINITY, 8), sign))
    with m.Elif(zero):
        m.d.comb += out.eq(Cat(Const(0, 31), sign))
    with m.Else():
        m.d.comb += out.eq(finite)
    return out


def add_with_carry(a: Value, b: Value, carry: Value) -> Value:
    """a + b + carry with one adder: the carry enters through an extra lowest bit. One bit wider than the operands."""
    return (Cat(carry, a) + Cat(carry, b))[1:]
