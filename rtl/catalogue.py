"""Every unit that can be emitted, by name, as a function of the configuration."""

from collections.abc import Callable

from rtl.config import Config
from rtl.operators.float_multiply import FloatMultiply
from rtl.pipeline import Core, StreamUnit


def _stream(core: Callable[[Config], Core]) -> Callable[[Config], StreamUnit]:
    return lambda config: StreamUnit(core(config), config.tag_width)


CATALOGUE: dict[str, Callable[[Config], StreamUnit]] = {
    "float_multiply": _stream(lambda c: FloatMultiply(c.multiply_depth)),
}
