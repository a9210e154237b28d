# amaranth: UnusedElaboratable=no
# (a unit is also made only to be emitted)
"""The traversal unit against the golden traversal: results and counters, trees that are wrong, loading anew."""

import functools
import random
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from amaranth import Module, Signal, Value

from lightloom.golden_model.contract import bitpack
from lightloom.golden_model.contract.formats import (
    BLOCK_BYTES,
    BVH_HEADER,
    LOAD_ERRORS,
    NODE_BLOCK,
    NODE_KIND,
    RAY_RESULT,
    TRACE_ERRORS,
    TRIANGLE,
)
from lightloom.golden_model.scene.files.load import load_scene
from lightloom.golden_model.stimuli.ray_families import RAY_FAMILIES
from lightloom.golden_model.tracing.wide_bvh.encode import build_wide
from lightloom.golden_model.tracing.wide_bvh.traversal import queries_of, trace_tree
from lightloom.rtl.config import PRESETS
from lightloom.rtl.fabric.one_hot import next_of
from lightloom.rtl.memory.axi_checker import AxiChecker
from lightloom.rtl.traversal.loader import Loader
from lightloom.rtl.traversal.masks import Counts, minus, one_hot, plus
from lightloom.rtl.traversal.unit import COUNTERS, Traversal
from lightloom.sim.emitted import emitted
from lightloom.sim.traversal import TraversalRun, TraversalUnit
from lightloom.verif.drivers.axi_ports import AmaranthSlave
from lightloom.verif.drivers.axi_slave import Wrong
from tests import ROOT
from tests.gen.test_lint import WAIVERS, lint
from tests.rtl.agreement import fields_in_hex
from tests.rtl.simulation import Simulation, simulate
from tests.rtl.watched import watched

SEED = 1987
SMALL = PRESETS["tiny"].but(
    tag_width=6,
    width=8,
    contexts=8,
    stack=6,
    overlap=4,
    node_sets=4,
    node_ways=2,
    node_misses=3,
    triangle_sets=2,
    triangle_ways=2,
    triangle_misses=2,
)
"""Too few of everything: every queue, cache and stack of the unit is full now and then."""
COUNTED = ("node_tests", "revisits", "triangle_tests", "leaf_visits")


@functools.cache
def verilog() -> str:
    return emitted("traversal", SMALL)


@functools.cache
def unit() -> TraversalUnit:
    return TraversalUnit(SMALL, memory_bits=20, verilog=verilog(), level=1)


def soup(count: int, seed: int) -> np.ndarray:
    """TRIANGLE (count,) that overlap, so that rays enter many boxes."""
    rng = np.random.default_rng(seed)
    corners = (rng.uniform(-1, 1, (count, 1, 3)) + rng.normal(0, 0.15, (count, 3, 3))).astype(np.float32)
    triangles = np.zeros(count, dtype=TRIANGLE)
    for k, name in enumerate(TRIANGLE.names or ()):
        triangles[name] = corners[:, k]
    return triangles


@dataclass(frozen=True, eq=False)
class Case:
    """A tree, and rays for it."""

    blocks: np.ndarray
    queries: np.ndarray


@functools.cache
def case(kind: str, family: str = "adversarial", count: int = 400) -> Case:
    """`kind`: "cornell-box"; or "soup", whose tree has five levels."""
    rng = np.random.default_rng(SEED)
    triangles = soup(400, SEED) if kind == "soup" else load_scene(kind).triangles
    masks = rng.choice(np.array([1, 2, 255], dtype=np.uint8), len(triangles))
    tree = build_wide(triangles, masks=masks, width=SMALL.tree.width, max_levels=SMALL.traversal.stack)
    rays = RAY_FAMILIES[family](triangles, count, SEED)
    any_hit, cull = rng.random((2, count)) < [[0.4], [0.3]]
    mask = rng.choice(np.array([0, 1, 3, 255]), count, p=[0.1, 0.2, 0.1, 0.6])
    return Case(tree.blocks, queries_of(rays, any_hit=any_hit, cull=cull, mask=mask))


def with_header(blocks: np.ndarray, /, **fields: int) -> np.ndarray:
    """The tree with other values in its header, and the check word that they need."""
    out = blocks.copy()
    header = bitpack.unpack(out[:1], BVH_HEADER)
    for name, value in fields.items():
        header[name] = value
    if "check" not in fields:
        header["check"] = 0
        header["check"] = np.bitwise_xor.reduce(bitpack.pack(header)[0])
    out[0] = bitpack.pack(header)[0]
    return out


