"""Bench of the traversal unit beside an AXI4 memory of cocotbext-axi: every ray comes back once, and right.

What is right is what the golden traversal says (`golden_model.wide_traversal`), in all bits, in whatever order rays
come back. With one visit of a ray under way, the counters are the golden ones too.
"""

import functools
import itertools
import json
import os
import random
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import cocotb
import numpy as np
from cocotb.triggers import FallingEdge, RisingEdge
from cocotbext.axi import AxiResp

from golden_model import bitpack
from golden_model.formats import (
    BLOCK_BYTES,
    BVH_HEADER,
    LOAD_ERRORS,
    NODE_BLOCK,
    RAY_QUERY,
    RAY_RESULT,
    TRACE_ERRORS,
    TRIANGLE,
    TRIANGLE_BLOCK,
)
from golden_model.ray_families import RAY_FAMILIES
from golden_model.scene import load_scene
from golden_model.units import COUNTERS
from golden_model.wide_bvh import WideBvh, build_wide
from golden_model.wide_traversal import COUNTS, queries_of, trace_tree
from verif.axi_slave import AxiSlave, Manner
from verif.bench import payloads
from verif.coverage import StreamCycles, note
from verif.stream import Exchange, StreamDriver, pattern
from verif.traversal_bins import channel_groups, counter_groups, load_groups, memory_groups, ray_groups

LOAD_CYCLES = 2000
"""Cycles after which a tree must have been loaded or refused."""
LINGER = 40
"""Cycles in which no result comes, when all have come."""
BASES = (0x12_3456_7FC0, 0x80)
"""Byte addresses of trees: one beyond 32 bits, and not on a page's boundary."""

RENDERED = ("diffuse", "camera", "shadow")
"""Families of rays of which none meets all boxes."""
NEVER = itertools.repeat(False)
MEMORIES = {
    "near": Manner(),
    "far": Manner(latency=(100, 100), stall=0.1),
    "brisk": Manner(latency=(0, 6), stall=0.25, reorder=True, interleave=True),
    "stalled": Manner(latency=(0, 20), stall=0.5),
    "wild": Manner(latency=(0, 40), stall=0.3, reorder=True, interleave=True),
}


# --- scenes, trees and rays -------------------------------------------------------------------------------------------


def soup(count: int, seed: int, size: float) -> np.ndarray:
    """TRIANGLE (count,) that overlap, so that rays enter many boxes."""
    rng = np.random.default_rng(seed)
    corners = (rng.uniform(-1, 1, (count, 1, 3)) + rng.normal(0, size, (count, 3, 3))).astype(np.float32)
    triangles = np.zeros(count, dtype=TRIANGLE)
    for k, name in enumerate(TRIANGLE.names or ()):
        triangles[name] = corners[:, k]
    return triangles


SOUPS = {
    "soup": (60, 1, 0.25),
    "other": (60, 2, 0.25),
    "triangle": (1, 3, 0.25),
    "empty": (0, 4, 0.25),
    "crowd": (400, 6, 0.1),  # no cache has room for it
    "handful": (24, 5, 0.2),  # rays are through with it in a short time
}
"""Number of triangles, seed, size."""


@functools.cache
def triangles_of(scene: str) -> np.ndarray:
    """One of SOUPS, or a scene of the golden model."""
    return soup(*SOUPS[scene]) if scene in SOUPS else load_scene(scene).triangles


