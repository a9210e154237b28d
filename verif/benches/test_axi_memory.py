"""Bench of the memory of the simulations, sim/axi_memory.v: its data, its timing and the rules of AXI4.

The master is cocotbext-axi's, which nobody here wrote. Beside it a monitor looks at both channels in every cycle: what
comes back has to be the image in all bits, burst by burst, with the order and the timing that was asked for.
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
from cocotbext.axi import AxiBurstType, AxiMasterRead, AxiReadBus, AxiResp
from cocotbext.axi.axi_channels import AxiARBus, AxiARSource, AxiRBus, AxiRSink

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


class Monitor:
    """Watches the memory's two channels in the middle of every cycle, when they have settled."""

    def __init__(self, dut: Any, image: bytes, memory_bytes: int) -> None:
        self.dut = dut
        self.image = image
        self.memory_bytes = memory_bytes
        self.lanes = len(dut.rdata) // 8
        self.errors: range = range(0)
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
            assert self.broken_master or not int(dut.violation.value), f"cycle {self.cycle}: violation"
            self.cycle += 1

    def _accept(self) -> None:
        dut = self.dut
        names = ("arid", "araddr", "arlen", "arsize", "arburst")
        identity, address, length, size, kind = (int(getattr(dut, name).value) for name in names)
        burst = Burst(len(self.bursts), identity, address, length + 1, 1 << size, kind, self.cycle)
        self.bursts.append(burst)
        self._waiting[identity].append(burst)

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
        first = burst.address if beat == 0 else burst.address // burst.size * burst.size + beat * burst.size
        start = first // burst.size * burst.size
        poison = int.from_bytes(POISON.to_bytes(4, "little") * (self.lanes // 4), "little")
        touched = range(max(start, self.errors.start), min(start + burst.size, self.errors.stop))
        if burst.kind != INCR or burst.size > self.lanes or touched:
            return poison, AxiResp.SLVERR
        if start >= self.memory_bytes:
            return poison, AxiResp.DECERR
        word = first // self.lanes * self.lanes
        return int.from_bytes(self.image[word : word + self.lanes].ljust(self.lanes, b"\0"), "little"), AxiResp.OKAY

    def overtaken(self) -> int:
        """Bursts whose first beat came after that of a burst accepted later."""
        latest, count = -1, 0
        for burst in sorted(self.bursts, key=lambda burst: burst.offered[0]):
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
        self.image = Path(run["image"]).read_bytes()
        self.memory_bytes: int = 1 << run["memory_bits"]
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
        self.set(error_last=0, seed=self.rng.getrandbits(32))
        self.set(**settings)
        self.dut.rready.value = 0
        self.dut.arvalid.value = 0
        Clock(self.dut.clk, 10, unit="ns").start()
        self.monitor = Monitor(self.dut, self.image, self.memory_bytes)
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
    reads.append((len(bench.image) - 5, 40, master.init_read(len(bench.image) - 5, 40)))
    for address, length, event in reads:
        await event.wait()
        expected = bench.image[address : address + length].ljust(length, b"\0")
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
        assert event.data.data == bench.image[address : address + length].ljust(length, b"\0")
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
