"""The traversal unit beside a memory that does not do as it was asked, with reads that end wrongly, late or never.

Whatever it does, a ray comes back with the golden result or with the error "memory", and when the memory is right
again, all rays are right again. And aborts, in whatever state the unit is.
"""

import random
from typing import Any

import cocotb
import numpy as np
from cocotb.triggers import ClockCycles, FallingEdge, RisingEdge

from lightloom.golden_model.contract.formats import BLOCK_BYTES, TRACE_ERRORS
from lightloom.golden_model.tracing.wide_bvh.encode import WideBvh
from lightloom.verif.benches.traversal_bench import BASES, MEMORIES, RENDERED, TraversalBench, rays_of
from lightloom.verif.drivers.axi_slave import Manner, Wrong
from lightloom.verif.vectors.edited_trees import with_header

MEMORY = TRACE_ERRORS["memory"]
TIMEOUT = 150
"""More than the memory's latency and all that reads wait for each other."""


def wrong_ends(beats: int, rng: random.Random) -> dict[str, tuple[Wrong, bool]]:
    """Bursts of a block of `beats` whose RLAST is wrong, and whether a beat shows that they are over."""
    last = beats - 1
    ends = {
        "no RLAST": (Wrong(beats=beats), False),
        "RLAST behind the block": (Wrong(beats=beats + 2, last=frozenset({last + 2})), True),
    }
    if beats > 1:
        early = rng.randrange(last)
        ends["RLAST too early"] = Wrong(beats=beats, last=frozenset({early})), False
        ends["RLAST twice"] = Wrong(beats=beats, last=frozenset({early, last})), True
    return ends


async def check_some_fail(bench: TraversalBench, tree: WideBvh, queries: np.ndarray, what: str) -> int:
    """Each ray has the result of the tree, or the error; returns how many have that."""
    got = await bench.trace(bench.traced(tree.blocks, queries))
    failed = got["error"] != 0
    assert set(got["error"]) <= {0, MEMORY}, f"{what}, seed {bench.seed}: {set(got['error'])}"
    assert (got["primitive"][failed] == -1).all()
    bench.assert_same(got[~failed], bench.traced(tree.blocks, queries[~failed]), what)
    return int(failed.sum())


def some_rays(bench: TraversalBench, count: int) -> np.ndarray:
    return rays_of("handful", count, bench.rng.getrandbits(16), RENDERED)


async def all_answered(bench: TraversalBench) -> None:
    """Waits until the memory has given all beats, and a little longer, until numbers are back."""
    while bench.memory.under_way:
        await RisingEdge(bench.dut.clk)
    await ClockCycles(bench.dut.clk, 100)


@cocotb.test()
async def reads_that_end_wrongly(dut: Any) -> None:
    """Where the read is over in the end, the rays that meet the block fail, and no others; where it may not be, numbers
    are used up, and more of them may. An abort makes up for it."""
    bench = TraversalBench(dut)
    await bench.begin(overlap="one")
    tree = bench.tree("handful")
    beats = BLOCK_BYTES // bench.memory.lanes
    for name, (answer, over) in wrong_ends(beats, bench.rng).items():
        await bench.check_sound(tree, f"before {name}")
        queries = bench.some_cut_short(some_rays(bench, bench.few), tree)
        some = bench.rng.sample(range(1, len(tree.blocks)), 6)
        wrong = ((tree.blocks, address, (address,)) for address in (1, *some))
        _, bad, rays = bench.met_by_some(queries, tree, wrong)
        await bench.load(tree.blocks)
        bench.memory.wrong = {BASES[0] + BLOCK_BYTES * bad: answer}
        if over:
            await bench.check_failing(rays, tree, MEMORY, bad, name)
        else:
            assert await check_some_fail(bench, tree, queries, name)
        bench.memory.wrong = {}
        if not over:
            await bench.abort()
    await bench.check_sound(tree, "after all")


