"""A unit behind registers: software and the streams use it at the same time, and each gets its own results."""

import random
from collections import deque
from typing import Any

import numpy as np
import pytest
from amaranth import Const, Signal

from lightloom.golden_model.contract import bitpack
from lightloom.golden_model.host.errors import InputError
from lightloom.golden_model.models import model_results
from lightloom.rtl.buses import component
from lightloom.rtl.catalogue import CATALOGUE
from lightloom.rtl.config import PRESETS
from lightloom.rtl.registers.front import RegisterFront
from lightloom.verif.vectors.unit_vectors import unit_vectors
from tests.rtl.simulation import simulate

UNIT, CONFIG = "float_add", PRESETS["tiny"]
SEED, COUNT = 77, 150
LIMIT = 60_000
"""Cycles."""


class Software:
    """What a driver does: a word at a time, by names of fields."""

    def __init__(self, ctx: Any, dut: RegisterFront, rng: random.Random) -> None:
        self.ctx, self.port, self.rng = ctx, dut.s_axi, rng
        self.places = {one.name: (register, low) for register in dut.table.registers for low, one in register.fields}

    async def pause(self) -> None:
        await self.ctx.tick().repeat(self.rng.choice([1, 1, 2, 9]))

    async def write(self, name: str, value: int) -> int:
        """A whole register by one of its fields; the answer."""
        register, low = self.places[name]
        ctx, port = self.ctx, self.port
        ctx.set(port.awaddr, register.offset)
        ctx.set(port.wdata, value << low)
        ctx.set(port.wstrb, 15)
        ctx.set(port.awvalid, 1)
        ctx.set(port.wvalid, 1)
        await ctx.tick()  # both are taken: nothing waits
        ctx.set(port.awvalid, 0)
        ctx.set(port.wvalid, 0)
        return await self._answer(port.bvalid, port.bready, port.bresp)

    async def read(self, name: str) -> int:
        register, low = self.places[name]
        ctx, port = self.ctx, self.port
        width = next(one.width for place, one in register.fields if place == low)
        ctx.set(port.araddr, register.offset)
        ctx.set(port.arvalid, 1)
        await ctx.tick()
        ctx.set(port.arvalid, 0)
        word = await self._answer(port.rvalid, port.rready, port.rdata)
        return word >> low & ((1 << width) - 1)

    async def _answer(self, valid: Any, ready: Any, payload: Any) -> int:
        while not self.ctx.get(valid):
            await self.ctx.tick()
        await self.pause()
        self.ctx.set(ready, 1)
        value: int = self.ctx.get(payload)
        await self.ctx.tick()
        self.ctx.set(ready, 0)
        return value


def whole(records: np.ndarray) -> list[int]:
    return [int.from_bytes(row.tobytes(), "little") for row in bitpack.pack(records).astype("<u4")]


