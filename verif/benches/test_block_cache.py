"""Bench of the block cache on the memory of the simulations: every request is answered once, with its block.

The system under test is sim/block_cache_system.v. Tags are the numbers of the requests, so any order of answers can be
checked; the memory has holes that give errors.
"""

import json
import os
import random
from pathlib import Path
from typing import Any

import cocotb
from cocotb.triggers import ClockCycles, RisingEdge

from lightloom.golden_model.contract.axi_rules import RULE_PORTS, rule_of
from lightloom.verif.drivers.stream import Exchange, StreamDriver, pattern

BLOCK_BYTES, BLOCK_BITS = 64, 512


class Bench:
    """The cache and its memory, and what the blocks are."""

    def __init__(self, dut: Any) -> None:
        run = json.loads(os.environ["LIGHTLOOM_BENCH"])
        self.dut = dut
        self.streams = StreamDriver(dut)
        self.image = Path(run["image"]).read_bytes()
        self.base: int = run["base"]
        self.blocks: int = (len(self.image) - self.base) // BLOCK_BYTES
        self.lines: int = run["sets"] * run["ways"]
        self.count: int = run["count"]
        self.tag_bits: int = len(dut.i__payload) - 32
        self.seed: int = run["seed"]
        self.rng = random.Random(self.seed)
        self.bad: range = range(0)
        cocotb.log.info("block_cache, %s, seed %d", run, self.seed)

    async def start(self, **settings: int) -> None:
        """Resets cache and memory; what `settings` do not name is as fast and plain as can be."""
        plain = {"latency": 0, "bandwidth": 256, "reorder": 0, "interleave": 0, "stall": 0, "invalidate": 0}
        plain |= {"prefetch__valid": 0, "prefetch__block": 0}
        plain |= {"error_enable": 0, "error_first": 0, "error_last": 0, "base": self.base}
        for name, value in (plain | {"seed": self.rng.getrandbits(32)} | settings).items():
            getattr(self.dut, name).value = value
        await self.streams.start()

    def break_blocks(self, bad: range) -> None:
        """Reads of these blocks give errors."""
        self.bad = bad
        self.dut.error_enable.value = int(len(bad) > 0)
        self.dut.error_first.value = self.base + bad.start * BLOCK_BYTES
        self.dut.error_last.value = self.base + bad.stop * BLOCK_BYTES - 1

    def requests(self, count: int) -> list[int]:
        """Blocks as rays ask for them: some are hot, some follow one another, some are asked for again and again."""
        rng = self.rng
        blocks: list[int] = []
        while len(blocks) < count:
            kind = rng.random()
            if kind < 0.4:
                blocks.append(rng.randrange(self.lines))
            elif kind < 0.6:
                blocks.append(rng.randrange(self.blocks))
            elif kind < 0.8:
                first = rng.randrange(self.blocks - 8)
                blocks += range(first, first + rng.randint(2, 8))
            else:
                blocks += [rng.randrange(self.blocks)] * rng.randint(2, 12)
        return blocks[:count]

    async def exchange(self, blocks: list[int], give: str = "always", take: str = "always") -> Exchange:
        """Requests `blocks`: exactly one answer each, with its block, or with an error where the block is bad."""
        assert len(blocks) < 1 << self.tag_bits
        payloads = [block | number << 32 for number, block in enumerate(blocks)]
        patterns = pattern(give, self.rng), pattern(take, self.rng)
        endless = 60 * len(blocks) + 2000
        seen = await self.streams.exchange(
            payloads, give=patterns[0], take=patterns[1], until=lambda cycle: cycle == endless
        )
        answered: set[int] = set()
        for payload in seen.received:
            number = payload >> BLOCK_BITS & (1 << self.tag_bits) - 1
            got, error = payload & (1 << BLOCK_BITS) - 1, payload >> BLOCK_BITS + self.tag_bits
            where = f"seed {self.seed}, request {number}"
            assert number < len(blocks), f"{where}: never made"
            assert number not in answered, f"{where}: answered twice"
            answered.add(number)
            block = blocks[number]
            first = self.base + block * BLOCK_BYTES
            wanted = int.from_bytes(self.image[first : first + BLOCK_BYTES], "little")
            assert error == (block in self.bad), f"{where}, block {block}: error {error}"
            assert error or got == wanted, f"{where}, block {block}: {got:#x}, wanted {wanted:#x}"
        assert len(answered) == len(blocks), f"{len(answered)} of {len(blocks)} requests were answered"
        return seen

    async def counters(self, requests: int, *, prefetches: bool = False) -> dict[str, int]:
        """The counters since reset, which have to agree with the number of requests and with what the memory saw.

        `prefetches`: blocks were read that nobody had asked for.
        """
        await ClockCycles(self.dut.clk, 3)
        names = ("hits", "misses", "merges", "stalls", "evictions", "read_bursts", "violation", *RULE_PORTS)
        seen = {name: int(getattr(self.dut, name).value) for name in names}
        cocotb.log.info("%s", seen)
        assert not seen["violation"]
        assert not any(seen[name] for name in RULE_PORTS), [rule_of(seen[name]) for name in RULE_PORTS]
        assert seen["hits"] + seen["misses"] + seen["merges"] == requests
        assert prefetches or seen["misses"] == seen["read_bursts"]
        assert seen["evictions"] <= seen["read_bursts"]
        return seen


