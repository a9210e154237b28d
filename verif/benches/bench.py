"""What benches have in common: the run, clock and reset, signals by name, streams, a memory, and answers by tag."""

import json
import os
import random
from collections.abc import Callable, Iterable, Mapping
from typing import Any

import cocotb
from cocotb.clock import Clock
from cocotb.triggers import ClockCycles, FallingEdge, RisingEdge

from lightloom.golden_model.contract.axi_rules import RULE_PORTS, rule_of
from lightloom.verif.drivers.axi_ports import CocotbSlave
from lightloom.verif.drivers.axi_slave import Manner
from lightloom.verif.drivers.stepped import Model, Stepped
from lightloom.verif.drivers.stream import Exchange, StreamDriver, pattern


class Bench:
    """A design under test: its clock `clk`, its reset `rst` (high) and, where it has them, one stream in and one out,
    and an AXI4 port `m_axi` with a memory behind it.

    `run` is what the run was told (LIGHTLOOM_BENCH, a JSON object); its `seed` decides everything random. Everything is
    driven behind a rising edge and looked at on the falling edge, when it has settled.
    """

    memory: CocotbSlave
    """From `start` on, where the design has a port `m_axi`."""

    def __init__(self, dut: Any) -> None:
        self.dut = dut
        self.run: dict[str, Any] = json.loads(os.environ["LIGHTLOOM_BENCH"])
        self.seed: int = self.run["seed"]
        self.rng = random.Random(self.seed)
        self.rising, self.falling = RisingEdge(dut.clk), FallingEdge(dut.clk)
        self.has_streams = hasattr(dut, "i__payload") and hasattr(dut, "o__payload")
        self.streams = StreamDriver(dut)
        cocotb.log.info("%s, %s", dut._name, self.run)

    async def start(self, inputs: Mapping[str, int] | None = None, memory: Manner | None = None) -> None:
        """Starts the clock and resets the design, with inputs by name, and the memory answering in that manner."""
        self.dut.rst.value = 1
        self.set(**(inputs or {}))
        if hasattr(self.dut, "m_axi_arready") or hasattr(self.dut, "m_axi_awready"):
            self.memory = CocotbSlave(self.dut, "m_axi", rng=self.rng)
            self.memory.manner = memory or Manner()
        Clock(self.dut.clk, 10, unit="ns").start()
        await self.reset()

    async def reset(self) -> None:
        """A reset of two cycles, in which nothing is offered."""
        if self.has_streams:
            self.streams.rest()
        self.dut.rst.value = 1
        await ClockCycles(self.dut.clk, 2)
        self.dut.rst.value = 0

    def set(self, **inputs: int) -> None:
        for name, value in inputs.items():
            getattr(self.dut, name).value = value

    def get(self, name: str) -> int:
        return int(getattr(self.dut, name).value)

    async def strobe(self, name: str, value: int = 1) -> None:
        """An input for one cycle, then 0."""
        self.set(**{name: value})
        await self.rising
        self.set(**{name: 0})

    async def until(self, done: Callable[[], bool], cycles: int, what: str) -> None:
        """Waits for the falling edge on which `done` says so; fails after `cycles` cycles in which `what` is not."""
        for _ in range(cycles):
            await self.falling
            if done():
                return
        raise AssertionError(f"seed {self.seed}: {what}, for {cycles} cycles")

    async def exchange(self, payloads: list[int], give: str = "half", take: str = "half", **options: Any) -> Exchange:
        """Payloads through the streams, both sides willing in the named patterns (`drivers.stream.pattern`)."""
        patterns = pattern(give, self.rng), pattern(take, self.rng)
        return await self.streams.exchange(payloads, give=patterns[0], take=patterns[1], **options)

    def by_tag(self, answers: Iterable[int], tag_of: Callable[[int], int], expected: Iterable[int]) -> dict[int, int]:
        """Answers by their tags: exactly one for each of the expected."""
        where, answers, wanted = f"seed {self.seed}", list(answers), set(expected)
        tags = [tag_of(answer) for answer in answers]
        assert len(set(tags)) == len(tags), f"{where}: doubled tags {sorted(t for t in tags if tags.count(t) > 1)[:9]}"
        strange, lost = set(tags) - wanted, wanted - set(tags)
        assert not strange, f"{where}: tags of no request {sorted(strange)[:9]}"
        assert not lost, f"{where}: lost tags {sorted(lost)[:9]}"
        return dict(zip(tags, answers, strict=True))

    def counters(self, names: Iterable[str], prefix: str = "") -> dict[str, int]:
        return {name: self.get(prefix + name) for name in names}

    def stepped(self, model: Model, what: str) -> Stepped:
        """A model that is held to the hardware step by step, from now on."""
        return Stepped(model, what, self.seed)

    def check_rules(self) -> None:
        """No rule of AXI is broken so far, as the checker beside the port says."""
        for name in RULE_PORTS:
            assert not self.get(name), f"seed {self.seed}: {rule_of(self.get(name))}"
