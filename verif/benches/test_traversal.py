"""The traversal unit and trees that are right: every ray comes back once, with the golden result, whoever stalls."""

from typing import Any

import cocotb
import numpy as np
from cocotb.triggers import FallingEdge, RisingEdge

from lightloom.golden_model.contract import bitpack
from lightloom.golden_model.contract.formats import BLOCK_BYTES, TRIANGLE_BLOCK
from lightloom.golden_model.stimuli.ray_families import RAY_FAMILIES
from lightloom.verif.benches.test_stream_unit import payloads
from lightloom.verif.benches.traversal_bench import BASES, MEMORIES, RENDERED, RaySteps, TraversalBench, rays_of
from lightloom.verif.drivers.axi_slave import Manner
from lightloom.verif.vectors.edited_trees import edited, leaves_with

SHARES = {
    ("cornell-box", "wild", "half", "half", "most"): 0.25,
    ("crowd", "wild", "bursts", "half", "most"): 0.05,
    ("cornell-box", "stalled", "bursts", "bursts", "one"): 0.2,
    ("soup", "stalled", "half", "bursts", "most"): 0.15,
    ("soup", "wild", "bursts", "half", "one"): 0.05,
    ("triangle", "stalled", "half", "half", "most"): 0.15,
    ("triangle", "wild", "half", "rare", "one"): 0.05,
    ("empty", "stalled", "bursts", "half", "most"): 0.1,
}
"""Scene, memory, how rays are given and taken, visits of a ray under way: what part of the rays."""


@cocotb.test()
@cocotb.parametrize(run=list(SHARES))
async def all_sides_stalled(dut: Any, run: tuple[str, str, str, str, str]) -> None:
    """Rays, results, addresses and data stall at random: every ray comes back once, with the golden result."""
    scene, memory, give, take, overlap = run
    bench = TraversalBench(dut)
    await bench.begin(memory=memory, overlap=overlap)
    tree = bench.tree(scene)
    await bench.load(tree.blocks)
    families = RENDERED if scene == "crowd" else tuple(RAY_FAMILIES)
    rays = bench.traced(tree.blocks, rays_of(scene, round(bench.rays * SHARES[run]), bench.seed, families))
    await bench.check(rays, f"{run}", give, take)
    bench.tell(rays)
    if memory == "wild" and scene != "triangle":
        assert bench.memory.overtaken > 5
        assert bench.memory.mixed > 5 or bench.memory.lanes == BLOCK_BYTES


@cocotb.test()
async def ray_by_ray_step_by_step(dut: Any) -> None:
    """One ray at a time, one visit at a time, beside the golden traversal: after each its result, and all counters."""
    bench = TraversalBench(dut)
    await bench.begin(overlap="one")
    tree = bench.tree("soup")
    await bench.load(tree.blocks)
    await bench.clear_counters()
    rays = bench.traced(tree.blocks, rays_of("soup", 2 * bench.few, bench.seed + 1))
    steps = bench.stepped(RaySteps(rays), "traversal")
    for k in range(len(rays)):
        result = await bench.trace(rays.only(np.arange(k, k + 1)))
        seen = bench.counters(steps.model.state(), "count_")
        query = payloads(rays.queries[k : k + 1], np.zeros(1))[0]
        steps.step({"ray": k, "query": query}, {"result": payloads(result, np.zeros(1))[0], **seen})
    assert steps.number == len(rays)


@cocotb.test()
@cocotb.parametrize(memory=["near", "far"])
async def nothing_stalled(dut: Any, memory: str) -> None:
    """Everybody is always willing, so that the unit itself is what holds rays up."""
    bench = TraversalBench(dut)
    await bench.begin(memory=memory)
    tree = bench.tree("cornell-box")
    await bench.load(tree.blocks)
    rays = bench.traced(tree.blocks, rays_of("cornell-box", 4 * bench.few, bench.seed, RENDERED))
    await bench.check(rays, memory, "always", "always")
    bench.tell(rays)


