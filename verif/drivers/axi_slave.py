"""An AXI4 read memory for benches, made of cocotbext-axi's channels, which also watches the master's manners.

It answers late, in any order and mixed, with errors and wrong bursts where it is told to, and stalls both channels.
What a master may not do fails the test in the cycle in which it is done.
"""

import logging
import random
from collections import defaultdict, deque
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import cocotb
from cocotb.triggers import FallingEdge, RisingEdge
from cocotbext.axi import AxiBurstType, AxiResp
from cocotbext.axi.axi_channels import AxiARBus, AxiARSink, AxiRBus, AxiRSource

from lightloom.verif.bins.coverage import StreamCycles

BLOCK_BYTES = 64
AHEAD = 2
"""Beats that are chosen before their turn, so that there can be one in every cycle."""
ADDRESS = ("araddr", "arid", "arlen", "arsize", "arburst")


@dataclass(frozen=True, kw_only=True)
class Manner:
    """How the memory answers."""

    latency: tuple[int, int] = (0, 0)
    """Least and greatest number of cycles that a burst waits before its first beat can come."""
    stall: float = 0.0
    """In what part of the cycles no address is accepted, and in what part no new beat is given."""
    reorder: bool = False
    """Bursts of different ids overtake each other; without, they are answered in their order."""
    interleave: bool = False
    """Beats of different bursts come mixed."""


@dataclass(frozen=True, kw_only=True)
class Wrong:
    """How a block is answered that is not answered as it was asked for."""

    beats: int
    """So many come, or none."""
    last: frozenset[int] = frozenset()
    """Which of them have RLAST, from 0 up."""
    after: int = 0
    """Cycles that the first of them waits longer than another burst's."""


@dataclass
class Burst:
    """A read that was accepted."""

    id: int
    address: int
    answer: Wrong
    from_cycle: int
    error: AxiResp
    bad_beat: int
    """The only one with an error, where `error` is one."""
    given: int = 0


