"""A tree in memory as a traversal unit sees it: what its header says, and what each block turns out to be when visited.

Nothing is trusted: any content gives a `TreeBlocks`, and rays that meet what is wrong with it fail. Whether a file is
sound as a whole is another question (`memory_image`).
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from lightloom.golden_model.contract.bitpack import unpack
from lightloom.golden_model.contract.formats import (
    BVH_HEADER,
    BVH_MAGIC,
    BVH_VERSION,
    NODE_BLOCK,
    NODE_KIND,
    TRIANGLE,
    TRIANGLE_BLOCK,
    TRIANGLES_KIND,
    WIDTH,
)

UNREADABLE = 16
"""Stands where a block's kind (4 bits) would: the memory answers with an error."""
UNKNOWN = 0
"""Any kind that is neither a node's nor that of triangles."""


@dataclass(frozen=True, kw_only=True, eq=False)
class TreeBlocks:
    """The blocks of a tree, unpacked: B of them, M nodes, L leaves."""

    header: np.ndarray
    """BVH_HEADER (), all zeros where it cannot be read."""
    usable: bool
    """Whether the header is one that a unit loads; otherwise all rays fail."""
    kind: np.ndarray
    """(B + 1,) uint8: NODE_KIND, TRIANGLES_KIND, UNKNOWN or UNREADABLE; the last stands for all blocks beyond."""
    place: np.ndarray
    """(B + 1,) int64: a block's index among the nodes or the leaves."""
    nodes: np.ndarray
    """NODE_BLOCK (M,)."""
    leaves: np.ndarray
    """TRIANGLE_BLOCK (L,)."""
    triangles: np.ndarray
    """TRIANGLE (L, 2), the triangles of the leaves; the second has no meaning where there is only one."""


def tree_blocks(blocks: np.ndarray, *, width: int, stack: int, unreadable: Iterable[int] = ()) -> TreeBlocks:
    """uint32 (B, 16), block after block, to what a unit with `width` box testers and `stack` entries a ray sees.

    `unreadable` are blocks for which the memory answers with an error, as it does for all beyond the last. A node with
    more children than box testers, and a leaf with neither one nor two triangles, are of no known kind.
    """
    count = len(blocks)
    failing = np.zeros(count + 1, dtype=bool)
    failing[[number for number in unreadable if number < count]] = True
    failing[count] = True
    header = np.zeros((), dtype=BVH_HEADER) if failing[0] else unpack(blocks[:1], BVH_HEADER)[0]

    # All kinds of blocks have theirs in the same place.
    kind = np.zeros(count + 1, dtype=np.uint8)
    kind[:count] = blocks[:, 0] & 15
    is_node, is_leaf = np.flatnonzero(kind == NODE_KIND), np.flatnonzero(kind == TRIANGLES_KIND)
    nodes, leaves = unpack(blocks[is_node], NODE_BLOCK), unpack(blocks[is_leaf], TRIANGLE_BLOCK)
    place = np.zeros(count + 1, dtype=np.int64)
    place[is_node], place[is_leaf] = np.arange(len(nodes)), np.arange(len(leaves))
    kind[(kind != NODE_KIND) & (kind != TRIANGLES_KIND)] = UNKNOWN
    kind[is_node[nodes["count"] > width]] = UNKNOWN
    kind[is_leaf[(leaves["count"] != 1) & (leaves["count"] != 2)]] = UNKNOWN
    kind[failing] = UNREADABLE
    return TreeBlocks(
        header=header,
        usable=not failing[0] and header_is_usable(blocks[0], header, width=width, stack=stack),
        kind=kind,
        place=place,
        nodes=nodes,
        leaves=leaves,
        triangles=leaf_triangles(leaves),
    )


def header_is_usable(block: np.ndarray, header: np.ndarray, *, width: int = WIDTH, stack: int) -> bool:
    """Whether a unit of `width` box testers and `stack` entries loads a tree with this block 0, (16,) uint32."""
    return bool(
        header["magic"] == BVH_MAGIC
        and header["version"] == BVH_VERSION
        and np.bitwise_xor.reduce(block) == 0
        and header["width"] <= width
        and 1 <= header["levels"] <= stack
        and 1 <= header["root"] < header["blocks"]
    )


def leaf_triangles(leaves: np.ndarray) -> np.ndarray:
    """TRIANGLE_BLOCK (L,) to TRIANGLE (L, 2)."""
    corners = leaves["vertices"].reshape(-1, 4, 3)
    out = np.zeros((len(leaves), 2), dtype=TRIANGLE)
    row = np.arange(len(leaves))
    for k, name in enumerate(TRIANGLE.names or ()):
        out[name][:, 0] = corners[:, k]
        out[name][:, 1] = corners[row, leaves["order"][:, k]]
    return out