def assert_same(got: np.ndarray, expected: np.ndarray, queries: np.ndarray, what: str) -> None:
    wrong = np.flatnonzero(~bitpack.equal(got, expected))
    lines = [f"{what}, seed {SEED}: {len(wrong)} of {len(queries)} results differ"]
    for k in wrong[:3]:
        lines += [f"ray {k}: {fields_in_hex(queries[k : k + 1])}"]
        lines += [f"  model {fields_in_hex(expected[k : k + 1])}", f"  unit  {fields_in_hex(got[k : k + 1])}"]
    assert not len(wrong), "\n".join(lines)


def assert_strict(blocks: np.ndarray, queries: np.ndarray, what: str, **options: Any) -> TraversalRun:
    """With one visit of a ray under way, results and counts are the golden model's."""
    run = unit().run(blocks, queries, overlap=1, **options)
    bad = options.get("bad_blocks")
    unreadable = range(bad[0], bad[1] + 1) if bad else ()
    expected, counts = trace_tree(
        blocks, queries, width=SMALL.tree.width, stack=SMALL.traversal.stack, bad_blocks=unreadable
    )
    assert_same(run.results, expected, queries, what)
    assert {name: run.counters[name] for name in COUNTED} == {name: counts[name].sum() for name in COUNTED}, what
    assert run.counters["errors"] == (expected["error"] != 0).sum()
    return run


# --- trees that are right ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["cornell-box", "soup"])
@pytest.mark.parametrize("family", ["adversarial", "diffuse", "shadow"])
def test_one_visit_at_a_time_is_the_golden_traversal(kind: str, family: str) -> None:
    each = case(kind, family)
    run = assert_strict(each.blocks, each.queries, f"{kind}, {family}", latency=10)
    assert (run.counters["rays"], run.counters["errors"]) == (len(each.queries), 0)


@pytest.mark.parametrize("kind", ["cornell-box", "soup"])
@pytest.mark.parametrize("overlap", [2, 3, 4])
def test_hits_do_not_depend_on_the_order(kind: str, overlap: int) -> None:
    each = case(kind, count=800)
    expected, counts = trace_tree(each.blocks, each.queries, stack=SMALL.traversal.stack)
    memories: tuple[dict[str, Any], ...] = (
        {"latency": 3},
        {"latency": 100, "stall_seed": SEED},
        {"latency": 30, "reorder": 100, "interleave": True, "memory_stall": 60, "stall_seed": SEED + 1},
    )
    for options in memories:
        run = unit().run(each.blocks, each.queries, overlap=overlap, **options)
        assert_same(run.results, expected, each.queries, f"{kind}, overlap {overlap}, {options}")
        assert run.counters["node_tests"] >= 0.9 * counts["node_tests"].sum()


def test_the_stack_is_full() -> None:
    """The tree has as many levels as the stack has entries, so no list is ever put there whole."""
    each = case("soup", count=800)
    blocks, queries = with_header(each.blocks, levels=SMALL.traversal.stack), each.queries
    run = assert_strict(blocks, queries, "full stack", latency=10)
    assert run.counters["revisits"] > 0.3 * run.counters["node_tests"]
    # Several visits at a time need more entries than there are: such rays begin again.
    expected, _ = trace_tree(blocks, queries, stack=SMALL.traversal.stack)
    assert_same(unit().run(blocks, queries, overlap=4).results, expected, queries, "full stack, overlap 4")


def test_counters() -> None:
    each = case("soup")
    counters = unit().run(each.blocks, each.queries).counters
    for name in ("node", "triangle"):
        parts = sum(counters[f"{name}_{part}"] for part in ("busy", "starved", "stalled"))
        assert parts == counters["cycles"], name
    blocks = {"node": counters["node_tests"], "triangle": counters["leaf_visits"]}
    for name, number in blocks.items():
        assert sum(counters[f"{name}_{part}"] for part in ("hits", "misses", "merged")) == number
    beats = BLOCK_BYTES * 8 // SMALL.memory.axi_width
    reads = [counters[name] for name in ("node_misses", "triangle_misses", "triangle_prefetches")]
    assert counters["beats"] == beats * sum(reads)
    assert min(reads) > 0
    assert counters["triangle_busy"] == counters["triangle_tests"]
    assert counters["node_busy"] == counters["node_tests"]


# --- trees that are wrong ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("error", "fields"),
    [
        ("magic", {"magic": 1}),
        ("version", {"version": 2}),
        ("check", {"check": 12345}),
        ("width", {"width": 9}),
        ("levels", {"levels": SMALL.traversal.stack + 1}),
        ("levels", {"levels": 0}),
        ("blocks", {"root": 0}),
        ("blocks", {"blocks": 1}),
    ],
)
def test_a_header_that_is_refused_fails_all_rays(error: str, fields: dict[str, int]) -> None:
    blocks = with_header(case("soup").blocks, **fields)
    run = assert_strict(blocks, case("soup").queries[:100], error)
    assert run.load_error == LOAD_ERRORS[error]
    assert (run.results["error"] == TRACE_ERRORS["header"]).all()


