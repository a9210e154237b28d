"""The parameters of the hardware, and the presets that `lightloom emit --preset` names."""

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Config:
    """Every parameter of every unit. Depths are register stages of an operator; all of them keep one result a cycle."""

    tag_width: int = 8
    """Bits of the tag that travels with each operation, 1 to 32."""
    add_depth: int = 2
    """float_add, 0 to 6."""
    multiply_depth: int = 2
    """float_multiply, 0 to 4."""
    difference_of_products_depth: int = 4
    """float_difference_of_products, 0 to 8."""
    multiplier_blocks: bool = False
    """Products of float32 numbers written for an FPGA's multiplier blocks, not as adders."""
    divide_depth: int = 14
    """float_divide, also inside ray_setup, 0 to 28: a bit of the quotient a step."""
    reciprocal_depth: int = 7
    """The reciprocal inside ray_triangle, 0 to 13: 1, 2, 3, 6 or 12 digits of two bits a stage, one stage to round."""
    sqrt_depth: int = 9
    """float_sqrt, 0 to 27: a bit of the root a step."""
    compare_depth: int = 1
    """float_compare and float_minmax, 0 to 1."""
    convert_depth: int = 2
    """float_to_half, half_to_float, float_to_fixed and fixed_to_float, 0 to 2."""
    width: int = 8
    """Boxes that a node test has testers for, 4 or 8: the greatest number of children of a node."""
    node_test_depth: int = 7
    """node_test, 0 to 15."""
    triangle_interval: int = 1
    """Cycles from one triangle test of a traversal unit to the next: 1 (`ray_triangle`) or 2 (`ray_triangle_half`)."""
    contexts: int = 64
    """Rays that a traversal unit has in flight, a power of two, 4 to 256."""
    stack: int = 24
    """Entries of a ray's stack, at least the levels of the trees that it will see, 4 to 64."""
    overlap: int = 4
    """Greatest number of visits of one ray in flight, 1 to 7; how many there are is chosen at run time."""
    node_sets: int = 64
    """Sets of the node cache, a power of two; a set is `node_ways` blocks of 64 bytes."""
    node_ways: int = 6
    """Ways of the node cache, 1 to 16."""
    node_misses: int = 96
    """Blocks that the node cache may be waiting for."""
    triangle_sets: int = 16
    """Sets of the triangle cache, a power of two."""
    triangle_ways: int = 8
    """Ways of the triangle cache, 1 to 16."""
    triangle_misses: int = 64
    """Blocks that the triangle cache may be waiting for."""
    address_width: int = 40
    """Bits of a byte address, 32 to 64."""
    axi_width: int = 512
    """Bits of the AXI4 data bus: 32, 64, 128, 256 or 512."""
    units: int = 1
    """Traversal units that share the memory port, 1 to 16."""


PRESETS: dict[str, Config] = {
    "tiny": Config(
        tag_width=4,
        add_depth=3,
        multiply_depth=2,
        difference_of_products_depth=4,
        multiplier_blocks=True,
        divide_depth=14,
        reciprocal_depth=7,
        sqrt_depth=9,
        compare_depth=1,
        convert_depth=2,
        width=4,
        node_test_depth=10,
        triangle_interval=2,
        contexts=16,
        stack=16,
        overlap=2,
        node_sets=16,
        node_ways=4,
        node_misses=12,
        triangle_sets=8,
        triangle_ways=4,
        triangle_misses=8,
        axi_width=128,
    ),
    "base": Config(),
    "full": Config(
        tag_width=16,
        add_depth=6,
        multiply_depth=4,
        difference_of_products_depth=8,
        divide_depth=28,
        reciprocal_depth=13,
        sqrt_depth=27,
        compare_depth=1,
        convert_depth=2,
        node_test_depth=9,
        contexts=128,
        stack=32,
        node_sets=128,
        node_ways=8,
        node_misses=128,
        triangle_sets=32,
        triangle_ways=8,
        triangle_misses=96,
    ),
}

PRESET_SUMMARIES: dict[str, str] = {
    "tiny": "four boxes a node, small caches, few rays, half the triangle tests; its pipelines are for an FPGA",
    "base": "the default",
    "full": "the deepest pipelines: highest clock",
}
"""What each preset is for, in one line."""
