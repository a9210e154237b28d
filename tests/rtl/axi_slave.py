"""An AXI4 read memory in Python for units in Amaranth's simulator, which also watches the master's manners."""

import random
from collections import deque
from typing import Any


class AxiSlave:
    """Answers reads from `content` (byte address of a word of the bus to its data) after `latency` cycles.

    With `reorder`, bursts of different ids overtake each other and their beats come mixed; with `stall`, that part of
    the cycles has no arready, and that part no new beat. Beats at an address in `bad` are errors (SLVERR). Call `drive`
    after each clock edge, and `sample` when everything has settled.
    """

    def __init__(self, axi: Any, *, latency: int = 1, reorder: bool = False, stall: float = 0.0, seed: int = 0):
        self.axi = axi
        self.latency, self.reorder, self.stall = latency, reorder, stall
        self.random = random.Random(seed)
        self.bad: set[int] = set()
        self.lanes = axi.signature.data_width // 8
        self.cycle = 0
        self.bursts: deque[list[int]] = deque()  # id, next address, beats left, cycle from which beats may come
        self.beat: tuple[int, ...] | None = None  # id, data, response, last
        self.reads: list[int] = []
        self.under_way = 0
        self.most_under_way = 0
        self._waiting: tuple[int, ...] | None = None

    @staticmethod
    def word(address: int, lanes: int) -> int:
        """The content: every aligned 32-bit word is a hash of its address."""
        return sum(((address + k) * 2654435761 & 0xFFFF_FFFF) << (8 * k) for k in range(0, lanes, 4))

    def drive(self, ctx: Any) -> None:
        axi = self.axi
        if self.beat is None and self.random.random() >= self.stall:
            self._choose()
        ctx.set(axi.arready, int(self.random.random() >= self.stall))
        ctx.set(axi.rvalid, int(self.beat is not None))
        if self.beat is not None:
            for signal, value in zip((axi.rid, axi.rdata, axi.rresp, axi.rlast), self.beat, strict=True):
                ctx.set(signal, value)

    def _choose(self) -> None:
        seen: set[int] = set()
        ready = []
        for burst in self.bursts:
            if burst[0] not in seen and burst[3] <= self.cycle:
                ready.append(burst)
            seen.add(burst[0])
        if not ready:
            return
        burst = self.random.choice(ready) if self.reorder else ready[0]
        identity, address, left, _ = burst
        self.beat = (identity, self.word(address, self.lanes), 2 if address in self.bad else 0, int(left == 0))
        burst[1:3] = address + self.lanes, left - 1
        if left == 0:
            self.bursts.remove(burst)

    def sample(self, ctx: Any) -> None:
        axi = self.axi
        self.cycle += 1
        asked = tuple(ctx.get(s) for s in (axi.araddr, axi.arid, axi.arlen, axi.arsize, axi.arburst))
        if ctx.get(axi.arvalid):
            assert self._waiting in (None, asked), "a waiting address changed"
            self._waiting = asked
            if ctx.get(axi.arready):
                self._waiting = None
                address, identity, length, size, kind = asked
                assert address % 64 == 0
                assert (length + 1) * self.lanes == 64
                assert 1 << size == self.lanes
                assert kind == 1
                self.bursts.append([identity, address, length, self.cycle + self.latency - 1])
                self.reads.append(address)
                self.under_way += 1
                self.most_under_way = max(self.most_under_way, self.under_way)
        else:
            assert self._waiting is None, "arvalid was withdrawn"
        if self.beat is not None and ctx.get(axi.rready):
            self.under_way -= self.beat[3]
            self.beat = None
