"""The way of visits to their blocks: what it says of visits that wait."""

from typing import Any

import pytest

from lightloom.rtl.config import PRESETS
from lightloom.rtl.memory.block_cache import CROWD
from lightloom.rtl.traversal.records import node_visit
from lightloom.rtl.traversal.visited_blocks import BACKLOG, VisitedBlocks
from tests.rtl.simulation import simulate

IN_CACHE = 4
"""Requests that a cache of one miss takes: one is read, one waits for the end of that, and two behind it."""


@pytest.mark.parametrize(
    ("misses", "few"),
    [(1, IN_CACHE + BACKLOG - 1), (2 * CROWD, CROWD - 1)],
    ids=["in front of the cache", "for the memory"],
)
def test_backlog(misses: int, few: int) -> None:
    """Visits of different nodes, one after the other, and a memory that takes no address: `few` are no backlog."""
    config = PRESETS["tiny"].but(contexts=16, node_misses=misses)
    memory = config.memory
    axi = {"address_width": memory.address_width, "data_width": memory.axi_width, "id_width": 4}
    visits, cache = config.traversal.visits, config.node_cache
    blocks = VisitedBlocks(visits=visits, cache=cache, visit=node_visit(config), axi=axi)
    seen: list[int] = []

    async def testbench(ctx: Any) -> None:
        for address in range(few + 3):
            ctx.set(blocks.i.payload.address, address)
            ctx.set(blocks.i.valid, 1)
            await ctx.tick()
            ctx.set(blocks.i.valid, 0)
            await ctx.tick().repeat(10)
            seen.append(ctx.get(blocks.backlog))

    simulate(blocks, testbench)
    assert seen == [0] * few + [1] * 3
