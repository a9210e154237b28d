"""Bench of the block cache on the memory of the simulations: every request is answered once, with its block.

The system under test is sim/block_cache_system.v. Tags are the numbers of the requests, so any order of answers can be
checked; the memory has holes that give errors.
"""

from pathlib import Path
from typing import Any

import cocotb
from cocotb.triggers import ClockCycles, RisingEdge

from lightloom.verif.benches.bench import Bench
from lightloom.verif.drivers.cache_model import CacheModel
from lightloom.verif.drivers.stream import Exchange

BLOCK_BYTES, BLOCK_BITS = 64, 512


class CacheBench(Bench):
    """The cache and its memory, and what the blocks are."""

    def __init__(self, dut: Any) -> None:
        super().__init__(dut)
        run = self.run
        self.image = Path(run["image"]).read_bytes()
        self.base: int = run["base"]
        self.blocks: int = (len(self.image) - self.base) // BLOCK_BYTES
        self.lines: int = run["sets"] * run["ways"]
        self.count: int = run["count"]
        self.tag_bits: int = len(dut.i__payload) - 32
        self.bad: range = range(0)

    async def begin(self, **settings: int) -> None:
        """Resets cache and memory; what `settings` do not name is as fast and plain as can be."""
        plain = {"latency": 0, "bandwidth": 256, "reorder": 0, "interleave": 0, "stall": 0, "invalidate": 0}
        plain |= {"prefetch__valid": 0, "prefetch__block": 0}
        plain |= {"error_enable": 0, "error_first": 0, "error_last": 0, "base": self.base}
        await self.start(plain | {"seed": self.rng.getrandbits(32)} | settings)

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

    async def ask(
        self, blocks: list[int], give: str = "always", take: str = "always", *, linger: int = 100
    ) -> Exchange:
        """Requests `blocks`: exactly one answer each, with its block, or with an error where the block is bad."""
        assert len(blocks) < 1 << self.tag_bits
        payloads = [block | number << 32 for number, block in enumerate(blocks)]
        endless = 60 * len(blocks) + 2000
        seen = await self.exchange(payloads, give, take, until=lambda cycle: cycle == endless, linger=linger)
        answers = self.by_tag(seen.received, self._tag, range(len(blocks)))
        for number, block in enumerate(blocks):
            got, error = answers[number] & (1 << BLOCK_BITS) - 1, answers[number] >> BLOCK_BITS + self.tag_bits
            where = f"seed {self.seed}, request {number}"
            first = self.base + block * BLOCK_BYTES
            wanted = int.from_bytes(self.image[first : first + BLOCK_BYTES], "little")
            assert error == (block in self.bad), f"{where}, block {block}: error {error}"
            assert error or got == wanted, f"{where}, block {block}: {got:#x}, wanted {wanted:#x}"
        return seen

    def _tag(self, answer: int) -> int:
        return answer >> BLOCK_BITS & (1 << self.tag_bits) - 1

    async def counted(self, requests: int, *, prefetches: bool = False) -> dict[str, int]:
        """The counters since reset, which have to agree with the number of requests and with what the memory saw.

        `prefetches`: blocks were read that nobody had asked for.
        """
        await ClockCycles(self.dut.clk, 3)
        seen = self.counters(("hits", "misses", "merges", "stalls", "evictions", "read_bursts", "violation"))
        cocotb.log.info("%s", seen)
        assert not seen["violation"]
        self.check_rules()
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
    bench = CacheBench(dut)
    *sides, memory = run
    settings = {
        "near": {},
        "far": {"latency": 100, "reorder": 64},
        "wild": {"latency": 30, "reorder": 128, "interleave": 1, "stall": 100},
    }[memory]
    await bench.begin(**settings)
    if memory == "wild":
        bench.break_blocks(range(5, 12))
    blocks = bench.requests(bench.count // (4 if "rare" in sides else 1))
    await bench.ask(blocks, *sides)
    counters = await bench.counted(len(blocks))
    assert min(counters["hits"], counters["misses"], counters["merges"]) > len(blocks) // 200


@cocotb.test()
@cocotb.parametrize(sides=[("always", "always"), ("half", "bursts")])
async def prefetches_change_no_answer(dut: Any, sides: tuple[str, str]) -> None:
    """Blocks are prefetched at random, some of them soon to be requested, some being read, some bad."""
    bench = CacheBench(dut)
    await bench.begin(latency=30, reorder=64, interleave=1, stall=60)
    bench.break_blocks(range(5, 12))
    blocks = bench.requests(bench.count)

    async def prefetch() -> None:
        while True:
            dut.prefetch__valid.value = int(bench.rng.random() < 0.5)
            dut.prefetch__block.value = bench.rng.choice(blocks)
            await RisingEdge(dut.clk)

    asks = cocotb.start_soon(prefetch())
    await bench.ask(blocks, *sides)
    asks.cancel()
    dut.prefetch__valid.value = 0
    await ClockCycles(dut.clk, 500)
    seen = await bench.counted(len(blocks), prefetches=True)
    assert seen["read_bursts"] > seen["misses"], "nothing was prefetched"
    assert not dut.prefetching.value


@cocotb.test()
async def hits_at_full_rate(dut: Any) -> None:
    """What is in the cache is answered in the second cycle after, one request a cycle."""
    bench = CacheBench(dut)
    await bench.begin(latency=20)
    blocks = list(range(min(bench.lines // 2, 8)))  # one after another: in different sets, as far as they go
    await bench.ask(blocks)
    again = [bench.rng.choice(blocks) for _ in range(1000)]
    seen = await bench.ask(again)
    assert seen.sent_at == list(range(1000)), "not one request a cycle"
    assert seen.received_at == list(range(3, 1003)), "not answered in order, 3 cycles after the request"
    counters = await bench.counted(len(blocks) + len(again))
    assert counters["hits"] == 1000


@cocotb.test()
async def what_is_in_it_step_by_step(dut: Any) -> None:
    """Requests one at a time, beside a model of the lines: what hits, and what gives way to what."""
    bench = CacheBench(dut)
    await bench.begin()
    bench.break_blocks(range(5, 12))
    model = bench.stepped(CacheModel(sets=bench.run["sets"], ways=bench.run["ways"]), "block cache")
    before = bench.counters(("hits", "misses", "evictions"))
    for block in bench.requests(bench.count // 3):
        await bench.ask([block], linger=8)
        now = bench.counters(before)
        seen = {name: now[name] - before[name] for name in before}
        assert seen["hits"] + seen["misses"] == 1
        model.step({"block": block, "fails": block in bench.bad}, {"hit": seen["hits"], "evicted": seen["evictions"]})
        before = now
    assert model.number == bench.count // 3


@cocotb.test()
async def errors_are_not_kept(dut: Any) -> None:
    """All that wait for a block get the error; when the memory is whole again, the block is read again."""
    bench = CacheBench(dut)
    await bench.begin(latency=50)
    bench.break_blocks(range(3, 5))
    blocks = [3, 2, 3, 4, 3, 5, 4, 3]
    await bench.ask(blocks)
    assert (await bench.counted(8))["misses"] == 4
    await bench.ask(blocks)
    assert (await bench.counted(16))["misses"] == 6
    bench.break_blocks(range(0))
    for reads in (8, 8):
        await bench.ask(blocks)
        counters = await bench.counted(sum(map(bench.get, ("hits", "misses", "merges"))))
        assert counters["misses"] == reads


@cocotb.test()
async def invalidated_blocks_are_read_again(dut: Any) -> None:
    """After `invalidate`, with another base, the same numbers are other blocks."""
    bench = CacheBench(dut)
    await bench.begin(latency=10)
    blocks = [bench.rng.randrange(8) for _ in range(100)]
    for k in range(3):
        bench.base += k * BLOCK_BYTES
        bench.set(base=bench.base)
        await bench.strobe("invalidate")
        await bench.ask(blocks)
        assert (await bench.counted(100 * (k + 1)))["misses"] >= 8 * (k + 1)


@cocotb.test()
async def a_reset_forgets_everything(dut: Any) -> None:
    """A reset of cache and memory with requests in flight; then all is as new."""
    bench = CacheBench(dut)
    await bench.begin(latency=40, stall=50)
    blocks = bench.requests(300)
    # A block's number is a request with tag 0; nobody looks at these answers.
    await bench.exchange(blocks, "always", "half", until=lambda cycle: cycle == 90)
    await bench.reset()
    await bench.ask(blocks, "always", "half")
    await bench.counted(len(blocks))
