"""The table of units: name, summary and payload formats of everything that exists in RTL, and what its counters count.

The RTL catalogue, the models, the benches, the bulk runs, the manifests and the documentation all start from here.
"""

from dataclasses import dataclass

import numpy as np

from lightloom.golden_model.contract import formats


@dataclass(frozen=True, kw_only=True)
class Unit:
    """One unit with an input stream, an output stream and a result that depends on its operands alone.

    `golden_model.models` has what it computes.
    """

    name: str
    """The name in every room, and of the Verilog module."""
    summary: str
    """What it computes, in one line."""
    input: np.dtype
    """Payload of the input stream, without the tag."""
    output: np.dtype
    """Payload of the output stream, without the tag."""


@dataclass(frozen=True, kw_only=True)
class System:
    """A unit between two streams whose results depend on a scene in memory and may come in another order."""

    name: str
    summary: str
    input: np.dtype
    """Payload of the input stream, without the tag."""
    output: np.dtype
    """Payload of the output stream, without the tag."""


def _unit(name: str, summary: str, source: np.dtype, result: np.dtype) -> Unit:
    return Unit(name=name, summary=summary, input=source, output=result)


_F = formats
OPERATORS: dict[str, Unit] = {
    unit.name: unit
    for unit in (
        _unit("float_add", "a + b, or a - b", _F.FLOAT_ADD, _F.FLOAT),
        _unit("float_multiply", "a * b", _F.FLOAT_PAIR, _F.FLOAT),
        _unit("float_difference_of_products", "a*b - c*d, exact, rounded once", _F.FLOAT_QUAD, _F.FLOAT),
        _unit("float_divide", "a / b", _F.FLOAT_PAIR, _F.FLOAT),
        _unit("float_sqrt", "square root", _F.FLOAT_UNARY, _F.FLOAT),
        _unit("float_compare", "less, equal, greater, unordered", _F.FLOAT_PAIR, _F.ORDER),
        _unit("float_minmax", "minimum or maximum number", _F.FLOAT_MINMAX, _F.FLOAT),
        _unit("float_to_half", "float32 to binary16", _F.FLOAT_UNARY, _F.HALF),
        _unit("half_to_float", "binary16 to float32", _F.HALF_UNARY, _F.FLOAT),
        _unit("float_to_fixed", "float32 to fixed point", _F.FLOAT_TO_FIXED, _F.FIXED),
        _unit("fixed_to_float", "fixed point to float32", _F.FIXED_TO_FLOAT, _F.FLOAT),
    )
}

UNITS: dict[str, Unit] = {
    **OPERATORS,
    "ray_setup": Unit(
        name="ray_setup",
        summary="dominant axis, shear constants and reciprocal direction of a ray",
        input=formats.RAY,
        output=formats.PREPARED_RAY,
    ),
    "ray_triangle": Unit(
        name="ray_triangle",
        summary="watertight ray-triangle intersection",
        input=formats.RAY_TRIANGLE,
        output=formats.TRIANGLE_HIT,
    ),
    "ray_triangle_half": Unit(
        name="ray_triangle_half",
        summary="ray_triangle in half the area, a test every other cycle",
        input=formats.RAY_TRIANGLE,
        output=formats.TRIANGLE_HIT,
    ),
    "ray_time": Unit(
        name="ray_time",
        summary="a distance along a ray for the box test, rounded both ways",
        input=formats.RAY_TIME,
        output=formats.RAY_TIMES,
    ),
    "box_setup": Unit(
        name="box_setup",
        summary="what the box test needs of a ray, in integers",
        input=formats.BOX_SETUP,
        output=formats.BOX_RAY,
    ),
    "node_test": Unit(
        name="node_test",
        summary="a ray against the boxes of a node's children, nearest first",
        input=formats.NODE_TEST,
        output=formats.NODE_HITS,
    ),
}

SYSTEMS: dict[str, System] = {
    "traversal": System(
        name="traversal",
        summary="nearest or any hit of rays, through a tree in memory",
        input=formats.RAY_QUERY,
        output=formats.RAY_RESULT,
    ),
}

ALL: dict[str, Unit | System] = {**UNITS, **SYSTEMS}

COUNTERS: dict[str, str] = {
    "cycles": "cycles in which a ray was in the unit",
    "rays": "results given",
    "node_tests": "nodes visited",
    "revisits": "of these again, for the rest of their children",
    "triangle_tests": "triangles tested",
    "leaf_visits": "blocks of triangles visited",
    "node_busy": "cycles in which a block entered the node test",
    "node_starved": "cycles in which there was none",
    "node_stalled": "cycles in which the node test had to wait for the stacks",
    "triangle_busy": "cycles in which a triangle entered the triangle test",
    "triangle_starved": "cycles in which there was no block of triangles",
    "triangle_stalled": "cycles for a block of which the ray sees no triangle, and of waiting where a test takes two",
    "node_hits": "blocks found in the node cache",
    "node_misses": "blocks that were not there, and that the memory was asked for",
    "node_merged": "blocks that it was waiting for already",
    "triangle_hits": "blocks found in the triangle cache",
    "triangle_misses": "blocks that were not there, and that the memory was asked for",
    "triangle_merged": "blocks that it was waiting for already",
    "triangle_prefetches": "blocks that the memory was asked for before a ray did",
    "beats": "beats of data from the memory",
    "errors": "rays that failed",
}
"""Name and meaning of every counter of the traversal unit; busy, starved and stalled cycles add up to `cycles`."""
