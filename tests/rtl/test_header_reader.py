"""The reader of a tree's header: what it takes over, and every header that it refuses."""

from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lightloom.gen.verilog import convert
from lightloom.golden_model.contract import bitpack
from lightloom.golden_model.contract.formats import BVH_HEADER, BVH_MAGIC, BVH_VERSION, LOAD_ERRORS
from lightloom.rtl.memory.axi_checker import AxiChecker
from lightloom.rtl.memory.header_reader import HeaderReader
from lightloom.verif.drivers.axi_ports import AmaranthSlave
from lightloom.verif.drivers.axi_slave import SLVERR, Wrong, wrong_ends
from tests.gen.test_lint import WAIVERS, lint
from tests.rtl.simulation import Simulation
from tests.rtl.watched import watched

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


@cache
def compiled(shape: tuple[tuple[str, int], ...]) -> tuple[HeaderReader, AxiChecker, Simulation]:
    """A reader of that shape, the checker beside its port, and both in a simulator."""
    reader = HeaderReader(**dict(shape))
    dut, checker = watched(reader)
    return reader, checker, Simulation(dut)


class Loads:
    """Loads headers one after another and notes what the reader says of each.

    `ticks`: cycles from one tick to the next, 0 for none; `pause`: cycles from one load to the next.
    """

    def __init__(
        self,
        *,
        data_width: int = 512,
        latency: int = 5,
        stall: float = 0.0,
        ticks: int = 0,
        pause: int = 3,
        **limits: int,
    ):
        self.ticks, self.pause = ticks, pause
        shape = {"width": 8, "stack": 24, "data_width": data_width} | limits
        self.reader, checker, self.simulation = compiled(tuple(sorted(shape.items())))
        options: dict[str, Any] = {"latency": latency, "stall": stall, "seed": 3, "content": self.content}
        self.memory = AmaranthSlave(self.reader.m_axi, checker=checker, **options)
        self.words = header()
        self.seen: list[dict[str, Any]] = []

    def content(self, address: int, size: int) -> int:
        """The same block everywhere."""
        first = address % 64
        return int.from_bytes(self.words.astype("<u4").tobytes()[first : first + size], "little")

    def __call__(
        self, *headers: np.ndarray, bad: set[int] | None = None, bases: Sequence[int] = (), mend: int = -1
    ) -> list[dict[str, Any]]:
        """`bases`: where they are, else all at BASE. Behind the load of number `mend` the memory is right."""
        reader, memory = self.reader, self.memory
        memory.errors = dict.fromkeys(bad or (), SLVERR)

        async def testbench(ctx: Any) -> None:
            assert not ctx.get(reader.loaded)
            assert not ctx.get(reader.busy)
            now = 0

            async def step() -> None:
                nonlocal now
                ctx.set(reader.tick, int(self.ticks > 0 and now % self.ticks == 0))
                memory.drive(ctx)
                memory.sample(ctx)
                await ctx.tick()
                now += 1

            for number, words in enumerate(headers):
                self.words = words
                for cycle in range(200):
                    # In the next cycle another base shows that it was taken with `load`.
                    ctx.set(reader.load, int(cycle == 0 or (cycle == 3 and ctx.get(reader.busy))))
                    ctx.set(reader.base, (bases[number] if bases else BASE) if cycle == 0 else 64)
                    if cycle and not ctx.get(reader.busy):
                        break
                    assert cycle == 0 or not (ctx.get(reader.loaded) or ctx.get(reader.load_error))
                    await step()
                ctx.set(reader.load, 0)
                if number == mend:
                    memory.wrong = {}
                for _ in range(self.pause):
                    await step()
                names = ("loaded", "load_error", "tree_base", "blocks", "root", "levels", "lattice_exponent")
                seen = {name: ctx.get(getattr(reader, name)) for name in names}
                seen["lattice_origin"] = [ctx.get(reader.lattice_origin[k]) for k in range(3)]
                self.seen.append(seen | {"cycles": cycle})

        self.simulation.run(testbench)
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


