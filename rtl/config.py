"""The configuration of the hardware, made of blocks, and the presets that `lightloom emit --preset` names.

Outside of the hardware, a parameter has one flat name, the block's prefix and the field's name: `node_sets`. So it is
called on the command line, in manifests and in reports; `PARAMETERS` has them all.
"""

import difflib
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Self

from lightloom.golden_model.contract.interfaces import Unit
from lightloom.golden_model.host.errors import InputError
from lightloom.golden_model.host.parameters import Parameter, parameters
from lightloom.rtl.blocks import (
    Cache,
    Memory,
    NodeTest,
    Operators,
    Streams,
    Texel,
    Traversal,
    Tree,
    TriangleTest,
    block,
)


@dataclass(frozen=True, kw_only=True)
class Config:
    """All blocks. tests/rtl/test_config.py traces rays through hardware at the ends of all parameters, with two units
    at most, and elaborates every pair of ends.
    """

    streams: Streams = block(Streams())
    operators: Operators = block(Operators())
    tree: Tree = block(Tree())
    node_test: NodeTest = block(NodeTest(), "node_test_")
    triangle_test: TriangleTest = block(TriangleTest(), "triangle_")
    traversal: Traversal = block(Traversal())
    node_cache: Cache = block(Cache(), "node_", "node cache")
    triangle_cache: Cache = block(Cache(sets=16, ways=8, misses=64), "triangle_", "triangle cache")
    memory: Memory = block(Memory())
    texel: Texel = block(Texel(), "texel_")

    def __post_init__(self) -> None:
        for each in fields(self):
            kind, given = type(each.default), getattr(self, each.name)
            if type(given) is not kind:
                raise InputError(f"{each.name}: must be a {kind.__name__} block, not {given!r}")

    @classmethod
    def of(cls, **flat: int) -> Self:
        """The default configuration with other values, by flat names. Raises InputError for what cannot be."""
        return cls().but(**flat)

    def but(self, **flat: int) -> Self:
        """This configuration with other values, by flat names. Raises InputError for what cannot be."""
        changed: dict[str, dict[str, int]] = {}
        for name, value in flat.items():
            if name not in PARAMETERS:
                close = difflib.get_close_matches(name, PARAMETERS, n=1)
                raise InputError(f"{name}: no such parameter of the hardware" + (f"; {close[0]}?" if close else ""))
            PARAMETERS[name].check(value, name)
            block, inside = PLACES[name]
            changed.setdefault(block, {})[inside] = value
        return replace(self, **{block: replace(getattr(self, block), **values) for block, values in changed.items()})

    def flat(self) -> dict[str, int]:
        """The value of every parameter, by its flat name."""
        return {name: getattr(getattr(self, block), inside) for name, (block, inside) in PLACES.items()}


def _places() -> Mapping[str, tuple[str, str]]:
    """Flat name to block and field."""
    return {
        block.metadata["prefix"] + name: (block.name, name)
        for block in fields(Config)
        for name in parameters(type(block.default))
    }


def _declared(name: str) -> Parameter:
    """A parameter by its flat name, with the default of its block in `Config`."""
    block, inside = PLACES[name]
    default = getattr(Config(), block)
    one = parameters(type(default))[inside]
    what = next(each.metadata["what"] for each in fields(Config) if each.name == block)
    return replace(one, name=name, default=getattr(default, inside), says=f"{what}: {one.says}" if what else one.says)


PLACES: Mapping[str, tuple[str, str]] = _places()
"""Block and field of every parameter, by its flat name."""

PARAMETERS: dict[str, Parameter] = {name: _declared(name) for name in PLACES}
"""Every parameter of the hardware, by its flat name."""


def parameters_of(unit: Unit) -> list[str]:
    """The parameters that a unit's hardware depends on, by their flat names."""
    known = {"streams", *unit.config}
    return [name for name, (block, inside) in PLACES.items() if not known.isdisjoint({block, f"{block}.{inside}"})]


PRESETS: dict[str, Config] = {
    "tiny": Config(
        streams=Streams(tag_width=4),
        operators=Operators(
            add_depth=3,
            multiply_depth=2,
            difference_of_products_depth=4,
            multiplier_blocks=True,
            divide_depth=14,
            reciprocal_depth=7,
            sqrt_depth=9,
            compare_depth=1,
            convert_depth=2,
        ),
        tree=Tree(width=4),
        node_test=NodeTest(depth=10),
        triangle_test=TriangleTest(interval=2),
        traversal=Traversal(contexts=16, stack=16, overlap=2),
        node_cache=Cache(sets=16, ways=4, misses=12),
        triangle_cache=Cache(sets=8, ways=4, misses=8),
        memory=Memory(axi_width=128),
    ),
    "base": Config(),
    "full": Config(
        streams=Streams(tag_width=16),
        operators=Operators(
            add_depth=6,
            multiply_depth=4,
            difference_of_products_depth=8,
            divide_depth=28,
            reciprocal_depth=13,
            sqrt_depth=27,
            compare_depth=1,
            convert_depth=2,
        ),
        node_test=NodeTest(depth=9),
        traversal=Traversal(contexts=128, stack=32),
        node_cache=Cache(sets=128, ways=8, misses=128),
        triangle_cache=Cache(sets=32, ways=8, misses=96),
    ),
}

PRESET_SUMMARIES: dict[str, str] = {
    "tiny": "four boxes a node, small caches, few rays, half the triangle tests; its pipelines are for an FPGA",
    "base": "the default",
    "full": "the deepest pipelines: highest clock",
}
"""What each preset is for, in one line."""
