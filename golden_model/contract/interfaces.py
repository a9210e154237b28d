"""The units of the hardware: name, summary, kind, payloads of the streams, what of the configuration they depend on.

That is what RTL, model, software and documentation agree on. Catalogue, manifests, packages, benches, bulk runs, proofs
and pages start from here; `golden_model.models` has what a unit computes, `rtl.catalogue` the hardware, whose ports and
counters are described where they are declared.
"""

from dataclasses import dataclass
from enum import Enum

import numpy as np

from lightloom.golden_model.contract import formats as _F
from lightloom.golden_model.contract.names import OF_FIELDS, OF_PORTS, check_name


class Kind(Enum):
    """What a unit's results depend on, and the order in which they come."""

    PURE = "pure"
    """On the operands alone; in their order, a fixed number of cycles later."""
    IN_ORDER = "in order"
    """On what the unit remembers too; in the operands' order."""
    TAGGED = "tagged"
    """On memory; in any order, told apart by their tags."""
    PASS = "pass over memory"
    """It reads and writes memory from a beginning to an end."""
    SYSTEM = "system"
    """It has registers and runs by itself."""


@dataclass(frozen=True, kw_only=True)
class Unit:
    """One unit, with a stream of operands and one of results. Raises ValueError for names that cannot be used."""

    name: str
    """The name in every room, and of the Verilog module."""
    summary: str
    """What it computes, in one line."""
    kind: Kind = Kind.PURE
    input: np.dtype
    """Payload of the input stream, without the tag."""
    output: np.dtype
    """Payload of the output stream, without the tag."""
    config: tuple[str, ...] = ()
    """What its hardware depends on beside the streams: blocks of `rtl.config.Config`, or single fields of them."""

    def __post_init__(self) -> None:
        check_name("unit", self.name, OF_PORTS)
        for field in (*(self.input.names or ()), *(self.output.names or ())):
            check_name(f"unit {self.name}: field", field, OF_FIELDS)


def _operator(name: str, summary: str, source: np.dtype, result: np.dtype, *config: str) -> Unit:
    return Unit(
        name=name, summary=summary, input=source, output=result, config=tuple(f"operators.{each}" for each in config)
    )


def _operators(*names: str) -> tuple[str, ...]:
    """The depths of operators, and how multipliers are written."""
    return (*(f"operators.{name}_depth" for name in names), "operators.multiplier_blocks")


def _by_name(*units: Unit) -> dict[str, Unit]:
    return {unit.name: unit for unit in units}


OPERATORS = _by_name(
    _operator("float_add", "a + b, or a - b", _F.FLOAT_ADD, _F.FLOAT, "add_depth"),
    _operator("float_multiply", "a * b", _F.FLOAT_PAIR, _F.FLOAT, "multiply_depth", "multiplier_blocks"),
    _operator(
        "float_difference_of_products",
        "a*b - c*d, exact, rounded once",
        _F.FLOAT_QUAD,
        _F.FLOAT,
        "difference_of_products_depth",
        "multiplier_blocks",
    ),
    _operator("float_divide", "a / b", _F.FLOAT_PAIR, _F.FLOAT, "divide_depth"),
    _operator("float_sqrt", "square root", _F.FLOAT_UNARY, _F.FLOAT, "sqrt_depth"),
    _operator("float_compare", "less, equal, greater, unordered", _F.FLOAT_PAIR, _F.ORDER, "compare_depth"),
    _operator("float_minmax", "minimum or maximum number", _F.FLOAT_MINMAX, _F.FLOAT, "compare_depth"),
    _operator("float_to_half", "float32 to binary16", _F.FLOAT_UNARY, _F.HALF, "convert_depth"),
    _operator("half_to_float", "binary16 to float32", _F.HALF_UNARY, _F.FLOAT, "convert_depth"),
    _operator("float_to_fixed", "float32 to fixed point", _F.FLOAT_TO_FIXED, _F.FIXED, "convert_depth"),
    _operator("float_to_fixed_down", "float32 to fixed point, down", _F.FLOAT_TO_FIXED, _F.FIXED, "convert_depth"),
    _operator("fixed_to_float", "fixed point to float32", _F.FIXED_TO_FLOAT, _F.FLOAT, "convert_depth"),
    _operator("fixed64_to_float", "fixed point of 64 bits to float32", _F.FIXED64_TO_FLOAT, _F.FLOAT, "convert_depth"),
)
"""The number units, which have a twin of the same name and operands in `golden_model.numerics.floats`."""