@pytest.mark.parametrize("data_width", [32, 128, 512])
def test_a_base_that_no_block_has(data_width: int) -> None:
    """0xFE0 let the burst cross a border of 4 KB, with a bus of 32 or 128 bits."""
    wrong = [BASE + offset for offset in (1, 2, 4, 8, 16, 32, 0xFE0, 63)]
    loads = Loads(data_width=data_width)
    seen = loads(*[header()] * (len(wrong) + 1), bases=[*wrong, BASE])
    assert [one["load_error"] for one in seen] == [LOAD_ERRORS["base"]] * len(wrong) + [0]
    assert [one["loaded"] for one in seen] == [0] * len(wrong) + [1]
    assert loads.memory.reads == [BASE], "read where there is no block"


@pytest.mark.parametrize("address_width", [32, 40, 64])
def test_a_tree_beyond_the_end_of_the_address_space(address_width: int) -> None:
    last = 2**address_width
    cases = [
        (last - 64 * 5, 5, "none"),
        (last - 64 * 5, 6, "size"),
        (last - 64, 2, "size"),
        (last - 64 * 2, 2, "none"),
        (0, 2**26, "none"),
        (0, 2**26 + 1, "size" if address_width == 32 else "none"),
        (64, 2**26, "size" if address_width == 32 else "none"),
        (0, 2**32 - 1, "size" if address_width == 32 else "none"),
        (last - 64, 2**32 - 1, "size"),
    ]
    loads = Loads(address_width=address_width)
    seen = loads(*[header(blocks=blocks) for _, blocks, _ in cases], bases=[base for base, *_ in cases])
    for one, (base, blocks, error) in zip(seen, cases, strict=True):
        assert one["load_error"] == LOAD_ERRORS[error], f"{blocks} blocks at {base:#x}"