def test_memory_errors() -> None:
    blocks, queries = case("soup").blocks, case("soup").queries
    run = assert_strict(blocks, queries, "bad blocks", bad_blocks=(40, 200), latency=5)
    failed = run.results["error"] == TRACE_ERRORS["memory"]
    assert 0.1 < failed.mean() < 0.9
    assert ((run.results["block"][failed] >= 40) & (run.results["block"][failed] <= 200)).all()


def damaged(blocks: np.ndarray, error: str, seed: int) -> np.ndarray:
    """The tree with a tenth of its nodes, not the root, and of its leaves damaged."""
    rng = np.random.default_rng(seed)
    out = blocks.copy()
    for address in np.flatnonzero(rng.random(len(blocks)) < 0.1):
        if address <= 1:
            continue
        node = bitpack.unpack(out[address : address + 1], NODE_BLOCK)
        if error == "kind":
            node["kind"] = rng.integers(0, 16)
        elif error == "random":
            out[address, rng.integers(0, 16)] ^= np.uint32(1) << np.uint32(rng.integers(0, 32))
            continue
        elif node["kind"][0] != NODE_KIND:
            continue
        elif error == "no children":
            node["count"], node["base"] = 0, rng.integers(0, address + 1)
        elif error == "order":
            node["base"] = rng.integers(1, address + 1)
        else:
            node["base"] = rng.choice([len(blocks) - int(node["count"][0]) + 1, 2**32 - 1])
        out[address] = bitpack.pack(node)[0]
    return out


@pytest.mark.parametrize("error", ["kind", "order", "outside", "random"])
def test_damaged_blocks_fail_the_rays_that_meet_them(error: str) -> None:
    blocks, queries = case("soup").blocks, case("soup").queries
    wrong = damaged(blocks, error, SEED)
    run = assert_strict(wrong, queries, error, latency=5)
    if error != "random":
        assert set(np.unique(run.results["error"])) == {0, TRACE_ERRORS[error]}
        assert 0.01 < (run.results["error"] != 0).mean() < 0.99
    # With several visits under way, a ray may meet a wrong block that it would have passed by, or the other way round.
    run = unit().run(wrong, queries, overlap=4, stall_seed=SEED)
    if error != "random":
        sound = run.results["error"] == 0
        expected, _ = trace_tree(blocks, queries, stack=SMALL.traversal.stack)
        assert_same(run.results[sound], expected[sound], queries[sound], f"{error}, overlap 4")


def test_a_node_without_children_is_no_error() -> None:
    """Wherever its children would be: it has none."""
    blocks, queries = case("soup").blocks, case("soup").queries
    run = assert_strict(damaged(blocks, "no children", SEED), queries, "no children", latency=5)
    assert run.counters["errors"] == 0
    assert run.counters["node_tests"] < assert_strict(blocks, queries, "all children").counters["node_tests"]


def test_a_header_of_too_few_levels() -> None:
    """The tree fills the stack: the ray fails, and the next one does not."""
    blocks, queries = with_header(case("soup").blocks, levels=1), case("soup").queries
    run = assert_strict(blocks, queries, "one level")
    assert (run.results["error"] == TRACE_ERRORS["header"]).any()
    run = unit().run(blocks, queries, overlap=4)
    expected, _ = trace_tree(case("soup").blocks, queries, stack=SMALL.traversal.stack)
    sound = run.results["error"] == 0
    assert_same(run.results[sound], expected[sound], queries[sound], "one level, overlap 4")


# --- loading ----------------------------------------------------------------------------------------------------------


def test_the_loader_waits_for_rays() -> None:
    loader = Loader(40)

    async def bench(ctx: Any) -> None:
        async def strobe(base: int) -> None:
            ctx.set(loader.load, 1)
            ctx.set(loader.base, base)
            await ctx.tick()
            ctx.set(loader.load, 0)
            ctx.set(loader.base, 0)

        ctx.set(loader.idle, 0)
        await strobe(64)
        for _ in range(5):
            assert (ctx.get(loader.loading), ctx.get(loader.go)) == (1, 0)
            await ctx.tick()
        await strobe(128)
        ctx.set(loader.idle, 1)
        assert (ctx.get(loader.go), ctx.get(loader.next_base)) == (1, 128)
        await ctx.tick()
        ctx.set(loader.busy, 1)
        assert (ctx.get(loader.go), ctx.get(loader.loading)) == (0, 1)
        await strobe(192)  # while the header is read
        assert ctx.get(loader.go) == 0
        ctx.set(loader.busy, 0)
        assert (ctx.get(loader.go), ctx.get(loader.next_base)) == (1, 192)
        await strobe(256)  # in the very cycle in which that begins
        assert (ctx.get(loader.go), ctx.get(loader.next_base)) == (1, 256)
        await ctx.tick()
        assert (ctx.get(loader.go), ctx.get(loader.loading)) == (0, 0)

    simulate(loader, bench)


