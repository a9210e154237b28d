"""Bench of the memory of the simulations, sim/axi_memory.v, as it is written: the same, and both at a time."""

import json
from pathlib import Path
from typing import Any

import cocotb
from cocotb.triggers import ClockCycles, FallingEdge
from cocotbext.axi import AxiBurstType, AxiResp

from lightloom.verif.benches.axi_memory_bench import CONTENT, Bench, WriteChannels, willing


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