@cocotb.test()
@cocotb.parametrize(overlap=["one", "most"])
async def late_reads(dut: Any, overlap: str) -> None:
    """Rays that wait for a read that takes too long fail; when it has come, it is nobody's, and all is well again."""
    bench = TraversalBench(dut)
    await bench.begin(overlap=overlap)
    dut.read_timeout.value = TIMEOUT
    tree = bench.tree("handful")
    beats = BLOCK_BYTES // bench.memory.lanes
    await bench.check_sound(tree, "before")
    for round_ in range(2):
        await bench.load(tree.blocks)
        for bad in bench.rng.sample(range(1, len(tree.blocks)), 3):
            answer = Wrong(beats=beats, last=frozenset({beats - 1}), after=bench.rng.choice((3, 5)) * TIMEOUT)
            bench.memory.wrong[BASES[0] + BLOCK_BYTES * bad] = answer
        bench.memory.wrong[BASES[0] + BLOCK_BYTES] = answer  # the root
        first, offered = bench.number, bench.packed(bench.traced(tree.blocks, some_rays(bench, bench.few)))
        seen = await bench.exchange(offered)
        got = bench.answers(seen.received, first, len(offered))
        assert (got["error"] == MEMORY).any(), "no read was late"
        bench.memory.wrong = {}
        await all_answered(bench)
        await bench.check(bench.traced(tree.blocks, some_rays(bench, bench.few)), f"round {round_}")