def rays_of(scene: str, count: int, seed: int, families: tuple[str, ...] = tuple(RAY_FAMILIES)) -> np.ndarray:
    """RAY_QUERY (count,), an equal part of each family, mixed; of all kinds, with all masks."""
    rng = np.random.default_rng([seed, 5])
    triangles = triangles_of(scene if scene != "empty" else "soup")
    part = -(-count // len(families))
    rays = np.concatenate([RAY_FAMILIES[family](triangles, part, seed) for family in families])
    rays = rays[rng.permutation(len(rays))[:count]]
    any_hit, cull = rng.random((2, count)) < [[0.4], [0.3]]
    return queries_of(rays, any_hit=any_hit, cull=cull, mask=rng.choice([0, 1, 3, 255], count, p=[0.1, 0.2, 0.1, 0.6]))


def edited(blocks: np.ndarray, address: int, layout: np.dtype, /, **fields: Any) -> np.ndarray:
    """The tree with other values in fields of one block."""
    out = blocks.copy()
    record = bitpack.unpack(out[address : address + 1], layout)
    for name, value in fields.items():
        record[name] = value
    out[address] = bitpack.pack(record)[0]
    return out


def with_header(blocks: np.ndarray, /, **fields: int) -> np.ndarray:
    """The tree with other values in its header, and the check word that they need, unless that is among them."""
    out = edited(blocks, 0, BVH_HEADER, **fields)
    if "check" not in fields:
        out[0, -1] ^= np.bitwise_xor.reduce(out[0])
    return out


# --- the bench --------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Rays:
    """Rays with what has to come back for them."""

    queries: np.ndarray
    results: np.ndarray
    counts: np.ndarray

    def __len__(self) -> int:
        return len(self.queries)

    def only(self, which: np.ndarray) -> "Rays":
        return Rays(self.queries[which], self.results[which], self.counts[which])


class Bench:
    """The unit with its memory, and the tree that is loaded."""

    def __init__(self, dut: Any) -> None:
        run = json.loads(os.environ["LIGHTLOOM_BENCH"])
        self.dut = dut
        self.seed: int = run["seed"]
        self.rays: int = run["rays"]
        self.few: int = run["few"]
        self.patience: int = run["patience"]
        self.width: int = run["width"]
        self.stack: int = run["stack"]
        self.overlap: int = run["overlap"]
        self.contexts: int = run["contexts"]
        self.lines: dict[str, int] = run["lines"]
        self.tag_width = len(dut.i__payload) - bitpack.width(RAY_QUERY)
        self.rng = random.Random(self.seed)
        self.streams = StreamDriver(dut)
        self.number = 0
        """Rays so far: their numbers are their tags."""
        self.blocks = build_wide(triangles_of("empty")).blocks
        """The tree that was loaded last."""
        cocotb.log.info("traversal, %s", run)

    async def start(self, *, overlap: str = "most", memory: str = "brisk") -> None:
        """`overlap`: "one" visit of a ray at a time, or as many as there can be."""
        dut = self.dut
        dut.load.value = dut.count_clear.value = dut.base.value = 0
        dut.overlap.value = 1 if overlap == "one" else self.overlap
        dut.rst.value = 1
        self.memory = AxiSlave(dut, "m_axi", rng=self.rng)
        self.memory.manner = MEMORIES[memory]
        await self.streams.start()

    def tree(self, scene: str) -> WideBvh:
        triangles = triangles_of(scene)
        masks = np.random.default_rng(self.seed).choice(np.array([1, 2, 255], dtype=np.uint8), len(triangles))
        return build_wide(triangles, masks=masks, width=self.width, max_levels=self.stack)

    def traced(self, blocks: np.ndarray, queries: np.ndarray, bad_blocks: Iterable[int] = ()) -> Rays:
        # The definition; and for so few rays it is faster than to load the compiled one.
        options: dict[str, Any] = {"width": self.width, "stack": self.stack, "backend": "numpy"}
        results, counts = trace_tree(blocks, queries, bad_blocks=bad_blocks, **options)
        return Rays(queries, results, counts)

    def put(self, blocks: np.ndarray, base: int = BASES[0]) -> None:
        """Into the memory."""
        self.memory.regions[base] = blocks.astype("<u4").tobytes()

    async def ask_to_load(self, base: int = BASES[0]) -> None:
        dut = self.dut
        dut.load.value, dut.base.value = 1, base
        await RisingEdge(dut.clk)
        dut.load.value, dut.base.value = 0, self.rng.getrandbits(len(dut.base))

    async def outcome(self) -> int:
        """Waits until the tree is loaded or refused; why it was refused, or 0."""
        dut, edge = self.dut, FallingEdge(self.dut.clk)
        for _ in range(LOAD_CYCLES):
            await edge
            loaded, error = int(dut.loaded.value), int(dut.load_error.value)
            assert not (loaded and error), f"loaded, and load_error {error}"
            if loaded or error:
                await RisingEdge(dut.clk)
                return error
        raise AssertionError(f"seed {self.seed}: no tree is loaded, and none refused")

    async def load(self, blocks: np.ndarray, *, base: int = BASES[0], error: str = "none") -> None:
        """Puts a tree into the memory and has it loaded, or refused because of `error`."""
        self.put(blocks, base)
        await self.ask_to_load(base)
        seen = await self.outcome()
        assert seen == LOAD_ERRORS[error], f"seed {self.seed}: load_error {seen}, not {error}"
        self.blocks = blocks
        note(lambda: load_groups(error))

    def packed(self, rays: Rays) -> list[int]:
        """What the unit is offered for rays; their tags go on where those of the rays before ended."""
        tags = np.arange(self.number, self.number + len(rays)) % (1 << self.tag_width)
        self.number += len(rays)
        return payloads(rays.queries, tags)

    def answers(self, received: list[int], first: int, count: int) -> np.ndarray:
        """Results to RAY_RESULT (count,) in the order of the rays from number `first` on: exactly one each."""
        width = bitpack.width(RAY_RESULT)
        tags = [payload >> width for payload in received]
        expected = [number % (1 << self.tag_width) for number in range(first, first + count)]
        where = f"seed {self.seed}"
        assert len(set(tags)) == len(tags), f"{where}: doubled tags {sorted(t for t in tags if tags.count(t) > 1)[:9]}"
        strange, lost = set(tags) - set(expected), set(expected) - set(tags)
        assert not strange, f"{where}: tags of no ray {sorted(strange)[:9]}"
        assert not lost, f"{where}: lost tags {sorted(lost)[:9]}"
        by_tag = dict(zip(tags, received, strict=True))
        rows = b"".join(
            (by_tag[tag] & (1 << width) - 1).to_bytes(4 * bitpack.words(RAY_RESULT), "little") for tag in expected
        )
        return bitpack.unpack(np.frombuffer(rows, dtype="<u4").reshape(count, -1), RAY_RESULT)

    def assert_same(self, got: np.ndarray, rays: Rays, what: str) -> None:
        wrong = np.flatnonzero(~bitpack.equal(got, rays.results))
        if not len(wrong):
            return
        k = slice(wrong[0], wrong[0] + 1)
        query, seen, model = (payloads(array[k], np.zeros(1))[0] for array in (rays.queries, got, rays.results))
        raise AssertionError(
            f"{what}, seed {self.seed}: {len(wrong)} of {len(rays)} results differ; ray {wrong[0]}: query {query:#x}, "
            f"result {seen:#x}, model {model:#x}; {got[k][0]}, model {rays.results[k][0]}"
        )

    async def exchange(self, offered: list[int], give: str = "half", take: str = "half", **options: Any) -> Exchange:
        patterns = pattern(give, self.rng), pattern(take, self.rng)
        options |= {"patience": self.patience, "linger": LINGER}
        return await self.streams.exchange(offered, give=patterns[0], take=patterns[1], **options)

    async def trace(self, rays: Rays, give: str = "half", take: str = "half") -> np.ndarray:
        """Rays through the unit to RAY_RESULT (N,): exactly one result each."""
        first = self.number
        seen = await self.exchange(self.packed(rays), give, take)
        assert not self.memory.under_way, "all rays are back, and the memory has not answered all reads"
        results = self.answers(seen.received, first, len(rays))
        self.note(rays.queries, results)
        return results

    def note(self, queries: np.ndarray, results: np.ndarray) -> None:
        """What rays have met since the last call."""
        memory = self.memory
        note(lambda: ray_groups(queries, results, self.blocks))
        note(lambda: memory_groups(memory.overtaken, memory.mixed, memory.most_under_way > 1))
        note(lambda: channel_groups(memory.cycles))
        memory.cycles = StreamCycles(*memory.cycles.names)

    async def check(self, rays: Rays, what: str, give: str = "half", take: str = "half") -> None:
        """Rays through the unit: the golden results; and the golden counters, where rays make one visit at a time."""
        await self.clear_counters()
        beats = self.memory.beats
        self.assert_same(await self.trace(rays, give, take), rays, what)
        seen = self.counters()
        expected = {"rays": len(rays), "beats": self.memory.beats - beats}
        if int(self.dut.overlap.value) == 1:
            expected |= {"errors": int((rays.results["error"] != 0).sum())}
            expected |= {name: int(rays.counts[name].sum()) for name in COUNTS.names or ()}
        assert {name: seen[name] for name in expected} == expected, f"{what}, seed {self.seed}"
        note(lambda: counter_groups(self.counters(COUNTERS), self.lines))

    def counters(self, names: Iterable[str] = ("rays", "errors", "beats", *(COUNTS.names or ()))) -> dict[str, int]:
        return {name: int(getattr(self.dut, f"count_{name}").value) for name in names}

    async def check_sound(self, tree: WideBvh, what: str) -> None:
        """Loads a good tree, and a few rays through it."""
        await self.load(tree.blocks)
        queries = rays_of("handful", self.few // 2, self.rng.getrandbits(16), RENDERED)
        rays = self.traced(tree.blocks, queries)
        assert not rays.results["error"].any()
        await self.check(rays, what)

    def some_cut_short(self, queries: np.ndarray, tree: WideBvh) -> np.ndarray:
        """The queries, every other one ended just before what it hits in the tree, so that it hits nothing.

        Such a ray visits the same blocks in whatever order: nothing that it finds spares it a visit.
        """
        nearest = queries.copy()
        nearest["any_hit"] = 0
        hits = self.traced(tree.blocks, nearest).results
        cut = (hits["primitive"] >= 0) & (np.arange(len(queries)) % 2 == 0)
        out = queries.copy()
        out["t_max"][cut] = np.nextafter(hits["t"][cut], np.float32(-np.inf))
        assert (self.traced(tree.blocks, out[cut]).results["primitive"] == -1).all()
        return out

    def surely_failing(self, rays: Rays, tree: WideBvh) -> np.ndarray:
        """Which of the rays, with what comes back where a block of `tree` is wrong, fail in whatever order they make
        their visits: those that fail and would have hit nothing."""
        return (rays.results["error"] != 0) & (self.traced(tree.blocks, rays.queries).results["primitive"] == -1)

    def met_by_some(
        self, queries: np.ndarray, tree: WideBvh, wrong: Iterable[tuple[np.ndarray, int, tuple[int, ...]]]
    ) -> tuple[np.ndarray, int, Rays]:
        """Of wrong copies of `tree`, each with the block that is wrong and blocks that cannot be read, one where some
        rays surely fail and some do not fail, or at least some surely do: its blocks, the wrong one, and the rays with
        what has to come back."""
        found: tuple[np.ndarray, int, Rays] | None = None
        candidates = list(wrong)
        for blocks, bad, unreadable in self.rng.sample(candidates, len(candidates)):
            rays = self.traced(blocks, queries, unreadable)
            if self.surely_failing(rays, tree).any():
                found = blocks, bad, rays
                if not rays.results["error"].all():
                    break
        assert found is not None, f"seed {self.seed}: no ray surely meets what is wrong"
        return found

    async def check_failing(self, rays: Rays, tree: WideBvh, error: int, bad: int, what: str) -> None:
        """Rays that fail with `error` at block `bad`, or are right: exactly the golden ones, one visit at a time.

        With more, a ray may make a visit that it would not have needed, or the other way round; but one that surely
        fails does.
        """
        failing = rays.results["error"] != 0
        assert set(rays.results["error"][failing]) == {error}
        assert set(rays.results["block"][failing]) == {bad}
        if int(self.dut.overlap.value) == 1:
            await self.check(rays, what)
            return
        got = await self.trace(rays)
        failed = got["error"] != 0
        self.assert_same(got[~failed], self.traced(tree.blocks, rays.queries[~failed]), what)
        failure = np.zeros(int(failed.sum()), dtype=RAY_RESULT)
        failure["error"], failure["block"], failure["primitive"] = error, bad, -1
        self.assert_same(got[failed], Rays(rays.queries[failed], failure, rays.counts[failed]), what)
        surely = self.surely_failing(rays, tree)
        assert surely.any(), f"{what}, seed {self.seed}: no ray surely meets block {bad}"
        spared = np.flatnonzero(surely & ~failed)
        assert not len(spared), f"{what}, seed {self.seed}: rays {spared[:9]} did not meet block {bad}"

    def tell(self, rays: Rays) -> None:
        memory = self.memory
        cocotb.log.info(
            "%d rays, %d cycles, %d bursts, %d overtaken, %d beats mixed, %d under way at most",
            *(len(rays), memory.cycle, memory.bursts, memory.overtaken, memory.mixed, memory.most_under_way),
        )

    async def clear_counters(self) -> None:
        self.dut.count_clear.value = 1
        await RisingEdge(self.dut.clk)
        self.dut.count_clear.value = 0


# --- trees that are right ---------------------------------------------------------------------------------------------

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
    bench = Bench(dut)
    await bench.start(memory=memory, overlap=overlap)
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
@cocotb.parametrize(memory=["near", "far"])
async def nothing_stalled(dut: Any, memory: str) -> None:
    """Everybody is always willing, so that the unit itself is what holds rays up."""
    bench = Bench(dut)
    await bench.start(memory=memory)
    tree = bench.tree("cornell-box")
    await bench.load(tree.blocks)
    rays = bench.traced(tree.blocks, rays_of("cornell-box", 4 * bench.few, bench.seed, RENDERED))
    await bench.check(rays, memory, "always", "always")
    bench.tell(rays)


@cocotb.test()
@cocotb.parametrize(closed=["results", "memory", "both"])
async def one_side_closed(dut: Any, closed: str) -> None:
    """Nobody takes results, or the memory does not answer: the unit holds what it has, and then goes on with it."""
    bench = Bench(dut)
    await bench.start()
    tree = bench.tree("soup")
    await bench.load(tree.blocks)
    rays = bench.traced(tree.blocks, rays_of("soup", bench.contexts + 30, bench.seed, RENDERED))
    offered = bench.packed(rays)
    if closed != "results":
        bench.memory.manner = Manner(stall=1.0)
    take = NEVER if closed != "memory" else pattern("half", bench.rng)
    before = await bench.streams.exchange(
        offered, give=pattern("always", bench.rng), take=take, until=lambda cycle: cycle == 400
    )
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
    bench = Bench(dut)
    await bench.start()
    tree = bench.tree("soup")
    await bench.load(tree.blocks)
    some = bench.traced(tree.blocks, rays_of("soup", 8 * bench.contexts, bench.seed))
    rays = some.only(np.full(bench.contexts, np.argmax(some.counts["node_tests"])))
    await bench.clear_counters()
    bench.memory.manner = Manner(stall=1.0)
    offered = bench.packed(rays)
    always = pattern("always", bench.rng)
    await bench.streams.exchange(offered, give=always, take=always, until=lambda cycle: cycle == 200)
    bench.memory.manner = MEMORIES["near"]
    after = await bench.exchange([], take="always", expected=len(rays))
    bench.assert_same(bench.answers(after.received, 0, len(rays)), rays, "root")
    stalled = bench.counters(["node_stalled"])["node_stalled"]
    assert stalled > 5, f"seed {bench.seed}: the node stage was held up for {stalled} cycles"


# --- trees that are wrong ---------------------------------------------------------------------------------------------


def inner_nodes(tree: WideBvh) -> list[int]:
    """Addresses of all nodes but the root."""
    return [int(address) for address in np.flatnonzero(tree.node_blocks) if address > 1]


def leaf_bits(tree: WideBvh, leaf: bool) -> Iterator[tuple[np.ndarray, int]]:
    """Trees in which one child that is a leaf, or is none, is said to be the other; and that child's address."""
    for address in map(int, np.flatnonzero(tree.node_blocks)):
        node = bitpack.unpack(tree.blocks[address : address + 1], NODE_BLOCK)[0]
        for slot in range(node["count"]):
            if (node["leaf"] >> slot & 1) == leaf:
                changed = edited(tree.blocks, address, NODE_BLOCK, leaf=node["leaf"] ^ (1 << slot))
                yield changed, int(node["base"]) + slot


def nodes_with(tree: WideBvh, **fields: Callable[[int, int], int]) -> Iterator[tuple[np.ndarray, int]]:
    """Trees in which fields of one node are what functions of its address and of its count say; and that address."""
    for address in inner_nodes(tree):
        count = int(bitpack.unpack(tree.blocks[address : address + 1], NODE_BLOCK)[0]["count"])
        values = {name: value(address, count) for name, value in fields.items()}
        yield edited(tree.blocks, address, NODE_BLOCK, **values), address


def leaves_with(tree: WideBvh, **fields: int) -> Iterator[tuple[np.ndarray, int]]:
    for address in map(int, np.flatnonzero(tree.triangle_blocks)):
        yield edited(tree.blocks, address, TRIANGLE_BLOCK, **fields), address


DAMAGES: dict[str, tuple[str, Callable[[WideBvh, int], Iterator[tuple[np.ndarray, int]]]]] = {
    "just outside": (
        "outside",
        lambda tree, _: nodes_with(tree, base=lambda address, count: len(tree.blocks) - count + 1),
    ),
    "far outside": ("outside", lambda tree, _: nodes_with(tree, base=lambda address, count: 2**32 - 1)),
    "its own child": ("order", lambda tree, _: nodes_with(tree, base=lambda address, count: address)),
    "back to the root": ("order", lambda tree, _: nodes_with(tree, base=lambda address, count: 1)),
    "triangles as a node": ("kind", lambda tree, _: leaf_bits(tree, True)),
    "a node as triangles": ("kind", lambda tree, _: leaf_bits(tree, False)),
    "too many children": ("kind", lambda tree, width: nodes_with(tree, count=lambda address, count: width + 1)),
    "no kind of node": ("kind", lambda tree, _: nodes_with(tree, kind=lambda address, count: 0)),
    "no triangle": ("kind", lambda tree, _: leaves_with(tree, count=0)),
    "three triangles": ("kind", lambda tree, _: leaves_with(tree, count=3)),
}
"""Name of a damage: the error that it gives, and trees with one block of it."""


@cocotb.test()
@cocotb.parametrize(overlap=["one", "most"])
async def damaged_blocks(dut: Any, overlap: str) -> None:
    """A block that is wrong fails the rays that meet it, with its address, and no others; before and after, none."""
    bench = Bench(dut)
    await bench.start(overlap=overlap)
    tree = bench.tree("handful")
    for name, (error, trees) in DAMAGES.items():
        await bench.check_sound(tree, f"before {name}")
        queries = rays_of("handful", bench.few, bench.rng.getrandbits(16), RENDERED)
        queries = bench.some_cut_short(queries, tree)
        blocks, bad, rays = bench.met_by_some(queries, tree, ((*wrong, ()) for wrong in trees(tree, bench.width)))
        await bench.load(blocks)
        await bench.check_failing(rays, tree, TRACE_ERRORS[error], bad, name)
    await bench.check_sound(tree, "after all")


@cocotb.test()
@cocotb.parametrize(overlap=["one", "most"])
async def memory_errors(dut: Any, overlap: str) -> None:
    """SLVERR and DECERR for one block: as above; and when the memory is whole again, so is the tree, as it is."""
    bench = Bench(dut)
    await bench.start(overlap=overlap)
    tree = bench.tree("handful")
    kinds = {"nodes": inner_nodes(tree), "triangles": np.flatnonzero(tree.triangle_blocks).tolist(), "root": [1]}
    for response in (AxiResp.SLVERR, AxiResp.DECERR):
        for name, addresses in kinds.items():
            await bench.check_sound(tree, f"before {name}")
            queries = rays_of("handful", bench.few, bench.rng.getrandbits(16), RENDERED)
            queries = bench.some_cut_short(queries, tree)
            wrong = ((tree.blocks, address, (address,)) for address in addresses)
            _, bad, rays = bench.met_by_some(queries, tree, wrong)
            await bench.load(tree.blocks)  # what was read before is forgotten
            bench.memory.errors = {BASES[0] + BLOCK_BYTES * bad: response}
            await bench.check_failing(rays, tree, TRACE_ERRORS["memory"], bad, f"{response!r} for {name}")
            bench.memory.errors = {}
            await bench.check(bench.traced(tree.blocks, rays.queries), f"{name}: a memory that is whole again")


@cocotb.test()
async def a_tree_that_is_cut_short(dut: Any) -> None:
    """A header that promises more blocks than there are, and a node whose children would be there: memory errors."""
    bench = Bench(dut)
    await bench.start(overlap="one")
    tree = bench.tree("handful")
    await bench.check_sound(tree, "before")
    count = len(tree.blocks)
    longer = WideBvh(with_header(tree.blocks, blocks=count + 100))
    queries = rays_of("handful", bench.few, bench.seed, RENDERED)
    wrong = nodes_with(longer, base=lambda address, _: count + 5)
    blocks, _, rays = bench.met_by_some(queries, tree, ((*each, ()) for each in wrong))
    for number in range(count, count + 100):
        bench.memory.errors[BASES[0] + BLOCK_BYTES * number] = AxiResp.DECERR
    await bench.load(blocks)
    assert set(rays.results["error"]) == {0, TRACE_ERRORS["memory"]}
    await bench.check(rays, "children beyond the end")
    await bench.check_sound(tree, "after")


@cocotb.test()
@cocotb.parametrize(overlap=["one", "most"])
async def too_few_levels(dut: Any, overlap: str) -> None:
    """A tree deeper than its header says may fill the stack: such rays fail, the others are right."""
    bench = Bench(dut)
    await bench.start(overlap=overlap)
    tree = bench.tree("soup")
    await bench.load(with_header(tree.blocks, levels=1))
    rays = bench.traced(with_header(tree.blocks, levels=1), rays_of("soup", 4 * bench.few, bench.seed))
    failed = (rays.results["error"] == TRACE_ERRORS["header"]).mean()
    assert failed < 0.9
    assert failed > 0 or bench.stack > 10, "no ray fills the stack"
    if overlap == "one":
        await bench.check(rays, "levels 1")
    else:
        got = await bench.trace(rays)
        whole = bench.traced(tree.blocks, rays.queries)
        sound = got["error"] == 0
        bench.assert_same(got[sound], whole.only(sound), "levels 1")
        assert set(got["error"]) <= {0, TRACE_ERRORS["header"]}
    await bench.check_sound(tree, "after")


HEADERS: dict[str, tuple[str, Callable[[Bench], dict[str, int]]]] = {
    "magic": ("magic", lambda bench: {"magic": 1}),
    "version": ("version", lambda bench: {"version": 2}),
    "check": ("check", lambda bench: {"check": bench.rng.getrandbits(32) | 1}),
    "too wide": ("width", lambda bench: {"width": bench.width + 1}),
    "no levels": ("levels", lambda bench: {"levels": 0}),
    "too many levels": ("levels", lambda bench: {"levels": bench.stack + 1}),
    "root is the header": ("blocks", lambda bench: {"root": 0}),
    "root outside": ("blocks", lambda bench: {"root": int(bench.tree("handful").header["blocks"])}),
    "root far outside": ("blocks", lambda bench: {"root": 2**32 - 1}),
}
"""Name of a damage to a header: the load error that it gives, and the fields with their wrong values."""


@cocotb.test()
async def unusable_headers(dut: Any) -> None:
    """Without a tree, and with one that is refused, all rays fail, until a good one is loaded; then none."""
    bench = Bench(dut)
    await bench.start()
    tree = bench.tree("handful")
    queries = rays_of("handful", bench.few, bench.seed)
    queries["direction"][0] = 0
    queries["t_max"][1] = queries["t_min"][1]
    none = bench.traced(tree.blocks, queries, bad_blocks=[0])
    assert (none.results["error"] == TRACE_ERRORS["header"]).all()
    assert none.results["invalid"][0]
    assert (int(dut.loaded.value), int(dut.load_error.value)) == (0, 0)
    await bench.check(none, "no tree yet")
    assert bench.memory.bursts == 0
    for name, (error, fields) in HEADERS.items():
        await bench.check_sound(tree, f"before {name}")
        blocks = with_header(tree.blocks, **fields(bench))
        await bench.load(blocks, error=error)
        bursts = bench.memory.bursts
        rays = bench.traced(blocks, queries)
        assert bitpack.equal(rays.results, none.results).all()
        await bench.check(rays, name)
        assert bench.memory.bursts == bursts, "the memory was read for rays without a tree"
    for response in (AxiResp.SLVERR, AxiResp.DECERR):
        await bench.check_sound(tree, f"before {response!r}")
        bench.memory.errors = {BASES[0]: response}
        await bench.load(tree.blocks, error="memory")
        await bench.check(none, f"{response!r} for the header")
        bench.memory.errors = {}
    await bench.check_sound(tree, "after all")


@cocotb.test()
async def root_of_another_kind(dut: Any) -> None:
    """A root that is a block of triangles: every ray that is traversed fails there."""
    bench = Bench(dut)
    await bench.start(overlap="one")
    tree = bench.tree("handful")
    root = int(np.flatnonzero(tree.triangle_blocks)[0])
    blocks = with_header(tree.blocks, root=root)
    await bench.load(blocks)
    rays = bench.traced(blocks, rays_of("handful", bench.few, bench.seed))
    failed = rays.results["error"] == TRACE_ERRORS["kind"]
    assert failed.any()
    assert (rays.results["block"][failed] == root).all()
    await bench.check(rays, "root")
    await bench.check_sound(tree, "after")


# --- rays that are wrong ----------------------------------------------------------------------------------------------

NAN, INFINITE, TINY = (np.float32(value) for value in (np.nan, np.inf, 1e-40))
FAULTS: dict[str, tuple[bool, dict[str, Any]]] = {
    "zero direction": (True, {"direction": (0, -0.0, 0)}),
    "subnormal direction": (True, {"direction": (TINY, -TINY, 0)}),
    "NaN direction": (True, {"direction": (1, NAN, 0)}),
    "infinite direction": (True, {"direction": (0, 1, INFINITE)}),
    "huge direction": (True, {"direction": (1, -(2.0**127), 0)}),
    "NaN origin": (True, {"origin": (NAN, 0, 0)}),
    "infinite origin": (True, {"origin": (0, 0, -INFINITE)}),
    "NaN t_min": (True, {"t_min": NAN}),
    "NaN t_max": (True, {"t_max": NAN}),
    "both NaN": (True, {"t_min": NAN, "t_max": NAN, "direction": (NAN, NAN, NAN)}),
    "empty range": (False, {"t_min": 1, "t_max": 1}),
    "backward range": (False, {"t_min": 2, "t_max": 1}),
    "range of zeros": (False, {"t_min": -0.0, "t_max": 0}),
    "range of subnormals": (False, {"t_min": -TINY, "t_max": TINY}),
    "range at infinity": (False, {"t_min": INFINITE, "t_max": INFINITE}),
}
"""Name of a fault: whether the ray is then invalid, and the fields with their values."""


@cocotb.test()
async def rays_that_cannot_hit(dut: Any) -> None:
    """Each among good rays: a miss without a visit, flagged where it is invalid; the others are right."""
    bench = Bench(dut)
    await bench.start(overlap="one")
    tree = bench.tree("handful")
    await bench.load(tree.blocks)
    queries = rays_of("handful", 2 * len(FAULTS), bench.seed, RENDERED)
    wrong = np.arange(len(FAULTS)) * 2 + 1
    for k, (_, fields) in zip(wrong, FAULTS.values(), strict=True):
        for name, value in fields.items():
            queries[name][k] = value
    rays = bench.traced(tree.blocks, queries)
    for k, (name, (invalid, _)) in zip(wrong, FAULTS.items(), strict=True):
        result = rays.results[k]
        assert (result["primitive"], result["invalid"], result["error"]) == (-1, invalid, 0), f"{name}: {result}"
        assert sum(rays.counts[k].item()) == 0, name
    assert (rays.results["primitive"][~np.isin(np.arange(len(queries)), wrong)] >= 0).any()
    await bench.check(rays, "good and bad")
    await bench.check(rays.only(wrong), "bad ones alone")


# --- other trees ------------------------------------------------------------------------------------------------------


@cocotb.test()
async def another_tree(dut: Any) -> None:
    """Loaded at the same place and at another one: nothing of the tree before is left in the caches."""
    bench = Bench(dut)
    await bench.start()
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
    bench = Bench(dut)
    await bench.start(memory="wild")
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
    bench = Bench(dut)
    await bench.start(memory="wild")
    tree = bench.tree("soup")
    for cycles in (40, 90, 250):
        await bench.load(tree.blocks)
        rays = bench.traced(tree.blocks, rays_of("soup", bench.contexts + 2 * bench.few, cycles, RENDERED))
        seen = await bench.exchange(
            bench.packed(rays), give="always", until=lambda cycle, cycles=cycles: cycle == cycles
        )
        assert len(seen.sent_at) > len(seen.received), "nothing is under way"
        await bench.streams.reset()
        await FallingEdge(dut.clk)
        seen_now = [int(getattr(dut, name).value) for name in ("o__valid", "loaded", "load_error", "count_rays")]
        assert seen_now == [0, 0, 0, 0]
        await RisingEdge(dut.clk)
        some = rays_of("soup", 10, bench.seed)
        await bench.check(bench.traced(tree.blocks, some, bad_blocks=[0]), "no tree after a reset")
        await bench.check_sound(tree, "after a reset")
