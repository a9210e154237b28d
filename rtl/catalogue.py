# amaranth: UnusedElaboratable=no
# (a unit is also made only to ask for its latency)
"""Every unit that can be emitted, by name, as a function of the configuration."""

from collections.abc import Callable

from lightloom.rtl.config import Config
from lightloom.rtl.engine.texel_blend import TexelBlend
from lightloom.rtl.engine.texel_match import TexelMatch
from lightloom.rtl.engine.texel_project import TexelProject
from lightloom.rtl.fabric.pipeline import Core, StreamUnit
from lightloom.rtl.fabric.unit import UnitComponent
from lightloom.rtl.intersection.box_setup import BoxSetup
from lightloom.rtl.intersection.node_test import NodeTest
from lightloom.rtl.intersection.ray_setup import RaySetup
from lightloom.rtl.intersection.ray_time import RayTime
from lightloom.rtl.intersection.ray_triangle import RayTriangle, RayTriangleHalf
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
from lightloom.rtl.operators.float_to_half import FloatToHalf
from lightloom.rtl.operators.half_to_float import HalfToFloat
from lightloom.rtl.traversal.array import traversal


def _stream(core: Callable[[Config], Core]) -> Callable[[Config], StreamUnit]:
    return lambda config: StreamUnit(core(config), config.streams.tag_width)


CATALOGUE: dict[str, Callable[[Config], UnitComponent]] = {
    "float_add": _stream(lambda c: FloatAdd(c.operators.add_depth)),
    "float_multiply": _stream(
        lambda c: FloatMultiply(c.operators.multiply_depth, blocks=c.operators.multiplier_blocks)
    ),
    "float_difference_of_products": _stream(
        lambda c: FloatDifferenceOfProducts(
            c.operators.difference_of_products_depth, blocks=c.operators.multiplier_blocks
        )
    ),
    "float_divide": _stream(lambda c: FloatDivide(c.operators.divide_depth)),
    "float_sqrt": _stream(lambda c: FloatSqrt(c.operators.sqrt_depth)),
    "float_compare": _stream(lambda c: FloatCompare(c.operators.compare_depth)),
    "float_minmax": _stream(lambda c: FloatMinmax(c.operators.compare_depth)),
    "float_to_half": _stream(lambda c: FloatToHalf(c.operators.convert_depth)),
    "half_to_float": _stream(lambda c: HalfToFloat(c.operators.convert_depth)),
    "float_to_fixed": _stream(lambda c: FloatToFixed(c.operators.convert_depth)),
    "float_to_fixed_down": _stream(lambda c: FloatToFixedDown(c.operators.convert_depth)),
    "fixed_to_float": _stream(lambda c: FixedToFloat(c.operators.convert_depth)),
    "fixed64_to_float": _stream(lambda c: Fixed64ToFloat(c.operators.convert_depth)),
    "ray_setup": _stream(RaySetup),
    "ray_triangle": _stream(RayTriangle),
    "ray_triangle_half": _stream(RayTriangleHalf),
    "ray_time": _stream(RayTime),
    "box_setup": _stream(BoxSetup),
    "node_test": _stream(NodeTest),
    "texel_project": _stream(lambda c: TexelProject(c, interval=c.texel.project_interval)),
    "texel_match": _stream(lambda c: TexelMatch(c, interval=c.texel.match_interval)),
    "texel_blend": _stream(lambda c: TexelBlend(c, interval=c.texel.blend_interval)),
    "traversal": traversal,
}


def stream_unit(unit: str, config: Config) -> StreamUnit:
    """A unit whose results depend on its operands alone; TypeError for another."""
    made = CATALOGUE[unit](config)
    if not isinstance(made, StreamUnit):
        raise TypeError(f"{unit} has no fixed latency")
    return made