@pytest.mark.parametrize("data_width", [32, 64, 128, 256, 512])
def test_a_header_that_ends_wrongly(data_width: int) -> None:
    """It is refused; and the next one is read when that read is over, but not before."""
    for name, (answer, ends) in wrong_ends(512 // data_width).items():
        loads = Loads(data_width=data_width, pause=20)
        loads.memory.wrong = {BASE: answer}
        first, second = loads(header(), header(), mend=0)
        extra = name == "a beat too many"  # behind a header that was whole
        assert (first["loaded"], first["load_error"]) == (extra, 0 if extra else LOAD_ERRORS["memory"]), name
        again = ends or extra
        assert (second["loaded"], second["load_error"]) == (again, 0 if again else LOAD_ERRORS["memory"]), name
        assert len(loads.memory.reads) == 1 + again, name


@pytest.mark.parametrize("data_width", [32, 512])
@pytest.mark.parametrize("accepted", [True, False])
def test_a_late_header(data_width: int, accepted: bool) -> None:
    """It is given up at the second tick; and none of its beats is taken for the next one's."""
    beats = 512 // data_width
    loads = Loads(data_width=data_width, ticks=20, pause=5, stall=0.0 if accepted else 1.0)
    loads.memory.wrong = {BASE: Wrong(beats=beats, last=frozenset({beats - 1}), after=100)}
    bases = [BASE + 64 * k for k in range(15)]
    late, *others = loads(*[header(magic=0)] + [header()] * 14, bases=bases, mend=0 if accepted else -1)
    assert (late["loaded"], late["load_error"]) == (0, LOAD_ERRORS["memory"])
    assert 20 < late["cycles"] <= 42
    errors = [one["load_error"] for one in others]
    if not accepted:  # the memory never takes the address, which has to stay: the checker says so where it does not
        assert set(errors) == {LOAD_ERRORS["memory"]}
        assert {one["tree_base"] for one in others} == {BASE}
        return
    back = errors.index(0)
    assert errors == [LOAD_ERRORS["memory"]] * back + [0] * (len(others) - back)
    assert all(one["loaded"] for one in others[back:])
    assert back > 5
    assert [one["tree_base"] for one in others] == [BASE] * back + bases[back + 1 :], "the address that was read last"
    assert loads.memory.reads == [BASE, *bases[back + 1 :]]


def beats_of_the_header(loads: Loads) -> list[tuple[int, int]]:
    """Of the block at BASE: the data of each beat, and its RLAST."""
    size = loads.reader.m_axi.signature.data_width // 8
    return [(loads.content(BASE + place, size), int(place + size == 64)) for place in range(0, 64, size)]


async def asks(ctx: Any, reader: HeaderReader) -> None:
    """A load at BASE, whose address is offered then."""
    ctx.set(reader.base, BASE)
    ctx.set(reader.load, 1)
    await ctx.tick()
    ctx.set(reader.load, 0)
    assert ctx.get(reader.m_axi.arvalid)


async def comes(ctx: Any, axi: Any, data: int, last: int, *, wrong: bool = False, identity: int = 0) -> None:
    """A cycle with that beat; or with one that is `wrong` in its data, its response and its RLAST."""
    ctx.set(axi.rvalid, 1)
    ctx.set(axi.rid, identity)
    ctx.set(axi.rdata, data ^ (((1 << len(axi.rdata)) - 1) if wrong else 0))
    ctx.set(axi.rresp, SLVERR if wrong else 0)
    ctx.set(axi.rlast, last ^ wrong)
    await ctx.tick()
    ctx.set(axi.rvalid, 0)


async def is_good(ctx: Any, reader: HeaderReader) -> None:
    """The load ends in the next cycle, and what was read is the header."""
    await ctx.tick()
    assert not ctx.get(reader.busy)
    assert ctx.get(reader.loaded), f"load_error {ctx.get(reader.load_error)}"
    assert ctx.get(reader.blocks) == GOOD["blocks"]


@pytest.mark.parametrize("data_width", [128, 512])
def test_beats_of_other_ids_are_no_part_of_the_header(data_width: int) -> None:
    """Of a master that shares the channel: before each beat of the header one of another read, wrong in all ways."""
    loads = Loads(data_width=data_width)
    reader, axi = loads.reader, loads.reader.m_axi

    async def testbench(ctx: Any) -> None:
        await asks(ctx, reader)
        ctx.set(axi.arready, 1)
        await ctx.tick()
        assert not ctx.get(axi.arvalid)
        for data, last in beats_of_the_header(loads):
            await comes(ctx, axi, data, last, wrong=True, identity=1)
            await comes(ctx, axi, data, last)
        await is_good(ctx, reader)

    loads.simulation.run(testbench)


@pytest.mark.parametrize("data_width", [128, 512])
def test_beats_before_the_address_is_taken_are_no_part_of_the_header(data_width: int) -> None:
    """Of no read that is under way: before the load, while its address waits, and in the cycle in which it is taken."""
    loads = Loads(data_width=data_width)
    reader, axi = loads.reader, loads.reader.m_axi
    beats = beats_of_the_header(loads)

    async def testbench(ctx: Any) -> None:
        for data, last in beats:
            await comes(ctx, axi, data, last, wrong=True)
        await asks(ctx, reader)
        for data, last in beats:
            await comes(ctx, axi, data, last, wrong=True)
        ctx.set(axi.arready, 1)
        await comes(ctx, axi, *beats[-1], wrong=True)
        assert not ctx.get(axi.arvalid)
        for data, last in beats:
            await comes(ctx, axi, data, last)
        await is_good(ctx, reader)

    loads.simulation.run(testbench)


@pytest.mark.parametrize("data_width", [128, 512])
def test_a_header_that_is_whole_at_the_second_tick(data_width: int) -> None:
    """Its last beat comes in that cycle: it is awaited no more."""
    loads = Loads(data_width=data_width)
    reader, axi = loads.reader, loads.reader.m_axi

    async def testbench(ctx: Any) -> None:
        await asks(ctx, reader)
        ctx.set(axi.arready, 1)
        ctx.set(reader.tick, 1)
        await ctx.tick()
        for data, last in beats_of_the_header(loads):
            ctx.set(reader.tick, last)
            await comes(ctx, axi, data, last)
        ctx.set(reader.tick, 0)
        await is_good(ctx, reader)

    loads.simulation.run(testbench)


@pytest.mark.parametrize("data_width", [32, 512])
def test_verilog_is_clean(data_width: int, tmp_path: Path) -> None:
    source = tmp_path / "header_reader.v"
    source.write_text(convert(HeaderReader(width=8, stack=24, data_width=data_width), "header_reader"))
    assert lint(WAIVERS, source, top="header_reader") == ""
