# amaranth: UnusedElaboratable=no
# (writers that cannot be built are tried)
"""The writer of blocks: what arrives in memory, when it says that all of it is there, bounds, errors and aborts."""

import random
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from lightloom.gen.verilog import convert
from lightloom.golden_model.contract.formats import BLOCK_BYTES, WRITE_ERRORS
from lightloom.rtl.memory.axi_checker import AxiChecker
from lightloom.rtl.memory.axi_writer import AxiWriter
from lightloom.rtl.memory.read_timer import ReadTimer
from lightloom.verif.drivers.axi_ports import AmaranthSlave
from lightloom.verif.drivers.axi_slave import SLVERR, Wrong
from tests.gen.test_lint import WAIVERS, lint
from tests.rtl.simulation import Simulation, simulate
from tests.rtl.watched import watched

SEED = 618
SHAPE = {"writes": 16, "address_width": 40, "data_width": 128, "id_width": 3}
BASE, LIMIT = 0x10_0000, 0x14_0000
NONE, MEMORY, OUTSIDE = (WRITE_ERRORS[name] for name in ("none", "memory", "outside"))


@dataclass(frozen=True)
class Block:
    """A block to be written: its byte address, its bytes as a number, and which of them are written."""

    address: int
    data: int
    strobes: int


def random_blocks(rng: random.Random, count: int, *, base: int = BASE, limit: int = LIMIT) -> list[Block]:
    """Whole ones, parts of some, and now and then the same one again."""
    blocks: list[Block] = []
    for _ in range(count):
        address = rng.randrange(base, limit) & -BLOCK_BYTES
        if blocks and rng.random() < 0.2:
            address = rng.choice(blocks[-4:]).address
        strobes = rng.choice(((1 << BLOCK_BYTES) - 1, rng.getrandbits(BLOCK_BYTES), 0))
        blocks.append(Block(address, rng.getrandbits(8 * BLOCK_BYTES), strobes))
    return blocks


@cache
def compiled(shape: tuple[tuple[str, int], ...]) -> tuple[AxiWriter, ReadTimer, AxiChecker, Simulation]:
    """A writer of that shape, its timer, the checker beside its port, and all of them in a simulator."""
    writer = AxiWriter(**dict(shape))
    dut, checker = watched(writer)
    dut.submodules.timer = timer = ReadTimer()
    dut.d.comb += [writer.tick.eq(timer.tick), writer.timed.eq(timer.runs)]
    return writer, timer, checker, Simulation(dut)


