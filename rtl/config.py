"""The parameters of the hardware, and the presets that `lightloom emit --preset` names."""

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Config:
    """Every parameter of every unit. Depths are register stages of an operator; all of them keep one result a cycle."""

    tag_width: int = 8
    """Bits of the tag that travels with each operation, 1 to 32."""
    add_depth: int = 3
    """float_add, 0 to 6."""
    multiply_depth: int = 3
    """float_multiply, 0 to 4."""
    difference_of_products_depth: int = 5
    """float_difference_of_products, 0 to 7."""
    divide_depth: int = 15
    """float_divide, also inside ray_setup and ray_triangle, 0 to 28: a bit of the quotient a step."""
    sqrt_depth: int = 14
    """float_sqrt, 0 to 27: a bit of the root a step."""
    compare_depth: int = 1
    """float_compare and float_minmax, 0 to 1."""
    convert_depth: int = 2
    """float_to_half, half_to_float, float_to_fixed and fixed_to_float, 0 to 2."""


PRESETS: dict[str, Config] = {
    "tiny": Config(
        tag_width=4,
        add_depth=1,
        multiply_depth=1,
        difference_of_products_depth=2,
        divide_depth=7,
        sqrt_depth=6,
        compare_depth=1,
        convert_depth=1,
    ),
    "base": Config(),
    "full": Config(
        tag_width=16,
        add_depth=6,
        multiply_depth=4,
        difference_of_products_depth=7,
        divide_depth=28,
        sqrt_depth=27,
        compare_depth=1,
        convert_depth=2,
    ),
}

PRESET_SUMMARIES: dict[str, str] = {
    "tiny": "shallow pipelines: least area and latency, low clock",
    "base": "the default",
    "full": "the deepest pipelines: highest clock",
}
"""What each preset is for, in one line."""