@cocotb.test()
@cocotb.parametrize(closed=["results", "memory", "both"])
async def one_side_closed(dut: Any, closed: str) -> None:
    """Nobody takes results, or the memory does not answer: the unit holds what it has, and then goes on with it."""
    bench = TraversalBench(dut)
    await bench.begin()
    tree = bench.tree("soup")
    await bench.load(tree.blocks)
    rays = bench.traced(tree.blocks, rays_of("soup", bench.contexts + 30, bench.seed, RENDERED))
    offered = bench.packed(rays)
    if closed != "results":
        bench.memory.manner = Manner(stall=1.0)
    take = "half" if closed == "memory" else "never"
    before = await bench.exchange(offered, "always", take, until=lambda cycle: cycle == 400)
    sent = len(before.sent_at)
    assert bench.contexts <= sent < len(rays), f"{sent} of {len(rays)} rays went in"
    assert not before.received or closed == "memory"
    bench.memory.manner = MEMORIES["brisk"]
    after = await bench.exchange(offered[sent:], expected=len(rays) - len(before.received))
    results = bench.answers(before.received + after.received, 0, len(rays))
    bench.assert_same(results, rays, closed)
    bench.note(rays.queries, results)


@cocotb.test()
async def all_wait_for_the_root(dut: Any) -> None:
    """All contexts visit the root at once and enter all boxes: stacks hold up the node stage, and that its cache."""
    bench = TraversalBench(dut)
    await bench.begin()
    tree = bench.tree("soup")
    await bench.load(tree.blocks)
    some = bench.traced(tree.blocks, rays_of("soup", 8 * bench.contexts, bench.seed))
    rays = some.only(np.full(bench.contexts, np.argmax(some.counts["node_tests"])))
    await bench.clear_counters()
    bench.memory.manner = Manner(stall=1.0)
    offered = bench.packed(rays)
    await bench.exchange(offered, "always", "always", until=lambda cycle: cycle == 200)
    bench.memory.manner = MEMORIES["near"]
    after = await bench.exchange([], take="always", expected=len(rays))
    bench.assert_same(bench.answers(after.received, 0, len(rays)), rays, "root")
    stalled = bench.get("count_node_stalled")
    # Longer than the registers on both sides of the node stage hide it.
    assert stalled > 3, f"seed {bench.seed}: the node stage was held up for {stalled} cycles"


@cocotb.test()
async def what_the_caches_count(dut: Any) -> None:
    """A ray by itself misses all blocks, then finds them; many at once wait for what one of them has asked for."""
    bench = TraversalBench(dut)
    await bench.begin(overlap="one", memory="near")
    tree = bench.tree("handful")
    some = bench.traced(tree.blocks, rays_of("handful", 8 * bench.contexts, bench.seed))
    # One for whose blocks the caches have room, whatever their sets are.
    fits = (some.counts["leaf_visits"] > 1) & (some.counts["node_tests"] > 2)
    least = np.argmin(np.where(fits, some.counts["node_tests"], 1000))
    nodes, triangles = (int(some.counts[name][least]) for name in ("node_tests", "leaf_visits"))
    assert fits.any()

    async def counted(copies: int) -> tuple[dict[str, int], int]:
        """The counters of both caches after so many rays at once, and how many blocks of nodes were read."""
        await bench.clear_counters()
        first = len(bench.memory.reads)
        await bench.trace(some.only(np.full(copies, least)), "always", "always")
        read = (np.array(bench.memory.reads[first:], dtype=np.int64) - BASES[0]) // BLOCK_BYTES
        names = [f"{cache}_{what}" for cache in ("node", "triangle") for what in ("hits", "misses", "merged")]
        return bench.counters(names, "count_"), int((~tree.triangle_blocks[read]).sum())

    await bench.load(tree.blocks)
    seen, read = await counted(1)
    assert (seen["node_misses"], seen["node_hits"], seen["node_merged"]) == (read, nodes - read, 0)
    assert seen["triangle_misses"] + seen["triangle_merged"] > 0
    seen, _ = await counted(1)
    assert seen == dict.fromkeys(seen, 0) | {"node_hits": nodes, "triangle_hits": triangles}
    await bench.load(tree.blocks)
    bench.memory.manner = MEMORIES["far"]
    seen, again = await counted(bench.contexts)
    assert (again, seen["node_misses"]) == (read, read)
    assert seen["node_merged"] >= bench.contexts - 1, "all others wait for the root"
    assert sum(seen[f"node_{what}"] for what in ("hits", "misses", "merged")) == nodes * bench.contexts


