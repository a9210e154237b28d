"""Drives a unit's input stream and watches its output stream, both sides stalling as told."""

import random
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

from cocotb.triggers import FallingEdge, RisingEdge

from lightloom.verif.bins.coverage import StreamCycles, note

HANG_CYCLES = 2000
"""Cycles without any transfer after which a unit is taken to hang: far more than any latency and any stall."""


def pattern(name: str, rng: random.Random) -> Iterator[bool]:
    """An endless sequence of cycles in which a side is willing to transfer.

    "always"; "never"; "half" of the cycles; "rare", one in eight; "bursts" of up to 40 willing cycles, then of
    unwilling ones.
    """
    while True:
        if name == "bursts":
            for willing in (True, False):
                yield from [willing] * rng.randint(1, 40)
        else:
            yield name == "always" or rng.random() < {"half": 0.5, "rare": 0.125, "never": 0.0}[name]


@dataclass
class Exchange:
    """What went through a unit: payloads as integers, and the cycle of each transfer."""

    sent_at: list[int] = field(default_factory=list)
    received: list[int] = field(default_factory=list)
    received_at: list[int] = field(default_factory=list)


class StreamDriver:
    """The two streams of a unit under test, `i` and `o`."""

    def __init__(self, dut: Any):
        self.dut = dut
        self._rising, self._falling = RisingEdge(dut.clk), FallingEdge(dut.clk)

    def rest(self) -> None:
        """Nothing is offered, and nothing taken."""
        self.dut.i__valid.value = 0
        self.dut.i__payload.value = 0
        self.dut.o__ready.value = 0

    async def exchange(
        self,
        payloads: list[int],
        *,
        give: Iterator[bool],
        take: Iterator[bool],
        expected: int | None = None,
        until: Callable[[int], bool] = lambda cycle: False,
        patience: int = HANG_CYCLES,
        linger: int = 100,
    ) -> Exchange:
        """Offers `payloads` in order when `give` is willing, takes results when `take` is, until `expected` (as many
        as payloads) have come and `linger` cycles after, to see one too many; or until `until` says so of a cycle.

        Everything is driven after a rising edge and sampled at the falling edge, when it has settled. Fails where a
        waiting result changes or is withdrawn, or nothing moves for `patience` cycles.
        """
        dut, seen = self.dut, Exchange()
        expected = len(payloads) if expected is None else expected
        offered = False
        cycles = StreamCycles()
        waiting: int | None = None  # a result that was not taken
        cycle = moved = 0
        while not until(cycle):
            sent = len(seen.sent_at)
            if not offered:
                offered = sent < len(payloads) and next(give)
                if offered:
                    dut.i__payload.value = payloads[sent]
                dut.i__valid.value = int(offered)
            ready = next(take)
            dut.o__ready.value = int(ready)
            await self._falling
            valid = bool(int(dut.o__valid.value))
            accepted = offered and bool(int(dut.i__ready.value))
            cycles.add(offered, accepted, valid, ready)
            if valid:
                result = int(dut.o__payload.value)
                assert waiting in (None, result), f"cycle {cycle}: a waiting result changed: {waiting:#x}, {result:#x}"
                waiting = None if ready else result
                if ready:
                    seen.received.append(result)
                    seen.received_at.append(cycle)
                    moved = cycle
            else:
                assert waiting is None, f"cycle {cycle}: a waiting result was withdrawn: {waiting:#x}"
            if accepted:
                seen.sent_at.append(cycle)
                offered = False
                moved = cycle
            await self._rising
            cycle += 1
            if len(seen.received) >= expected and cycle - moved > linger:
                break
            assert cycle - moved < patience, f"cycle {cycle}: hangs; {sent} sent, {len(seen.received)} received"
        note(cycles.groups)
        dut.i__valid.value = 0
        dut.o__ready.value = 0  # a result that comes later waits for the next exchange
        return seen
