"""An AXI4 read memory in Python for units in Amaranth's simulator, which also watches the master's manners."""

import random
from collections import deque
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True, kw_only=True)
class Wrong:
    """How a block is answered that is not answered as it was asked for."""

    beats: int
    """So many come."""
    last: frozenset[int] = frozenset()
    """Which of them have RLAST, from 0 up."""
    after: int = 0
    """Cycles that the answer takes longer than others."""


def wrong_ends(beats: int) -> dict[str, tuple[Wrong, bool]]:
    """Ways in which RLAST can be wrong in a block of `beats`: the answer, and whether a beat shows that it is over."""
    whole = frozenset({beats - 1})
    ends = {
        "no RLAST": (Wrong(beats=beats), False),
        "a beat too many": (Wrong(beats=beats + 1, last=whole | {beats}), True),
    }
    for more in (1, 3):
        ends[f"RLAST {more} beats late"] = (Wrong(beats=beats + more, last=frozenset({beats - 1 + more})), True)
    for k in sorted({0, 1, beats // 2, beats - 2} & set(range(beats - 1))):
        ends[f"RLAST on beat {k}"] = (Wrong(beats=beats, last=frozenset({k})), False)
        ends[f"RLAST on beat {k}, too"] = (Wrong(beats=beats, last=whole | {k}), True)
        ends[f"{k + 1} beats"] = (Wrong(beats=k + 1, last=frozenset({k})), False)
    return ends


class AxiSlave:
    """Answers reads from `content` (byte address of a word of the bus to its data) after `latency` cycles.

    With `reorder`, bursts of different ids overtake each other and their beats come mixed; with `stall`, that part of
    the cycles has no arready, and that part no new beat. Beats at an address in `bad` are errors (SLVERR); blocks at an
    address in `wrong` are answered as that says. Call `drive` after each clock edge, and `sample` when everything has
    settled. No id may have two bursts under way, until all beats of the first have been taken.
    """

    def __init__(self, axi: Any, *, latency: int = 1, reorder: bool = False, stall: float = 0.0, seed: int = 0):
        self.axi = axi
        self.latency, self.reorder, self.stall = latency, reorder, stall
        self.random = random.Random(seed)
        self.bad: set[int] = set()
        self.wrong: dict[int, Wrong] = {}
        self.lanes = axi.signature.data_width // 8
        self.cycle = 0
        self.bursts: deque[list[Any]] = deque()  # id, next address, beats, cycle from which they may come, given, last
        self.ids: set[int] = set()
        self.beat: tuple[int, ...] | None = None  # id, data, response, last
        self.reads: list[int] = []
        self.asked: list[int] = []
        """Their ids."""
        self.most_under_way = 0
        self._waiting: tuple[int, ...] | None = None

    @property
    def under_way(self) -> int:
        """Bursts whose last beat has not been taken."""
        return len(self.ids)

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
        identity, address, beats, _, given, last = burst
        self.beat = (identity, self.word(address, self.lanes), 2 if address in self.bad else 0, int(given in last))
        burst[1], burst[4] = address + self.lanes, given + 1
        self._ends = burst[4] == beats
        if self._ends:
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
                assert identity not in self.ids, "a burst of this id is under way"
                answer = self.wrong.get(address, Wrong(beats=length + 1, last=frozenset({length})))
                begin = self.cycle + self.latency + answer.after - 1
                self.reads.append(address)
                self.asked.append(identity)
                if answer.beats:
                    self.bursts.append([identity, address, answer.beats, begin, 0, answer.last])
                self.ids.add(identity)
                self.most_under_way = max(self.most_under_way, self.under_way)
        else:
            assert self._waiting is None, "arvalid was withdrawn"
        if self.beat is not None and ctx.get(axi.rready):
            if self._ends:
                self.ids.discard(self.beat[0])
            self.beat = None