# --- other trees ------------------------------------------------------------------------------------------------------


@cocotb.test()
async def another_tree(dut: Any) -> None:
    """Loaded at the same place and at another one: nothing of the tree before is left in the caches."""
    bench = TraversalBench(dut)
    await bench.begin()
    blocks = {scene: bench.tree(scene).blocks for scene in ("soup", "other", "triangle")}
    # The same nodes, so that the rays look for the same triangles; but these have other numbers.
    blocks["renumbered"] = blocks["soup"]
    for _, address in leaves_with(bench.tree("soup"), count=1):
        numbers = bitpack.unpack(blocks["soup"][address : address + 1], TRIANGLE_BLOCK)["primitive"]
        blocks["renumbered"] = edited(blocks["renumbered"], address, TRIANGLE_BLOCK, primitive=numbers + 100)
    queries = rays_of("soup", bench.few, bench.seed, RENDERED)
    places = [
        ("soup", 0),
        ("renumbered", 0),
        ("other", 0),
        ("other", 1),
        ("triangle", 1),
        ("soup", 1),
        ("renumbered", 1),
    ]
    for scene, base in places:
        await bench.load(blocks[scene], base=BASES[base])
        # The last one's blocks are still in the cache.
        queries = queries[::-1]
        await bench.check(bench.traced(blocks[scene], queries), f"{scene} at {BASES[base]:#x}")


@cocotb.test()
async def another_tree_while_rays_are_under_way(dut: Any) -> None:
    """They are finished in the tree before; of several loads asked for in that time, the last one counts."""
    bench = TraversalBench(dut)
    await bench.begin(memory="wild")
    old, new = bench.tree("soup"), bench.tree("other")
    for round_ in range(3):
        await bench.load(old.blocks)
        bench.put(new.blocks, BASES[1])
        queries = rays_of("soup", bench.contexts + 2 * bench.few, bench.seed + round_, RENDERED)
        first, offered = bench.number, bench.packed(bench.traced(old.blocks, queries))
        end = 60 * (round_ + 1)
        before = await bench.exchange(offered, give="always", until=lambda cycle, end=end: cycle == end)
        sent, came = len(before.sent_at), len(before.received)
        assert came < sent < len(queries), f"{sent} sent, {came} received: nothing is under way"
        if round_:
            await bench.ask_to_load(BASES[0] + BLOCK_BYTES)  # no header is there
        await bench.ask_to_load(BASES[1])
        after = await bench.exchange(offered[sent:], expected=len(queries) - came)
        assert (int(dut.loaded.value), int(dut.load_error.value)) == (1, 0)
        got = bench.answers(before.received + after.received, first, len(queries))
        bench.assert_same(got[:sent], bench.traced(old.blocks, queries[:sent]), "the tree before")
        bench.assert_same(got[sent:], bench.traced(new.blocks, queries[sent:]), "the new tree")


@cocotb.test()
async def reset_in_flight(dut: Any) -> None:
    """A reset drops all rays and the tree; then the unit works as new."""
    bench = TraversalBench(dut)
    await bench.begin(memory="wild")
    tree = bench.tree("soup")
    for cycles in (40, 90, 250):
        await bench.load(tree.blocks)
        rays = bench.traced(tree.blocks, rays_of("soup", bench.contexts + 2 * bench.few, cycles, RENDERED))
        seen = await bench.exchange(
            bench.packed(rays), give="always", until=lambda cycle, cycles=cycles: cycle == cycles
        )
        assert len(seen.sent_at) > len(seen.received), "nothing is under way"
        await bench.reset()
        await FallingEdge(dut.clk)
        seen_now = [int(getattr(dut, name).value) for name in ("o__valid", "loaded", "load_error", "count_rays")]
        assert seen_now == [0, 0, 0, 0]
        await RisingEdge(dut.clk)
        some = rays_of("soup", 10, bench.seed)
        await bench.check(bench.traced(tree.blocks, some, bad_blocks=[0]), "no tree after a reset")
        await bench.check_sound(tree, "after a reset")