class AxiSlave:
    """Memory at the AXI4 read port `prefix` of `dut`, whose master reads whole blocks of 64 bytes.

    `regions` are the bytes that begin at an address; elsewhere the answer is DECERR. Blocks at an address in `errors`
    get that response, in one of their beats. Data that comes with an error is random. Blocks at an address in `wrong`
    are answered as that says. `bursts` and `beats` count those that were accepted and taken. The master must

    - ask for an aligned block (which is never on both sides of a 4 KB boundary) with one INCR burst over the whole
      width of the bus, and only for what is in a region or in `errors`;
    - have no two bursts of an id under way, the first of which still gets beats;
    - hold address and valid until they are taken, and offer nothing during a reset.
    """

    def __init__(self, dut: Any, prefix: str, *, rng: random.Random) -> None:
        self.dut = dut
        self.rng = rng
        self.regions: dict[int, bytes] = {}
        self.errors: dict[int, AxiResp] = {}
        self.wrong: dict[int, Wrong] = {}
        self.manner = Manner()
        self.cycle = 0
        self.bursts = self.beats = 0
        self.overtaken = self.mixed = 0
        self.most_under_way = 0
        self.cycles = StreamCycles("addresses", "data")
        self._port = {name: getattr(dut, f"{prefix}_{name}") for name in (*ADDRESS, "arvalid", "arready")}
        self._port |= {name: getattr(dut, f"{prefix}_{name}") for name in ("rvalid", "rready", "rid", "rlast")}
        self.lanes = len(getattr(dut, f"{prefix}_rdata")) // 8
        self._addresses = AxiARSink(AxiARBus.from_prefix(dut, prefix), dut.clk, dut.rst)
        self._data = AxiRSource(AxiRBus.from_prefix(dut, prefix), dut.clk, dut.rst)
        self._addresses.log.setLevel(logging.WARNING)  # both channels tell of every reset
        self._addresses.set_pause_generator(self._stalls())
        self._data.set_pause_generator(self._stalls())
        self._forget()
        cocotb.start_soon(self._watch())
        cocotb.start_soon(self._serve())

    @property
    def under_way(self) -> int:
        """Bursts that are not answered yet."""
        return len(self._left)

    def _forget(self) -> None:
        self._queues: dict[int, deque[Burst]] = defaultdict(deque)
        self._order: list[Burst] = []
        self._engaged: Burst | None = None
        self._left: dict[int, int] = {}
        """Beats still to be taken of the burst of an id."""
        self._held: tuple[int, ...] | None = None
        self._addresses.clear()
        self._data.clear()

    def _stalls(self) -> Iterator[bool]:
        while True:
            yield self.rng.random() < self.manner.stall

    # --- the memory -----------------------------------------------------------------------------------------------

    async def _serve(self) -> None:
        edge = RisingEdge(self.dut.clk)
        while True:
            await edge
            self.cycle += 1
            if int(self.dut.rst.value):
                self._forget()
                continue
            while not self._addresses.empty():
                self._accept(self._addresses.recv_nowait())
            while self._data.count() < AHEAD and self._give():
                pass

    def _accept(self, asked: Any) -> None:
        address, beats = int(asked.araddr), int(asked.arlen) + 1
        error = self.errors.get(address, AxiResp.OKAY)
        if error == AxiResp.OKAY and self._content(address) is None:
            error = AxiResp.DECERR
        burst = Burst(
            id=int(asked.arid),
            address=address,
            answer=self._answer(address, beats),
            from_cycle=self.cycle + self.rng.randint(*self.manner.latency),
            error=error,
            bad_beat=self.rng.randrange(beats),
        )
        burst.from_cycle += burst.answer.after
        if burst.answer.beats:
            self._queues[burst.id].append(burst)
            self._order.append(burst)

    def _answer(self, address: int, beats: int) -> Wrong:
        return self.wrong.get(address, Wrong(beats=beats, last=frozenset({beats - 1})))

    def _content(self, address: int) -> bytes | None:
        for base, content in self.regions.items():
            if base <= address < base + len(content):
                return content[address - base : address - base + BLOCK_BYTES]
        return None

    def _give(self) -> bool:
        """Chooses the next beat; whether there is one."""
        manner, burst = self.manner, self._engaged
        if burst is None or manner.interleave:
            first = [queue[0] for queue in self._queues.values() if queue]
            ready = [each for each in first if each.from_cycle <= self.cycle]
            if not manner.reorder:
                ready = [each for each in ready if each is self._order[0]]
            if not ready:
                return False
            chosen = self.rng.choice(ready)
            self.mixed += burst is not None and chosen is not burst
            self.overtaken += chosen is not self._order[0] and chosen.given == 0
            burst = chosen
        number, burst.given = burst.given, burst.given + 1
        bad = burst.error != AxiResp.OKAY and number == burst.bad_beat
        content = self._content(burst.address)
        if content is None or bad:
            content = self.rng.randbytes(BLOCK_BYTES)
        beat = self._data._transaction_obj()
        beat.rid, beat.rresp = burst.id, burst.error if bad else AxiResp.OKAY
        offset = number * self.lanes % BLOCK_BYTES
        beat.rdata = int.from_bytes(content[offset : offset + self.lanes], "little")
        beat.rlast = int(number in burst.answer.last)
        self._data.send_nowait(beat)
        ends = burst.given == burst.answer.beats
        self._engaged = None if ends else burst
        if ends:
            self._queues[burst.id].popleft()
            self._order.remove(burst)
        return True

    # --- the master -----------------------------------------------------------------------------------------------

    async def _watch(self) -> None:
        """Looks at both channels in the middle of every cycle, when they have settled."""
        port, edge = self._port, FallingEdge(self.dut.clk)
        arvalid, arready, rvalid, rready = (port[name] for name in ("arvalid", "arready", "rvalid", "rready"))
        in_reset = 0
        while True:
            await edge
            if int(self.dut.rst.value):
                in_reset += 1
                # The first of these cycles still shows what was before.
                assert in_reset < 2 or not int(arvalid.value), "arvalid during a reset"
                continue
            in_reset = 0
            asked, given = bool(int(arvalid.value)), bool(int(rvalid.value))
            accepted, taken = asked and bool(int(arready.value)), given and bool(int(rready.value))
            self.cycles.add(asked, accepted, given, taken)
            if asked:
                self._check_address(accepted)
            else:
                assert self._held is None, f"cycle {self.cycle}: arvalid was withdrawn"
            if taken:
                self.beats += 1
                identity = int(port["rid"].value)
                self._left[identity] -= 1
                if not self._left[identity]:
                    del self._left[identity]

    def _check_address(self, accepted: bool) -> None:
        asked = tuple(int(self._port[name].value) for name in ADDRESS)
        where = f"cycle {self.cycle}: " + ", ".join(f"{k} {v:#x}" for k, v in zip(ADDRESS, asked, strict=True))
        assert self._held in (None, asked), f"{where}: a waiting address changed, from {self._held}"
        self._held = None if accepted else asked
        if not accepted:
            return
        address, identity, length, size, kind = asked
        assert 1 << size == self.lanes, f"{where}: not the whole width of the bus"
        assert kind == AxiBurstType.INCR, f"{where}: not INCR"
        assert address % BLOCK_BYTES == 0, f"{where}: not aligned"
        assert (length + 1) * self.lanes == BLOCK_BYTES, f"{where}: not a block"
        assert address in self.errors or self._content(address) is not None, f"{where}: nothing is there"
        assert identity not in self._left, f"{where}: a burst of this id is under way"
        beats = self._answer(address, length + 1).beats
        if beats:
            self._left[identity] = beats
        self.bursts += 1
        self.most_under_way = max(self.most_under_way, self.under_way)
