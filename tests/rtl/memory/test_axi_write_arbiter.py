# amaranth: UnusedElaboratable=no
# (arbiters that cannot be built are tried)
"""The arbiter of AXI4 write masters: data follows addresses, answers go to who asked, full rate, turns; aborts."""

import random
from collections import deque
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from lightloom.gen.verilog import convert
from lightloom.golden_model.contract.formats import BLOCK_BYTES
from lightloom.rtl.memory.axi_checker import AxiChecker
from lightloom.rtl.memory.axi_write_arbiter import AxiWriteArbiter
from lightloom.rtl.memory.read_timer import ReadTimer
from lightloom.verif.drivers.axi_ports import AmaranthSlave
from lightloom.verif.drivers.axi_slave import OKAY, SLVERR, Wrong
from tests.gen.test_lint import WAIVERS, lint
from tests.rtl.simulation import Simulation, simulate
from tests.rtl.watched import watched

SEED = 91
SHAPE = {"writes": 32, "address_width": 32, "data_width": 128, "id_width": 3}
BEATS, LANES = 4, 16
TIMEOUT = 20
BAD = {(k << 20) + page + 64: SLVERR for k in range(4) for page in range(0, 64_000, 4096)}
"""Blocks that cannot be written, in each master's area."""
Write = tuple[int, int, int]
"""Address, data and strobes of a block."""


class Master:
    """Writes blocks of its own area, several with each id at a time; addresses and data go their own ways."""

    def __init__(self, port: Any, number: int, count: int, *, share: float = 1.0, take: float = 1.0):
        self.port, self.number, self.left = port, number, count
        self.share, self.take = share, take
        self.random = random.Random(SEED + number)
        self.addresses: deque[tuple[int, int]] = deque()  # (id, address) not yet offered
        self.beats: deque[tuple[int, int, int]] = deque()  # (data, strobes, last) not yet offered
        self.address: tuple[int, int] | None = None
        self.beat: tuple[int, int, int] | None = None
        self.waiting: list[tuple[int, int]] = []
        """Ids and addresses of blocks that are not answered, in their order."""
        self.responses = BAD
        self.written: list[Write] = []
        self.accepted_at: list[int] = []
        self.beats_at: list[int] = []

    def _begin(self) -> None:
        address = (self.number << 20) + BLOCK_BYTES * self.random.randrange(1000)
        identity, data = self.random.randrange(8), self.random.getrandbits(512)
        strobes = self.random.choice((2**64 - 1, self.random.getrandbits(64)))
        self.written.append((address, data, strobes))
        self.waiting.append((identity, address))
        self.addresses.append((identity, address))
        for k in range(BEATS):
            beat = data >> 128 * k & 2**128 - 1, strobes >> LANES * k & 2**LANES - 1, int(k == BEATS - 1)
            self.beats.append(beat)
        self.left -= 1

    def drive(self, ctx: Any) -> None:
        port = self.port
        room = len(self.addresses) < 3 and len(self.beats) < 3 * BEATS and len(self.waiting) < 8
        if self.left and room and self.random.random() < self.share:
            self._begin()
        if self.address is None and self.addresses and self.random.random() < self.share:
            self.address = self.addresses.popleft()
            ctx.set(port.awid, self.address[0])
            ctx.set(port.awaddr, self.address[1])
        if self.beat is None and self.beats and self.random.random() < self.share:
            self.beat = self.beats.popleft()
            for signal, value in zip((port.wdata, port.wstrb, port.wlast), self.beat, strict=True):
                ctx.set(signal, value)
        ctx.set(port.awvalid, int(self.address is not None))
        ctx.set(port.awlen, BEATS - 1)
        ctx.set(port.awsize, 4)
        ctx.set(port.awburst, 1)
        ctx.set(port.wvalid, int(self.beat is not None))
        ctx.set(port.bready, int(self.random.random() < self.take))

    def sample(self, ctx: Any, cycle: int) -> None:
        port = self.port
        if self.address is not None and ctx.get(port.awready):
            self.accepted_at.append(cycle)
            self.address = None
        if self.beat is not None and ctx.get(port.wready):
            self.beats_at.append(cycle)
            self.beat = None
        if ctx.get(port.bvalid) and ctx.get(port.bready):
            identity = ctx.get(port.bid)
            oldest = next((one for one in self.waiting if one[0] == identity), None)
            assert oldest is not None, f"seed {SEED}, cycle {cycle}: an answer to nothing, id {identity}"
            assert ctx.get(port.bresp) == self.responses.get(oldest[1], OKAY), f"seed {SEED}: {oldest[1]:#x}"
            self.waiting.remove(oldest)

    def done(self) -> bool:
        return not (self.left or self.addresses or self.beats or self.waiting)


@cache
def compiled(count: int) -> tuple[AxiWriteArbiter, AxiChecker, Simulation]:
    """An arbiter of so many masters, the checker beside its port, and both in a simulator."""
    arbiter = AxiWriteArbiter(count, **SHAPE)
    dut, checker = watched(arbiter)
    return arbiter, checker, Simulation(dut)


