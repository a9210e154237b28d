"""Bench of a unit behind AXI4-Lite whose results depend on its operands alone, by a master that nobody here wrote.

The master is cocotbext-axi's, which pauses each of its channels as told. What is right is what the golden model
computes, and what the model of the registers says (`verif.drivers.register_model`); the streams are used too.
"""

from collections.abc import Iterator
from typing import Any

import cocotb
import numpy as np
from cocotb.triggers import RisingEdge
from cocotbext.axi import AxiLiteBus, AxiLiteMaster

from lightloom.golden_model.contract import bitpack
from lightloom.golden_model.contract.interfaces import PURE
from lightloom.golden_model.models import model_results
from lightloom.verif.benches.bench import Bench
from lightloom.verif.benches.test_stream_unit import payloads
from lightloom.verif.drivers.register_model import OKAY, SLVERR, RegisterSteps
from lightloom.verif.drivers.stream import pattern

MANNERS = ["always", "half", "rare", "bursts"]
"""How willing the master's channels are, and the streams."""
ACCESSES = 150
"""Of any words."""
PATIENCE = 400
"""Reads of the status in which a result has to come."""


class RegisterBench(Bench):
    """The unit with the master at its registers and a driver at its streams."""

    def __init__(self, dut: Any) -> None:
        super().__init__(dut)
        run = self.run
        self.unit = PURE[run["unit"]]
        self.config: dict[str, int] = run["config"]
        self.tag_width: int = run["tag_width"]
        self.registers: list[dict[str, Any]] = run["registers"]
        self.operands = bitpack.unpack(np.load(run["operands"]), self.unit.input)
        self.places = {field["name"]: (one, field) for one in self.registers for field in one["fields"]}

    async def begin(self, willing: str) -> None:
        dut = self.dut
        self.master = AxiLiteMaster(AxiLiteBus.from_prefix(dut, "s_axi"), dut.clk, dut.rst)
        write, read = self.master.write_if, self.master.read_if
        for channel in (write.aw_channel, write.w_channel, write.b_channel, read.ar_channel, read.r_channel):
            channel.set_pause_generator(self._pauses(willing))
        await self.start({"s_axi_awprot": 0, "s_axi_arprot": 0})

    def _pauses(self, willing: str) -> Iterator[bool]:
        return (not one for one in pattern(willing, self.rng))

    async def write(self, address: int, data: bytes) -> int:
        """Bytes of one word; the answer."""
        return int((await self.master.write(address, data)).resp)

    async def read(self, address: int) -> tuple[int, int]:
        """A word and the answer."""
        seen = await self.master.read(address, 4)
        return int.from_bytes(seen.data, "little"), int(seen.resp)

    async def put(self, **values: int) -> None:
        """Registers, each by one of its fields; the others of its fields become 0."""
        words: dict[int, int] = {}
        for name, value in values.items():
            register, field = self.places[name]
            words[register["offset"]] = words.get(register["offset"], 0) | value << field["low"]
        for offset, word in words.items():
            assert await self.write(offset, word.to_bytes(4, "little")) == OKAY, f"seed {self.seed}: {values}"

    async def field(self, name: str) -> int:
        register, field = self.places[name]
        word, answer = await self.read(register["offset"])
        assert answer == OKAY
        return word >> field["low"] & ((1 << field["width"]) - 1)

    async def await_field(self, name: str, value: int) -> None:
        for _ in range(PATIENCE):
            if await self.field(name) == value:
                return
        raise AssertionError(f"seed {self.seed}: {name} does not become {value}")

    def split(self, kind: str, dtype: np.dtype, payload: int) -> dict[str, int]:
        """A payload as what its fields hold."""
        return {
            "_".join([kind, name, *map(str, index)]): payload >> offset & ((1 << width) - 1)
            for name, index, _, offset, width in bitpack.fields(dtype)
        }


@cocotb.test()
@cocotb.parametrize(willing=MANNERS)
async def operations_through_registers(dut: Any, willing: str) -> None:
    """While others go through the streams: each side gets its own results, in order, with their tags."""
    bench = RegisterBench(dut)
    await bench.begin(willing)
    half = len(bench.operands) // 2
    mine, theirs = bench.operands[:half], bench.operands[half:]
    tags = 1 << bench.tag_width
    golden = model_results(bench.unit.name, bench.operands, bench.config)
    wanted = payloads(golden[:half], np.zeros(half))
    given = payloads(theirs, np.arange(len(theirs)) % tags)
    patterns = [pattern(willing, bench.rng) for _ in range(2)]
    streams = cocotb.start_soon(bench.streams.exchange(given, give=patterns[0], take=patterns[1]))

    await bench.put(result_came_enable=1)
    for k, payload in enumerate(payloads(mine, np.zeros(half))):
        await bench.put(**bench.split("operand", bench.unit.input, payload))
        await bench.put(operand_tag=k % tags)
        await bench.put(submit=1)
        await bench.await_field("result_waits", 1)
        assert int(dut.irq.value) == 1, f"seed {bench.seed}: no interrupt"
        await bench.put(result_came=1)
        await RisingEdge(dut.clk)
        assert int(dut.irq.value) == 0, f"seed {bench.seed}: the interrupt stays"
        assert await bench.field("result_tag") == k % tags
        for name, value in bench.split("result", bench.unit.output, wanted[k]).items():
            seen = await bench.field(name)
            assert seen == value, f"seed {bench.seed}: {mine[k]}: {name} {seen:#x}, not {value:#x}"
        await bench.put(release=1)
    received = (await streams).received
    tagged = payloads(golden[half:], np.arange(len(theirs)) % tags)
    assert received == tagged, f"seed {bench.seed}: results of the stream"
    assert await bench.field("result_waits") == 0


@cocotb.test()
@cocotb.parametrize(willing=MANNERS)
async def accesses_at_random(dut: Any, willing: str) -> None:
    """Reads and writes of any words, there or not, and of some of their bytes: as the model has them."""
    bench = RegisterBench(dut)
    await bench.begin(willing)
    steps, rng = bench.stepped(RegisterSteps(bench.registers), "registers"), bench.rng
    # Whatever is submitted or released would change what is read: that is another test.
    quiet = {bench.places[name][0]["offset"] for name in ("submit", "release")}
    end = 1 << len(dut.s_axi_awaddr)
    answers = set()
    for _ in range(ACCESSES):
        address = rng.randrange(0, end, 4)
        if rng.random() < 0.5:
            first = rng.randrange(4)
            data = rng.randbytes(rng.randint(1, 4 - first))
            if address in quiet:
                continue
            answer = await bench.write(address + first, data)
            word, strobes = int.from_bytes(data, "little") << 8 * first, ((1 << len(data)) - 1) << first
            steps.step({"address": address, "data": word, "strobes": strobes}, {"response": answer})
        else:
            word, answer = await bench.read(address)
            steps.step({"address": address}, {"response": answer, "word": word, "irq": int(dut.irq.value)})
        answers.add(answer)
    assert answers == {OKAY, SLVERR}
