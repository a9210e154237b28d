"""The blocks of the hardware's configuration: what may be chosen of a unit, or of what several units are made of.

Every field has its range and its meaning beside it, and is checked when the block is made. What follows from the fields
is a property of the block.
"""

from dataclasses import dataclass, field, replace
from typing import Any, Self

from lightloom.golden_model.host.parameters import check, parameters, powers_of_two, whole


@dataclass(frozen=True, kw_only=True)
class Block:
    """Raises InputError for a value that its field does not allow."""

    def __post_init__(self) -> None:
        check(self)


def block(default: Any, prefix: str = "", what: str = "") -> Any:
    """A field for a block: `prefix` begins the flat names of its parameters; `what` it is, where there are several."""
    return field(default=default, metadata={"prefix": prefix, "what": what})


@dataclass(frozen=True, kw_only=True)
class Streams(Block):
    """Every unit's streams."""

    tag_width: int = whole(8, range(1, 33), "bits of the tag that travels with each operation")


@dataclass(frozen=True, kw_only=True)
class Operators(Block):
    """Number units, alone and inside of others. A depth is register stages; all keep one result a cycle."""

    # Depths end at an operator's number of steps: there is no place for another register.
    add_depth: int = whole(2, range(7), "`float_add`")
    multiply_depth: int = whole(2, range(5), "`float_multiply`")
    difference_of_products_depth: int = whole(4, range(9), "`float_difference_of_products`")
    multiplier_blocks: bool = whole(
        False, (False, True), "products of float32 numbers written for an FPGA's multiplier blocks, not as adders"
    )
    divide_depth: int = whole(14, range(29), "`float_divide`, also inside `ray_setup`: a bit of the quotient a step")
    # 1, 2, 3, 6 or 12 cycles of digits of two bits, and one to round.
    reciprocal_depth: int = whole(7, (0, 2, 3, 5, 7, 13), "the reciprocal inside `ray_triangle`")
    sqrt_depth: int = whole(9, range(28), "`float_sqrt`: a bit of the root a step")
    compare_depth: int = whole(1, range(2), "`float_compare` and `float_minmax`")
    convert_depth: int = whole(2, range(3), "conversions: `float_to_half`, `fixed_to_float` and the like")

    @property
    def reciprocal_cycles(self) -> int:
        """Cycles in which the reciprocal finds digits, the same number in each; one more rounds."""
        return max(self.reciprocal_depth - 1, 1)

    @property
    def deeper(self) -> Self:
        """These, with a stage more in adders and multipliers where there is a place for it."""
        deepest = {name: parameters(type(self))[name].values for name in ("add_depth", "multiply_depth")}
        return replace(self, **{name: min(getattr(self, name) + 1, max(values)) for name, values in deepest.items()})


@dataclass(frozen=True, kw_only=True)
class Tree(Block):
    """The trees that the hardware reads."""

    width: int = whole(8, (4, 8), "boxes that a node test has testers for: the greatest number of children of a node")


@dataclass(frozen=True, kw_only=True)
class NodeTest(Block):
    """`node_test`."""

    depth: int = whole(7, range(16), "`node_test`")


@dataclass(frozen=True, kw_only=True)
class TriangleTest(Block):
    """The triangle test of a traversal unit."""

    interval: int = whole(
        1,
        (1, 2),
        "cycles from one triangle test of a traversal unit to the next: `ray_triangle` or `ray_triangle_half`",
    )


@dataclass(frozen=True, kw_only=True)
class Texel(Block):
    """The units that see to texels, each a graph whose operators are shared over the cycles of its interval."""

    project_interval: int = whole(1, powers_of_two(1, 32), "cycles from one `texel_project` to the next")
    match_interval: int = whole(4, powers_of_two(1, 32), "cycles from one `texel_match` to the next")
    blend_interval: int = whole(16, powers_of_two(1, 32), "cycles from one `texel_blend` to the next")


@dataclass(frozen=True, kw_only=True)
class Traversal(Block):
    """`traversal`."""

    # Where a context's entries are on the stacks is its number and a place, side by side.
    contexts: int = whole(64, powers_of_two(2, 256), "rays that a traversal unit has in flight")
    stack: int = whole(24, range(4, 65), "entries of a ray's stack, at least the levels of the trees that it sees")
    overlap: int = whole(4, range(1, 8), "greatest number of visits of one ray in flight; chosen at run time")
    units: int = whole(1, range(1, 17), "traversal units that share the memory port")

    @property
    def context_bits(self) -> int:
        """Of the number of a context."""
        return (self.contexts - 1).bit_length()

    @property
    def height_bits(self) -> int:
        """Of the number of entries on a stack."""
        return self.stack.bit_length()

    @property
    def overlap_bits(self) -> int:
        """Of the number of visits that a ray may have in flight."""
        return self.overlap.bit_length()

    @property
    def visits(self) -> int:
        """Of all rays together, in flight at most."""
        return self.contexts * self.overlap


@dataclass(frozen=True, kw_only=True)
class Cache(Block):
    """A cache of blocks of 64 bytes."""

    # The set is the exclusive or of pieces of the block's number.
    sets: int = whole(64, powers_of_two(2, 1024), "sets of as many blocks of 64 bytes as it has ways")
    ways: int = whole(6, range(1, 17), "ways")
    misses: int = whole(96, range(1, 257), "blocks that it may be waiting for")

    @property
    def lines(self) -> int:
        """Blocks that it holds."""
        return self.sets * self.ways


@dataclass(frozen=True, kw_only=True)
class Memory(Block):
    """The memory port."""

    address_width: int = whole(40, range(32, 65), "bits of a byte address")
    axi_width: int = whole(512, powers_of_two(32, 512), "bits of the AXI4 data bus")
