"""The register block against a model, its port's channels stalled at random, while what it reads changes."""

import random
from collections import deque
from typing import Any

import pytest

from lightloom.gen.manifest import registers
from lightloom.rtl.registers.register_block import RegisterBlock
from lightloom.verif.drivers.register_model import RegisterModel
from tests.rtl.registers.toy import toy_table
from tests.rtl.simulation import simulate

ACCESSES = 1500


class Channel:
    """One side of a channel: offers what is put, stalls at random, and never takes back an offer."""

    def __init__(self, rng: random.Random, busy: float) -> None:
        self.waiting: deque[dict[str, int]] = deque()
        self.rng, self.busy, self.shown = rng, busy, False

    def offers(self) -> bool:
        self.shown = bool(self.waiting) and (self.shown or self.rng.random() < self.busy)
        return self.shown


def accesses(rng: random.Random, size: int) -> list[tuple[int, int, int]]:
    """Address, data and strobes; a few of them beyond the registers, and of words that are written often."""
    out = []
    for _ in range(ACCESSES):
        address = rng.choice([rng.randrange(0, 1 << (size - 1).bit_length()), 8, 12, 24, 28, 32, 36])
        out.append((address, rng.getrandbits(32), rng.choice([15, 15, rng.getrandbits(4)])))
    return out


@pytest.mark.parametrize("busy", [1.0, 0.4])
def test_reads_and_writes_at_random(busy: float) -> None:
    seed = 100 + int(10 * busy)
    rng, table = random.Random(seed), toy_table()
    dut = RegisterBlock(table)
    model = RegisterModel(registers(table))
    wanted = {"b": deque[Any](), "r": deque[Any]()}
    strobes = [one.name for one in table.fields if one.access.value == "w1p"]

    async def bench(ctx: Any) -> None:
        port = dut.s_axi
        channels = {name: Channel(rng, busy) for name in ("aw", "w", "ar")}
        for address, data, strobe in accesses(rng, table.size):
            channels["aw"].waiting.append({"awaddr": address})
            channels["w"].waiting.append({"wdata": data, "wstrb": strobe})
        channels["ar"].waiting.extend({"araddr": address} for address, *_ in accesses(rng, table.size))
        taken = {name: deque[dict[str, int]]() for name in channels}
        expected: set[str] = set()
        done = 0
        for _ in range(40 * ACCESSES):
            # What the hardware says changes in every cycle, and events come.
            model.status = {name: rng.getrandbits(len(getattr(dut, name))) for name in model.status}
            for name, value in model.status.items():
                ctx.set(getattr(dut, name), value)
            events = {name: rng.random() < 0.2 for name in ("over", "lost")}
            for name, happens in events.items():
                ctx.set(getattr(dut, f"{name}_set"), happens)
            for name, channel in channels.items():
                ctx.set(getattr(port, f"{name}valid"), channel.offers())
                for signal, value in (channel.waiting[0] if channel.shown else {}).items():
                    ctx.set(getattr(port, signal), value)
            for name in ("b", "r"):
                ctx.set(getattr(port, f"{name}ready"), rng.random() < busy)
            for name in model.held:
                assert ctx.get(getattr(dut, name)) == model.held[name], f"seed {seed}: {name}"
            assert {name for name in strobes if ctx.get(getattr(dut, name))} == expected, f"seed {seed}"

            # An access is done in the cycle after all of it has come, if its answer has somewhere to go.
            expected = set()
            if taken["ar"] and not ctx.get(port.rvalid):
                wanted["r"].append(model.read(taken["ar"].popleft()["araddr"]))
            if taken["aw"] and taken["w"] and not ctx.get(port.bvalid):
                place, word = taken["aw"].popleft(), taken["w"].popleft()
                wanted["b"].append((model.write(place["awaddr"], word["wdata"], word["wstrb"]),))
                expected = model.strobes
            for name, happens in events.items():
                if happens:
                    model.happen(name)
            for name, channel in channels.items():
                if channel.shown and ctx.get(getattr(port, f"{name}ready")):
                    taken[name].append(channel.waiting.popleft())
                    channel.shown = False
            for name, signals in (("b", ("bresp",)), ("r", ("rdata", "rresp"))):
                if ctx.get(getattr(port, f"{name}valid")) and ctx.get(getattr(port, f"{name}ready")):
                    seen = tuple(ctx.get(getattr(port, signal)) for signal in signals)
                    assert wanted[name], f"seed {seed}: an answer to nothing"
                    assert seen == wanted[name].popleft(), f"seed {seed}: answer {done}"
                    done += 1
            await ctx.tick()
            if done == 2 * ACCESSES:
                return
        raise AssertionError(f"seed {seed}: {done} of {2 * ACCESSES} answers")

    simulate(dut, bench)