def run(count: int, writes: int, *, options: list[dict[str, float]] | None = None, **slave: Any) -> Any:
    """Masters of `writes` blocks each; they and the memory behind them."""
    arbiter, checker, simulation = compiled(count)
    memory = AmaranthSlave(arbiter.m_axi, checker=checker, seed=SEED, **slave)
    memory.errors = BAD
    masters = [Master(arbiter.masters[k], k, writes, **(options or [{}] * count)[k]) for k in range(count)]

    async def testbench(ctx: Any) -> None:
        cycle = moved = 0
        while not all(master.done() for master in masters) or cycle < moved + 5:
            for master in masters:
                master.drive(ctx)
            memory.drive(ctx)
            before = sum(len(master.waiting) + len(master.beats_at) for master in masters)
            for master in masters:
                master.sample(ctx, cycle)
            memory.sample(ctx)
            if sum(len(master.waiting) + len(master.beats_at) for master in masters) != before:
                moved = cycle
            await ctx.tick()
            cycle += 1
            assert cycle < moved + 500, "hangs"

    simulation.run(testbench)
    return masters, memory


@pytest.mark.parametrize("count", [1, 3, 4])
def test_blocks_arrive_whole_and_answers_return(count: int) -> None:
    shares = [{"share": 0.2}, {"share": 1.0}, {"share": 0.5, "take": 0.5}, {"share": 0.8}][:count]
    masters, memory = run(count, 60, options=shares, latency=(1, 60), reorder=True, stall=0.3)
    for master in masters:
        mine = [write[:3] for write in memory.writes if write[0] >> 20 == master.number]
        assert sorted(mine) == sorted(master.written), f"seed {SEED}: blocks torn, lost or doubled"
    assert len(memory.writes) == 60 * count
    assert memory.overtaken > 5


def test_writes_of_an_id_stay_in_order() -> None:
    masters, memory = run(3, 60, latency=(1, 60), reorder=True, stall=0.2)
    for master in masters:
        mine = [write[:3] for write in memory.writes if write[0] >> 20 == master.number]
        assert mine != master.written, "nothing was overtaken"
    # The master looks at each answer: it is that of the oldest block of its id.


def test_a_beat_every_cycle() -> None:
    masters, memory = run(3, 40, latency=4)
    beats = sorted(cycle for master in masters for cycle in master.beats_at)
    assert beats == list(range(beats[0], beats[0] + 3 * 40 * BEATS))
    assert [write[:3] for write in memory.writes if write[0] >> 20 == 1] == masters[1].written


def test_in_turn() -> None:
    masters, _ = run(3, 20, latency=4)
    accepted = sorted((cycle, k) for k, master in enumerate(masters) for cycle in master.accepted_at)
    assert [k for _, k in accepted] == [0, 1, 2] * 20


def test_who_asks_rarely_is_not_kept_waiting() -> None:
    masters, _ = run(3, 40, options=[{"share": 1.0}, {"share": 0.1}, {"share": 1.0}], latency=1)
    assert len(masters[1].accepted_at) == 40


class Aborted:
    """An arbiter whose masters are held in reset by its aborts, as they are to be, and begin anew after each."""

    def __init__(self, aborts: int, *, timeout: int = 0, silent: float = 0.0, **slave: Any):
        """`silent`: this part of the blocks is never answered."""
        self.rng = random.Random(SEED)
        self.arbiter = AxiWriteArbiter(2, **SHAPE)
        self.dut, self.checker = watched(self.arbiter)
        self.timer = ReadTimer()
        self.dut.submodules.timer = self.timer
        self.dut.d.comb += [
            self.timer.timeout.eq(timeout),
            self.arbiter.tick.eq(self.timer.tick),
            self.arbiter.timed.eq(self.timer.runs),
        ]
        self.memory = AmaranthSlave(self.arbiter.m_axi, checker=self.checker, seed=SEED, **slave)
        self.memory.errors = {} if silent else BAD
        if silent:
            blocks = [(k << 20) + BLOCK_BYTES * n for k in range(2) for n in range(1000) if self.rng.random() < silent]
            self.memory.wrong = {address: Wrong(beats=0) for address in blocks}
        self.aborts = aborts
        self.took: list[int] = []
        self.begun: list[Write] = []
        """Blocks whose address had been taken."""

    def masters(self, number: int) -> list[Master]:
        masters = [Master(port, k, 100, share=0.7) for k, port in enumerate(self.arbiter.masters)]
        for master in masters:
            master.random.seed(f"{SEED} {number} {master.number}")
            master.responses = self.memory.errors
        return masters

    def __call__(self) -> "Aborted":
        arbiter, memory = self.arbiter, self.memory

        async def testbench(ctx: Any) -> None:
            for number in range(self.aborts):
                masters, cycles, now = self.masters(number), 0, self.rng.randint(20, 200)
                for cycle in range(now):
                    for master in masters:
                        master.drive(ctx)
                    ctx.set(arbiter.abort, int(cycle == now - 1))
                    memory.drive(ctx)
                    for master in masters:
                        master.sample(ctx, cycle)
                    memory.sample(ctx)
                    await ctx.tick()
                ctx.set(arbiter.abort, 0)
                for master in masters:
                    self.begun += master.written[: len(master.accepted_at)]
                    for name in ("awvalid", "wvalid"):
                        ctx.set(getattr(master.port, name), 0)
                assert ctx.get(arbiter.aborting), "no abort"
                while ctx.get(arbiter.aborting):
                    memory.drive(ctx)
                    for master in masters:
                        assert not ctx.get(master.port.awready), "takes an address"
                        assert not (cycles and ctx.get(master.port.bvalid)), "gives an answer"
                    memory.sample(ctx)
                    await ctx.tick()
                    cycles += 1
                    assert cycles < 2000, f"seed {SEED}: abort {number} does not end"
                self.took.append(cycles)
                assert not memory.under_way, f"seed {SEED}: over too early"
                assert not ctx.get(arbiter.m_axi.awvalid)
                assert not ctx.get(arbiter.m_axi.wvalid)

        simulate(self.dut, testbench)
        return self


