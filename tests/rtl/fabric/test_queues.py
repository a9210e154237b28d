"""Buffers, queues and the list of free numbers, against Python's own, with both sides stalling at random."""

import random
from collections import deque
from itertools import pairwise
from typing import Any

import pytest

from lightloom.rtl.fabric.queues import Buffer, FreeList, PassingQueue, Queue, number_width
from tests.rtl.fabric.streams import exchange
from tests.rtl.simulation import simulate

SEED = 1971
WIDTH = 10
CYCLES = 600


def test_buffer_at_full_rate() -> None:
    """A transfer a cycle, latency 1, and the input ready in all cycles."""
    payloads = random.Random(SEED).sample(range(1 << WIDTH), 100)
    (seen,) = exchange(Buffer(WIDTH), payloads, [(1, 1)], SEED)
    assert seen.received == payloads
    assert {after - before for before, after in pairwise(seen.sent_at)} == {1}
    assert {out - into for into, out in zip(seen.sent_at, seen.received_at, strict=True)} == {1}
    assert all(seen.ready)


@pytest.mark.parametrize("rates", [(0.5, 0.5), (1, 0.3), (0.3, 1), (1, 0.9)])
def test_buffer_with_stalls(rates: tuple[float, float]) -> None:
    payloads = random.Random(SEED).sample(range(1 << WIDTH), 200)
    (seen,) = exchange(Buffer(WIDTH), payloads, [rates], SEED)
    assert seen.received == payloads, f"seed {SEED}"


def test_buffer_takes_two_and_is_then_full() -> None:
    """Its readiness says what is inside, not what its output does in this cycle: it cuts that path."""
    dut = Buffer(WIDTH)
    ready = []

    async def testbench(ctx: Any) -> None:
        ctx.set(dut.i.valid, 1)
        for cycle in range(6):
            ctx.set(dut.i.payload, cycle)
            ready.append(ctx.get(dut.i.ready))
            await ctx.tick()
        ctx.set(dut.o.ready, 1)
        ready.append(ctx.get(dut.i.ready))
        await ctx.tick()
        ready.append(ctx.get(dut.i.ready))

    simulate(dut, testbench)
    assert ready == [1, 1, 0, 0, 0, 0, 0, 1]


def through(dut: Queue | PassingQueue, depth: int, give: float, take: float) -> list[tuple[int, int]]:
    """Sends numbers through a queue that is never given more than `depth`; the cycles in which each went in and out.

    Asserts that they come in order, wait unchanged, and that the level is right.
    """
    rng = random.Random(SEED + depth)
    inside: deque[tuple[int, int]] = deque()  # payload, and the cycle in which it came
    times = []

    async def testbench(ctx: Any) -> None:
        for cycle in range(CYCLES):
            takes = rng.random() < take
            ctx.set(dut.o.ready, takes)
            leaves = ctx.get(dut.o.valid) and takes
            assert ctx.get(dut.level) == len(inside), f"seed {SEED + depth}, cycle {cycle}"
            if ctx.get(dut.o.valid):
                assert ctx.get(dut.o.payload) == inside[0][0], f"seed {SEED + depth}, cycle {cycle}"
            gives = len(inside) - leaves < depth and rng.random() < give
            payload = rng.getrandbits(WIDTH)
            ctx.set(dut.i.valid, gives)
            ctx.set(dut.i.payload, payload)
            if leaves:
                times.append((inside.popleft()[1], cycle))
            if gives:
                inside.append((payload, cycle))
            await ctx.tick()

    simulate(dut, testbench)
    assert len(times) > CYCLES * min(give, take) / 4
    return times


@pytest.mark.parametrize("depth", [1, 2, 3, 5, 8])
@pytest.mark.parametrize("make", [Queue, PassingQueue])
def test_queues_with_stalls(make: type[Queue | PassingQueue], depth: int) -> None:
    through(make(WIDTH, depth), depth, 0.6, 0.5)


def test_queue_at_full_rate() -> None:
    times = through(Queue(WIDTH, 4), 4, 1, 1)
    assert {out - into for into, out in times} == {2}
    assert {after - before for (_, before), (_, after) in pairwise(times)} == {1}


def test_passing_queue_at_full_rate() -> None:
    times = through(PassingQueue(WIDTH, 4), 4, 1, 1)
    assert {out - into for into, out in times} == {1}
    assert {after - before for (_, before), (_, after) in pairwise(times)} == {1}


def test_passing_queue_lets_past_only_where_nobody_waits() -> None:
    times = through(PassingQueue(WIDTH, 4), 4, 0.5, 0.5)
    assert min(out - into for into, out in times) == 1
    waited = [out - into for (_, before), (into, out) in pairwise(times) if before > into]  # behind one that waited
    assert waited
    assert min(waited) >= 3


@pytest.mark.parametrize("count", [1, 2, 3, 8])
def test_free_numbers(count: int) -> None:
    """First all of them in order; later any that was given back, none that is in use; and all of them, over time."""
    dut = FreeList(count)
    rng = random.Random(SEED + count)
    used: list[int] = []
    given: list[int] = []

    async def testbench(ctx: Any) -> None:
        for cycle in range(CYCLES):
            takes = rng.random() < 0.6
            back = used.pop(rng.randrange(len(used))) if used and cycle > count and rng.random() < 0.5 else None
            ctx.set(dut.o.ready, takes)
            ctx.set(dut.i.valid, back is not None)
            ctx.set(dut.i.payload, back or 0)
            if ctx.get(dut.o.valid) and takes:
                number = ctx.get(dut.o.payload)
                assert 0 <= number < count
                assert number not in used, f"seed {SEED + count}, cycle {cycle}: {number} is given twice"
                used.append(number)
                given.append(number)
            await ctx.tick()

    simulate(dut, testbench)
    assert given[:count] == list(range(count))
    assert len(given) > CYCLES // 8
    assert set(given[count:]) == set(range(count))


@pytest.mark.parametrize(("count", "width"), [(1, 1), (2, 1), (3, 2), (4, 2), (5, 3), (256, 8), (257, 9)])
def test_number_width(count: int, width: int) -> None:
    assert number_width(count) == width
