"""What a block cache takes in: requests, and prefetches between them."""

from typing import Any

import pytest

from lightloom.rtl.memory.block_requests import BlockRequests
from tests.rtl.simulation import simulate


@pytest.mark.parametrize("waiting", [[10, 11], [10, 11, 12]])
def test_prefetches_wait_behind_requests_that_wait(waiting: list[int]) -> None:
    """There is room for two, which come when those are over, in their order and once each; a third one is dropped."""
    requests = BlockRequests(tag_width=4)
    came: list[tuple[int, int]] = []

    async def testbench(ctx: Any) -> None:
        for block in waiting:
            ctx.set(requests.i.payload.block, block)
            ctx.set(requests.i.valid, 1)
            await ctx.tick()
        ctx.set(requests.i.valid, 0)
        await ctx.tick().repeat(3)
        for block in (20, 21, 22):
            ctx.set(requests.prefetch.block, block)
            ctx.set(requests.prefetch.valid, 1)
            await ctx.tick()
        ctx.set(requests.prefetch.valid, 0)
        await ctx.tick().repeat(3)
        ctx.set(requests.o.ready, 1)
        for _ in range(10):
            if ctx.get(requests.o.valid):
                came.append((ctx.get(requests.o.payload.block), ctx.get(requests.o.payload.is_prefetch)))
            await ctx.tick()

    simulate(requests, testbench)
    assert came == [*((block, 0) for block in waiting), (20, 1), (21, 1)]
