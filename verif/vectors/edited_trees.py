"""Trees with one block that is wrong, for the benches of the traversal unit."""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from lightloom.golden_model.contract import bitpack
from lightloom.golden_model.contract.formats import BVH_HEADER, NODE_BLOCK, TRIANGLE_BLOCK
from lightloom.golden_model.tracing.wide_bvh.encode import WideBvh


def edited(blocks: np.ndarray, address: int, layout: np.dtype, /, **fields: Any) -> np.ndarray:
    """The tree with other values in fields of one block."""
    out = blocks.copy()
    record = bitpack.unpack(out[address : address + 1], layout)
    for name, value in fields.items():
        record[name] = value
    out[address] = bitpack.pack(record)[0]
    return out


def with_header(blocks: np.ndarray, /, **fields: int) -> np.ndarray:
    """The tree with other values in its header, and the check word that they need, unless that is among them."""
    out = edited(blocks, 0, BVH_HEADER, **fields)
    if "check" not in fields:
        out[0, -1] ^= np.bitwise_xor.reduce(out[0])
    return out


def inner_nodes(tree: WideBvh) -> list[int]:
    """Addresses of all nodes but the root."""
    return [int(address) for address in np.flatnonzero(tree.node_blocks) if address > 1]


def leaf_bits(tree: WideBvh, leaf: bool) -> Iterator[tuple[np.ndarray, int]]:
    """Trees in which one child that is a leaf, or is none, is said to be the other; and that child's address."""
    for address in map(int, np.flatnonzero(tree.node_blocks)):
        node = bitpack.unpack(tree.blocks[address : address + 1], NODE_BLOCK)[0]
        for slot in range(node["count"]):
            if (node["leaf"] >> slot & 1) == leaf:
                changed = edited(tree.blocks, address, NODE_BLOCK, leaf=node["leaf"] ^ (1 << slot))
                yield changed, int(node["base"]) + slot


def nodes_with(tree: WideBvh, **fields: Callable[[int, int], int]) -> Iterator[tuple[np.ndarray, int]]:
    """Trees in which fields of one node are what functions of its address and of its count say; and that address."""
    for address in inner_nodes(tree):
        count = int(bitpack.unpack(tree.blocks[address : address + 1], NODE_BLOCK)[0]["count"])
        values = {name: value(address, count) for name, value in fields.items()}
        yield edited(tree.blocks, address, NODE_BLOCK, **values), address


def leaves_with(tree: WideBvh, **fields: int) -> Iterator[tuple[np.ndarray, int]]:
    """Trees in which fields of one block of triangles have other values; and its address."""
    for address in map(int, np.flatnonzero(tree.triangle_blocks)):
        yield edited(tree.blocks, address, TRIANGLE_BLOCK, **fields), address
