"""Masks of which at most one bit is set."""

from collections.abc import Iterable

from amaranth import Cat, Value


def any_of(values: Iterable[Value]) -> Value:
    """The or of all of them, bit by bit."""
    result, *others = values
    for value in others:
        result = result | value
    return result


def number_of(one_hot: Value) -> Value:
    """The number of the only bit that is set; no bits wide where there is only one."""
    width = (len(one_hot) - 1).bit_length()
    return Cat(Cat(bit for k, bit in enumerate(one_hot) if k >> place & 1).any() for place in range(width))


def lowest(bits: Value) -> Value:
    """Only the lowest bit that is set."""
    return bits & (~bits + 1)[: len(bits)]
