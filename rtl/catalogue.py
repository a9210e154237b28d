# amaranth: UnusedElaboratable=no
# (a unit is also made only to ask for its latency)
"""Every unit that can be emitted, by name, as a function of the configuration."""

from collections.abc import Callable

from rtl.config import Config
from rtl.operators.float_add import FloatAdd
from rtl.operators.float_difference_of_products import FloatDifferenceOfProducts
from rtl.operators.float_divide import FloatDivide
from rtl.operators.float_multiply import FloatMultiply
from rtl.pipeline import Core, StreamUnit


def _stream(core: Callable[[Config], Core]) -> Callable[[Config], StreamUnit]:
    return lambda config: StreamUnit(core(config), config.tag_width)


CATALOGUE: dict[str, Callable[[Config], StreamUnit]] = {
    "float_add": _stream(lambda c: FloatAdd(c.add_depth)),
    "float_multiply": _stream(lambda c: FloatMultiply(c.multiply_depth)),
    "float_difference_of_products": _stream(lambda c: FloatDifferenceOfProducts(c.difference_of_products_depth)),
    "float_divide": _stream(lambda c: FloatDivide(c.divide_depth)),
}
