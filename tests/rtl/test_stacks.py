"""The stacks of a traversal unit: what they tell of the entries that they write."""

import random
from typing import Any

from amaranth.sim import Simulator

from lightloom.golden_model.contract.formats import WIDTH
from lightloom.rtl.config import PRESETS
from lightloom.rtl.traversal.stacks import Stacks
from tests.rtl.simulation import simulate

SEED = 1989
LISTS = 60


def test_backlog() -> None:
    """High in all cycles of writing but the last: lists of one, four and two entries, one after the other."""
    stacks = Stacks(PRESETS["tiny"])
    seen: list[int] = []

    async def testbench(ctx: Any) -> None:
        push = stacks.push
        for first, last in ((1, 1), (1, 4), (2, 3)):
            ctx.set(push.payload, {"first": first, "last": last})
            ctx.set(push.valid, 1)
            await ctx.tick()
            seen.append(ctx.get(stacks.backlog))
        ctx.set(push.valid, 0)
        for _ in range(6):
            await ctx.tick()
            seen.append(ctx.get(stacks.backlog))

    simulate(stacks, testbench)
    assert seen == [0, 1, 1, 1, 1, 1, 0, 0, 0]


def test_leaves_that_are_near_are_told() -> None:
    """Once each, with their address, as they are written: not nodes, not what is far, not a node to be seen again."""
    rng = random.Random(SEED)
    stacks = Stacks(PRESETS["tiny"])
    expected: list[int] = []
    told: list[int] = []

    async def pushes(ctx: Any) -> None:
        push = stacks.push
        for k in range(LISTS):
            first = rng.randint(1, WIDTH - 1)
            again = rng.random() < 0.2
            last = first if again else rng.randint(first, WIDTH - 1)
            slots = rng.sample(range(WIDTH), WIDTH)
            leaf, near = rng.getrandbits(WIDTH), rng.getrandbits(WIDTH)
            item = {"context": k % 4, "height": 0, "first": first, "last": last, "again": again, "base": 100 * k}
            ctx.set(push.payload, item | {"leaf": leaf, "slot": slots, "entry": [0] * WIDTH, "near": near})
            ctx.set(push.valid, 1)
            await ctx.tick().until(push.ready)
            ctx.set(push.valid, 0)
            await ctx.tick().repeat(rng.randint(0, 3) + 1)
            for rank in range(last, first - 1, -1):
                if not again and near >> rank & 1 and leaf >> slots[rank] & 1:
                    expected.append(100 * k + slots[rank])
        await ctx.tick().repeat(10 * WIDTH)

    async def watches(ctx: Any) -> None:
        async for _, _, valid, address in ctx.tick().sample(stacks.near_leaf.valid, stacks.near_leaf.payload.address):
            if valid:
                told.append(address)

    simulator = Simulator(stacks)
    simulator.add_clock(1e-6)
    simulator.add_testbench(pushes)
    simulator.add_testbench(watches, background=True)
    simulator.run()
    assert len(expected) > LISTS // 4
    assert told == expected, f"seed {SEED}"
