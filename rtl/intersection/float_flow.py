# amaranth: UnusedElaboratable=no
# (a unit is also made only to ask for its latency)
"""float32 arithmetic in a dataflow: one method an operation, named as in `golden_model.numerics.floats`."""

from amaranth import Value

from lightloom.rtl.blocks import Operators
from lightloom.rtl.fabric.dataflow import Dataflow, Node
from lightloom.rtl.operators.float_add import FloatAdd
from lightloom.rtl.operators.float_compare import FloatCompare
from lightloom.rtl.operators.float_difference_of_products import FloatDifferenceOfProducts
from lightloom.rtl.operators.float_divide import FloatDivide
from lightloom.rtl.operators.float_multiply import FloatMultiply

ONE = 0x3F800000


class FloatFlow:
    """Places operators into a dataflow; `name` names the submodule."""

    def __init__(self, flow: Dataflow, operators: Operators):
        self._flow = flow
        self._operators = operators

    def add(self, name: str, a: Node, b: Node) -> Node:
        return self._flow.apply(name, FloatAdd(self._operators.add_depth), a=a, b=b, subtract=0)["z"]

    def subtract(self, name: str, a: Node, b: Node) -> Node:
        return self._flow.apply(name, FloatAdd(self._operators.add_depth), a=a, b=b, subtract=1)["z"]

    def multiply(self, name: str, a: Node, b: Node) -> Node:
        """a * b, or a*b - 0*0, which is the same number in all cases."""
        core = FloatMultiply(self._operators.multiply_depth, blocks=self._operators.multiplier_blocks)
        return self._flow.apply(name, core, self._difference_of_products(), a=a, b=b)["z"]

    def difference_of_products(self, name: str, a: Node, b: Node, c: Node, d: Node) -> Node:
        return self._flow.apply(name, self._difference_of_products(), a=a, b=b, c=c, d=d)["z"]

    def _difference_of_products(self) -> FloatDifferenceOfProducts:
        depth, blocks = self._operators.difference_of_products_depth, self._operators.multiplier_blocks
        return FloatDifferenceOfProducts(depth, blocks=blocks)

    def reciprocal(self, name: str, a: Node) -> Node:
        return self._flow.apply(name, FloatDivide(self._operators.divide_depth), a=ONE, b=a)["z"]

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