@functools.cache
def compiled() -> tuple[Traversal, AxiChecker, Simulation]:
    """The unit, the checker beside its port, and both in a simulator."""
    traversal = Traversal(SMALL)
    dut, checker = watched(traversal)
    return traversal, checker, Simulation(dut)


def test_another_tree_while_rays_are_under_way() -> None:
    """Rays that came before it are traced in the tree before, all others in the new one."""
    trees = [build_wide(soup(count, SEED + count), max_levels=SMALL.traversal.stack).blocks for count in (12, 18)]
    bases = [0x400, 0x400 + BLOCK_BYTES * len(trees[0])]
    image = b"".join(blocks.astype("<u4").tobytes() for blocks in trees)
    count, before = 24, 10
    queries = queries_of(RAY_FAMILIES["diffuse"](soup(12, SEED + 12), count, SEED))
    expected = np.concatenate(
        [
            trace_tree(blocks, queries[part], stack=SMALL.traversal.stack)[0]
            for blocks, part in zip(trees, (slice(before), slice(before, None)), strict=True)
        ]
    )
    traversal, checker, simulation = compiled()
    packed = [int.from_bytes(row.tobytes(), "little") for row in bitpack.pack(queries)]
    answers: dict[int, int] = {}

    def content(address: int, size: int) -> int:
        first = address - bases[0]
        return int.from_bytes(image[first : first + size], "little")

    async def bench(ctx: Any) -> None:
        memory = AmaranthSlave(traversal.m_axi, checker=checker, latency=20, seed=SEED, content=content)
        stalls = random.Random(SEED)
        sent = loads = 0
        ctx.set(traversal.overlap, 3)
        while len(answers) < count:
            memory.drive(ctx)
            load = loads < 2 and sent == (0, before)[loads] and not ctx.get(traversal.load)
            ctx.set(traversal.load, load)
            ctx.set(traversal.base, bases[loads] if load else 0)
            loads += load
            offer = sent < count and loads == (2 if sent >= before else 1) and not load
            ctx.set(traversal.i.valid, offer)
            if offer:
                ctx.set(Value.cast(traversal.i.payload), packed[sent] | sent << bitpack.width(queries.dtype))
            ctx.set(traversal.o.ready, stalls.random() < 0.5)
            memory.sample(ctx)
            sent += offer and ctx.get(traversal.i.ready)
            if ctx.get(traversal.o.valid) and ctx.get(traversal.o.ready):
                answer = ctx.get(Value.cast(traversal.o.payload))
                tag = answer >> bitpack.width(RAY_RESULT)
                assert tag not in answers
                answers[tag] = answer & (1 << bitpack.width(RAY_RESULT)) - 1
            await ctx.tick()

    simulation.run(bench)
    rows = b"".join(answers[k].to_bytes(4 * bitpack.words(RAY_RESULT), "little") for k in range(count))
    got = bitpack.unpack(np.frombuffer(rows, dtype="<u4").reshape(count, -1), RAY_RESULT)
    assert (got["error"] == 0).all()
    assert_same(got, expected, queries, "two trees")
    assert not bitpack.equal(trace_tree(trees[0], queries, stack=SMALL.traversal.stack)[0], expected)[before:].all()


