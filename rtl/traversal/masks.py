"""Small state of many contexts, held as masks with a bit a context.

Several things happen to different contexts in one cycle. A mask takes them all as bitwise operations of its width,
without a decoder and a multiplexer a context. A count of a context is held as planes: plane b has bit b of all counts.
"""

from collections.abc import Sequence

from amaranth import Cat, Const, Module, Signal, Value

from lightloom.rtl.fabric.one_hot import any_of


def one_hot(number: Value, count: int) -> Value:
    """The mask of one context; none if `number` is not below `count`."""
    return (Const(1) << number)[:count]


def only_if(condition: Value, mask: Value) -> Value:
    """A mask where a condition of one bit holds, else none."""
    return mask & condition.replicate(len(mask))


class Counts:
    """A count for each context, from 0 to `greatest`; after reset 0."""

    def __init__(self, name: str, contexts: int, greatest: int):
        self.planes = [Signal(contexts, name=f"{name}{b}") for b in range(greatest.bit_length())]

    def some(self) -> Value:
        """The contexts whose count is not 0."""
        return any_of(self.planes)

    def of(self, context: Value) -> Value:
        """The count of the only context in a mask."""
        return Cat((plane & context).any() for plane in self.planes)

    def below(self, limit: Value) -> Value:
        """The contexts whose count is less than `limit`."""
        count = len(self.planes[0])
        less: Value = Const(0, count)
        equal: Value = Const((1 << count) - 1, count)
        for b in reversed(range(max(len(self.planes), len(limit)))):
            plane = self.planes[b] if b < len(self.planes) else Const(0, count)
            digit = (limit[b] if b < len(limit) else Const(0, 1)).replicate(count)
            less = less | (equal & ~plane & digit)
            equal = equal & ~(plane ^ digit)
        return less

    def become(self, m: Module, planes: Sequence[Value]) -> None:
        m.d.sync += [plane.eq(value) for plane, value in zip(self.planes, planes, strict=True)]


def plus(planes: Sequence[Value], mask: Value) -> list[Value]:
    """One more for each context of a mask."""
    out, carry = [], mask
    for plane in planes:
        out.append(plane ^ carry)
        carry = plane & carry
    return out


def minus(planes: Sequence[Value], mask: Value) -> list[Value]:
    """One less for each context of a mask."""
    out, borrow = [], mask
    for plane in planes:
        out.append(plane ^ borrow)
        borrow = ~plane & borrow
    return out


def replace(planes: Sequence[Value], mask: Value, count: Value) -> list[Value]:
    """`count` for each context of a mask."""
    width = len(mask)
    return [(plane & ~mask) | (mask & count[b].replicate(width)) for b, plane in enumerate(planes)]
