# amaranth: UnusedElaboratable=no
# (arbiters that cannot be built are tried)
"""The arbiter of AXI4 read masters: data comes back to who asked, at the full rate, in turn."""

import random
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from amaranth import Module

from lightloom.gen.verilog import convert
from lightloom.rtl.memory.axi_checker import AxiChecker
from lightloom.rtl.memory.axi_read_arbiter import AxiReadArbiter
from lightloom.rtl.memory.read_timer import ReadTimer
from lightloom.verif.drivers.axi_ports import AmaranthSlave
from lightloom.verif.drivers.axi_slave import OKAY, SLVERR, hashed
from tests.gen.test_lint import WAIVERS, lint
from tests.rtl.simulation import Simulation, simulate
from tests.rtl.watched import watched

SEED = 90
SHAPE = {"reads": 16, "address_width": 32, "data_width": 128, "id_width": 3}
BEATS, LANES = 4, 16
TIMEOUT = 20


class Master:
    """Reads blocks of its own addresses, up to one with each id at a time, and checks what comes back."""

    def __init__(self, port: Any, number: int, count: int, share: float, take: float):
        self.port, self.left, self.share, self.take = port, count, share, take
        self.random = random.Random(SEED + number)
        self.area = number << 20
        self.waiting: dict[int, int] = {}
        """Id to the address of the next beat."""
        self.offer: tuple[int, int] | None = None
        self.accepted_at: list[int] = []
        self.beats_at: list[int] = []

    def drive(self, ctx: Any) -> None:
        free = [identity for identity in range(8) if identity not in self.waiting]
        if self.offer is None and self.left and free and self.random.random() < self.share:
            self.offer = self.random.choice(free), self.area + 64 * self.random.randrange(1000)
            self.left -= 1
            ctx.set(self.port.arid, self.offer[0])
            ctx.set(self.port.araddr, self.offer[1])
        ctx.set(self.port.arvalid, int(self.offer is not None))
        ctx.set(self.port.arlen, BEATS - 1)
        ctx.set(self.port.arsize, 4)
        ctx.set(self.port.arburst, 1)
        ctx.set(self.port.rready, int(self.random.random() < self.take))

    def sample(self, ctx: Any, cycle: int) -> None:
        if self.offer is not None and ctx.get(self.port.arready):
            identity, address = self.offer
            self.waiting[identity] = address
            self.accepted_at.append(cycle)
            self.offer = None
        if ctx.get(self.port.rvalid) and ctx.get(self.port.rready):
            identity = ctx.get(self.port.rid)
            address = self.waiting[identity]
            response = ctx.get(self.port.rresp)
            assert response == (SLVERR if address % 4096 == 64 else OKAY)
            right = ctx.get(self.port.rdata) == hashed(address, LANES)
            assert right or response, f"seed {SEED}: data of {address:#x}"
            assert ctx.get(self.port.rlast) == (address % 64 == 64 - LANES)
            self.waiting[identity] += LANES
            if self.waiting[identity] % 64 == 0:
                del self.waiting[identity]
            self.beats_at.append(cycle)

    def done(self) -> bool:
        return not self.left and self.offer is None and not self.waiting


@cache
def compiled(count: int) -> tuple[AxiReadArbiter, AxiChecker, Simulation]:
    """An arbiter of so many masters, the checker beside its port, and both in a simulator."""
    arbiter = AxiReadArbiter(count, **SHAPE)
    dut, checker = watched(arbiter)
    return arbiter, checker, Simulation(dut)


def run(
    count: int, reads: int, *, shares: list[float] | None = None, take: float = 1.0, **slave: Any
) -> tuple[list[Master], AmaranthSlave]:
    arbiter, checker, simulation = compiled(count)
    memory = AmaranthSlave(arbiter.m_axi, checker=checker, seed=SEED, **slave)
    memory.errors = {(k << 20) + page + 64: SLVERR for k in range(count) for page in range(0, 64_000, 4096)}
    shares = shares or [1.0] * count
    masters = [Master(arbiter.masters[k], k, reads, shares[k], take) for k in range(count)]

    async def testbench(ctx: Any) -> None:
        cycle = moved = 0
        while not all(master.done() for master in masters) or cycle < moved + 5:
            for master in masters:
                master.drive(ctx)
            memory.drive(ctx)
            before = sum(len(master.beats_at) for master in masters)
            for master in masters:
                master.sample(ctx, cycle)
            memory.sample(ctx)
            if sum(len(master.beats_at) for master in masters) != before:
                moved = cycle
            await ctx.tick()
            cycle += 1
            assert cycle < moved + 500, "hangs"

    simulation.run(testbench)
    return masters, memory


@pytest.mark.parametrize("count", [1, 3, 4])
def test_data_goes_to_who_asked(count: int) -> None:
    shares = [0.2, 1.0, 0.5, 0.8][:count]
    masters, memory = run(count, 60, shares=shares, take=0.7, latency=15, reorder=True, stall=0.3)
    assert len(memory.reads) == 60 * count
    assert all(len(master.beats_at) == 60 * BEATS for master in masters)


def test_a_beat_every_cycle() -> None:
    masters, _ = run(3, 40, latency=4)
    beats = sorted(cycle for master in masters for cycle in master.beats_at)
    assert beats == list(range(beats[0], beats[0] + 3 * 40 * BEATS))
    # An address and a beat take a cycle each through the arbiter.
    assert beats[0] == min(master.accepted_at[0] for master in masters) + 1 + 4 + 1


