# amaranth: UnusedElaboratable=no
# (a unit is also made only to ask for its latency)
"""float32 arithmetic in a dataflow: one method an operation, named as in `golden_model.numerics.floats`."""

from collections.abc import Sequence

import numpy as np
from amaranth import Cat, Const, Value

from lightloom.rtl.blocks import Operators
from lightloom.rtl.fabric.dataflow import Dataflow, Node
from lightloom.rtl.operators.fixed64_to_float import Fixed64ToFloat
from lightloom.rtl.operators.fixed_to_float import FixedToFloat
from lightloom.rtl.operators.float_add import FloatAdd
from lightloom.rtl.operators.float_compare import FloatCompare
from lightloom.rtl.operators.float_difference_of_products import FloatDifferenceOfProducts
from lightloom.rtl.operators.float_divide import FloatDivide
from lightloom.rtl.operators.float_minmax import FloatMinmax
from lightloom.rtl.operators.float_multiply import FloatMultiply
from lightloom.rtl.operators.float_sqrt import FloatSqrt
from lightloom.rtl.operators.float_to_fixed import FloatToFixed
from lightloom.rtl.operators.float_to_fixed_down import FloatToFixedDown
from lightloom.rtl.operators.half_to_float import HalfToFloat

ONE = 0x3F800000


def bits_of(value: float | np.float32) -> int:
    """A constant, as a float32 number's bits."""
    return int(np.float32(value).view(np.uint32))


class FloatFlow:
    """Places operators into a dataflow; `name` names the submodule."""

    def __init__(self, flow: Dataflow, operators: Operators):
        self._flow = flow
        self._operators = operators

    def add(self, name: str, a: Node | int, b: Node) -> Node:
        return self._flow.apply(name, FloatAdd(self._operators.add_depth), a=a, b=b, subtract=0)["z"]

    def subtract(self, name: str, a: Node, b: Node) -> Node:
        return self._flow.apply(name, FloatAdd(self._operators.add_depth), a=a, b=b, subtract=1)["z"]

    def multiply(self, name: str, a: Node, b: Node | int) -> Node:
        """a * b, or a*b - 0*0, which is the same number in all cases."""
        core = FloatMultiply(self._operators.multiply_depth, blocks=self._operators.multiplier_blocks)
        return self._flow.apply(name, core, self._difference_of_products(), a=a, b=b)["z"]

    def difference_of_products(self, name: str, a: Node, b: Node, c: Node, d: Node) -> Node:
        return self._flow.apply(name, self._difference_of_products(), a=a, b=b, c=c, d=d)["z"]

    def _difference_of_products(self) -> FloatDifferenceOfProducts:
        depth, blocks = self._operators.difference_of_products_depth, self._operators.multiplier_blocks
        return FloatDifferenceOfProducts(depth, blocks=blocks)

    def dot(self, name: str, a: Sequence[Node], b: Sequence[Node | int]) -> Node:
        """(x + y) + z of the products."""
        x, y, z = (self.multiply(f"{name}_{axis}", p, q) for axis, p, q in zip("xyz", a, b, strict=True))
        return self.add(f"{name}_xyz", self.add(f"{name}_xy", x, y), z)

    def divide(self, name: str, a: Node | int, b: Node) -> Node:
        return self._flow.apply(name, FloatDivide(self._operators.divide_depth), a=a, b=b)["z"]

    def reciprocal(self, name: str, a: Node) -> Node:
        return self.divide(name, ONE, a)

    def sqrt(self, name: str, a: Node) -> Node:
        return self._flow.apply(name, FloatSqrt(self._operators.sqrt_depth), a=a)["z"]

    def minimum(self, name: str, a: Node, b: Node | int) -> Node:
        return self._flow.apply(name, FloatMinmax(self._operators.compare_depth), a=a, b=b, maximum=0)["z"]

    def maximum(self, name: str, a: Node, b: Node | int) -> Node:
        return self._flow.apply(name, FloatMinmax(self._operators.compare_depth), a=a, b=b, maximum=1)["z"]

    def negate(self, name: str, a: Node) -> Node:
        return self._flow.logic(name, lambda a: Cat(a[:31], ~a[31]), a)

    def absolute(self, name: str, a: Node) -> Node:
        return self._flow.logic(name, lambda a: Cat(a[:31], Const(0, 1)), a)

    def to_fixed(self, name: str, a: Node, fraction: int) -> Node:
        core = FloatToFixed(self._operators.convert_depth)
        return self._flow.apply(name, core, a=a, fraction=fraction)["z"]

    def to_fixed_down(self, name: str, a: Node, fraction: int) -> Node:
        core = FloatToFixedDown(self._operators.convert_depth)
        return self._flow.apply(name, core, a=a, fraction=fraction)["z"]

    def from_fixed(self, name: str, a: Node, fraction: Node | int = 0) -> Node:
        """Of an unsigned integer of at most 31 bits."""
        return self._flow.apply(name, FixedToFloat(self._operators.convert_depth), a=a, fraction=fraction)["z"]

    def from_fixed64(self, name: str, a: Node, fraction: Node | int = 0) -> Node:
        """Of an integer of 64 bits, or an unsigned one of fewer."""
        core = Fixed64ToFloat(self._operators.convert_depth)
        return self._flow.apply(name, core, a=a, fraction=fraction)["z"]

    def from_half(self, name: str, a: Node) -> Node:
        return self._flow.apply(name, HalfToFloat(self._operators.convert_depth), a=a)["z"]

    def compare(self, name: str, a: Node, b: Node) -> dict[str, Node]:
        """Nodes `less`, `equal`, `greater`, `unordered`."""
        return self._flow.apply(name, FloatCompare(self._operators.compare_depth), a=a, b=b)


# Predicates over the bits of a result of an operator (subnormals are flushed already).


def exponent(z: Value) -> Value:
    return z[23:31]


def is_zero(z: Value) -> Value:
    return exponent(z) == 0


def is_finite(z: Value) -> Value:
    return exponent(z) != 0xFF


def is_negative(z: Value) -> Value:
    """z < 0 (or a NaN with its sign set, which no operator returns)."""
    return z[31] & ~is_zero(z)


def is_positive(z: Value) -> Value:
    """z > 0 or the canonical NaN."""
    return ~z[31] & ~is_zero(z)
