# amaranth: UnusedElaboratable=no
# (components are made only to ask for their ports)
"""The AXI4 interfaces: AXI's signals, widths and directions, and the names that they have in Verilog."""

from typing import Any

import pytest
from amaranth import Module
from amaranth.lib import wiring
from amaranth.lib.wiring import Out

from lightloom.gen.verilog import ports_of
from lightloom.rtl.memory.axi import Axi, AxiPort, AxiRead, AxiWrite
from lightloom.rtl.memory.axi_writer import AxiWriter
from lightloom.rtl.memory.header_reader import HeaderReader
from lightloom.verif.drivers.axi_ports import AmaranthSlave
from tests.rtl.simulation import simulate
from tests.rtl.test_header_reader import header
from tests.rtl.watched import watched

WIDTHS = {"address_width": 40, "data_width": 128, "id_width": 5}
ADDRESS = {"valid": 1, "ready": -1, "addr": 40, "id": 5, "len": 8, "size": 3, "burst": 2}
SIGNALS = {
    "aw": ADDRESS,
    "w": {"valid": 1, "ready": -1, "data": 128, "strb": 16, "last": 1},
    "b": {"valid": -1, "ready": 1, "id": -5, "resp": -2},
    "ar": ADDRESS,
    "r": {"valid": -1, "ready": 1, "data": -128, "id": -5, "resp": -2, "last": -1},
}
"""Of a master, by the specification (AMBA AXI, IHI 0022): bits of its outputs, and less than nothing of its inputs."""


def signals(*channels: str) -> dict[str, int]:
    return {f"{channel}{name}": bits for channel in channels for name, bits in SIGNALS[channel].items()}


class Master(wiring.Component):
    """Nothing but a port."""

    def __init__(self, signature: wiring.Signature):
        super().__init__({"m_axi": Out(signature)})

    def elaborate(self, platform: object) -> Module:
        return Module()


@pytest.mark.parametrize(
    ("port", "channels"),
    [(AxiRead, ("ar", "r")), (AxiWrite, ("aw", "w", "b")), (Axi, ("ar", "r", "aw", "w", "b"))],
    ids=["read", "write", "both"],
)
def test_a_master_has_the_signals_of_axi(port: type[AxiPort], channels: tuple[str, ...]) -> None:
    ports = {
        name: len(value) if member.flow == Out else -len(value)
        for name, member, value in ports_of(Master(port(**WIDTHS)))
    }
    assert ports == {f"m_axi_{name}": bits for name, bits in signals(*channels).items()}
    assert list(ports) == [f"m_axi_{name}" for name in signals(*channels)], "another order is another Verilog text"


class Both(wiring.Component):
    """Writes blocks, and loads headers, through one port."""

    def __init__(self) -> None:
        self.writer = AxiWriter(writes=4, **WIDTHS)
        self.reader = HeaderReader(width=8, stack=24, **WIDTHS)
        super().__init__({"m_axi": Out(Axi(**WIDTHS))})

    def elaborate(self, platform: object) -> Module:
        m = Module()
        m.submodules.writer = self.writer
        m.submodules.reader = self.reader
        wiring.connect(m, self.writer.m_axi, wiring.flipped(self.m_axi.write))
        wiring.connect(m, self.reader.m_axi, wiring.flipped(self.m_axi.read))
        return m


def test_what_was_written_is_read_through_the_same_port() -> None:
    """A header, once the writer is idle; and what was there before it, while that is not so."""
    unit = Both()
    dut, checker = watched(unit)
    memory = AmaranthSlave(unit.m_axi, checker=checker, latency=20, content=lambda address, size: 0)
    base, words = 0x5_0040, header(blocks=77)

    async def load(ctx: Any) -> bool:
        ctx.set(unit.reader.base, base)
        ctx.set(unit.reader.load, 1)
        await step(ctx)
        ctx.set(unit.reader.load, 0)
        while ctx.get(unit.reader.busy):
            await step(ctx)
        return bool(ctx.get(unit.reader.loaded))

    async def step(ctx: Any) -> None:
        memory.drive(ctx)
        memory.sample(ctx)
        await ctx.tick()

    async def testbench(ctx: Any) -> None:
        ctx.set(unit.writer.limit, 1 << WIDTHS["address_width"])
        content = int.from_bytes(words.astype("<u4").tobytes(), "little")
        ctx.set(unit.writer.i.payload, {"block": base // 64, "data": content, "strobes": (1 << 64) - 1})
        ctx.set(unit.writer.i.valid, 1)
        await step(ctx)
        ctx.set(unit.writer.i.valid, 0)
        assert not ctx.get(unit.writer.idle)
        assert not await load(ctx)
        while not ctx.get(unit.writer.idle):
            await step(ctx)
        assert await load(ctx)
        assert ctx.get(unit.reader.blocks) == 77

    simulate(dut, testbench)


@pytest.mark.parametrize(("width", "beats", "size"), [(32, 16, 2), (128, 4, 4), (512, 1, 6)])
def test_a_block_is_a_burst(width: int, beats: int, size: int) -> None:
    port = AxiWrite(**(WIDTHS | {"data_width": width}))
    assert (port.block_beats, port.beat_size) == (beats, size)


@pytest.mark.parametrize("port", [AxiRead, AxiWrite, Axi])
def test_widths_that_cannot_be(port: type[AxiPort]) -> None:
    for name, values in {"address_width": (6, 65), "data_width": (16, 100, 1024), "id_width": (0,)}.items():
        for value in values:
            with pytest.raises(ValueError, match=f"{name} must be .*, not {value}"):
                port(**(WIDTHS | {name: value}))
