"""The parameters of the hardware with what each may be, and the presets that `lightloom emit --preset` names."""

from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from typing import Any


class ConfigError(ValueError):
    """A parameter is not what it may be; the message is one line that names it, what was given and what is allowed."""


def powers_of_two(least: int, greatest: int) -> tuple[int, ...]:
    """All of them from `least` to `greatest`, which are two of them."""
    return tuple(1 << place for place in range(least.bit_length() - 1, greatest.bit_length()))


def parameter(default: int, values: Sequence[int], says: str) -> Any:
    """A field of `Config`: what it may be, in rising order, and what it is."""
    return field(default=default, metadata={"default": default, "values": values, "says": says})


@dataclass(frozen=True, kw_only=True)
class Config:
    """Every parameter of every unit. Depths are register stages of an operator; all of them keep one result a cycle.

    Raises ConfigError for a value that its field does not allow. tests/rtl/test_config.py traces rays through hardware
    at the ends of all ranges, with two units at most, and elaborates every pair of ends.
    """

    tag_width: int = parameter(8, range(1, 33), "bits of the tag that travels with each operation")
    # Depths end at an operator's number of steps: there is no place for another register.
    add_depth: int = parameter(2, range(7), "`float_add`")
    multiply_depth: int = parameter(2, range(5), "`float_multiply`")
    difference_of_products_depth: int = parameter(4, range(9), "`float_difference_of_products`")
    multiplier_blocks: bool = parameter(
        False, (False, True), "products of float32 numbers written for an FPGA's multiplier blocks, not as adders"
    )
    divide_depth: int = parameter(
        14, range(29), "`float_divide`, also inside `ray_setup`: a bit of the quotient a step"
    )
    # 1, 2, 3, 6 or 12 cycles of digits of two bits, and one to round.
    reciprocal_depth: int = parameter(7, (0, 2, 3, 5, 7, 13), "the reciprocal inside `ray_triangle`")
    sqrt_depth: int = parameter(9, range(28), "`float_sqrt`: a bit of the root a step")
    compare_depth: int = parameter(1, range(2), "`float_compare` and `float_minmax`")
    convert_depth: int = parameter(
        2, range(3), "`float_to_half`, `half_to_float`, `float_to_fixed` and `fixed_to_float`"
    )
    width: int = parameter(
        8, (4, 8), "boxes that a node test has testers for: the greatest number of children of a node"
    )
    node_test_depth: int = parameter(7, range(16), "`node_test`")
    triangle_interval: int = parameter(
        1,
        (1, 2),
        "cycles from one triangle test of a traversal unit to the next: `ray_triangle` or `ray_triangle_half`",
    )
    # Where a context's entries are on the stacks is its number and a place, side by side.
    contexts: int = parameter(64, powers_of_two(2, 256), "rays that a traversal unit has in flight")
    stack: int = parameter(24, range(4, 65), "entries of a ray's stack, at least the levels of the trees that it sees")
    overlap: int = parameter(4, range(1, 8), "greatest number of visits of one ray in flight; chosen at run time")
    # The set is the exclusive or of pieces of the block's number.
    node_sets: int = parameter(
        64, powers_of_two(2, 1024), "sets of the node cache; a set is `node_ways` blocks of 64 bytes"
    )
    node_ways: int = parameter(6, range(1, 17), "ways of the node cache")
    node_misses: int = parameter(96, range(1, 257), "blocks that the node cache may be waiting for")
    triangle_sets: int = parameter(16, powers_of_two(2, 1024), "sets of the triangle cache")
    triangle_ways: int = parameter(8, range(1, 17), "ways of the triangle cache")
    triangle_misses: int = parameter(64, range(1, 257), "blocks that the triangle cache may be waiting for")
    address_width: int = parameter(40, range(32, 65), "bits of a byte address")
    axi_width: int = parameter(512, powers_of_two(32, 512), "bits of the AXI4 data bus")
    units: int = parameter(1, range(1, 17), "traversal units that share the memory port")

    def __post_init__(self) -> None:
        for each in PARAMETERS.values():
            each.check(getattr(self, each.name))


@dataclass(frozen=True)
class Parameter:
    """A field of `Config`."""

    name: str
    default: int
    values: Sequence[int]
    """What it may be, in rising order."""
    says: str

    @property
    def allowed(self) -> str:
        """The values in words."""
        return described(self.values)

    def check(self, value: object) -> None:
        """Raises ConfigError where the field may not be `value`; a truth value is no number, nor is a float."""
        if type(value) is not type(self.default) or value not in self.values:
            raise ConfigError(f"{self.name} {value!r}: must be {self.allowed}")

    def parsed(self, text: str) -> int:
        """The value that `text` means, such as "64" or "True". Raises ConfigError where there is none."""
        for value in self.values:
            if str(value).lower() == text.lower():
                return value
        raise ConfigError(f"{self.name} {text}: must be {self.allowed}")


def described(values: Sequence[int]) -> str:
    """What a number may be, in words: "4 to 64", "a power of two, 2 to 256", "4 or 8"."""
    least, greatest = values[0], values[-1]
    if isinstance(values, range):
        return f"{least} to {greatest}"
    if least and len(values) > 2 and tuple(values) == powers_of_two(least, greatest):
        return f"a power of two, {least} to {greatest}"
    return ", ".join(map(str, values[:-1])) + f" or {greatest}"


PARAMETERS: dict[str, Parameter] = {each.name: Parameter(name=each.name, **each.metadata) for each in fields(Config)}
"""Every field of `Config`, by its name."""


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
