"""Bench of the memory of the simulations, sim/axi_memory.v: its data, its timing and the rules of AXI4.

The master is cocotbext-axi's, which nobody here wrote. Beside it a monitor looks at all channels in every cycle: what
comes back has to be the image in all bits, burst by burst, with the order and the timing that was asked for. What is
written lies over the image for all tests that follow: nothing but a new simulation brings the image back.
"""

import itertools
import json
import logging
import os
import random
from collections import defaultdict, deque
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import cocotb
from cocotb.clock import Clock
from cocotb.triggers import ClockCycles, FallingEdge
from cocotbext.axi import AxiBurstType, AxiMasterRead, AxiMasterWrite, AxiReadBus, AxiResp, AxiWriteBus
from cocotbext.axi.axi_channels import (
    AxiARBus,
    AxiARSource,
    AxiAWBus,
    AxiAWSource,
    AxiBBus,
    AxiBSink,
    AxiRBus,
    AxiRSink,
    AxiWBus,
    AxiWSource,
)

from lightloom.golden_model.contract.axi_rules import RULE_PORTS, rule_of

INCR, POISON = 1, 0xDEADBEEF
HANG_CYCLES = 3000
"""Cycles without a beat after which the memory is taken to hang: far more than any latency here."""


@dataclass
class Burst:
    """A burst as it was accepted, and what became of it; cycles are counted from the last reset."""

    number: int
    id: int
    address: int
    length: int  # beats
    size: int  # bytes a beat
    kind: int
    accepted: int
    offered: list[int] = field(default_factory=list)
    taken: list[int] = field(default_factory=list)
    responses: list[int] = field(default_factory=list)
    data: list[tuple[int, int]] = field(default_factory=list)
    """Of a write: its beats and their strobes, as they were taken."""
    whole: int = 0
    """The cycle in which the last of its address and its data was taken."""

    def address_of(self, beat: int) -> int:
        """The first byte of a beat."""
        return self.address if beat == 0 else self.address // self.size * self.size + beat * self.size


CONTENT = bytearray()
"""What the memory holds: the image and all that was written over it, in this simulation."""