@pytest.mark.parametrize(
    "slave", [{"latency": 5}, {"latency": 40, "stall": 0.6}, {"latency": 15, "reorder": True, "stall": 0.2}]
)
def test_an_abort_ends_what_had_begun(slave: dict[str, Any]) -> None:
    """Each block is in memory as it was to be written, or some beats of it, and none has anything of another one."""
    seen = Aborted(25, **slave)()
    begun = {(address, data): strobes for address, data, strobes in seen.begun}
    assert len(seen.memory.writes) == len(seen.begun)
    cut = 0
    for address, data, strobes, _ in seen.memory.writes:
        fits = [
            (whole, wanted)
            for (at, whole), wanted in begun.items()
            if at == address
            and all(
                strobes >> LANES * k & 2**LANES - 1 in (0, wanted >> LANES * k & 2**LANES - 1)
                and (not strobes >> LANES * k & 2**LANES - 1 or (data ^ whole) >> 128 * k & 2**128 - 1 == 0)
                for k in range(BEATS)
            )
        ]
        assert fits, f"seed {SEED}: {address:#x} is torn"
        cut += strobes != fits[0][1]
    assert cut > 3, "no abort came amid a block"


def test_an_abort_with_a_timeout_ends_when_nothing_comes_any_more() -> None:
    seen = Aborted(12, timeout=TIMEOUT, silent=0.3, latency=4)()
    assert min(seen.took) > TIMEOUT


def test_an_abort_without_a_timeout_waits_for_all_answers() -> None:
    with pytest.raises(AssertionError, match="abort 0 does not end"):
        Aborted(1, silent=1.0, latency=4)()


def test_answers_that_nobody_asked_for_do_not_count() -> None:
    arbiter = AxiWriteArbiter(1, **SHAPE)

    async def testbench(ctx: Any) -> None:
        ctx.set(arbiter.masters[0].bready, 1)
        ctx.set(arbiter.m_axi.bvalid, 1)
        await ctx.tick().repeat(5)
        ctx.set(arbiter.m_axi.bvalid, 0)
        await ctx.tick().repeat(3)
        ctx.set(arbiter.abort, 1)
        await ctx.tick()
        ctx.set(arbiter.abort, 0)
        assert ctx.get(arbiter.aborting)
        await ctx.tick()
        assert not ctx.get(arbiter.aborting), "waits for answers to no write"

    simulate(arbiter, testbench)


def test_answers_to_nobody_are_dropped() -> None:
    """Of three masters there is no number 3."""
    arbiter = AxiWriteArbiter(3, **SHAPE)

    async def testbench(ctx: Any) -> None:
        ctx.set(arbiter.m_axi.bvalid, 1)
        ctx.set(arbiter.m_axi.bid, 3 << SHAPE["id_width"])
        for _ in range(5):
            assert ctx.get(arbiter.m_axi.bready)
            await ctx.tick()
            assert not any(ctx.get(master.bvalid) for master in arbiter.masters)

    simulate(arbiter, testbench)


def test_arbiters_that_cannot_be_built() -> None:
    with pytest.raises(ValueError, match="at least one master, not 0"):
        AxiWriteArbiter(0, **SHAPE)
    with pytest.raises(ValueError, match="writes must be at least 1, not 0"):
        AxiWriteArbiter(2, **SHAPE | {"writes": 0})
    for name, value in {"address_width": 65, "data_width": 100, "id_width": 0}.items():
        with pytest.raises(ValueError, match=f"{name} must be"):
            AxiWriteArbiter(2, **(SHAPE | {name: value}))


@pytest.mark.parametrize("count", [1, 3])
def test_verilog_is_clean(count: int, tmp_path: Path) -> None:
    source = tmp_path / "axi_write_arbiter.v"
    source.write_text(convert(AxiWriteArbiter(count, **SHAPE), "axi_write_arbiter"))
    assert lint(WAIVERS, source, top="axi_write_arbiter") == ""