@cocotb.test()
@cocotb.parametrize(
    run=[
        ("always", "always", "near"),
        ("always", "always", "far"),
        ("half", "half", "wild"),
        ("always", "bursts", "far"),
        ("bursts", "always", "wild"),
        ("bursts", "bursts", "near"),
        ("always", "rare", "wild"),
    ]
)
async def every_request_is_answered_once(dut: Any, run: tuple[str, str, str]) -> None:
    """Either side and the memory stall, the memory's answers come in any order and mixed, and some are errors."""
    bench = Bench(dut)
    *sides, memory = run
    settings = {
        "near": {},
        "far": {"latency": 100, "reorder": 64},
        "wild": {"latency": 30, "reorder": 128, "interleave": 1, "stall": 100},
    }[memory]
    await bench.start(**settings)
    if memory == "wild":
        bench.break_blocks(range(5, 12))
    blocks = bench.requests(bench.count // (4 if "rare" in sides else 1))
    await bench.exchange(blocks, *sides)
    counters = await bench.counters(len(blocks))
    assert min(counters["hits"], counters["misses"], counters["merges"]) > len(blocks) // 200


@cocotb.test()
@cocotb.parametrize(sides=[("always", "always"), ("half", "bursts")])
async def prefetches_change_no_answer(dut: Any, sides: tuple[str, str]) -> None:
    """Blocks are prefetched at random, some of them soon to be requested, some being read, some bad."""
    bench = Bench(dut)
    await bench.start(latency=30, reorder=64, interleave=1, stall=60)
    bench.break_blocks(range(5, 12))
    blocks = bench.requests(bench.count)

    async def prefetch() -> None:
        while True:
            dut.prefetch__valid.value = int(bench.rng.random() < 0.5)
            dut.prefetch__block.value = bench.rng.choice(blocks)
            await RisingEdge(dut.clk)

    asks = cocotb.start_soon(prefetch())
    await bench.exchange(blocks, *sides)
    asks.cancel()
    dut.prefetch__valid.value = 0
    await ClockCycles(dut.clk, 500)
    seen = await bench.counters(len(blocks), prefetches=True)
    assert seen["read_bursts"] > seen["misses"], "nothing was prefetched"
    assert not dut.prefetching.value


@cocotb.test()
async def hits_at_full_rate(dut: Any) -> None:
    """What is in the cache is answered in the second cycle after, one request a cycle."""
    bench = Bench(dut)
    await bench.start(latency=20)
    blocks = list(range(min(bench.lines // 2, 8)))  # one after another: in different sets, as far as they go
    await bench.exchange(blocks)
    again = [bench.rng.choice(blocks) for _ in range(1000)]
    seen = await bench.exchange(again)
    assert seen.sent_at == list(range(1000)), "not one request a cycle"
    assert seen.received_at == list(range(3, 1003)), "not answered in order, 3 cycles after the request"
    counters = await bench.counters(len(blocks) + len(again))
    assert counters["hits"] == 1000


@cocotb.test()
async def errors_are_not_kept(dut: Any) -> None:
    """All that wait for a block get the error; when the memory is whole again, the block is read again."""
    bench = Bench(dut)
    await bench.start(latency=50)
    bench.break_blocks(range(3, 5))
    blocks = [3, 2, 3, 4, 3, 5, 4, 3]
    await bench.exchange(blocks)
    assert (await bench.counters(8))["misses"] == 4
    await bench.exchange(blocks)
    assert (await bench.counters(16))["misses"] == 6
    bench.break_blocks(range(0))
    for reads in (8, 8):
        await bench.exchange(blocks)
        counters = await bench.counters(int(dut.hits.value) + int(dut.misses.value) + int(dut.merges.value))
        assert counters["misses"] == reads


@cocotb.test()
async def invalidated_blocks_are_read_again(dut: Any) -> None:
    """After `invalidate`, with another base, the same numbers are other blocks."""
    bench = Bench(dut)
    await bench.start(latency=10)
    blocks = [bench.rng.randrange(8) for _ in range(100)]
    for k in range(3):
        bench.base += k * BLOCK_BYTES
        dut.base.value = bench.base
        dut.invalidate.value = 1
        await ClockCycles(dut.clk, 1)
        dut.invalidate.value = 0
        await bench.exchange(blocks)
        assert (await bench.counters(100 * (k + 1)))["misses"] >= 8 * (k + 1)


@cocotb.test()
async def a_reset_forgets_everything(dut: Any) -> None:
    """A reset of cache and memory with requests in flight; then all is as new."""
    bench = Bench(dut)
    await bench.start(latency=40, stall=50)
    blocks = bench.requests(300)
    always, half = pattern("always", bench.rng), pattern("half", bench.rng)
    # A block's number is a request with tag 0; nobody looks at these answers.
    await bench.streams.exchange(blocks, give=always, take=half, until=lambda cycle: cycle == 90)
    await bench.streams.reset()
    await bench.exchange(blocks, "always", "half")
    await bench.counters(len(blocks))