class Monitor:
    """Watches the memory's channels in the middle of every cycle, when they have settled."""

    def __init__(self, dut: Any, memory_bytes: int, writable: list[range]) -> None:
        self.dut = dut
        self.memory_bytes = memory_bytes
        self.writable = writable
        self.lanes = len(dut.rdata) // 8
        self.errors: range = range(0)
        self.write_errors: range = range(0)
        self.rules = [getattr(dut, name) for name in RULE_PORTS if hasattr(dut, name)]
        self.broken_master = False
        """The master of this test breaks rules on purpose."""
        self.forget()
        cocotb.start_soon(self._watch())

    def forget(self) -> None:
        self.cycle = 0
        self.busy = 0
        self.ready_cycles = 0
        self.bursts: list[Burst] = []
        self.finished = 0
        self.beats: list[tuple[int, Burst]] = []  # (cycle taken, burst)
        self._waiting: dict[int, deque[Burst]] = defaultdict(deque)
        self._held: tuple[int, ...] | None = None
        self.writes: list[Burst] = []
        self.answered = 0
        self._data: deque[tuple[int, int]] = deque()  # beats without an address
        self._unanswered: dict[int, deque[Burst]] = defaultdict(deque)
        self._answer: tuple[int, int] | None = None

    async def _watch(self) -> None:
        dut, edge = self.dut, FallingEdge(self.dut.clk)
        while True:
            await edge
            if int(dut.rst.value):
                self.forget()
                continue
            self.busy += self.finished < len(self.bursts)
            if int(dut.rvalid.value):
                self._beat(taken=bool(int(dut.rready.value)))
            else:
                assert self._held is None, f"cycle {self.cycle}: a waiting beat was withdrawn"
            if int(dut.arready.value):
                self.ready_cycles += 1
                if int(dut.arvalid.value):
                    self._accept()
            self._watch_writes()
            assert self.broken_master or not int(dut.violation.value), f"cycle {self.cycle}: violation"
            for rule in self.rules if not self.broken_master else ():
                assert not int(rule.value), f"cycle {self.cycle}: {rule_of(int(rule.value))}"
            self.cycle += 1

    def _burst(self, channel: str, number: int) -> Burst:
        names = (f"{channel}{name}" for name in ("id", "addr", "len", "size", "burst"))
        identity, address, length, size, kind = (int(getattr(self.dut, name).value) for name in names)
        return Burst(number, identity, address, length + 1, 1 << size, kind, self.cycle)

    def _accept(self) -> None:
        burst = self._burst("ar", len(self.bursts))
        self.bursts.append(burst)
        self._waiting[burst.id].append(burst)

    def _beat(self, taken: bool) -> None:
        dut = self.dut
        identity, data, response, last = (int(getattr(dut, name).value) for name in ("rid", "rdata", "rresp", "rlast"))
        seen = (identity, data, response, last)
        assert self._held in (None, seen), f"cycle {self.cycle}: a waiting beat changed: {self._held}, {seen}"
        assert self._waiting[identity], f"cycle {self.cycle}: a beat of id {identity:#x}, which waits for none"
        burst = self._waiting[identity][0]
        beat = len(burst.taken)
        if self._held is None:
            burst.offered.append(self.cycle)
            wanted_data, wanted_response = self._expected(burst, beat)
            assert (response, data) == (wanted_response, wanted_data), (
                f"cycle {self.cycle}: beat {beat} of {burst}: {data:#x}, response {response}; "
                f"expected {wanted_data:#x}, response {wanted_response}"
            )
            assert last == (beat + 1 == burst.length), f"cycle {self.cycle}: rlast {last} in beat {beat} of {burst}"
        self._held = None if taken else seen
        if taken:
            burst.taken.append(self.cycle)
            burst.responses.append(response)
            self.beats.append((self.cycle, burst))
            if last:
                self._waiting[identity].popleft()
                self.finished += 1

    def _expected(self, burst: Burst, beat: int) -> tuple[int, int]:
        """The whole bus, also those of its bytes that a narrow beat does not ask for, and the response."""
        first = burst.address_of(beat)
        start = first // burst.size * burst.size
        poison = int.from_bytes(POISON.to_bytes(4, "little") * (self.lanes // 4), "little")
        touched = range(max(start, self.errors.start), min(start + burst.size, self.errors.stop))
        if burst.kind != INCR or burst.size > self.lanes or touched:
            return poison, AxiResp.SLVERR
        if start >= self.memory_bytes:
            return poison, AxiResp.DECERR
        word = first // self.lanes * self.lanes
        return int.from_bytes(CONTENT[word : word + self.lanes], "little"), AxiResp.OKAY

    # --- writes ---------------------------------------------------------------------------------------------------

    def _watch_writes(self) -> None:
        """After the reads of this cycle: what is written shows from the cycle after the one that offers its answer."""
        dut = self.dut
        if int(dut.bvalid.value):
            self._see_answer(taken=bool(int(dut.bready.value)))
        else:
            assert self._answer is None, f"cycle {self.cycle}: a waiting answer was withdrawn"
        if int(dut.awvalid.value) and int(dut.awready.value):
            burst = self._burst("aw", len(self.writes))
            self.writes.append(burst)
            self._unanswered[burst.id].append(burst)
        if int(dut.wvalid.value) and int(dut.wready.value):
            self._data.append((int(dut.wdata.value), int(dut.wstrb.value)))
        for burst in self.writes:
            while self._data and len(burst.data) < burst.length:
                burst.data.append(self._data.popleft())
                burst.whole = self.cycle

    def _see_answer(self, taken: bool) -> None:
        identity, response = int(self.dut.bid.value), int(self.dut.bresp.value)
        assert self._answer in (None, (identity, response)), f"cycle {self.cycle}: a waiting answer changed"
        assert self._unanswered[identity], f"cycle {self.cycle}: an answer with id {identity:#x}, which waits for none"
        burst = self._unanswered[identity][0]
        assert len(burst.data) == burst.length, f"cycle {self.cycle}: an answer before the data of {burst}"
        if self._answer is None:
            burst.offered.append(self.cycle)
            wanted = self._write(burst)
            assert response == wanted, f"cycle {self.cycle}: response {response} to {burst}; expected {wanted}"
        self._answer = None if taken else (identity, response)
        if taken:
            burst.taken.append(self.cycle)
            burst.responses.append(response)
            self._unanswered[identity].popleft()
            self.answered += 1

    def _write(self, burst: Burst) -> int:
        """Its bytes into the content, if they come there; its response."""
        if burst.kind != INCR or burst.size > self.lanes:
            return AxiResp.SLVERR
        whole = range(burst.address // burst.size * burst.size, burst.address_of(burst.length))
        if range(max(whole.start, self.write_errors.start), min(whole.stop, self.write_errors.stop)):
            return AxiResp.SLVERR
        if whole.stop > self.memory_bytes:
            return AxiResp.DECERR
        for beat, (data, strobes) in enumerate(burst.data):
            word = burst.address_of(beat) // self.lanes * self.lanes
            for lane in range(self.lanes):
                if strobes >> lane & 1 and any(word + lane in region for region in self.writable):
                    CONTENT[word + lane] = data >> 8 * lane & 0xFF
        return AxiResp.OKAY

    def overtaken(self, bursts: list[Burst] | None = None) -> int:
        """Bursts, of reads as a rule, whose first answer came after that of a burst accepted later."""
        latest, count = -1, 0
        for burst in sorted(self.bursts if bursts is None else bursts, key=lambda burst: burst.offered[0]):
            count += burst.number < latest
            latest = max(latest, burst.number)
        return count

    def interleaved(self) -> int:
        """Beats that follow one of another burst that was not that one's last."""
        pairs = itertools.pairwise(burst for _, burst in self.beats)
        left = {burst.number: burst.length for burst in self.bursts}
        count = 0
        for before, after in pairs:
            left[before.number] -= 1
            count += before is not after and left[before.number] > 0
        return count


class Bench:
    """The memory with its clock, its settings and its monitor."""

    def __init__(self, dut: Any) -> None:
        run = json.loads(os.environ["LIGHTLOOM_BENCH"])
        self.dut = dut
        self.queue: int = run["queue"]
        self.writes: int = run["writes"]
        self.memory_bytes: int = 1 << run["memory_bits"]
        if not CONTENT:
            CONTENT.extend(Path(run["image"]).read_bytes().ljust(self.memory_bytes, b"\0"))
        self.image_bytes: int = Path(run["image"]).stat().st_size
        self.writable = [range(first, last + 1) for first, last in run["writable"]]
        self.rng = random.Random(run["seed"])
        self.lanes = len(dut.rdata) // 8
        self.size = self.lanes.bit_length() - 1
        self.ids = 1 << len(dut.arid)
        logging.getLogger("cocotb.axi_memory").setLevel(logging.WARNING)  # the master tells of every read
        cocotb.log.info("axi_memory, %d bits, seed %d", 8 * self.lanes, run["seed"])

    async def start(self, **settings: int) -> None:
        """Starts the clock and resets the memory; what `settings` do not name is as fast and plain as can be."""
        self.dut.rst.value = 1
        self.set(latency=0, bandwidth=256, reorder=0, interleave=0, stall=0, error_enable=0, error_first=0)
        self.set(error_last=0, write_error_enable=0, seed=self.rng.getrandbits(32))
        self.set(**settings)
        self.set(rready=0, arvalid=0, awvalid=0, wvalid=0, bready=0)
        if hasattr(self.dut, "axi_forget"):
            self.set(axi_forget=0)
        Clock(self.dut.clk, 10, unit="ns").start()
        self.monitor = Monitor(self.dut, self.memory_bytes, self.writable)
        await self.reset()

    async def reset(self) -> None:
        self.dut.rst.value = 1
        await ClockCycles(self.dut.clk, 3)
        self.dut.rst.value = 0
        await FallingEdge(self.dut.clk)

    def set(self, **settings: int) -> None:
        for name, value in settings.items():
            getattr(self.dut, name).value = value

    def master(self) -> AxiMasterRead:
        return AxiMasterRead(AxiReadBus.from_entity(self.dut), self.dut.clk, self.dut.rst)

    def channels(self) -> "Channels":
        return Channels(self)

    def writer(self) -> AxiMasterWrite:
        return AxiMasterWrite(AxiWriteBus.from_entity(self.dut), self.dut.clk, self.dut.rst)

    async def answered(self, writes: int) -> None:
        """Waits until `writes` have been accepted and answered, and a while longer."""
        monitor = self.monitor
        before, idle = -1, 0
        while monitor.answered < writes:
            await ClockCycles(self.dut.clk, 20)
            idle = 0 if monitor.answered != before else idle + 20
            before = monitor.answered
            assert idle < HANG_CYCLES, f"hangs: {monitor.answered} of {writes} writes answered"
        await ClockCycles(self.dut.clk, 100)
        assert len(monitor.writes) == monitor.answered == writes

    async def finished(self, bursts: int) -> None:
        """Waits until `bursts` have been accepted and answered, and a while longer, to see a beat too many."""
        monitor = self.monitor
        while monitor.finished < bursts:
            before = len(monitor.beats)
            await ClockCycles(self.dut.clk, 20)
            if len(monitor.beats) == before:
                moved = [cycle for cycle, _ in monitor.beats[-1:]] + [burst.accepted for burst in monitor.bursts[-1:]]
                idle = monitor.cycle - max(moved, default=0)
                assert idle < HANG_CYCLES, f"hangs: {monitor.finished} of {bursts} bursts answered"
        await ClockCycles(self.dut.clk, 100)
        assert len(monitor.bursts) == monitor.finished == bursts


class Channels:
    """The two channels of the master by themselves: bursts as fast as the memory takes them."""

    def __init__(self, bench: Bench) -> None:
        dut = bench.dut
        self.bench = bench
        self.source = AxiARSource(AxiARBus.from_entity(dut), dut.clk, dut.rst)
        self.sink = AxiRSink(AxiRBus.from_entity(dut), dut.clk, dut.rst)

    def send(self, address: int, *, arid: int = 0, beats: int = 1, size: int | None = None, kind: int = INCR) -> None:
        burst = self.source._transaction_obj()
        burst.araddr, burst.arid, burst.arlen, burst.arburst = address, arid, beats - 1, kind
        burst.arsize = self.bench.size if size is None else size
        self.source.send_nowait(burst)

    def send_random(self, count: int, *, beats: int = 1, ids: int | None = None) -> None:
        """Aligned bursts of full beats, none across a 4 KB boundary."""
        bench = self.bench
        for _ in range(count):
            step = beats * bench.lanes
            page = bench.rng.randrange(bench.memory_bytes // 4096)
            offset = bench.rng.randrange(4096 // step) * step
            self.send(page * 4096 + offset, arid=bench.rng.randrange(ids or bench.ids), beats=beats)


class WriteChannels:
    """The three channels of the master by themselves: addresses and data each as fast as the memory takes them."""

    def __init__(self, bench: Bench) -> None:
        dut = bench.dut
        self.bench = bench
        self.addresses = AxiAWSource(AxiAWBus.from_entity(dut), dut.clk, dut.rst)
        self.data = AxiWSource(AxiWBus.from_entity(dut), dut.clk, dut.rst)
        self.answers = AxiBSink(AxiBBus.from_entity(dut), dut.clk, dut.rst)

    def send(
        self,
        address: int,
        *,
        awid: int = 0,
        beats: int = 1,
        size: int | None = None,
        kind: int = INCR,
        strobes: int | None = None,
        last: int | None = None,
    ) -> None:
        """A burst of random data. As a rule a beat has the `strobes` of all of its bytes, the `last` one has WLAST."""
        bench = self.bench
        size = bench.size if size is None else size
        burst = self.addresses._transaction_obj()
        burst.awaddr, burst.awid, burst.awlen, burst.awburst, burst.awsize = address, awid, beats - 1, kind, size
        self.addresses.send_nowait(burst)
        for number in range(beats):
            first = address if number == 0 else (address & -(1 << size)) + (number << size)
            end = (first & -(1 << size)) % bench.lanes + (1 << size)
            mine = (1 << end) - (1 << first % bench.lanes)
            beat = self.data._transaction_obj()
            beat.wdata = bench.rng.getrandbits(8 * bench.lanes)
            beat.wstrb = mine if strobes is None else strobes
            beat.wlast = int(number == (beats - 1 if last is None else last))
            self.data.send_nowait(beat)

    def send_random(self, count: int, *, ids: int | None = None, longest: int = 4) -> None:
        """Bursts within the regions that may be written, none across a 4 KB boundary."""
        bench = self.bench
        region = max(bench.writable, key=len)
        for _ in range(count):
            beats = bench.rng.randint(1, longest)
            step = beats * bench.lanes
            page = bench.rng.randrange(-(-region.start // 4096), region.stop // 4096)
            offset = bench.rng.randrange(4096 // step) * step
            self.send(page * 4096 + offset, awid=bench.rng.randrange(ids or bench.ids), beats=beats)


def willing(rng: random.Random, share: float) -> Iterator[bool]:
    """Pauses of a channel: in how large a share of cycles it is willing."""
    while True:
        yield rng.random() >= share


@cocotb.test()
async def data_of_any_read(dut: Any) -> None:
    """The master's reads of any address, length and beat size give the image's bytes."""
    bench = Bench(dut)
    await bench.start()
    master = bench.master()
    reads = []
    for _ in range(150):
        length = bench.rng.choice([1, 2, 3, bench.lanes, bench.rng.randrange(1, 1000)])
        address = bench.rng.randrange(bench.memory_bytes - length)
        size = bench.rng.randrange(bench.size + 1)
        if size < 2:
            length = min(length, 100)
        event = master.init_read(address, length, size=size, arid=bench.rng.randrange(bench.ids))
        reads.append((address, length, event))
    # The last bytes of the image, which do not fill a word, and what follows.
    end = bench.image_bytes
    reads.append((end - 5, 40, master.init_read(end - 5, 40)))
    for address, length, event in reads:
        await event.wait()
        expected = CONTENT[address : address + length]
        assert (event.data.resp, event.data.data) == (AxiResp.OKAY, expected), f"{length} bytes at {address:#x}"


@cocotb.test()
@cocotb.parametrize(reorder=[0, 100, 255], interleave=[0, 1])
async def stalled_and_out_of_order(dut: Any, reorder: int, interleave: int) -> None:
    """All sides stall at random: nothing lost, each id in order; bursts overtake and beats mix only as asked for."""
    bench = Bench(dut)
    await bench.start(latency=20, bandwidth=200, stall=60, reorder=reorder, interleave=interleave)
    master = bench.master()
    master.ar_channel.set_pause_generator(willing(bench.rng, 0.8))
    master.r_channel.set_pause_generator(willing(bench.rng, 0.7))
    reads = []
    for _ in range(150):
        length = bench.rng.randrange(1, 8 * bench.lanes)
        address = bench.rng.randrange(bench.memory_bytes - length)
        reads.append((address, length, master.init_read(address, length, arid=bench.rng.randrange(6))))
    for address, length, event in reads:
        await event.wait()
        assert event.data.data == CONTENT[address : address + length]
    monitor = bench.monitor
    overtaken, mixed = monitor.overtaken(), monitor.interleaved()
    cocotb.log.info("%d bursts, %d overtaken, %d beats mixed", len(monitor.bursts), overtaken, mixed)
    assert overtaken > len(monitor.bursts) // 10 if reorder else overtaken == 0
    assert mixed > 10 if interleave else mixed == 0


@cocotb.test()
async def latency(dut: Any) -> None:
    """Alone, a burst's first beat is offered exactly `latency` cycles after it was accepted, the others one by one."""
    bench = Bench(dut)
    await bench.start()
    channels = bench.channels()
    settings = (0, 1, 2, 3, 50, 100, 400)
    for count, cycles in enumerate(settings, 1):
        bench.set(latency=cycles)
        channels.send_random(1, beats=4)
        await bench.finished(count)
        burst = bench.monitor.bursts[-1]
        first = burst.accepted + max(cycles, 1)
        assert burst.offered == list(range(first, first + 4)), f"latency {cycles}: {burst}"


@cocotb.test()
@cocotb.parametrize(cycles=[0, 30])
async def full_rate(dut: Any, cycles: int) -> None:
    """Bursts accepted every cycle, a beat every cycle, each exactly `latency` after its burst."""
    bench = Bench(dut)
    await bench.start(latency=cycles)
    channels = bench.channels()
    channels.send_random(300)
    await bench.finished(300)
    bursts = bench.monitor.bursts
    assert [burst.accepted - bursts[0].accepted for burst in bursts] == list(range(300))
    assert {burst.taken[0] - burst.accepted for burst in bursts} == {max(cycles, 1)}


@cocotb.test()
@cocotb.parametrize(share=[256, 255, 128, 100, 16, 1])
async def bandwidth(dut: Any, share: int) -> None:
    """Under load exactly `share` beats in 256 cycles."""
    bench = Bench(dut)
    await bench.start(bandwidth=share)
    channels = bench.channels()
    bursts = 3 if share == 1 else 60
    channels.send_random(bursts, beats=2)
    await bench.finished(bursts)
    cycles = [cycle for cycle, _ in bench.monitor.beats]
    for k, cycle in enumerate(cycles):
        # Not a whole number: whether a beat comes before or after it depends on the credit left by the first one.
        assert k * 256 // share <= cycle - cycles[0] <= -(-k * 256 // share), (
            f"beat {k} after {cycle - cycles[0]} cycles"
        )


@cocotb.test()
async def stalls_as_often_as_asked(dut: Any) -> None:
    """`stall` of 256 cycles without arready, and as many without a new beat; another seed, other cycles."""
    bench = Bench(dut)
    seen: list[list[tuple[int, list[int]]]] = []
    for seed in (1, 1, 2):
        if not seen:
            await bench.start(stall=64, seed=seed)
            channels = bench.channels()
        else:
            bench.set(seed=seed)
            await bench.reset()
        for _ in range(600):
            channels.send(0)
        await bench.finished(600)
        bursts = bench.monitor.bursts
        accepting = bursts[-1].accepted - bursts[0].accepted
        assert 700 < accepting < 900, f"600 bursts accepted in {accepting} cycles; 800 expected"
        seen.append([(burst.accepted, burst.offered) for burst in bursts])
    assert seen[0] == seen[1] != seen[2]
    bench.set(stall=0)
    await bench.reset()
    bench.set(stall=192)
    for _ in range(400):
        channels.send(0, beats=4)
    await ClockCycles(dut.clk, 1000)
    assert 200 < len(bench.monitor.beats) < 300, f"{len(bench.monitor.beats)} beats in 1000 cycles; 250 expected"


@cocotb.test()
async def errors(dut: Any) -> None:
    """An error range, addresses beyond the memory, and kinds of bursts that are not served; others go on."""
    bench = Bench(dut)
    lanes, start = bench.lanes, 4096 + 2 * bench.lanes
    bench.rng.seed(1)
    await bench.start(error_enable=1, error_first=start + 3, error_last=start + lanes, reorder=128)
    bench.monitor.errors = range(start + 3, start + lanes + 1)
    channels = bench.channels()
    channels.send(4096, arid=1, beats=6)
    channels.send(start, arid=2, size=0)  # the bytes before the range are good
    channels.send(start + 2, arid=2, size=0, beats=3)
    channels.send(start + lanes, arid=3, size=0, beats=2)
    channels.send(bench.memory_bytes - lanes, arid=4)
    channels.send(bench.memory_bytes, arid=5, beats=2)
    channels.send((1 << len(dut.araddr)) - lanes, arid=5)
    channels.send(0, arid=6, beats=4, kind=AxiBurstType.WRAP)
    channels.send(0, arid=7, beats=4, kind=AxiBurstType.FIXED)
    channels.send(0, arid=7)
    await bench.finished(10)
    ok, slave, decode = AxiResp.OKAY, AxiResp.SLVERR, AxiResp.DECERR
    assert [burst.responses for burst in bench.monitor.bursts] == [
        [ok, ok, slave, slave, ok, ok],
        [ok],
        [ok, slave, slave],
        [slave, ok],
        [ok],
        [decode, decode],
        [decode],
        [slave] * 4,
        [slave] * 4,
        [ok],
    ]
    bench.set(error_enable=0)
    bench.monitor.errors = range(0)
    channels.send(4096, beats=6)
    await bench.finished(11)


@cocotb.test()
async def bursts_under_way(dut: Any) -> None:
    """Nobody takes beats: QUEUE bursts are accepted and no more; then all are answered."""
    bench = Bench(dut)
    await bench.start(reorder=100)
    channels = bench.channels()
    channels.sink.pause = True
    channels.send_random(bench.queue + 50)
    await ClockCycles(dut.clk, bench.queue + 100)
    assert len(bench.monitor.bursts) == bench.queue
    assert not int(dut.arready.value)
    channels.sink.pause = False
    await bench.finished(bench.queue + 50)


@cocotb.test()
async def counters(dut: Any) -> None:
    """Bursts accepted, beats taken, cycles with a burst under way."""
    bench = Bench(dut)
    await bench.start(latency=7, stall=50)
    channels = bench.channels()
    for total in range(1, 30):
        channels.send_random(1, beats=bench.rng.randint(1, 4))
        if bench.rng.random() < 0.5:
            await bench.finished(total)
    await bench.finished(29)
    monitor = bench.monitor
    seen = tuple(int(signal.value) for signal in (dut.read_bursts, dut.read_beats, dut.busy_cycles))
    assert seen == (29, len(monitor.beats), monitor.busy)
    assert 0 < monitor.busy < monitor.cycle
    await bench.reset()
    assert (int(dut.read_bursts.value), int(dut.read_beats.value), int(dut.busy_cycles.value)) == (0, 0, 0)


@cocotb.test()
async def reset_in_flight(dut: Any) -> None:
    """A reset drops all bursts, and the memory works on as new."""
    bench = Bench(dut)
    await bench.start(latency=30, reorder=128, stall=30)
    channels = bench.channels()
    channels.send_random(80, beats=4, ids=5)
    await ClockCycles(dut.clk, 70)
    assert bench.monitor.finished < len(bench.monitor.bursts)
    channels.source.clear()
    await bench.reset()
    assert not int(dut.rvalid.value)
    channels.send_random(80, beats=4, ids=5)
    await bench.finished(80)
    # For the comparison of simulators: what was offered when, after random choices of all kinds but mixing.
    Path("offered.json").write_text(json.dumps([burst.offered for burst in bench.monitor.bursts]))


@cocotb.test()
@cocotb.parametrize(rule=["none", "boundary", "withdrawn", "changed", "oversized"])
async def violations(dut: Any, rule: str) -> None:
    """A master that breaks a rule is told so; one that goes to the limit of a rule is not."""
    bench = Bench(dut)
    await bench.start(stall=0)
    bench.monitor.broken_master = rule != "none"
    size, full = bench.size, 4096 // bench.lanes
    ask = {"arvalid": 1, "araddr": 0, "arid": 3, "arlen": 0, "arsize": size, "arburst": INCR}
    bench.set(rready=1, **ask)
    if rule in ("withdrawn", "changed"):
        # Fill the memory, so that an address has to wait.
        bench.set(rready=0)
        await ClockCycles(dut.clk, bench.queue + 5)
        assert int(dut.violation.value) == 0
        bench.set(**({"arvalid": 0} if rule == "withdrawn" else {"araddr": 64}))
    elif rule == "boundary":
        bench.set(araddr=4096 - bench.lanes, arlen=1)
    elif rule == "oversized":
        if size == 7:
            return  # no beat is larger than 128 bytes
        bench.set(arsize=size + 1)
    else:
        bench.set(araddr=4096, arlen=min(full, 256) - 1)
    await ClockCycles(dut.clk, 3)
    await FallingEdge(dut.clk)
    assert int(dut.violation.value) == (rule != "none")
    bench.set(**{**ask, "arvalid": 0})
    await bench.reset()
    assert int(dut.violation.value) == 0


# --- writes -----------------------------------------------------------------------------------------------------------


@cocotb.test()
async def data_of_any_write(dut: Any) -> None:
    """The master's writes of any address, length and beat size are read back, and what lies beside them stays."""
    bench = Bench(dut)
    await bench.start(latency=3)
    writer, reader = bench.writer(), bench.master()
    for round_ in range(3):
        events = []
        for _ in range(40):
            region = bench.rng.choice(bench.writable)
            length = min(bench.rng.choice([1, 2, 3, bench.lanes, bench.rng.randrange(1, 300)]), len(region))
            address = bench.rng.randrange(region.start, region.stop - length + 1)
            size = bench.rng.randrange(bench.size + 1)
            data = bench.rng.randbytes(min(length, 100) if size < 2 else length)
            event = writer.init_write(address, data, size=size, awid=bench.rng.randrange(bench.ids))
            events.append((address, data, event))
            if round_ == 0:  # one after the other: each is read back
                await event.wait()
                assert event.data.resp == AxiResp.OKAY
                assert (await reader.read(address, len(data))).data == data
        for _, _, event in events:
            await event.wait()
        for region in bench.writable:
            start, length = max(region.start - 8, 0), min(len(region) + 16, 1000)
            length = min(length, bench.memory_bytes - start)
            assert (await reader.read(start, length)).data == CONTENT[start : start + length]


@cocotb.test()
@cocotb.parametrize(reorder=[0, 100, 255])
async def writes_stalled_and_out_of_order(dut: Any, reorder: int) -> None:
    """All sides stall at random, and reads go on: nothing lost, each id in order; overtaking only as asked for."""
    bench = Bench(dut)
    await bench.start(latency=20, bandwidth=200, stall=60, reorder=reorder)
    channels, reads = WriteChannels(bench), bench.channels()
    for channel, share in ((channels.addresses, 0.8), (channels.data, 0.9), (channels.answers, 0.5)):
        channel.set_pause_generator(willing(bench.rng, share))
    channels.send_random(200, ids=6)
    region = max(bench.writable, key=len)
    for _ in range(600):
        reads.send(bench.rng.randrange(region.start, region.stop) & -bench.lanes, arid=bench.rng.randrange(6))
    await bench.answered(200)
    await bench.finished(600)
    overtaken = bench.monitor.overtaken(bench.monitor.writes)
    cocotb.log.info("%d writes, %d overtaken", len(bench.monitor.writes), overtaken)
    assert overtaken > 20 if reorder else overtaken == 0


@cocotb.test()
async def latency_of_answers(dut: Any) -> None:
    """Alone, an answer is offered exactly `latency` cycles after the last of address and data was taken."""
    bench = Bench(dut)
    await bench.start()
    channels = WriteChannels(bench)
    settings = (0, 1, 2, 3, 50, 100)
    for count, cycles in enumerate(settings, 1):
        bench.set(latency=cycles)
        channels.addresses.pause = count % 2 == 0  # its data comes first
        channels.send_random(1)
        await ClockCycles(dut.clk, 10)
        channels.addresses.pause = False
        await bench.answered(count)
        burst = bench.monitor.writes[-1]
        assert burst.offered == [max(burst.whole, burst.accepted) + max(cycles, 1)], f"latency {cycles}: {burst}"


@cocotb.test()
async def full_rate_of_writes(dut: Any) -> None:
    """A beat, an address and an answer every cycle."""
    bench = Bench(dut)
    await bench.start(latency=10)
    channels = WriteChannels(bench)
    channels.send_random(200, longest=1)
    await bench.answered(200)
    writes = bench.monitor.writes
    assert [burst.taken[0] - writes[0].taken[0] for burst in writes] == list(range(200))


@cocotb.test()
async def reads_do_not_depend_on_writes(dut: Any) -> None:
    """The same seed and the same reads: the same cycles, whether anything is written or not."""
    bench = Bench(dut)
    seed, seen = bench.rng.getrandbits(32), []
    await bench.start(latency=13, reorder=100, interleave=1, stall=60, seed=seed)
    reads, writes = bench.channels(), WriteChannels(bench)
    for count in (0, 100):
        await bench.reset()
        bench.rng.seed(3)
        reads.send_random(100, beats=2)
        writes.send_random(count)
        await bench.finished(100)
        await bench.answered(count)
        seen.append([burst.offered for burst in bench.monitor.bursts])
    assert seen[0] == seen[1]


@cocotb.test()
async def what_is_not_answered_is_not_there(dut: Any) -> None:
    """Reads get the old bytes until the answer is offered, and the new ones from then on, however long it waits."""
    bench = Bench(dut)
    await bench.start(latency=40)
    writes, reads = WriteChannels(bench), bench.channels()
    address = -(-max(bench.writable, key=len).start // 4096) * 4096
    before = bytes(CONTENT[address : address + bench.lanes])
    writes.answers.pause = True
    writes.send(address)
    await ClockCycles(dut.clk, 10)
    bench.set(latency=1)  # of what is accepted from now on
    for _ in range(60):
        reads.send(address)
        await ClockCycles(dut.clk, 2)
    await bench.finished(60)
    monitor = bench.monitor
    assert bytes(CONTENT[address : address + bench.lanes]) != before
    offered = monitor.writes[0].offered[0]
    assert not monitor.answered
    assert monitor.bursts[0].offered[0] <= offered < monitor.bursts[-1].offered[0], "the monitor compared nothing"
    writes.answers.pause = False
    await bench.answered(1)


@cocotb.test()
async def errors_of_writes(dut: Any) -> None:
    """An error range, and kinds of bursts that are not served: nothing of them is written; others go on."""
    bench = Bench(dut)
    lanes, start = bench.lanes, -(-max(bench.writable, key=len).start // 4096) * 4096
    await bench.start(write_error_enable=1, error_first=start + 3, error_last=start + lanes, reorder=128)
    bench.monitor.write_errors = range(start + 3, start + lanes + 1)
    channels = WriteChannels(bench)
    channels.send(start, awid=1, beats=4)
    channels.send(start, awid=2, size=0, beats=3)  # the bytes before the range
    channels.send(start, awid=2, size=0, beats=4)
    channels.send(start + lanes, awid=3)
    channels.send(start + 2 * lanes, awid=3)
    channels.send(start + 4 * lanes, awid=6, beats=4, kind=AxiBurstType.WRAP)
    channels.send(start + 4 * lanes, awid=7, beats=4, kind=AxiBurstType.FIXED)
    channels.send(start + 4 * lanes, awid=7)
    await bench.answered(8)
    ok, slave = AxiResp.OKAY, AxiResp.SLVERR
    assert [burst.responses for burst in bench.monitor.writes] == [
        [slave],
        [ok],
        [slave],
        [slave],
        [ok],
        [slave],
        [slave],
        [ok],
    ]
    reads = bench.channels()
    reads.send(start, beats=8)
    await bench.finished(1)
    bench.set(write_error_enable=0, error_enable=1)  # of reads alone
    bench.monitor.write_errors = range(0)
    channels.send(start, beats=2)
    await bench.answered(9)
    bench.set(error_enable=0)
    reads.send(start, beats=8)
    await bench.finished(2)


@cocotb.test()
@cocotb.parametrize(offset=[-1, 0])
async def bytes_that_may_not_be_written(dut: Any, offset: int) -> None:
    """At both ends of every region: the first byte beyond is flagged and stays, the last one within is not flagged."""
    bench = Bench(dut)
    await bench.start()
    bench.monitor.broken_master = True
    channels, reads = WriteChannels(bench), bench.channels()
    count = 0
    for region in bench.writable:
        for byte in (region.start + offset, region.stop + offset):
            if not 0 <= byte < bench.memory_bytes:
                continue
            channels.send(byte // bench.lanes * bench.lanes, strobes=1 << byte % bench.lanes)
            count += 1
            await bench.answered(count)
            allowed = any(byte in each for each in bench.writable)
            assert int(dut.violation.value) == (not allowed), f"byte {byte:#x}"
            reads.send(byte // bench.lanes * bench.lanes)
            await bench.finished(1)
            await bench.reset()
            count = 0
    # Beyond the memory
    channels.send(bench.memory_bytes)
    await bench.answered(1)
    assert int(dut.violation.value)
    assert bench.monitor.writes[0].responses == [AxiResp.DECERR]


@cocotb.test()
async def counters_of_writes(dut: Any) -> None:
    """Bursts accepted, beats taken; those of reads do not count them. And a reset, with some under way, drops them."""
    bench = Bench(dut)
    await bench.start(latency=7, stall=50, reorder=100)
    channels = WriteChannels(bench)
    channels.send_random(30)
    await bench.answered(30)
    names = ("write_bursts", "write_beats", "read_bursts", "read_beats", "busy_cycles")
    beats = sum(burst.length for burst in bench.monitor.writes)
    assert [int(getattr(dut, name).value) for name in names] == [30, beats, 0, 0, 0]
    bench.set(latency=60)
    channels.send_random(60)
    await ClockCycles(dut.clk, 50)
    assert bench.monitor.answered < len(bench.monitor.writes)
    for source in (channels.addresses, channels.data):
        source.clear()
    await bench.reset()
    assert [int(getattr(dut, name).value) for name in names] == [0] * 5
    assert not int(dut.bvalid.value)
    channels.send_random(60)
    await bench.answered(60)
    Path("answered.json").write_text(json.dumps([burst.offered for burst in bench.monitor.writes]))


@cocotb.test()
async def writes_under_way(dut: Any) -> None:
    """Nobody takes answers: WRITES bursts are accepted and no more, and data for them; then all are answered."""
    bench = Bench(dut)
    await bench.start()
    channels = WriteChannels(bench)
    channels.answers.pause = True
    channels.send_random(bench.writes + 20, longest=1)
    await ClockCycles(dut.clk, bench.writes + 100)
    assert len(bench.monitor.writes) == bench.writes
    assert not int(dut.awready.value)
    channels.answers.pause = False
    await bench.answered(bench.writes + 20)


@cocotb.test()
@cocotb.parametrize(rule=["none", "boundary", "early last", "no last", "strobe"])
async def violations_of_writes(dut: Any, rule: str) -> None:
    """A master that breaks a rule which the memory needs is told so; one that goes to its limit is not."""
    bench = Bench(dut)
    await bench.start()
    bench.monitor.broken_master = rule != "none"
    channels = WriteChannels(bench)
    start, lanes = -(-max(bench.writable, key=len).start // 4096) * 4096, bench.lanes
    if rule == "none":
        channels.send(start + 4096 - 2 * lanes, beats=2)
    elif rule == "boundary":
        channels.send(start + 4096 - lanes, beats=2)
    elif rule == "strobe":
        channels.send(start + 1, size=0, strobes=4)
    else:
        channels.send(start, beats=3, last=1 if rule == "early last" else 7)
    await ClockCycles(dut.clk, 20)
    await FallingEdge(dut.clk)
    assert int(dut.violation.value) == (rule != "none")
    await bench.reset()
    assert int(dut.violation.value) == 0
