"""What the benches of the memory of the simulations, sim/axi_memory.v, share: its master, and what watches it.

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
from cocotbext.axi import AxiMasterRead, AxiMasterWrite, AxiReadBus, AxiResp, AxiWriteBus
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
