"""Register stages change when a number unit's result comes, not what it is: the pipeline against its own chain."""

from functools import partial

from amaranth import Signal, Value

from lightloom.gen.formal.bench import Bench
from lightloom.gen.formal.properties import Bounded, Property
from lightloom.rtl.fabric.float_format import FloatFormat
from lightloom.rtl.fabric.pipeline import StepCore
from lightloom.rtl.operators.float_add import FloatAdd
from lightloom.rtl.operators.float_compare import FloatCompare
from lightloom.rtl.operators.float_difference_of_products import FloatDifferenceOfProducts
from lightloom.rtl.operators.float_divide import FloatDivide
from lightloom.rtl.operators.float_minmax import FloatMinmax
from lightloom.rtl.operators.float_multiply import FloatMultiply
from lightloom.rtl.operators.float_sqrt import FloatSqrt

SMALL = FloatFormat(2, 2)
"""What the steps compute is not in question here."""
STALLS = 2
"""Cycles beyond the latency, in which the pipeline may stand."""

CORES: tuple[type[StepCore], ...] = (
    FloatAdd,
    FloatMultiply,
    FloatDivide,
    FloatSqrt,
    FloatCompare,
    FloatMinmax,
    FloatDifferenceOfProducts,
)


def cut(make: type[StepCore], depth: int) -> Bench:
    """A core with register stages beside one without, whose results wait in a delay line that moves with `en`."""
    core, chain = make(depth, SMALL), make(0, SMALL)
    bench = Bench(core)
    bench.add("chain", chain)
    bench.m.d.comb += Value.cast(chain.i).eq(core.i)
    expected = Value.cast(chain.o)
    filled = Signal(range(depth + 1))
    stalled = Signal()  # while something was inside, not yet at the end
    bench.m.d.sync += stalled.eq(stalled | (~core.en & (filled != 0) & (filled != depth)))
    with bench.m.If(core.en):
        for stage in range(depth):
            delayed = Signal(len(expected), name=f"delayed{stage}")
            bench.m.d.sync += delayed.eq(expected)
            expected = delayed
        with bench.m.If(filled != depth):
            bench.m.d.sync += filled.eq(filled + 1)
    bench.require("same_result", (filled != depth) | (Value.cast(core.o) == expected))
    bench.reach("filled", filled == depth)
    if depth > 1:
        bench.reach("filled_after_a_stall", (filled == depth) & stalled)
    bench.reach("stalls_when_filled", (filled == depth) & ~core.en)
    return bench


def properties() -> list[Property]:
    out = []
    for make in CORES:
        depth = len(make.steps(SMALL))
        out.append(
            Property(
                unit=make.declared.name,
                name="cuts",
                says="a register after every step gives the same results, that many enabled cycles later",
                method=Bounded(depth=depth + STALLS),
                build=partial(cut, make, depth),
            )
        )
    return out
