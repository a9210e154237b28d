"""The traversal unit behind AXI4-Lite, aborted in every phase."""

from collections.abc import Awaitable, Callable
from typing import Any

import cocotb
import numpy as np
from cocotb.triggers import ClockCycles

from lightloom.verif.benches.front_bench import FrontBench
from lightloom.verif.benches.test_stream_unit import payloads
from lightloom.verif.benches.traversal_bench import BASES, MEMORIES, RENDERED, rays_of
from lightloom.verif.drivers.axi_slave import Manner, Wrong


async def _nothing(bench: FrontBench) -> None:
    pass


async def _loading(bench: FrontBench) -> None:
    bench.put(bench.tree("soup").blocks, BASES[0])
    await bench.set_base(BASES[0])
    await bench.write(load=1)


async def _loaded(bench: FrontBench) -> None:
    await _loading(bench)
    await bench.await_field("loaded", 1)


async def _waiting(bench: FrontBench) -> None:
    await _loading(bench)
    await bench.submit(rays_of("soup", 1, bench.seed, RENDERED), 1)


async def _tracing(bench: FrontBench) -> None:
    await _loaded(bench)
    for tag in range(2):
        await bench.submit(rays_of("soup", 2, bench.seed, RENDERED)[tag : tag + 1], tag)


async def _results_wait(bench: FrontBench) -> None:
    await _tracing(bench)
    await bench.submit(rays_of("soup", 1, bench.seed + 1, RENDERED), 2)
    await bench.await_field("result_waits", 1)


async def _full(bench: FrontBench) -> None:
    """Nobody takes results, neither at the registers nor at the streams."""
    await _loaded(bench)
    rays = rays_of("soup", bench.contexts + 30, bench.seed, RENDERED)
    offered = payloads(rays, np.arange(len(rays)))
    await bench.exchange(offered, "always", "never", until=lambda cycle: cycle == 400)
    await bench.submit(rays[:1], 1)
    await bench.await_field("operands_wait", 1)
    bench.streams.rest()


async def _aborting(bench: FrontBench) -> None:
    bench.memory.manner = MEMORIES["far"]
    await _tracing(bench)
    await bench.write(abort=1)


async def _silent(bench: FrontBench) -> None:
    """The memory owes answers that never come: silence ends the abort."""
    await bench.write(read_timeout=60)
    await _loaded(bench)
    bench.memory.wrong = dict.fromkeys(range(BASES[0], BASES[0] + 64 * 200, 64), Wrong(beats=0))
    await bench.submit(rays_of("soup", 1, bench.seed, RENDERED), 1)


PHASES: dict[str, Callable[[FrontBench], Awaitable[None]]] = {
    each.__name__.strip("_"): each
    for each in (_nothing, _loading, _loaded, _waiting, _tracing, _results_wait, _full, _aborting, _silent)
}


@cocotb.test()
@cocotb.parametrize(phase=list(PHASES))
async def aborts(dut: Any, phase: str) -> None:
    """In every phase, some cycles after it has begun: an abort ends, once; nothing waits or comes behind it, events
    that had happened stay, and the unit traces again as after a reset."""
    bench = FrontBench(dut)
    await bench.begin(willing="half")
    for time in range(bench.times):
        where = f"seed {bench.seed}, {phase}, time {time}"
        bench.memory.manner, bench.memory.wrong = MEMORIES["brisk"], {}
        await bench.write(abort_over_enable=1)
        await PHASES[phase](bench)
        await ClockCycles(dut.clk, bench.rng.choice([1, 2, 5, bench.rng.randrange(60)]))
        await bench.lite.write(bench.offsets["events"], 1 << bench.places["abort_over"][1]["low"])
        before = await bench.word("events")
        await bench.write(abort=1)
        await bench.await_irq()
        status, events = await bench.word("status"), await bench.word("events")
        assert status == 0, f"{where}: status {status:#x} behind an abort"
        assert events & before == before, f"{where}: an event that had happened is gone"
        assert events >> bench.places["abort_over"][1]["low"] & 1, f"{where}: no event"
        assert bench.get("m_axi_arvalid") == 0, where
        assert phase == "silent" or not bench.memory.under_way, where
        for name in ("count_cycles", "count_rays", "count_beats"):
            assert await bench.word(name) == 0, f"{where}: {name}"
        await bench.write(read_timeout=0)
        await bench.lite.write(bench.offsets["events"], 0b111)
        for _ in range(40):
            await bench.falling
            assert (bench.get("o__valid"), bench.get("irq")) == (0, 0), f"{where}: something comes behind an abort"
        assert await bench.word("status") == 0, f"{where}: something comes behind an abort"
        if phase == "silent":
            bench.memory.forget()
            await bench.strobe("axi_forget")
        bench.memory.manner, bench.memory.wrong = Manner(), {}
        await bench.check_by_registers("handful", 2, where)
        assert await bench.field("abort_over") == 0, f"{where}: the abort has ended twice"
