# amaranth: UnusedElaboratable=no
# (a memory is also made only to ask what it is called)
"""Memories: where the RTL has them, what they are called, and what a read sees."""

import ast
import random
from typing import Any

import pytest
from amaranth import Module
from amaranth.lib import wiring

from lightloom.rtl.fabric.fifos import RamFifo, RegisterFifo
from lightloom.rtl.fabric.memory import Ram, RegisterFile, Wrapped, Wrapper, write_first
from tests import ROOT
from tests.rtl.simulation import simulate

SEED = 2029
DEPTH, WIDTH = 6, 9


def test_the_rtl_has_memories_in_one_place() -> None:
    """Nothing else imports what Amaranth makes memories of: its own, and its queues with some inside."""
    names = {"amaranth.lib.memory", "amaranth.lib.fifo", "Memory", "MemoryData", "MemoryInstance"}
    users = set()
    for path in (ROOT / "rtl").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                found = {alias.name for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and (node.module or "").startswith("amaranth"):
                found = {node.module or "", *(alias.name for alias in node.names)}
            else:
                continue
            if found & names:
                users.add(path.relative_to(ROOT).as_posix())
    assert users == {"rtl/fabric/memory.py"}


@pytest.mark.parametrize(
    ("memory", "name"),
    [
        (Ram(8, 384), "ram_1r1w_384x8"),
        (Ram(8, 384, read_first=True), "ram_1r1w_384x8_read_first"),
        (RegisterFile(3, 6), "regfile_1r1w_6x3"),
        (RegisterFile(3, 6, reads=2), "regfile_2r1w_6x3"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_a_name_says_what_a_wrapper_is(memory: Wrapped, name: str) -> None:
    assert memory.wrapper.name == name
    assert Wrapper.of(f"a_traversal_{name}") == memory.wrapper


@pytest.mark.parametrize(
    "name", ["traversal_ram", "traversal_ram_1r1w", "program_1r1w_8x8", "traversal_ram_1r1w_8x8_1"]
)
def test_other_names(name: str) -> None:
    assert Wrapper.of(name) is None


def test_one_word_is_no_memory() -> None:
    with pytest.raises(ValueError, match="2 words at least, not 1"):
        Ram(8, 1)


def run(dut: Any, cycles: int, check: Any) -> None:
    """Random writes and reads; `check` is told of each cycle: what was asked of the dut, and what it shows after it."""
    rng = random.Random(SEED)

    async def testbench(ctx: Any) -> None:
        for cycle in range(cycles):
            asked = {"w_en": rng.random() < 0.6, "w_addr": rng.randrange(DEPTH), "w_data": rng.getrandbits(WIDTH)}
            reads = [name for name in vars(dut) if name.startswith("r") and name.endswith("_addr")]
            asked |= {name: asked["w_addr"] if rng.random() < 0.4 else rng.randrange(DEPTH) for name in reads}
            if hasattr(dut, "r_en"):
                asked["r_en"] = rng.random() < 0.7
            for name, value in asked.items():
                ctx.set(getattr(dut, name), value)
            before = {name: ctx.get(getattr(dut, name.replace("addr", "data"))) for name in reads}
            await ctx.tick()
            after = {name: ctx.get(getattr(dut, name.replace("addr", "data"))) for name in reads}
            check(f"seed {SEED}, cycle {cycle}, {asked}", asked, before, after)

    simulate(dut, testbench)


class WriteFirst(wiring.Component):
    """A RAM with `write_first` around it."""

    def __init__(self) -> None:
        self._ram = Ram(WIDTH, DEPTH)
        super().__init__(self._ram.signature)

    def elaborate(self, platform: object) -> Module:
        m = Module()
        m.submodules.ram = ram = self._ram
        m.d.comb += [getattr(ram, name).eq(getattr(self, name)) for name in ("w_en", "w_addr", "w_data")]
        m.d.comb += [ram.r_en.eq(self.r_en), ram.r_addr.eq(self.r_addr), self.r_data.eq(write_first(m, ram, "word"))]
        return m


@pytest.mark.parametrize(
    ("dut", "new"),
    [(Ram(WIDTH, DEPTH, read_first=True), False), (WriteFirst(), True)],
    ids=["read first", "write first"],
)
def test_a_read_during_a_write(dut: Any, new: bool) -> None:
    words = [0] * DEPTH
    clashes = 0

    def check(what: str, asked: Any, before: Any, after: Any) -> None:
        nonlocal clashes
        old = words[asked["r_addr"]]
        if asked["w_en"]:
            words[asked["w_addr"]] = asked["w_data"]
        clashes += asked["w_en"] and asked["r_en"] and asked["w_addr"] == asked["r_addr"]
        expected = (words[asked["r_addr"]] if new else old) if asked["r_en"] else before["r_addr"]
        assert after["r_addr"] == expected, what

    run(dut, 400, check)
    assert clashes > 50


def test_a_register_file() -> None:
    """Every port shows its word, before the edge the old one and after it the new one."""
    words = [0] * DEPTH

    def check(what: str, asked: Any, before: Any, after: Any) -> None:
        for name in ("r0_addr", "r1_addr"):
            assert before[name] == words[asked[name]], what
        if asked["w_en"]:
            words[asked["w_addr"]] = asked["w_data"]
        for name in ("r0_addr", "r1_addr"):
            assert after[name] == words[asked[name]], what

    run(RegisterFile(WIDTH, DEPTH, reads=2), 400, check)


@pytest.mark.parametrize("kind", [RamFifo, RegisterFifo])
@pytest.mark.parametrize("depth", [3, 4, 6])
def test_a_fifo_is_a_list(kind: Any, depth: int) -> None:
    """Fills up, empties and goes round; while the RAM's output is empty, an item is on its way to it for a cycle."""
    dut, rng = kind(WIDTH, depth), random.Random(SEED)
    inside: list[int] = []
    seen = set()

    async def testbench(ctx: Any) -> None:
        for cycle in range(600):
            what = f"seed {SEED}, cycle {cycle}"
            likely = 0.9 if cycle // 40 % 2 else 0.2
            payload, comes, goes = rng.getrandbits(WIDTH), rng.random() < likely, rng.random() > likely
            ctx.set(dut.w.payload, payload)
            ctx.set(dut.w.valid, comes)
            ctx.set(dut.r.ready, goes)
            assert ctx.get(dut.level) == len(inside), what
            seen.add(len(inside))
            if ctx.get(dut.r.valid):
                assert ctx.get(dut.r.payload) == inside[0], what
            elif kind is RegisterFifo:
                assert not inside, what
            takes, gives = ctx.get(dut.w.ready) and comes, ctx.get(dut.r.valid) and goes
            if kind is RegisterFifo:
                assert ctx.get(dut.w.ready) == (len(inside) < depth), what
            await ctx.tick()
            if gives:
                inside.pop(0)
            if takes:
                inside.append(payload)

    simulate(dut, testbench)
    assert seen == set(range(depth + 1))
