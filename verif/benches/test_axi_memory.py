"""Bench of the memory of the simulations, sim/axi_memory.v, as it is read: its data, its timing, the rules of AXI4."""

import json
from pathlib import Path
from typing import Any

import cocotb
from cocotb.triggers import ClockCycles, FallingEdge
from cocotbext.axi import AxiBurstType, AxiResp

from lightloom.verif.benches.axi_memory_bench import CONTENT, INCR, Bench, willing


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
