"""Masks of which at most one bit is set."""

from collections.abc import Iterable
from typing import Any

from amaranth import Cat, Module, Mux, Signal, Value


def any_of(values: Iterable[Value]) -> Value:
    """The or of all of them, bit by bit."""
    result, *others = values
    for value in others:
        result = result | value
    return result


def pick(chosen: Iterable[Value], values: Iterable[Any]) -> Value:
    """The value whose bit is set, of at most one; zero for none. The shorter of the two ends the list."""
    return any_of(Mux(bit, value, 0) for bit, value in zip(chosen, values, strict=False))


def number_of(one_hot: Value) -> Value:
    """The number of the only bit that is set; no bits wide where there is only one."""
    width = (len(one_hot) - 1).bit_length()
    return Cat(Cat(bit for k, bit in enumerate(one_hot) if k >> place & 1).any() for place in range(width))


def above_lowest(m: Module, name: str, bits: Value) -> Signal:
    """All places above the lowest bit that is set.

    A tree of log2 levels: the carry of a subtraction would say the same, by an adder's detours.
    """
    count = len(bits)
    reach = Signal(count, name=f"{name}_above1")
    m.d.comb += reach.eq(bits << 1)
    step = 1
    while step < count - 1:
        farther = Signal(count, name=f"{name}_above{2 * step}")
        m.d.comb += farther.eq(reach | reach << step)
        reach, step = farther, 2 * step
    return reach


def lowest(m: Module, name: str, bits: Value) -> Value:
    """Only the lowest bit that is set."""
    return bits & ~above_lowest(m, name, bits)


def next_of(m: Module, name: str, wanted: Value, take: Value) -> Signal:
    """One of the wanted bits: the next one above the last that was taken, round and round."""
    count = len(wanted)
    above, higher, chosen = (Signal(count, name=f"{name}_{part}") for part in ("above", "higher", "chosen"))
    some = Signal(name=f"{name}_some")
    above_higher, above_wanted = (
        above_lowest(m, f"{name}_{part}", bits) for part, bits in (("higher", higher), ("wanted", wanted))
    )
    m.d.comb += [
        higher.eq(wanted & above),
        some.eq(higher.any()),
        chosen.eq(Mux(some, higher & ~above_higher, wanted & ~above_wanted)),
    ]
    with m.If(take):
        m.d.sync += above.eq(Mux(some, above_higher, above_wanted))
    return chosen
