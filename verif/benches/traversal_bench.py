"""What the benches of the traversal unit share: scenes and rays, and the unit beside a memory of ours.

What is right is what the golden traversal says (`golden_model.tracing.wide_bvh.traversal`), in all bits, in whatever
order rays come back. With one visit of a ray under way, the counters are the golden ones too.
"""

import functools
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import cocotb
import numpy as np
from cocotb.triggers import FallingEdge, RisingEdge

from lightloom.golden_model.contract import bitpack
from lightloom.golden_model.contract.formats import LOAD_ERRORS, RAY_QUERY, RAY_RESULT, TRIANGLE
from lightloom.golden_model.scene.files.load import load_scene
from lightloom.golden_model.stimuli.ray_families import RAY_FAMILIES
from lightloom.golden_model.tracing.wide_bvh.encode import WideBvh, build_wide
from lightloom.golden_model.tracing.wide_bvh.traversal import COUNTS, queries_of, trace_tree
from lightloom.verif.benches.bench import Bench
from lightloom.verif.benches.test_stream_unit import payloads
from lightloom.verif.bins.coverage import StreamCycles, note
from lightloom.verif.bins.traversal_bins import channel_groups, counter_groups, load_groups, memory_groups, ray_groups
from lightloom.verif.drivers.axi_slave import Manner
from lightloom.verif.drivers.stepped import Values
from lightloom.verif.drivers.stream import Exchange

LOAD_CYCLES = 2000
"""Cycles after which a tree must have been loaded or refused."""
LINGER = 40
"""Cycles in which no result comes, when all have come."""
BASES = (0x12_3456_7FC0, 0x80)
"""Byte addresses of trees: one beyond 32 bits, and not on a page's boundary."""

RENDERED = ("diffuse", "camera", "shadow")
"""Families of rays of which none meets all boxes."""
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


class RaySteps:
    """The golden traversal as a model that is stepped, a ray a step, one visit at a time: its state is what it has
    counted. An operand is the number of the `ray`; seen are its `result` as a number, and all counters."""

    def __init__(self, rays: Rays) -> None:
        self.results, self.counts = payloads(rays.results, np.zeros(len(rays))), rays.counts
        self.failed = rays.results["error"] != 0
        self.counted = dict.fromkeys((*(COUNTS.names or ()), "rays", "errors"), 0)

    def state(self) -> Values:
        return dict(self.counted)

    def step(self, operands: Values, seen: Values) -> Values:
        ray = operands["ray"]
        more = {name: int(self.counts[name][ray]) for name in COUNTS.names or ()}
        more |= {"rays": 1, "errors": int(self.failed[ray])}
        self.counted = {name: count + more[name] for name, count in self.counted.items()}
        return {"result": self.results[ray], **self.counted}