def test_software_and_streams_share_a_unit() -> None:
    rng = random.Random(SEED)
    dut = component(UNIT, CONFIG, "axi4-lite")
    assert isinstance(dut, RegisterFront)
    operands = unit_vectors(UNIT, 2 * COUNT, SEED)[: 2 * COUNT]
    results = whole(model_results(UNIT, operands, CONFIG.flat()))
    mine, theirs = operands[:COUNT], whole(operands[COUNT:])
    tags = 1 << CONFIG.streams.tag_width
    ends: list[str] = []
    events = 0

    async def software(ctx: Any) -> None:
        nonlocal events
        cpu = Software(ctx, dut, rng)
        await cpu.write("result_came_enable", 1)
        under_way: deque[int] = deque()
        sent = received = 0
        while received < COUNT:
            if sent < COUNT and len(under_way) < 4 and not await cpu.read("operands_wait"):
                for name in ("a", "b", "subtract"):
                    bits = int(np.ascontiguousarray(mine[name][sent : sent + 1]).view(f"u{mine[name].itemsize}")[0])
                    assert await cpu.write(f"operand_{name}", bits) == 0
                assert await cpu.write("operand_tag", sent % tags) == 0
                assert await cpu.write("submit", 1) == 0
                under_way.append(sent)
                sent += 1
            await cpu.pause()
            if ctx.get(dut.irq):
                events += 1
                await cpu.write("result_came", 1)
            if await cpu.read("result_waits"):
                k = under_way.popleft()
                assert await cpu.read("result_tag") == k % tags, f"seed {SEED}: operation {k}"
                seen = await cpu.read("result_z")
                assert seen == results[k], f"seed {SEED}: {mine[k]}: {seen:#x}, not {results[k]:#x}"
                await cpu.write("release", 1)
                received += 1
            # One that is not there is not given.
            assert len(under_way) + received == sent
        ends.append("software")

    async def giver(ctx: Any) -> None:
        width = bitpack.width(operands.dtype)
        for k, payload in enumerate(theirs):
            await ctx.tick().repeat(rng.choice([1, 1, 1, 5]))
            ctx.set(dut.i.payload.as_value(), payload | k % tags << width)
            ctx.set(dut.i.valid, 1)
            await ctx.tick().until(dut.i.ready)
            ctx.set(dut.i.valid, 0)
        ends.append("giver")

    async def taker(ctx: Any) -> None:
        width = bitpack.width(model_results(UNIT, operands[:1], CONFIG.flat()).dtype)
        for k in range(COUNT):
            await ctx.tick().repeat(rng.choice([1, 1, 7]))
            ctx.set(dut.o.ready, 1)
            (seen,) = await ctx.tick().sample(dut.o.payload.as_value()).until(dut.o.valid)
            ctx.set(dut.o.ready, 0)
            assert seen == results[COUNT + k] | k % tags << width, f"seed {SEED}: operation {k} of the stream"
        ends.append("taker")

    async def inside(ctx: Any) -> None:
        """What the unit is offered stays until it is taken."""
        unit, before = dut._unit.i, None
        async for _, _, valid, ready, payload in ctx.tick().sample(unit.valid, unit.ready, unit.payload.as_value()):
            assert before is None or (valid and payload == before), f"seed {SEED}: an offer was changed"
            before = payload if valid and not ready else None
            if len(ends) == 3:
                return

    simulate(dut, software, giver, taker, inside, cycles=LIMIT)
    assert sorted(ends) == ["giver", "software", "taker"], f"seed {SEED}: not over after {LIMIT} cycles"
    assert events > 10


def test_operands_are_held_while_they_wait() -> None:
    """A unit that takes nothing: registers of operands refuse what would change them, and say that they wait."""
    dut = component(UNIT, CONFIG, "axi4-lite")
    assert isinstance(dut, RegisterFront)
    answers: list[int] = []

    async def bench(ctx: Any) -> None:
        cpu = Software(ctx, dut, random.Random(SEED))
        # Software takes no result: three fill the unit's output and the two places behind it, others its pipeline.
        for k in range(40):
            if await cpu.read("operands_wait"):
                break
            await cpu.write("operand_a", k)
            await cpu.write("submit", 1)
        for name in ("operand_a", "operand_b", "operand_subtract", "operand_tag", "submit"):
            answers.append(await cpu.write(name, 1))
        assert await cpu.read("operand_a") == k - 1
        assert await cpu.read("result_waits")
        await cpu.write("release", 1)
        answers.append(await cpu.write("operand_a", 1))

    simulate(dut, bench)
    assert answers == [2, 2, 2, 2, 2, 0]


@pytest.mark.parametrize("tag_width", [31, 32])
def test_a_tag_leaves_room_for_a_bit(tag_width: int) -> None:
    config = CONFIG.but(tag_width=tag_width)
    if tag_width == 31:
        assert component(UNIT, config, "axi4-lite").tag_width == 31
    else:
        with pytest.raises(InputError, match="tag_width 32: behind a bus a tag has a bit less"):
            component(UNIT, config, "axi4-lite")


def test_every_unit_says_what_has_happened_by_its_ports() -> None:
    for unit in CATALOGUE:
        made = CATALOGUE[unit](CONFIG)
        for event in made.EVENTS:
            assert isinstance(event.level(made), Const | Signal) or len(event.level(made)) == 1, event.name