def test_an_address_every_cycle_in_turn() -> None:
    """All masters offer an address in each cycle; until ids run out one is accepted in each, in turn."""
    masters, _ = run(3, 8, latency=200)
    accepted = sorted((cycle, k) for k, master in enumerate(masters) for cycle in master.accepted_at)
    assert [cycle for cycle, _ in accepted] == list(range(24))
    assert [k for _, k in accepted] == [0, 1, 2] * 8


def test_who_asks_rarely_is_not_kept_waiting() -> None:
    masters, _ = run(3, 40, shares=[1.0, 0.02, 1.0], latency=1)
    assert len(masters[1].accepted_at) == 40


def aborted(beats: list[int], *, timeout: int = 0, patience: int = 100) -> list[int]:
    """An arbiter through aborts, one for each of `beats`: before it a block is asked for, of which so many beats come
    after it. Returns how many cycles each abort takes; one that takes `patience` is given a timeout then."""
    arbiter = AxiReadArbiter(1, **SHAPE)
    dut = Module()
    dut.submodules.arbiter = arbiter
    dut.submodules.timer = timer = ReadTimer()
    dut.d.comb += [arbiter.tick.eq(timer.tick), arbiter.timed.eq(timer.runs)]
    port, took = arbiter.m_axi, []

    async def testbench(ctx: Any) -> None:
        ctx.set(port.arready, 1)
        for come in beats:
            ctx.set(timer.timeout, timeout)
            ctx.set(arbiter.masters[0].arvalid, 1)
            await ctx.tick().until(arbiter.masters[0].arready)
            ctx.set(arbiter.masters[0].arvalid, 0)
            await ctx.tick().repeat(3)  # the address is out
            ctx.set(arbiter.abort, 1)
            await ctx.tick()
            ctx.set(arbiter.abort, 0)
            cycles = 0
            while ctx.get(arbiter.aborting):
                ctx.set(port.rvalid, cycles < come)
                if cycles == patience:
                    ctx.set(timer.timeout, 5)
                await ctx.tick()
                cycles += 1
            ctx.set(port.rvalid, 0)
            took.append(cycles)

    simulate(dut, testbench, cycles=1000)
    assert len(took) == len(beats), f"an abort does not end; those before it took {took} cycles"
    return took


def test_an_abort_ends_with_the_last_beat() -> None:
    assert aborted([BEATS] * 3) == [BEATS + 2] * 3


def test_an_abort_with_a_timeout_ends_when_nothing_comes_any_more() -> None:
    """Whether the beats are too few, as many as were asked for, or too many; and not much later."""
    few, whole, many = 0, BEATS, 3 * BEATS
    for come in (few, whole, many):
        for took in aborted([come] * 8, timeout=TIMEOUT):
            assert come + TIMEOUT < took <= come + 2 * (TIMEOUT + 1) + 2


def test_a_timeout_may_be_set_during_an_abort() -> None:
    """Which would not end without it; the next one then counts from nothing."""
    first, *others = aborted([BEATS - 1, BEATS, BEATS], patience=200)
    assert first > 200
    assert others == [BEATS + 2] * 2


def test_a_timeout_that_is_made_shorter() -> None:
    """More time has passed than it says now: the next tick is at once."""
    timer = ReadTimer()
    ticks = []

    async def testbench(ctx: Any) -> None:
        ctx.set(timer.timeout, 1000)
        await ctx.tick().repeat(500)
        ctx.set(timer.timeout, 100)
        for _ in range(300):
            await ctx.tick()
            ticks.append(ctx.get(timer.tick))

    simulate(timer, testbench)
    assert [k for k, tick in enumerate(ticks) if tick] == [0, 101, 202]


def test_beats_that_nobody_asked_for_do_not_count() -> None:
    arbiter = AxiReadArbiter(1, **SHAPE)

    async def testbench(ctx: Any) -> None:
        ctx.set(arbiter.masters[0].rready, 1)
        ctx.set(arbiter.m_axi.rvalid, 1)
        await ctx.tick().repeat(5)
        ctx.set(arbiter.m_axi.rvalid, 0)
        await ctx.tick().repeat(3)
        ctx.set(arbiter.abort, 1)
        await ctx.tick()
        ctx.set(arbiter.abort, 0)
        assert ctx.get(arbiter.aborting)
        await ctx.tick()
        assert not ctx.get(arbiter.aborting), "waits for beats of no read"

    simulate(arbiter, testbench)


def test_arbiters_that_cannot_be_built() -> None:
    with pytest.raises(ValueError, match="at least one master, not 0"):
        AxiReadArbiter(0, **SHAPE)
    with pytest.raises(ValueError, match="reads must be at least 1, not 0"):
        AxiReadArbiter(2, **SHAPE | {"reads": 0})
    for name, value in {"address_width": 65, "data_width": 100, "id_width": 0}.items():
        with pytest.raises(ValueError, match=f"{name} must be"):
            AxiReadArbiter(2, **(SHAPE | {name: value}))


@pytest.mark.parametrize("count", [1, 3])
def test_verilog_is_clean(count: int, tmp_path: Path) -> None:
    source = tmp_path / "axi_read_arbiter.v"
    source.write_text(convert(AxiReadArbiter(count, **SHAPE), "axi_read_arbiter"))
    assert lint(WAIVERS, source, top="axi_read_arbiter") == ""
