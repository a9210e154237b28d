"""The traversal unit behind AXI4-Lite: registers, events and the interrupt, and rays of software and of the streams."""

from typing import Any

import cocotb
from cocotb.triggers import ClockCycles

from lightloom.golden_model.contract.formats import LOAD_ERRORS
from lightloom.verif.benches.front_bench import LIMIT, WILLING, FrontBench
from lightloom.verif.benches.traversal_bench import BASES, MEMORIES, RENDERED, rays_of
from lightloom.verif.drivers.axi_slave import Manner
from lightloom.verif.drivers.register_model import OKAY, SLVERR, WORD

QUIET = {"control": 0b1100, "submit": 0}
"""Bits of strobes that change nothing of a unit without rays: `count_clear` and `release`."""


def fields_of(registers: list[dict[str, Any]], *accesses: str) -> dict[str, dict[str, Any]]:
    return {field["name"]: field for one in registers for field in one["fields"] if field["access"] in accesses}


# --- registers --------------------------------------------------------------------------------------------------------


@cocotb.test()
@cocotb.parametrize(willing=WILLING)
async def reset_values(dut: Any, willing: str) -> None:
    """Every register behind a reset is what the table says; so it is behind one that comes while software writes."""
    bench = FrontBench(dut)
    await bench.begin(willing=willing)
    for again in range(2):
        reset = {name: field.get("reset", 0) for name, field in fields_of(bench.registers, "rw", "ro", "w1c").items()}
        for one in bench.registers:
            for half in range(one["width"] // 32):
                access = await bench.lite.read(one["offset"] + WORD * half)
                if one["name"].startswith("result_"):
                    continue  # nothing waits there
                value = sum(reset.get(field["name"], 0) << field["low"] for field in one["fields"])
                assert access.word == value >> 32 * half, f"seed {bench.seed}: {one['name']} is {access.word:#x}"
        assert bench.get("irq") == 0
        if not again:
            for one in bench.registers:
                data = bench.rng.getrandbits(32) & QUIET.get(one["name"], 0xFFFF_FFFF)
                bench.lite.write(one["offset"], data)
                bench.lite.read(one["offset"])
            await ClockCycles(dut.clk, 90)
            assert bench.lite.done > 20
            await bench.reset()


@cocotb.test()
@cocotb.parametrize(willing=WILLING)
async def accesses_at_random(dut: Any, willing: str) -> None:
    """Reads beside writes, of words that are there and of others, with any strobes; only what may change changes."""
    bench = FrontBench(dut)
    await bench.begin(willing=willing)
    rng, lite = bench.rng, bench.lite
    quiet = {bench.offsets[name]: mask for name, mask in QUIET.items()}
    end = 1 << len(dut.s_axi_awaddr)
    writable = [one["offset"] for one in bench.registers if any(field["access"] == "rw" for field in one["fields"])]
    accesses = []
    for _ in range(bench.accesses):
        address = rng.choice([rng.randrange(end), rng.choice(writable)])
        data = rng.getrandbits(32) & quiet.get(address // WORD * WORD, 0xFFFF_FFFF)
        accesses.append(lite.write(address, data, rng.choice([15, rng.getrandbits(4)])))
        accesses.append(lite.read(rng.choice([address, rng.randrange(end)])))
    for access in accesses:
        await access
    refused = {access.data is None for access in accesses if access.response == SLVERR}
    assert refused == {True, False}, f"seed {bench.seed}: reads and writes of nothing"
    for one in bench.registers:  # no status has been written
        access = await lite.read(one["offset"])
        if one["name"] == "status" or one["name"].startswith("count_"):
            assert access.word == 0, f"seed {bench.seed}: {one['name']} {access.word:#x}"


# --- events and interrupt ---------------------------------------------------------------------------------------------


CAUSES: dict[str, str] = {"load_over": "load", "abort_over": "abort", "result_came": "submit"}
"""What software writes to have an event happen."""


async def _cleared(bench: FrontBench, event: str, clear_after: int | None) -> tuple[int, int, list[int], int]:
    """From a reset on: has the event happen, and clears it so many cycles after what causes it. Returns when the cause
    and the clearing were done, the interrupt in each cycle, and the events in the end."""
    await bench.reset()
    tree = bench.tree("handful")
    await bench.load_tree(tree.blocks)
    for fields in bench.operand(rays_of("handful", 1, bench.seed, RENDERED)).values():
        await bench.write(**fields)
    await bench.write(**{f"{event}_enable": 1})
    if event == "load_over":
        await bench.ask(load_over=1)
    begin = bench.lite.cycle + 4
    cause = bench.ask(begin, **{CAUSES[event]: 1})
    clear = None if clear_after is None else bench.ask(begin + 1 + clear_after - 1, **{event: 1})
    await bench.until(lambda: bench.lite.cycle > begin + bench.settle, LIMIT, "time stands still")
    assert cause.done_at == begin + 1
    return cause.done_at, clear.done_at if clear else 0, list(bench.lite.irqs), await bench.word("events")


@cocotb.test()
@cocotb.parametrize(event=list(CAUSES))
async def events_while_they_are_cleared(dut: Any, event: str) -> None:
    """Cleared in the cycle before it happens, in the very cycle, and later: only what had happened before is cleared,
    and no other event. The interrupt is told to the cycle."""
    bench = FrontBench(dut)
    await bench.begin(memory="near")
    cause, _, irqs, events = await _cleared(bench, event, None)
    low = bench.places[event][1]["low"]
    assert events >> low & 1
    rises = next(cycle for cycle in range(cause, len(irqs)) if irqs[cycle])  # set in the cycle before
    others = events & ~(1 << low)
    for later in range(-2, 4):
        after = rises - 1 - cause + later
        if after < 2:
            continue  # a write takes two cycles
        cause_again, cleared, irqs, seen = await _cleared(bench, event, after)
        assert (cause_again, cleared - cause) == (cause, after), f"seed {bench.seed}: not as it was before"
        stays = later <= 0
        assert seen == others | stays << low, f"seed {bench.seed}: {event} cleared {later} cycles after: {seen:#x}"
        wanted = [int(cycle >= rises and (stays or cycle <= cleared)) for cycle in range(cause, len(irqs))]
        assert irqs[cause:] == wanted, f"seed {bench.seed}: {event} cleared {later} cycles after: {irqs[cause:]}"


@cocotb.test()
async def interrupt_of_every_mask(dut: Any) -> None:
    """With every set of events, under every mask; while rays run, with masks and clearings at random."""
    bench = FrontBench(dut)
    await bench.begin(willing="half")
    names = [field["name"] for field in bench.registers[2]["fields"]]
    assert names == list(fields_of(bench.registers, "w1c"))
    await bench.check_by_registers("handful", 2, "before")
    await bench.write(abort=1)
    await bench.await_field("abort_over", 1)
    present = (1 << len(names)) - 1
    assert await bench.word("events") == present
    for name in names:
        for mask in range(1 << len(names)):
            await bench.write(**{f"{each}_enable": mask >> k & 1 for k, each in enumerate(names)})
            assert await bench.word("events") == present
            assert bench.get("irq") == bool(present & mask)
        await bench.ask(**{name: 1})
        present &= ~(1 << names.index(name))
    assert await bench.word("events") == 0

    done = False

    async def meddle() -> None:
        while not done:
            choice = bench.rng.random()
            if choice < 0.3:
                await bench.lite.write(bench.offsets["event_enables"], bench.rng.getrandbits(3))
            elif choice < 0.6:
                await bench.lite.write(bench.offsets["events"], bench.rng.getrandbits(3))
            else:
                await bench.word("events")

    meddling = cocotb.start_soon(meddle())
    await bench.check_by_registers("soup", bench.few, "while events are cleared")
    done = True
    await meddling


# --- rays -------------------------------------------------------------------------------------------------------------


@cocotb.test()
@cocotb.parametrize(willing=WILLING)
async def rays_of_both(dut: Any, willing: str) -> None:
    """Software's rays and the stream's, at a time: each gets its own results, golden in all bits."""
    bench = FrontBench(dut)
    await bench.begin(willing=willing, memory="wild")
    tree = bench.tree("soup")
    await bench.load_tree(tree.blocks)
    mine, theirs = (
        bench.traced(tree.blocks, rays_of("soup", count, bench.seed + k)) for k, count in enumerate((bench.few, 60))
    )
    few = bench.traced(tree.blocks, rays_of("soup", 5, bench.seed + 2))
    bench.assert_same(await bench.trace(few), few, "by streams alone")
    assert await bench.field("result_came") == 0, f"seed {bench.seed}: a result of the stream is an event"
    await bench.write(count_clear=1)
    first = bench.number
    streams = cocotb.start_soon(bench.exchange(bench.packed(theirs), "half", "half"))
    bench.assert_same(await bench.trace_by_registers(mine), mine, "by registers")
    received = (await streams).received
    bench.assert_same(bench.answers(received, first, len(theirs)), theirs, "by streams")
    assert await bench.word("count_rays") == len(mine) + len(theirs)
    bench.check_rules()


@cocotb.test()
async def what_waits_is_held(dut: Any) -> None:
    """While a tree is being loaded, a ray waits: its registers refuse every write, and a second submission. A load
    while one is under way is of the last base. Then the ray has the golden result, once."""
    bench = FrontBench(dut)
    await bench.begin(willing="half")
    bench.memory.manner = Manner(latency=(3000, 3000))
    trees = [bench.tree(scene) for scene in ("soup", "other")]
    for tree, base in zip(trees, BASES, strict=True):
        bench.put(tree.blocks, base)
    rays = bench.traced(trees[1].blocks, rays_of("other", 1, bench.seed, RENDERED))
    await bench.set_base(BASES[0])
    await bench.write(load=1)
    await bench.submit(rays.queries, 77)
    assert await bench.field("operands_wait") == 1
    held = [one for one in bench.registers if any("held_by" in field for field in one["fields"])]
    assert len(held) > 10
    before = {one["name"]: await bench.word(one["name"]) for one in held}
    for one in held:
        access = await bench.lite.write(one["offset"], bench.rng.getrandbits(32) | 1)
        assert access.response == SLVERR, f"seed {bench.seed}: {one['name']} is written while it is held"
    assert {name: await bench.word(name) for name in before} == before
    await bench.set_base(BASES[1])
    await bench.write(load=1)
    assert await bench.field("operands_wait") == 1
    bench.memory.manner = MEMORIES["brisk"]
    await bench.await_field("result_waits", 1)
    tag, result = await bench.result()
    assert tag == 77
    bench.assert_same(result, rays, "the ray that waited")
    status = {name: await bench.field(name) for name in ("loaded", "load_error", "operands_wait", "result_waits")}
    assert status == {"loaded": 1, "load_error": 0, "operands_wait": 0, "result_waits": 0}
    assert await bench.word("count_rays") == 1
    assert (await bench.lite.write(bench.offsets["operand_tag"], 3)).response == OKAY


@cocotb.test()
async def a_load_that_is_refused(dut: Any) -> None:
    """The status says why, and the event comes as for one that is not."""
    bench = FrontBench(dut)
    await bench.begin(willing="half")
    await bench.write(load_over_enable=1)
    await bench.set_base(BASES[0] + 4)
    await bench.write(load=1)
    await bench.await_irq()
    assert await bench.field("load_error") == LOAD_ERRORS["base"]
    assert await bench.field("loaded") == 0
    assert await bench.word("events") == 1 << bench.places["load_over"][1]["low"]