class Run:
    """A writer with its memory, in Amaranth's simulator. `on_cycle` is called in every cycle when all has settled."""

    def __init__(
        self, *, give: float = 1.0, timeout: int = 0, memory: dict[str, Any] | None = None, **shape: int
    ) -> None:
        self.rng = random.Random(SEED)
        self.give, self.timeout = give, timeout
        self.writer, self.timer, checker, self.simulation = compiled(tuple(sorted((SHAPE | shape).items())))
        self.memory = AmaranthSlave(self.writer.m_axi, checker=checker, seed=SEED, **(memory or {}))
        self.base, self.limit = BASE, LIMIT
        self.accepted: list[Block] = []
        self.accepted_at: list[int] = []
        self.idle: list[bool] = []
        self.lost = 0
        """Blocks that were taken and will not be answered."""
        self.on_cycle: Callable[[Any, int], None] = lambda ctx, cycle: None

    def __call__(self, blocks: Iterable[Block], *, least: int = 0) -> "Run":
        """Gives the blocks, and goes on until the writer is idle and `least` cycles have passed."""

        async def testbench(ctx: Any) -> None:
            await self._run(ctx, list(blocks), least)

        self.simulation.run(testbench)
        return self

    async def _run(self, ctx: Any, blocks: list[Block], least: int) -> None:
        writer, offers, cycle, moved, answered = self.writer, False, 0, 0, 0
        ctx.set(self.timer.timeout, self.timeout)
        ctx.set(writer.base, self.base)
        ctx.set(writer.limit, self.limit)
        while blocks or cycle < max(moved + 5, least) or not ctx.get(writer.idle):
            offers = bool(blocks) and (offers or self.rng.random() < self.give)
            ctx.set(writer.i.valid, int(offers))
            if offers:
                block = blocks[0]
                content = {"block": block.address // BLOCK_BYTES, "data": block.data, "strobes": block.strobes}
                ctx.set(writer.i.payload, content)
            self.memory.drive(ctx)
            self.on_cycle(ctx, cycle)
            self.idle.append(bool(ctx.get(writer.idle)))
            before = answered
            answered += ctx.get(writer.m_axi.bvalid) & ctx.get(writer.m_axi.bready)
            due = sum(self.inside(block) for block in self.accepted) - self.lost
            assert self.idle[-1] == (due == before), f"seed {SEED}, cycle {cycle}: {due} blocks, {before} answers"
            if offers and ctx.get(writer.i.ready):
                self.accepted.append(blocks.pop(0))
                self.accepted_at.append(cycle)
                offers, moved = False, cycle
            self.memory.sample(ctx)
            moved = cycle if answered != before else moved
            await ctx.tick()
            cycle += 1
            assert cycle < moved + 1000, f"seed {SEED}: hangs"

    def inside(self, block: Block) -> bool:
        return self.base <= block.address and block.address + BLOCK_BYTES <= self.limit

    def check(self) -> None:
        """All blocks within the bounds are written, in their order, and no others."""
        wanted = [(block.address, block.data, block.strobes) for block in self.accepted if self.inside(block)]
        assert [write[:3] for write in self.memory.writes] == wanted, f"seed {SEED}"


MEMORIES: dict[str, dict[str, Any]] = {
    "near": {},
    "far": {"latency": 60},
    "stalled": {"latency": 3, "stall": 0.5},
    "wild": {"latency": 20, "stall": 0.3, "reorder": True},
}


@pytest.mark.parametrize("memory", MEMORIES)
@pytest.mark.parametrize("data_width", [32, 128, 512])
def test_blocks_are_written_in_order(data_width: int, memory: str) -> None:
    run = Run(give=0.7, memory=MEMORIES[memory], data_width=data_width)
    run(random_blocks(run.rng, 60)).check()
    assert len(run.memory.writes) == 60
    wanted: dict[int, int] = {}
    for block in run.accepted:
        for byte in range(BLOCK_BYTES):
            if block.strobes >> byte & 1:
                wanted[block.address + byte] = block.data >> 8 * byte & 0xFF
    assert run.memory.written == wanted


@pytest.mark.parametrize(("data_width", "beats"), [(512, 1), (128, 4), (32, 16)])
def test_a_beat_every_cycle(data_width: int, beats: int) -> None:
    """With room for what is under way the writer takes a block in as many cycles as that has beats."""
    run = Run(memory={"latency": 10}, data_width=data_width)
    run(random_blocks(run.rng, 40))
    first, last = run.accepted_at[2], run.accepted_at[-1]
    assert last - first == 37 * beats


def test_no_more_are_under_way_than_may_be() -> None:
    run = Run(memory={"latency": 100}, writes=5, data_width=512)
    run(random_blocks(run.rng, 20)).check()
    assert run.accepted_at[4] < 10
    assert run.accepted_at[5] > 100
    assert run.memory.most_under_way == 5


def test_idle_when_the_last_answer_has_come() -> None:
    run = Run(memory={"latency": 30}, data_width=512)
    run(random_blocks(run.rng, 3))
    busy = [cycle for cycle, idle in enumerate(run.idle) if not idle]
    assert busy == list(range(run.accepted_at[0] + 1, busy[-1] + 1)), "idle in between"
    # The address comes a cycle after the block, and the answer `latency` after that.
    assert busy[-1] == run.accepted_at[-1] + 1 + 30


@pytest.mark.parametrize(
    ("base", "limit"),
    [
        (BASE, BASE + 8 * BLOCK_BYTES),
        (BASE + 1, BASE + 8 * BLOCK_BYTES - 1),
        (BASE + 63, BASE + 64 * 3 + 63),
        (0, 3 * BLOCK_BYTES),
        (2**40 - 4 * BLOCK_BYTES, 2**40),
        (BASE, BASE),
        (BASE + 640, BASE),
    ],
)
def test_nothing_is_written_outside(base: int, limit: int) -> None:
    run = Run(data_width=512)
    run.base, run.limit = base, limit
    near = [edge // BLOCK_BYTES + k for edge in (base, limit) for k in range(-3, 4)]
    addresses = [BLOCK_BYTES * block for block in near if 0 <= block < 2**34]
    blocks = [Block(address, run.rng.getrandbits(512), (1 << 64) - 1) for address in addresses]
    run.rng.shuffle(blocks)
    told = []
    run.on_cycle = lambda ctx, cycle: told.append((ctx.get(run.writer.error), ctx.get(run.writer.error_block)))
    run(blocks).check()
    assert all(base <= byte < limit for byte in run.memory.written)
    outside = [block.address for block in blocks if not run.inside(block)]
    assert told[-1] == (OUTSIDE, outside[0] // BLOCK_BYTES), "the first one"


def test_the_first_error_is_told_until_it_is_cleared() -> None:
    run = Run(memory={"latency": 8}, data_width=128)
    blocks = [Block(BASE + BLOCK_BYTES * k, run.rng.getrandbits(512), (1 << 64) - 1) for k in range(30)]
    blocks[20] = replace(blocks[20], address=LIMIT)
    run.memory.errors = {blocks[k].address: SLVERR for k in (7, 9, 25)}
    seen: list[tuple[int, int]] = []

    def clears(ctx: Any, cycle: int) -> None:
        error = ctx.get(run.writer.error), ctx.get(run.writer.error_block)
        ctx.set(run.writer.clear, int(len(seen) > 0 and error == seen[-1] and cycle % 40 == 0))
        if error[0] and (not seen or error != seen[-1]):
            seen.append(error)

    run.on_cycle = clears
    run(blocks)
    assert seen[0] == (MEMORY, blocks[7].address // BLOCK_BYTES)
    assert seen[1][0] == MEMORY or seen[1] == (OUTSIDE, LIMIT // BLOCK_BYTES)
    assert len(seen) > 1
    written = [address for address, _, _, response in run.memory.writes if not response]
    assert written == [block.address for k, block in enumerate(blocks) if k not in (7, 9, 20, 25)], "others are written"


def test_an_error_beside_clear_is_told() -> None:
    """The strobe is for what was told before."""
    run = Run(data_width=512)
    told = []
    run.memory.errors = {BASE + BLOCK_BYTES: SLVERR}

    def looks(ctx: Any, cycle: int) -> None:
        ctx.set(run.writer.clear, 1)
        if ctx.get(run.writer.error):
            told.append((ctx.get(run.writer.error), ctx.get(run.writer.error_block)))

    run.on_cycle = looks
    run([Block(BASE, 1, 1), Block(BASE + BLOCK_BYTES, 2, 1), Block(LIMIT, 3, 1), Block(BASE, 4, 1)])
    assert sorted(told) == sorted([(MEMORY, BASE // BLOCK_BYTES + 1), (OUTSIDE, LIMIT // BLOCK_BYTES)])


def test_bounds_count_when_a_block_is_taken() -> None:
    run = Run(memory={"latency": 30}, data_width=512)
    blocks = [Block(BASE, 1, 1), Block(LIMIT, 2, 1)]

    def moves(ctx: Any, cycle: int) -> None:
        if len(run.accepted) == 1:
            ctx.set(run.writer.base, LIMIT)
            ctx.set(run.writer.limit, LIMIT + BLOCK_BYTES)
            run.base, run.limit = BASE, LIMIT + BLOCK_BYTES  # both are written

    run.on_cycle = moves
    run(blocks).check()
    assert len(run.memory.writes) == 2


@pytest.mark.parametrize("memory", MEMORIES)
@pytest.mark.parametrize("data_width", [32, 512])
def test_an_abort_finishes_what_was_taken(data_width: int, memory: str) -> None:
    """At any time; whole blocks are written, no other is taken, and then all is as new."""
    run = Run(give=0.8, memory=MEMORIES[memory], data_width=data_width)
    aborts = sorted(run.rng.sample(range(5, 1000), 12))
    run.memory.errors = {block.address: SLVERR for block in random_blocks(random.Random(3), 5)}
    aborting: list[int] = []
    writer = run.writer

    def strobes(ctx: Any, cycle: int) -> None:
        ctx.set(writer.abort, int(cycle in aborts))
        now = ctx.get(writer.aborting)
        assert not (now and ctx.get(writer.i.ready)), f"cycle {cycle}: takes a block"
        if cycle - 1 in aborts:
            assert now, f"cycle {cycle}: no abort"
        elif not now and cycle - 1 in aborting:
            assert ctx.get(writer.idle), f"cycle {cycle}: over too early"
            assert not ctx.get(writer.error)
            assert not run.memory.under_way
        aborting.extend([cycle] if now else [])

    run.on_cycle = strobes
    run(random_blocks(run.rng, 60), least=1010)
    assert [write[:3] for write in run.memory.writes] == [
        (block.address, block.data, block.strobes) for block in run.accepted
    ]
    assert len(aborting) >= len(aborts)


@pytest.mark.parametrize("missing", [1, 3])
def test_an_abort_with_a_timeout_ends_when_nothing_comes_any_more(missing: int) -> None:
    """Some writes are never answered; behind the abort all is as new, and as many may be under way as before."""
    timeout, begin = 40, 100
    run = Run(timeout=timeout, memory={"latency": 4}, data_width=512, writes=4)
    blocks = [Block(BASE + BLOCK_BYTES * k, run.rng.getrandbits(512), 1) for k in range(30)]
    run.memory.wrong = {block.address: Wrong(beats=0) for block in blocks[10 : 10 + missing]}
    ends: list[int] = []

    def strobes(ctx: Any, cycle: int) -> None:
        ctx.set(run.writer.abort, int(cycle == begin))
        if cycle > begin and not ends and not ctx.get(run.writer.aborting):
            ends.append(cycle)
            assert ctx.get(run.writer.idle)
            run.memory.wrong = {}
            run.lost = len(run.accepted) - len(run.memory.writes)

    run.on_cycle = strobes
    run(blocks, least=300)
    assert timeout < ends[0] - begin <= 2 * (timeout + 1) + 10
    assert run.lost == missing
    assert len(run.accepted) == 30
    assert run.memory.most_under_way == 4


def test_answers_that_are_nobodys_do_not_count() -> None:
    """Of another id, or where nothing is under way."""
    writer = AxiWriter(**SHAPE)

    async def testbench(ctx: Any) -> None:
        ctx.set(writer.limit, LIMIT)
        ctx.set(writer.m_axi.bvalid, 1)
        ctx.set(writer.m_axi.bresp, SLVERR)
        await ctx.tick().repeat(3)
        assert ctx.get(writer.idle)
        ctx.set(writer.m_axi.bid, 1)
        ctx.set(writer.i.valid, 1)
        await ctx.tick()
        ctx.set(writer.i.valid, 0)
        for _ in range(5):
            await ctx.tick()
            assert not ctx.get(writer.idle)
            assert not ctx.get(writer.error)
        ctx.set(writer.m_axi.bid, 0)
        await ctx.tick()
        assert ctx.get(writer.idle)
        assert ctx.get(writer.error) == MEMORY

    simulate(writer, testbench)


def test_writers_that_cannot_be_built() -> None:
    for name, value in {"writes": 0, "address_width": 65, "data_width": 100, "id_width": 0}.items():
        with pytest.raises(ValueError, match=f"{name} must be"):
            AxiWriter(**(SHAPE | {name: value}))


@pytest.mark.parametrize("data_width", [32, 512])
def test_verilog_is_clean(data_width: int, tmp_path: Path) -> None:
    source = tmp_path / "axi_writer.v"
    source.write_text(convert(AxiWriter(**(SHAPE | {"data_width": data_width})), "axi_writer"))
    assert lint(WAIVERS, source, top="axi_writer") == ""
