"""Bench of the writers of blocks behind their arbiter, on the memory of the simulations.

The system under test is sim/axi_writes_system.v. Each of its two writers has a region of its own; what comes there is
read back through cocotbext-axi, which nobody here wrote. A byte outside the regions is flagged by the memory, a broken
rule of AXI by the checker.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import cocotb
from cocotb.triggers import FallingEdge, RisingEdge
from cocotbext.axi import AxiMasterRead, AxiReadBus, AxiResp

from lightloom.golden_model.contract.formats import BLOCK_BYTES, WRITE_ERRORS
from lightloom.verif.benches.bench import Bench
from lightloom.verif.drivers.stream import HANG_CYCLES, pattern

ADDRESS_BITS, BLOCK_BITS = 34, 512
WHOLE = (1 << BLOCK_BYTES) - 1


@dataclass(frozen=True)
class Block:
    """A block to be written."""

    address: int
    data: int
    strobes: int

    @property
    def payload(self) -> int:
        return self.address // BLOCK_BYTES | self.data << ADDRESS_BITS | self.strobes << ADDRESS_BITS + BLOCK_BITS


@dataclass
class Writer:
    """One of the writers: what it was given, and what has to be in its region then."""

    number: int
    region: range
    content: bytearray
    taken: list[Block] = field(default_factory=list)

    def write(self, block: Block) -> None:
        first = block.address - self.region.start
        for byte in range(BLOCK_BYTES):
            if block.strobes >> byte & 1:
                self.content[first + byte] = block.data >> 8 * byte & 0xFF


CONTENT: dict[int, bytearray] = {}
"""What the regions hold, which stays from test to test; by the number of the writer."""


class WritesBench(Bench):
    """The system with its settings and both sides of its streams."""

    def __init__(self, dut: Any) -> None:
        super().__init__(dut)
        self.count: int = self.run["count"]
        self.writers = []
        for number, (first, last) in enumerate(self.run["regions"]):
            region = range(first, last + 1)
            content = CONTENT.setdefault(number, bytearray(len(region)))
            self.writers.append(Writer(number, region, content))
        self.bad: range = range(0)

    async def begin(self, **settings: int) -> None:
        """Resets everything; what `settings` do not name is as fast and plain as can be."""
        plain = {"latency": 0, "reorder": 0, "stall": 0, "write_error_enable": 0, "error_first": 0, "error_last": 0}
        plain |= {"abort": 0, "arvalid": 0, "rready": 0, "seed": self.rng.getrandbits(32)}
        for writer in self.writers:
            plain |= {f"{name}{writer.number}": 0 for name in ("clear", "abort")}
            plain |= {f"i{writer.number}__valid": 0, f"i{writer.number}__payload": 0}
            plain |= {f"base{writer.number}": writer.region.start, f"limit{writer.number}": writer.region.stop}
        self.dut.rst.value = 1
        self.reader = AxiMasterRead(AxiReadBus.from_entity(self.dut), self.dut.clk, self.dut.rst)
        self.reader.log.setLevel("WARNING")
        await self.start(plain | settings)
        cocotb.start_soon(self._watch())

    async def _watch(self) -> None:
        """Fails in the cycle after the one in which a rule of AXI is broken, or a byte written outside."""
        while True:
            await FallingEdge(self.dut.clk)
            if not self.get("rst"):
                assert not self.get("violation"), f"seed {self.seed}: the memory says why"
                self.check_rules()

    def blocks(self, writer: Writer, count: int) -> list[Block]:
        """Whole ones, parts of some, and now and then the same one again."""
        rng = self.rng
        blocks: list[Block] = []
        for _ in range(count):
            address = rng.randrange(writer.region.start, writer.region.stop) & -BLOCK_BYTES
            if blocks and rng.random() < 0.2:
                address = rng.choice(blocks[-4:]).address
            strobes = rng.choice((WHOLE, rng.getrandbits(BLOCK_BYTES), 0))
            blocks.append(Block(address, rng.getrandbits(BLOCK_BITS), strobes))
        return blocks

    async def give(self, writer: Writer, blocks: list[Block], willing: Iterator[bool], until: int = 1 << 60) -> None:
        """Offers the blocks in order when `willing`, for `until` cycles at most; what is taken is in `writer.taken`."""
        dut, k = self.dut, writer.number
        valid, ready, payload = (getattr(dut, f"i{k}__{name}") for name in ("valid", "ready", "payload"))
        offered, left, idle = False, list(blocks), 0
        for _ in range(until):
            if not left:
                break
            if not offered and next(willing):
                payload.value = left[0].payload
                offered = True
            valid.value = int(offered)
            await FallingEdge(dut.clk)
            if offered and int(ready.value):
                writer.taken.append(left.pop(0))
                offered, idle = False, 0
            await RisingEdge(dut.clk)
            idle += 1
            assert idle < HANG_CYCLES, f"seed {self.seed}: writer {k} hangs with {len(left)} blocks left"
        valid.value = 0

    async def idle(self, writer: Writer) -> None:
        """Waits until the writer says that all is written."""
        idle = f"idle{writer.number}"
        await self.until(lambda: bool(self.get(idle)), HANG_CYCLES, f"writer {writer.number} is not idle")

    async def written(self, writer: Writer) -> bytes:
        """The content of its region."""
        seen = await self.reader.read(writer.region.start, len(writer.region))
        assert seen.resp == AxiResp.OKAY
        return bytes(seen.data)

    async def check(self, writer: Writer) -> None:
        """What was taken since the last time is in memory, in that order, but for what lies in the bad range."""
        for block in writer.taken:
            if block.address in writer.region and not set(range(block.address, block.address + 64)) & set(self.bad):
                writer.write(block)
        writer.taken.clear()
        seen = await self.written(writer)
        wrong = [k for k, (got, wanted) in enumerate(zip(seen, writer.content, strict=True)) if got != wanted]
        where = f"seed {self.seed}, writer {writer.number}"
        assert not wrong, f"{where}: {len(wrong)} bytes differ, the first at {writer.region.start + wrong[0]:#x}"


MEMORIES = {
    "near": {},
    "far": {"latency": 80},
    "stalled": {"latency": 3, "stall": 128},
    "wild": {"latency": 30, "reorder": 128, "stall": 100},
}


@cocotb.test()
@cocotb.parametrize(
    run=[
        ("always", "always", "near"),
        ("always", "half", "far"),
        ("half", "bursts", "stalled"),
        ("bursts", "rare", "wild"),
        ("always", "always", "wild"),
    ]
)
async def blocks_arrive(dut: Any, run: tuple[str, str, str]) -> None:
    """Both writers and all channels stall, answers come in any order: all blocks of both are there, whole."""
    bench = WritesBench(dut)
    *sides, memory = run
    await bench.begin(**MEMORIES[memory])
    tasks = [
        cocotb.start_soon(bench.give(writer, bench.blocks(writer, bench.count), pattern(side, bench.rng)))
        for writer, side in zip(bench.writers, sides, strict=True)
    ]
    for task in tasks:
        await task
    for writer in bench.writers:
        await bench.idle(writer)
        await bench.check(writer)
        assert bench.get(f"error{writer.number}") == WRITE_ERRORS["none"]
    assert bench.get("write_bursts") == 2 * bench.count


@cocotb.test()
@cocotb.parametrize(memory=["far", "wild"])
async def idle_is_a_fence(dut: Any, memory: str) -> None:
    """Whenever a writer is idle, all that it has taken can be read, whatever the other one does meanwhile."""
    bench = WritesBench(dut)
    await bench.begin(**MEMORIES[memory])
    first, second = bench.writers
    other = cocotb.start_soon(bench.give(second, bench.blocks(second, 4 * bench.count), pattern("half", bench.rng)))
    for _ in range(12):
        await bench.give(first, bench.blocks(first, bench.rng.randint(1, 12)), pattern("always", bench.rng))
        await bench.idle(first)
        await bench.check(first)
    await other
    await bench.idle(second)
    await bench.check(second)


@cocotb.test()
async def errors_are_told(dut: Any) -> None:
    """Of several bad blocks the first one, until it is cleared; the others of both writers are written."""
    bench = WritesBench(dut)
    first, second = bench.writers
    bad = first.region.start + 5 * BLOCK_BYTES
    bench.bad = range(bad, bad + 2 * BLOCK_BYTES)
    await bench.begin(latency=20, write_error_enable=1, error_first=bad, error_last=bad + 2 * BLOCK_BYTES - 1)
    numbers = [1, 2, 6, 3, 5, 4, 6, 7]
    blocks = [Block(first.region.start + BLOCK_BYTES * k, bench.rng.getrandbits(512), WHOLE) for k in numbers]
    others = cocotb.start_soon(bench.give(second, bench.blocks(second, 20), pattern("half", bench.rng)))
    for expected in (6, 6):
        await bench.give(first, blocks, pattern("half", bench.rng))
        await bench.idle(first)
        told = bench.get("error0"), bench.get("error_block0")
        assert told == (WRITE_ERRORS["memory"], first.region.start // BLOCK_BYTES + expected)
        await bench.check(first)
        await RisingEdge(dut.clk)
        await bench.strobe("clear0")
        await FallingEdge(dut.clk)
        assert bench.get("error0") == WRITE_ERRORS["none"]
        await RisingEdge(dut.clk)
    await others
    await bench.idle(second)
    assert bench.get("error1") == WRITE_ERRORS["none"]
    await bench.check(second)


@cocotb.test()
async def nothing_is_written_outside(dut: Any) -> None:
    """Blocks beside the region, also those of the other writer's, are refused; the memory would flag them."""
    bench = WritesBench(dut)
    await bench.begin(latency=10)
    first, second = bench.writers
    for writer, other in ((first, second), (second, first)):
        stray = [writer.region.start - BLOCK_BYTES, writer.region.stop, other.region.start, 0, (1 << 40) - BLOCK_BYTES]
        for address in stray:
            blocks = [*bench.blocks(writer, 3), Block(address, 1, WHOLE), *bench.blocks(writer, 3)]
            await bench.give(writer, blocks, pattern("always", bench.rng))
            await bench.idle(writer)
            told = bench.get(f"error{writer.number}"), bench.get(f"error_block{writer.number}")
            assert told == (WRITE_ERRORS["outside"], address // BLOCK_BYTES)
            await RisingEdge(dut.clk)
            await bench.strobe(f"clear{writer.number}")
        await bench.check(writer)
    await bench.check(first)


def aborted(bench: Bench) -> bool:
    """The first writer's abort is over; until then it takes nothing."""
    over = not bench.get("aborting0")
    assert over or not bench.get("i0__ready"), "takes a block during an abort"
    return over


@cocotb.test()
@cocotb.parametrize(memory=["far", "wild"])
async def aborts_of_a_writer(dut: Any, memory: str) -> None:
    """At any time: what it took is written whole, nothing else, and the other writer does not notice."""
    bench = WritesBench(dut)
    await bench.begin(**MEMORIES[memory])
    first, second = bench.writers
    other = cocotb.start_soon(bench.give(second, bench.blocks(second, 2 * bench.count), pattern("half", bench.rng)))
    for _ in range(8):
        cycles = bench.rng.randint(5, 60)
        await bench.give(first, bench.blocks(first, 200), pattern("always", bench.rng), until=cycles)
        await bench.strobe("abort0")
        await bench.until(partial(aborted, bench), HANG_CYCLES, "an abort does not end")
        assert bench.get("idle0")
        await RisingEdge(dut.clk)
        await bench.check(first)
    await other
    await bench.idle(second)
    await bench.check(second)


@cocotb.test()
@cocotb.parametrize(memory=["far", "stalled", "wild"])
async def aborts_of_the_arbiter(dut: Any, memory: str) -> None:
    """With both writers in reset: each beat of a block is written or not, none has anything else; then all goes on."""
    bench = WritesBench(dut)
    await bench.begin(**MEMORIES[memory])
    cut = 0
    for _ in range(8):
        cycles = bench.rng.randint(10, 80)
        tasks = [
            cocotb.start_soon(bench.give(writer, bench.blocks(writer, 200), pattern("always", bench.rng), until=cycles))
            for writer in bench.writers
        ]
        for task in tasks:
            await task
        await bench.strobe("abort")
        await bench.until(lambda: not bench.get("aborting"), HANG_CYCLES, "an abort does not end")
        await RisingEdge(dut.clk)
        for writer in bench.writers:
            seen = await bench.written(writer)
            cut += settle(writer, seen, len(dut.rdata) // 8)
    for writer in bench.writers:
        await bench.give(writer, bench.blocks(writer, 20), pattern("half", bench.rng))
        await bench.idle(writer)
        await bench.check(writer)
    cocotb.log.info("%d blocks written in part, or not at all", cut)
    assert cut


def settle(writer: Writer, seen: bytes, lanes: int) -> int:
    """Takes over what is in memory, if it can have come there: in each beat's place what was there, or what one of the
    blocks that were taken since puts there, all of its bytes. Returns how many beats were not written."""
    missing = 0
    for first in range(0, len(seen), lanes):
        possible = {bytes(writer.content[first : first + lanes])}
        now = bytes(writer.content[first : first + lanes])
        for block in writer.taken:
            offset = writer.region.start + first - block.address
            if 0 <= offset < BLOCK_BYTES:
                possible |= {over(old, block, offset) for old in possible}
                now = over(now, block, offset)
        got = seen[first : first + lanes]
        assert got in possible, f"writer {writer.number}: torn at {writer.region.start + first:#x}"
        missing += got != now
        writer.content[first : first + lanes] = got
    writer.taken.clear()
    return missing


def over(old: bytes, block: Block, offset: int) -> bytes:
    """Bytes of memory when the part of a block from `offset` on was written over them."""
    data = block.data >> 8 * offset
    return bytes(
        data >> 8 * lane & 0xFF if block.strobes >> offset + lane & 1 else byte for lane, byte in enumerate(old)
    )


@cocotb.test()
async def reset_in_flight(dut: Any) -> None:
    """A reset of all drops what is under way, and all works on as new."""
    bench = WritesBench(dut)
    await bench.begin(latency=40, stall=50, reorder=64)
    for writer in bench.writers:
        await bench.give(writer, bench.blocks(writer, 100), pattern("always", bench.rng), until=50)
    await bench.reset()
    for writer in bench.writers:
        seen = await bench.written(writer)
        settle(writer, seen, len(dut.rdata) // 8)
        await bench.give(writer, bench.blocks(writer, 30), pattern("half", bench.rng))
        await bench.idle(writer)
        await bench.check(writer)
