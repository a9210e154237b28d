"""float32 operators by a solver, for all operands: zeros, infinities and NaNs, and what no result is.

The value of finite results is not stated here: small formats are tried exhaustively (`gen.formal.numbers`), and at full
width they are compared with Berkeley SoftFloat by the tests.
"""

from collections.abc import Callable
from typing import Any

from amaranth import Cat, Const, Mux, Signal, Value

from lightloom.gen.formal.bench import Bench
from lightloom.gen.formal.properties import Combinational, Property
from lightloom.rtl.fabric.pipeline import Core
from lightloom.rtl.operators.float_add import FloatAdd
from lightloom.rtl.operators.float_compare import FloatCompare
from lightloom.rtl.operators.float_divide import FloatDivide
from lightloom.rtl.operators.float_minmax import FloatMinmax
from lightloom.rtl.operators.float_multiply import FloatMultiply
from lightloom.rtl.operators.float_sqrt import FloatSqrt

NAN = 0x7FC00000


class Number:
    """What a solver is to know of an operand: classes by the rules of the numbers, subnormal operands being zeros."""

    def __init__(self, bench: Bench, bits: Any, name: str):
        raw = Value.cast(bits)
        self.sign = raw[31]
        self.magnitude = raw[:31]
        self.nan, self.infinite, self.zero = (Signal(name=f"{name}_{kind}") for kind in ("nan", "infinite", "zero"))
        self.flushed = Signal(32, name=f"{name}_flushed")
        bench.m.d.comb += [
            self.nan.eq(self.magnitude > 0x7F800000),
            self.infinite.eq(self.magnitude == 0x7F800000),
            self.zero.eq(raw[23:31] == 0),
            self.flushed.eq(Cat(Mux(self.zero, 0, self.magnitude)[:31], self.sign)),
        ]
        self.finite = ~self.nan & ~self.infinite


def infinity(sign: Any) -> Value:
    return Cat(Const(0, 23), Const(0xFF, 8), sign)


def zero(sign: Any) -> Value:
    return Cat(Const(0, 31), sign)


def _bench(core: Core) -> tuple[Bench, Any, list[Number]]:
    """The bench, the result `z` where there is one, and the operands; with what holds of any result."""
    bench = Bench(core)
    operands = [Number(bench, core.i[name], name) for name in ("a", "b", "c", "d") if name in core.i.shape().members]
    if "z" not in core.o.shape().members:
        return bench, None, operands
    z = Value.cast(core.o.z)
    bench.require("no_subnormal_result", (z[23:31] != 0) | (z[:23] == 0))
    bench.require("one_nan", (z[:31] <= 0x7F800000) | (z == NAN))
    return bench, z, operands


def add() -> Bench:
    core = FloatAdd(0)
    bench, z, (a, b) = _bench(core)
    sign_b = b.sign ^ core.i.subtract
    differ = a.sign ^ sign_b
    invalid = a.nan | b.nan | (a.infinite & b.infinite & differ)
    bench.require("nan", invalid == (z == NAN))
    bench.require("infinite_a", invalid | ~a.infinite | (z == infinity(a.sign)))
    bench.require("infinite_b", invalid | ~b.infinite | (z == infinity(sign_b)))
    bench.require("zero_a", invalid | ~a.zero | b.zero | (z == Cat(b.flushed[:31], sign_b)))
    bench.require("zero_b", invalid | ~b.zero | a.zero | (z == a.flushed))
    bench.require("zeros", ~(a.zero & b.zero) | (z == zero(a.sign & sign_b)))
    cancels = a.finite & ~a.zero & (a.magnitude == b.magnitude) & differ
    bench.require("cancels", ~cancels | (z == 0))
    bench.require("sign_of_sum", invalid | differ | (z[31] == a.sign))
    return bench


def multiply() -> Bench:
    bench, z, (a, b) = _bench(FloatMultiply(0))
    sign = a.sign ^ b.sign
    invalid = a.nan | b.nan | (a.infinite & b.zero) | (a.zero & b.infinite)
    bench.require("nan", invalid == (z == NAN))
    bench.require("infinite", invalid | ~(a.infinite | b.infinite) | (z == infinity(sign)))
    bench.require("zero", invalid | ~(a.zero | b.zero) | (z == zero(sign)))
    bench.require("sign", invalid | (z[31] == sign))
    return bench


def divide() -> Bench:
    bench, z, (a, b) = _bench(FloatDivide(0))
    sign = a.sign ^ b.sign
    invalid = a.nan | b.nan | (a.infinite & b.infinite) | (a.zero & b.zero)
    bench.require("nan", invalid == (z == NAN))
    bench.require("infinite", invalid | ~(a.infinite | b.zero) | (z == infinity(sign)))
    bench.require("zero", invalid | ~(a.zero | b.infinite) | (z == zero(sign)))
    bench.require("sign", invalid | (z[31] == sign))
    return bench


def sqrt() -> Bench:
    bench, z, (a,) = _bench(FloatSqrt(0))
    invalid = a.nan | (a.sign & ~a.zero)
    bench.require("nan", invalid == (z == NAN))
    bench.require("infinite", invalid | ~a.infinite | (z == infinity(0)))
    bench.require("zero", ~a.zero | (z == zero(a.sign)))
    bench.require("positive", invalid | a.zero | ~z[31])
    return bench


def compare() -> Bench:
    core = FloatCompare(0)
    bench, _, (a, b) = _bench(core)
    o = core.o
    bench.require("one_of_four", o.less + o.equal + o.greater + o.unordered == 1)
    bench.require("unordered", o.unordered == (a.nan | b.nan))
    bench.require("equal", o.equal == (~a.nan & ~b.nan & ((a.flushed == b.flushed) | (a.zero & b.zero))))
    positive = ~a.sign & ~b.sign & a.finite & b.finite
    bench.require("order", ~positive | (o.less == (a.flushed < b.flushed)))
    bench.require("signs", (a.zero & b.zero) | ~(a.sign & ~b.sign) | a.nan | b.nan | o.less)
    return bench


def minmax() -> Bench:
    core = FloatMinmax(0)
    bench, z, (a, b) = _bench(core)
    bench.require("both_nan", ~(a.nan & b.nan) | (z == NAN))
    bench.require("nan_loses", (a.nan == b.nan) | (z == Mux(a.nan, b.flushed, a.flushed)))
    bench.require("one_of_them", a.nan | b.nan | (z == a.flushed) | (z == b.flushed))
    negative = a.sign & ~b.sign & ~a.nan & ~b.nan
    bench.require("signs", ~negative | (z == Mux(core.i.maximum, b.flushed, a.flushed)))
    positive = ~a.sign & ~b.sign & ~a.nan & ~b.nan
    least = Mux(a.flushed < b.flushed, a.flushed, b.flushed)
    greatest = Mux(a.flushed < b.flushed, b.flushed, a.flushed)
    bench.require("positive", ~positive | (z == Mux(core.i.maximum, greatest, least)))
    return bench


BENCHES: dict[str, Callable[[], Bench]] = {
    "float_add": add,
    "float_multiply": multiply,
    "float_divide": divide,
    "float_sqrt": sqrt,
    "float_compare": compare,
    "float_minmax": minmax,
}


def properties() -> list[Property]:
    return [
        Property(
            unit=unit,
            name="special-cases",
            says="float32: NaNs, infinities, zeros and subnormals, signs; no subnormal result, one NaN",
            method=Combinational(),
            build=build,
            quick=unit in ("float_multiply", "float_minmax"),
        )
        for unit, build in BENCHES.items()
    ]
