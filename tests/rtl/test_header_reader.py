"""The reader of a tree's header: what it takes over, and every header that it refuses."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from amaranth.sim import Simulator

from gen.verilog import convert
from golden_model import bitpack
from golden_model.formats import BVH_HEADER, BVH_MAGIC, BVH_VERSION, LOAD_ERRORS
from rtl.header_reader import HeaderReader
from tests.gen.test_lint import WAIVERS, lint
from tests.rtl.axi_slave import AxiSlave

BASE = 0x12_3456_7000
GOOD = {
    "magic": BVH_MAGIC,
    "version": BVH_VERSION,
    "width": 8,
    "levels": 9,
    "blocks": 0x89AB_CDEF,
    "root": 1,
    "nodes": 1234,
    "triangle_blocks": 5678,
    "triangles": 9876,
    "lattice_exponent": -117,
    "lattice_origin": (1.5, -2.25, 1e30),
}


def header(**fields: Any) -> np.ndarray:
    """A header (16,) of words, GOOD but for `fields`, with its check word."""
    record = np.zeros(1, BVH_HEADER)
    for name, value in (GOOD | fields).items():
        record[name] = value
    words = bitpack.pack(record)[0].copy()
    words[-1] = 0
    words[-1] = np.bitwise_xor.reduce(words)
    return words


class Memory(AxiSlave):
    """One block at BASE."""

    words = header()

    def _choose(self) -> None:
        super()._choose()
        if self.beat is not None:
            first = (self.bursts[0][1] - self.lanes if self.bursts else BASE + 64 - self.lanes) - BASE
            data = int.from_bytes(self.words.astype("<u4").tobytes()[first : first + self.lanes], "little")
            self.beat = (self.beat[0], data, *self.beat[2:])


class Loads:
    """Loads headers one after another and notes what the reader says of each."""

    def __init__(self, *, data_width: int = 512, latency: int = 5, stall: float = 0.0, **limits: int):
        self.reader = HeaderReader(**({"width": 8, "stack": 24} | limits), data_width=data_width)
        self.memory = Memory(self.reader.m_axi, latency=latency, stall=stall, seed=3)
        self.seen: list[dict[str, Any]] = []

    def __call__(self, *headers: np.ndarray, bad: set[int] | None = None) -> list[dict[str, Any]]:
        reader, memory = self.reader, self.memory
        memory.bad = bad or set()

        async def testbench(ctx: Any) -> None:
            assert not ctx.get(reader.loaded)
            assert not ctx.get(reader.busy)
            for words in headers:
                memory.words = words
                for cycle in range(200):
                    # In the next cycle another base shows that it was taken with `load`.
                    ctx.set(reader.load, int(cycle in (0, 3)))
                    ctx.set(reader.base, BASE if cycle == 0 else 64)
                    memory.drive(ctx)
                    memory.sample(ctx)
                    if cycle and not ctx.get(reader.busy):
                        break
                    assert cycle == 0 or not (ctx.get(reader.loaded) or ctx.get(reader.load_error))
                    await ctx.tick()
                ctx.set(reader.load, 0)
                await ctx.tick().repeat(3)
                names = ("loaded", "load_error", "tree_base", "blocks", "root", "levels", "lattice_exponent")
                seen = {name: ctx.get(getattr(reader, name)) for name in names}
                seen["lattice_origin"] = [ctx.get(reader.lattice_origin[k]) for k in range(3)]
                self.seen.append(seen | {"cycles": cycle})

        simulator = Simulator(reader)
        simulator.add_clock(1e-6)
        simulator.add_testbench(testbench)
        simulator.run()
        return self.seen


@pytest.mark.parametrize("data_width", [32, 128, 512])
def test_a_good_header(data_width: int) -> None:
    loads = Loads(data_width=data_width)
    (seen,) = loads(header())
    assert loads.memory.reads == [BASE], "one read, at the base that was given with load"
    # load, the address, the memory's latency, a beat a cycle, and the check
    assert seen.pop("cycles") == 1 + 5 + 512 // data_width + 1
    assert seen == {
        "loaded": 1,
        "load_error": LOAD_ERRORS["none"],
        "tree_base": BASE,
        "blocks": 0x89AB_CDEF,
        "root": 1,
        "levels": 9,
        "lattice_exponent": -117 & 0xFFFF,
        "lattice_origin": [int(np.float32(x).view(np.uint32)) for x in (1.5, -2.25, 1e30)],
    }


def test_stalls() -> None:
    (seen,) = Loads(data_width=32, stall=0.6)(header())
    assert seen["loaded"]


@pytest.mark.parametrize(
    ("error", "fields"),
    [
        ("magic", {"magic": BVH_MAGIC ^ 1 << 31}),
        ("version", {"version": BVH_VERSION + 1}),
        ("width", {"width": 9}),
        ("width", {"width": 255}),
        ("levels", {"levels": 0}),
        ("levels", {"levels": 25}),
        ("blocks", {"root": 0}),
        ("blocks", {"root": 7, "blocks": 7}),
        ("blocks", {"root": 0xFFFF_FFFF}),
        ("blocks", {"blocks": 1}),
        ("blocks", {"blocks": 0}),
        ("none", {"width": 0, "levels": 1, "blocks": 2}),
        ("none", {"levels": 24, "root": 6, "blocks": 7}),
        # The first of several faults
        ("magic", {"magic": 0, "version": 0, "width": 9, "levels": 0, "blocks": 0}),
        ("version", {"version": 0, "width": 9, "levels": 0, "blocks": 0}),
        ("width", {"width": 9, "levels": 0, "blocks": 0}),
        ("levels", {"levels": 0, "blocks": 0}),
    ],
)
def test_refused_headers(error: str, fields: dict[str, int]) -> None:
    refused, good = Loads()(header(**fields), header())
    assert (refused["loaded"], refused["load_error"]) == (error == "none", LOAD_ERRORS[error])
    assert (good["loaded"], good["load_error"]) == (1, 0), "the reader does not recover"


@pytest.mark.parametrize("data_width", [32, 512])
def test_any_damaged_bit_is_found(data_width: int) -> None:
    rng = np.random.default_rng(5)
    damaged = []
    for word in range(16):
        words = header()
        words[word] ^= np.uint32(1 << int(rng.integers(32)))
        damaged.append(words)
    seen = Loads(data_width=data_width)(*damaged, header())
    codes = [LOAD_ERRORS["magic"], *[LOAD_ERRORS["check"]] * 15, 0]
    assert [one["load_error"] for one in seen[2:]] == codes[2:]
    assert seen[0]["load_error"] == LOAD_ERRORS["magic"]
    assert seen[1]["load_error"] in (LOAD_ERRORS["version"], LOAD_ERRORS["check"])
    assert [one["loaded"] for one in seen] == [0] * 16 + [1]


@pytest.mark.parametrize("beat", [0, 1, 3])
def test_a_memory_error(beat: int) -> None:
    seen = Loads(data_width=128)(header(), bad={BASE + 16 * beat})
    assert (seen[0]["loaded"], seen[0]["load_error"]) == (0, LOAD_ERRORS["memory"])


def test_limits_of_the_hardware() -> None:
    seen = Loads(width=4, stack=12)(header(width=4, levels=12), header(width=5, levels=12), header(width=4, levels=13))
    assert [one["load_error"] for one in seen] == [0, LOAD_ERRORS["width"], LOAD_ERRORS["levels"]]


@pytest.mark.parametrize("data_width", [32, 512])
def test_verilog_is_clean(data_width: int, tmp_path: Path) -> None:
    source = tmp_path / "header_reader.v"
    source.write_text(convert(HeaderReader(width=8, stack=24, data_width=data_width), "header_reader"))
    assert lint(WAIVERS, source, top="header_reader") == ""