UNITS = OPERATORS | _by_name(
    Unit(
        name="ray_setup",
        summary="dominant axis, shear constants and reciprocal direction of a ray",
        input=_F.RAY,
        output=_F.PREPARED_RAY,
        config=("operators.multiply_depth", "operators.multiplier_blocks", "operators.divide_depth"),
    ),
    Unit(
        name="ray_triangle",
        summary="watertight ray-triangle intersection",
        input=_F.RAY_TRIANGLE,
        output=_F.TRIANGLE_HIT,
        config=(
            *("operators.add_depth", "operators.multiply_depth", "operators.difference_of_products_depth"),
            *("operators.multiplier_blocks", "operators.reciprocal_depth", "operators.compare_depth"),
        ),
    ),
    Unit(
        name="ray_triangle_half",
        summary="ray_triangle in half the area, a test every other cycle",
        input=_F.RAY_TRIANGLE,
        output=_F.TRIANGLE_HIT,
        config=(
            *("operators.add_depth", "operators.multiply_depth", "operators.difference_of_products_depth"),
            *("operators.multiplier_blocks", "operators.reciprocal_depth", "operators.compare_depth"),
        ),
    ),
    Unit(
        name="ray_time",
        summary="a distance along a ray for the box test, rounded both ways",
        input=_F.RAY_TIME,
        output=_F.RAY_TIMES,
        config=("operators.multiply_depth", "operators.multiplier_blocks", "operators.convert_depth"),
    ),
    Unit(
        name="box_setup",
        summary="what the box test needs of a ray, in integers",
        input=_F.BOX_SETUP,
        output=_F.BOX_RAY,
        config=(
            *("operators.add_depth", "operators.multiply_depth", "operators.multiplier_blocks"),
            "operators.convert_depth",
        ),
    ),
    Unit(
        name="node_test",
        summary="a ray against the boxes of a node's children, nearest first",
        input=_F.NODE_TEST,
        output=_F.NODE_HITS,
        config=("operators.multiplier_blocks", "tree", "node_test"),
    ),
    Unit(
        name="texel_project",
        summary="where on the screen a texel lies, how deep, and how high the eye is above it",
        input=_F.TEXEL_PROJECT,
        output=_F.TEXEL_PLACE,
        config=(*_operators("add", "multiply", "divide", "compare", "convert"), "texel.project_interval"),
    ),
    Unit(
        name="texel_match",
        summary="whether a texel is what the four pixels around it see",
        input=_F.TEXEL_MATCH,
        output=_F.TEXEL_MATCHED,
        config=(*_operators("add", "multiply", "divide", "compare", "convert"), "texel.match_interval"),
    ),
    Unit(
        name="texel_blend",
        summary="what a texel becomes by a sample, and how unusual that was",
        input=_F.TEXEL_BLEND,
        output=_F.TEXEL_BLENDED,
        config=(*_operators("add", "multiply", "divide", "sqrt", "compare", "convert"), "texel.blend_interval"),
    ),
    Unit(
        name="traversal",
        summary="nearest or any hit of rays, through a tree in memory",
        kind=Kind.TAGGED,
        input=_F.RAY_QUERY,
        output=_F.RAY_RESULT,
        config=(
            *("operators", "tree", "node_test", "triangle_test"),
            *("traversal", "node_cache", "triangle_cache", "memory"),
        ),
    ),
)
"""Every unit, by its name."""

PURE = {name: unit for name, unit in UNITS.items() if unit.kind is Kind.PURE}
"""Those whose results depend on their operands alone."""