class TraversalBench(Bench):
    """The unit with its memory, and the tree that is loaded."""

    def __init__(self, dut: Any) -> None:
        super().__init__(dut)
        run = self.run
        self.rays: int = run["rays"]
        self.few: int = run["few"]
        self.patience: int = run["patience"]
        self.width: int = run["width"]
        self.stack: int = run["stack"]
        self.overlap: int = run["overlap"]
        self.contexts: int = run["contexts"]
        self.lines: dict[str, int] = run["lines"]
        self.counted: list[str] = run["counters"]
        self.addresses: int = run["units"] + (2 if run["units"] > 1 else 0)
        """That may wait when an abort comes: one that each unit offers, and two in the buffer of an array's port."""
        self.tag_width = len(dut.i__payload) - bitpack.width(RAY_QUERY)
        self.number = 0
        """Rays so far: their numbers are their tags."""
        self.blocks = build_wide(triangles_of("empty")).blocks
        """The tree that was loaded last."""

    async def begin(self, *, overlap: str = "most", memory: str = "brisk") -> None:
        """`overlap`: "one" visit of a ray at a time, or as many as there can be."""
        quiet = dict.fromkeys(("load", "count_clear", "base", "read_timeout", "abort", "axi_forget"), 0)
        await self.start(quiet | {"overlap": 1 if overlap == "one" else self.overlap}, MEMORIES[memory])

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
        await self.load_from(base, error)
        self.blocks = blocks

    async def load_from(self, base: int, error: str) -> None:
        """Has the tree at `base` loaded, or refused because of `error`."""
        await self.ask_to_load(base)
        seen = await self.outcome()
        assert seen == LOAD_ERRORS[error], f"seed {self.seed}: load_error {seen}, not {error}"
        note(lambda: load_groups(error))

    async def result_waits(self) -> None:
        """Until a result is offered, of rays under way; nobody takes it."""
        for _ in range(LOAD_CYCLES):
            await FallingEdge(self.dut.clk)
            assert not int(self.dut.o__ready.value)
            if int(self.dut.o__valid.value):
                break
        else:
            raise AssertionError(f"seed {self.seed}: no result waits")
        await RisingEdge(self.dut.clk)

    async def abort(self, strobes: int = 1, load: bool = False) -> int:
        """Aborts, in `strobes` cycles one after another; with `load`, until the end a load is asked for in every cycle.
        Returns how many cycles `aborting` was high. The memory is not told; all that it still answers comes before the
        end."""
        dut, memory = self.dut, self.memory
        waiting = bool(int(dut.m_axi_arvalid.value))
        dut.abort.value, dut.load.value, dut.base.value = 1, int(load), BASES[0]
        await RisingEdge(dut.clk)
        bursts = memory.bursts
        for cycle in range(LOAD_CYCLES):
            dut.abort.value, dut.load.value = int(cycle + 1 < strobes), 0
            await FallingEdge(dut.clk)
            if not int(dut.aborting.value):
                break
            dut.load.value = int(load)
            assert not int(dut.i__ready.value), f"seed {self.seed}: takes rays during an abort"
            if cycle:
                # Of an array, addresses may wait in its own port's buffer, too.
                assert not int(dut.o__valid.value), f"seed {self.seed}: gives results during an abort"
            await RisingEdge(dut.clk)
        else:
            raise AssertionError(f"seed {self.seed}: an abort does not end; {memory.under_way} reads under way")
        assert cycle, f"seed {self.seed}: no abort"
        assert not memory.under_way, f"seed {self.seed}: {memory.under_way} reads under way behind an abort"
        assert not int(dut.m_axi_arvalid.value)
        assert memory.bursts - bursts <= self.addresses, f"seed {self.seed}: {memory.bursts - bursts} reads ({waiting})"
        seen = [
            int(getattr(dut, name).value) for name in ("o__valid", "loaded", "load_error", "count_rays", "count_beats")
        ]
        assert not any(seen), f"seed {self.seed}: {seen} behind an abort"
        await RisingEdge(dut.clk)
        return cycle

    async def forget(self) -> None:
        """Tells the checker that what the memory owes will not come: an abort has ended without it."""
        self.dut.axi_forget.value = 1
        await RisingEdge(self.dut.clk)
        self.dut.axi_forget.value = 0
        self.memory.keeps_rules = True

    def packed(self, rays: Rays) -> list[int]:
        """What the unit is offered for rays; their tags go on where those of the rays before ended."""
        tags = np.arange(self.number, self.number + len(rays)) % (1 << self.tag_width)
        self.number += len(rays)
        return payloads(rays.queries, tags)

    def answers(self, received: list[int], first: int, count: int) -> np.ndarray:
        """Results to RAY_RESULT (count,) in the order of the rays from number `first` on: exactly one each."""
        width = bitpack.width(RAY_RESULT)
        expected = [number % (1 << self.tag_width) for number in range(first, first + count)]
        by_tag = self.by_tag(received, lambda payload: payload >> width, expected)
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

    async def exchange(self, payloads: list[int], give: str = "half", take: str = "half", **options: Any) -> Exchange:
        return await super().exchange(payloads, give, take, patience=self.patience, linger=LINGER, **options)

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
        expected = {"rays": len(rays), "beats": self.memory.beats - beats}
        if int(self.dut.overlap.value) == 1:
            expected |= {"errors": int((rays.results["error"] != 0).sum())}
            expected |= {name: int(rays.counts[name].sum()) for name in COUNTS.names or ()}
        assert self.counters(expected, "count_") == expected, f"{what}, seed {self.seed}"
        note(lambda: counter_groups(self.counters(self.counted, "count_"), self.lines))

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