@cocotb.test()
async def reads_that_never_end(dut: Any) -> None:
    """Of two blocks too few beats come, or none: no ray waits for ever, and none gets another block's data."""
    bench = TraversalBench(dut)
    await bench.begin()
    dut.read_timeout.value = TIMEOUT
    tree = bench.tree("handful")
    beats = BLOCK_BYTES // bench.memory.lanes
    for missing in (1, beats):
        await bench.load(tree.blocks)
        bad = bench.rng.sample(range(2, len(tree.blocks)), len(tree.blocks) // 3)
        bench.memory.wrong = {
            BASES[0] + BLOCK_BYTES * address: Wrong(beats=beats - missing, last=frozenset({beats - missing - 1}))
            for address in bad
        }
        queries = some_rays(bench, 2 * bench.few)
        first, offered = bench.number, bench.packed(bench.traced(tree.blocks, queries))
        seen = await bench.exchange(offered)
        got = bench.answers(seen.received, first, len(offered))
        sound = got["error"] == 0
        assert set(got["error"]) == {0, MEMORY} or not sound.any()
        bench.assert_same(got[sound], bench.traced(tree.blocks, queries[sound]), f"{missing} beats missing")
        bench.memory.wrong = {}
        await bench.reset()
        await bench.check_sound(tree, "after a reset of all")


@cocotb.test()
async def headers_that_cannot_be_read(dut: Any) -> None:
    """Addresses that no tree can have are refused, without a read or with the header; so are late and wrong reads."""
    bench = TraversalBench(dut)
    await bench.begin()
    dut.read_timeout.value = TIMEOUT
    tree = bench.tree("handful")
    beats = BLOCK_BYTES // bench.memory.lanes
    for base in (BASES[0] + 1, BASES[0] + 32, 0xFE0):
        await bench.load(tree.blocks)
        bursts = bench.memory.bursts
        await bench.load_from(base, "base")
        assert bench.memory.bursts == bursts
        queries = some_rays(bench, 5)
        await bench.check(bench.traced(tree.blocks, queries, bad_blocks=[0]), f"base {base:#x}")
    top = (1 << len(dut.base)) - BLOCK_BYTES * len(tree.blocks)
    await bench.load(tree.blocks, base=top)
    await bench.check(bench.traced(tree.blocks, some_rays(bench, bench.few)), "at the end of the address space")
    await bench.load(with_header(tree.blocks, blocks=len(tree.blocks) + 1), base=top, error="size")
    for name, (answer, over) in wrong_ends(beats, bench.rng).items():
        bench.memory.wrong = {BASES[0]: answer}
        await bench.load(tree.blocks, error="memory")
        bench.memory.wrong = {}
        if over:
            await all_answered(bench)
        else:
            await bench.load(tree.blocks, error="memory")
            await bench.abort()
        await bench.check_sound(tree, f"after {name}")
    bench.memory.wrong = {BASES[0]: Wrong(beats=beats, last=frozenset({beats - 1}), after=4 * TIMEOUT)}
    await bench.load(with_header(tree.blocks, root=0), error="memory")
    bench.memory.wrong = {}
    await bench.load(tree.blocks, error="memory")  # at once: the other one is still under way
    await all_answered(bench)
    await bench.check_sound(tree, "after a late header")


@cocotb.test()
@cocotb.parametrize(memory=["far", "wild"])
async def abort_in_flight(dut: Any, memory: str) -> None:
    """At any time, with rays and reads under way: the reads are finished, and then all is as new."""
    bench = TraversalBench(dut)
    await bench.begin(memory=memory)
    tree = bench.tree("soup")
    for round_ in range(4):
        await bench.load(tree.blocks)
        rays = bench.traced(tree.blocks, rays_of("soup", bench.contexts + 2 * bench.few, bench.seed + round_, RENDERED))
        end = bench.rng.randint(20, 300)
        seen = await bench.exchange(bench.packed(rays), give="always", until=lambda cycle, end=end: cycle == end)
        assert len(seen.sent_at) > len(seen.received), "nothing is under way"
        if round_ % 2:
            await bench.result_waits()
        await bench.abort(strobes=1 + round_ % 2 * 5, load=round_ % 3 == 1)
        some = rays_of("soup", 5, bench.seed)
        await bench.check(bench.traced(tree.blocks, some, bad_blocks=[0]), "no tree after an abort")
        await bench.check_sound(tree, f"round {round_}, after an abort in cycle {end}")


@cocotb.test()
async def abort_while_a_tree_is_loaded(dut: Any) -> None:
    """In every cycle of a load, from before its address is taken until behind its end; also of an idle unit."""
    bench = TraversalBench(dut)
    await bench.begin(memory="stalled")
    tree = bench.tree("handful")
    bench.put(tree.blocks)
    for cycles in (0, 1, 2, 3, 4, 6, 8, 12, 20, 60):
        await bench.ask_to_load()
        if cycles:
            await ClockCycles(dut.clk, cycles)
        await bench.abort()
        await bench.abort()
    await bench.check_sound(tree, "after aborts of loads")


@cocotb.test()
@cocotb.parametrize(timeout=[0, 60])
async def abort_while_an_address_waits(dut: Any, timeout: int) -> None:
    """The memory takes no address: the one that is offered stays until it does, and no other follows. A timeout does
    not change that."""
    bench = TraversalBench(dut)
    await bench.begin(memory="near")
    dut.read_timeout.value = timeout
    tree = bench.tree("soup")
    await bench.load(tree.blocks)
    offered = bench.packed(bench.traced(tree.blocks, rays_of("soup", bench.contexts, bench.seed, RENDERED)))
    bench.memory.manner = Manner(stall=1.0)
    await bench.exchange(offered, give="always", until=lambda cycle: cycle == 150)
    await FallingEdge(dut.clk)
    assert int(dut.m_axi_arvalid.value)
    bursts = bench.memory.bursts

    async def opens() -> None:
        await ClockCycles(dut.clk, 100)
        assert int(dut.aborting.value)
        assert int(dut.m_axi_arvalid.value)
        bench.memory.manner = MEMORIES["wild"]

    task = cocotb.start_soon(opens())
    await RisingEdge(dut.clk)
    assert await bench.abort() >= 100
    await task
    assert bench.memory.bursts - bursts >= 1
    dut.read_timeout.value = 0  # too short for this memory
    await bench.check_sound(tree, "after an abort with an address that waits")


@cocotb.test()
@cocotb.parametrize(ends=["early", "late"])
async def abort_while_bursts_are_wrong(dut: Any, ends: str) -> None:
    """Every block comes with too few beats, or none, or with too many. No count of beats says when that is over, but
    with a timeout all that comes comes before the end of the abort, and behind it all is well."""
    bench = TraversalBench(dut)
    await bench.begin(memory="far")
    tree = bench.tree("soup")
    beats = BLOCK_BYTES // bench.memory.lanes
    for round_ in range(3):
        dut.read_timeout.value = 0 if round_ == 1 else TIMEOUT
        await bench.load(tree.blocks)
        for number in range(1, len(tree.blocks)):
            come = bench.rng.randrange(beats) if ends == "early" else beats + bench.rng.randint(1, 3)
            bench.memory.wrong[BASES[0] + BLOCK_BYTES * number] = Wrong(beats=come, last=frozenset({come - 1}))
        offered = bench.packed(bench.traced(tree.blocks, rays_of("soup", bench.contexts, bench.seed, RENDERED)))
        end = bench.rng.randint(130, 400)
        await bench.exchange(offered, give="always", until=lambda cycle, end=end: cycle == end)
        abort = cocotb.start_soon(bench.abort())
        if round_ == 1 and ends == "early":
            await ClockCycles(dut.clk, 500)
            assert int(dut.aborting.value), "what is missing is not waited for"
        dut.read_timeout.value = TIMEOUT
        assert await abort > TIMEOUT
        await bench.forget()
        bench.memory.wrong = {}
        await bench.check_sound(tree, f"round {round_}, after an abort in cycle {end}")