def test_a_load_waits_for_a_prefetch() -> None:
    """A ray that needs any hit has one in the first of two leaves, while the other one is still on its way."""
    triangles = np.zeros(4, dtype=TRIANGLE)  # all the same, so that both leaves are equally near
    for name, x, y in zip(TRIANGLE.names or (), (-1, 1, 0), (-1, -1, 1), strict=True):
        triangles[name] = x, y, 0
    blocks = build_wide(triangles, max_levels=SMALL.traversal.stack).blocks
    image = blocks.astype("<u4").tobytes()
    leaves = [
        BLOCK_BYTES * k for k in range(1, len(blocks)) if bitpack.unpack(blocks[[k]], NODE_BLOCK)["kind"] != NODE_KIND
    ]
    assert len(leaves) == 2
    rays = RAY_FAMILIES["diffuse"](triangles, 1, SEED)
    rays["origin"], rays["direction"] = (0, 0, -3), (0, 0, 1)
    query = int.from_bytes(bitpack.pack(queries_of(rays, any_hit=True))[0].tobytes(), "little")
    traversal, checker, simulation = compiled()
    beats = BLOCK_BYTES * 8 // SMALL.memory.axi_width
    late = Wrong(beats=beats, last=frozenset({beats - 1}), after=300)

    def content(address: int, size: int) -> int:
        return int.from_bytes(image[address : address + size], "little")

    async def bench(ctx: Any) -> None:
        memory = AmaranthSlave(traversal.m_axi, checker=checker, latency=20, seed=SEED, content=content)

        async def step() -> None:
            memory.drive(ctx)
            memory.sample(ctx)
            if not memory.wrong and memory.reads[-1:] in ([leaf] for leaf in leaves):
                memory.wrong = {leaf: late for leaf in leaves if leaf != memory.reads[-1]}
            await ctx.tick()

        async def steps_until(signal: Any) -> None:
            while not ctx.get(signal):
                await step()

        async def load() -> None:
            ctx.set(traversal.load, 1)
            await step()
            ctx.set(traversal.load, 0)

        ctx.set(traversal.o.ready, 1)
        await load()
        await steps_until(traversal.loaded)
        ctx.set(Value.cast(traversal.i.payload), query)
        ctx.set(traversal.i.valid, 1)
        await steps_until(traversal.i.ready)
        await step()
        ctx.set(traversal.i.valid, 0)
        await steps_until(traversal.o.valid)
        assert ctx.get(traversal.o.payload.data.primitive) >= 0
        assert memory.under_way == 1, "nothing is on its way"
        await load()
        while memory.reads[-1] != 0:
            await step()
        assert memory.under_way == 1, "the header is not all that is on its way"

    simulation.run(bench)


# --- small parts ------------------------------------------------------------------------------------------------------


def test_counts_of_contexts() -> None:
    """One more here, one less there, a limit: as with numbers."""
    contexts, greatest = 8, 5
    counts = Counts("count", contexts, greatest)
    up, down = Signal(contexts), Signal(contexts)
    limit, which = Signal(3), Signal(3)
    below, some, of = Signal(contexts), Signal(contexts), Signal(3)
    m = Module()
    m.d.comb += [below.eq(counts.below(limit)), some.eq(counts.some()), of.eq(counts.of(one_hot(which, contexts)))]
    counts.become(m, minus(plus(counts.planes, up), down))
    choice = random.Random(SEED)

    async def bench(ctx: Any) -> None:
        numbers = [0] * contexts
        for _ in range(500):
            raised, lowered = choice.getrandbits(contexts), choice.getrandbits(contexts)
            for k in range(contexts):
                if numbers[k] == greatest:
                    raised &= ~(1 << k)
                if numbers[k] == 0:
                    lowered &= ~(1 << k)
                numbers[k] += (raised >> k & 1) - (lowered >> k & 1)
            ctx.set(up, raised)
            ctx.set(down, lowered)
            await ctx.tick()
            ctx.set(limit, choice.randrange(8))
            ctx.set(which, choice.randrange(8))
            assert ctx.get(of) == numbers[ctx.get(which)]
            assert ctx.get(some) == sum((number > 0) << k for k, number in enumerate(numbers))
            assert ctx.get(below) == sum((number < ctx.get(limit)) << k for k, number in enumerate(numbers))

    simulate(m, bench)


def test_every_context_has_its_turn() -> None:
    wanted, take = Signal(8), Signal()
    m = Module()
    chosen = next_of(m, "turn", wanted, take)

    async def bench(ctx: Any) -> None:
        ctx.set(wanted, 0b1011_0010)
        ctx.set(take, 1)
        turns = []
        for _ in range(8):
            turns.append(ctx.get(chosen))
            await ctx.tick()
        assert turns == [1 << k for k in (1, 4, 5, 7)] * 2
        ctx.set(take, 0)
        await ctx.tick()
        assert ctx.get(chosen) == 1 << 1

    simulate(m, bench)


def test_lint(tmp_path: Path) -> None:
    source = tmp_path / "traversal.v"
    source.write_text(verilog(), encoding="utf-8")
    assert lint(WAIVERS, source, top="traversal") == ""


def test_every_counter_is_documented() -> None:
    page = (ROOT / "docs" / "traversal_unit.md").read_text(encoding="utf-8")
    for one in COUNTERS:
        assert f"| `{one.name}` | {one.meaning} |" in page
