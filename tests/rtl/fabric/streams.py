"""Runs a component with a stream on either side in Amaranth's own simulator, both sides stalling at random."""

import random
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from amaranth import ClockDomain, Module, Value
from amaranth.lib import wiring

from tests.rtl.simulation import simulate

PATIENCE = 400
"""Cycles without any transfer after which a component is taken to hang."""
LINGER = 80
"""Cycles after the last result, in which there must be no further one."""


@dataclass
class Transfers:
    """What went through: results as integers, and the cycle of each transfer."""

    sent_at: list[int] = field(default_factory=list)
    received: list[int] = field(default_factory=list)
    received_at: list[int] = field(default_factory=list)
    ready: list[bool] = field(default_factory=list)
    """Of each cycle, whether the input was ready."""
    waits: list[bool] = field(default_factory=list)
    """Of each cycle, whether a result was offered and not taken."""


def exchange(
    component: wiring.Component, payloads: Sequence[int], rates: Sequence[tuple[float, float]], seed: int
) -> list[Transfers]:
    """For each pair of rates, sends all payloads and takes as many results, in one simulation.

    The rates are the probabilities, a cycle, that a payload is offered and that a result is taken. Asserts that results
    stay as they are until they are taken, that there are as many as payloads, and that nothing hangs.
    """
    seen = [Transfers() for _ in rates]
    top = Module()
    top.domains.sync = ClockDomain()  # also where the component has no register
    top.submodules.component = component
    rng = random.Random(seed)

    async def testbench(ctx: Any) -> None:
        for (give, take), transfers in zip(rates, seen, strict=True):
            await _run(ctx, component, payloads, rng, give, take, transfers)

    simulate(top, testbench)
    for transfers in seen:
        assert len(transfers.received) == len(payloads), f"seed {seed}: {transfers}"
    return seen


async def _run(
    ctx: Any, dut: Any, payloads: Sequence[int], rng: random.Random, give: float, take: float, seen: Transfers
) -> None:
    given, result = Value.cast(dut.i.payload), Value.cast(dut.o.payload)
    offered = False
    waiting: int | None = None  # a result that was not taken
    cycle = moved = 0
    while cycle - moved < (LINGER if len(seen.received) >= len(payloads) else PATIENCE):
        if not offered:
            offered = len(seen.sent_at) < len(payloads) and rng.random() < give
            # What is not offered may be anything.
            ctx.set(given, payloads[len(seen.sent_at)] if offered else rng.getrandbits(len(given)))
            ctx.set(dut.i.valid, offered)
        takes = rng.random() < take
        ctx.set(dut.o.ready, takes)
        ready = bool(ctx.get(dut.i.ready))
        valid = bool(ctx.get(dut.o.valid))
        seen.ready.append(ready)
        seen.waits.append(valid and not takes)
        if valid:
            payload = ctx.get(result)
            assert waiting in (None, payload), f"cycle {cycle}: a waiting result changed"
            waiting = None if takes else payload
            if takes:
                seen.received.append(payload)
                seen.received_at.append(cycle)
                moved = cycle
        else:
            assert waiting is None, f"cycle {cycle}: a waiting result was withdrawn"
        if offered and ready:
            seen.sent_at.append(cycle)
            offered, moved = False, cycle
        await ctx.tick()
        cycle += 1
