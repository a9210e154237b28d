"""The master of an AXI4-Lite port in cocotb: all five channels stall as told, and every answer is looked at."""

import random
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import cocotb
from cocotb.triggers import Event, FallingEdge, RisingEdge

from lightloom.verif.drivers.register_model import OKAY, RegisterSteps
from lightloom.verif.drivers.stepped import Stepped
from lightloom.verif.drivers.stream import pattern

FORTH = {"aw": ("awaddr",), "w": ("wdata", "wstrb"), "ar": ("araddr",)}
"""Channels to the slave, and what each carries."""
BACK = {"r": ("rdata", "rresp"), "b": ("bresp",)}
"""Channels of answers: a read does not see the write that is done in the same cycle, so reads come first."""


class Access:
    """A read or a write of a word. `await` it for its answer."""

    def __init__(self, address: int, data: int | None, strobes: int, at: int) -> None:
        self.address, self.data, self.strobes = address, data, strobes
        self.at = at
        """The cycle before which it is not offered."""
        self.response = OKAY
        self.word: int | None = None
        """What was read; None where the simulator has it as undefined."""
        self.done_at = 0
        """The cycle in which it was done: the one in which a write changes registers, or a read looks at them."""
        self.irq = 0
        """The interrupt in that cycle."""
        self.over = Event()

    def __await__(self) -> Any:
        yield from self.over.wait().__await__()
        return self

    def __str__(self) -> str:
        what = "read" if self.data is None else f"write of {self.data:#010x}, strobes {self.strobes:#x},"
        return f"{what} at {self.address:#x} in cycle {self.done_at}"


@dataclass
class _Offer:
    """What a channel to the slave offers."""

    waiting: deque[tuple[Access, tuple[int, ...]]]
    willing: Iterator[bool]
    shown: bool = False
    taken: Access | None = None
    """What the slave has taken and not done."""


class LiteMaster:
    """Offers accesses in the order in which they are asked for, reads and writes beside each other.

    It knows when an access is done, as the documentation says it: in the cycle after all of it was taken, when the
    answer to the one before is gone; its answer is offered in the next. A channel is ready while nothing of it waits.
    Each answer is held to that, to the model of the registers (whatever software alone decides is compared in all bits,
    in every read), and in every read of the events to the interrupt of the same cycle. Whether a write of a held
    register is refused is for the test to say.
    """

    def __init__(self, dut: Any, registers: list[dict[str, Any]], rng: random.Random, seed: int) -> None:
        self.dut, self.rng, self.registers, self.seed = dut, rng, registers, seed
        self.stall("always")
        self.cycle = 0
        self.irqs: list[int] = []
        """The interrupt in each cycle since the reset."""
        self.refused = self.done = 0
        self.forget()
        dut.s_axi_awprot.value = dut.s_axi_arprot.value = 0
        cocotb.start_soon(self._run())

    def stall(self, willing: str) -> None:
        """Every channel is willing in that pattern (`drivers.stream.pattern`), each by itself, from now on."""
        self._willing = {name: pattern(willing, self.rng) for name in (*FORTH, *BACK)}
        for name, offer in getattr(self, "_offers", {}).items():
            offer.willing = self._willing[name]

    def forget(self) -> None:
        """A reset."""
        self._offers = {name: _Offer(deque(), self._willing[name]) for name in FORTH}
        self._due: dict[str, Access | None] = dict.fromkeys(BACK)
        self._seen: dict[str, str | None] = dict.fromkeys(BACK)
        self.steps = Stepped(RegisterSteps(self.registers), "registers", self.seed)
        self.cycle, self.irqs = 0, []

    def write(self, address: int, data: int, strobes: int = 0xF, at: int = 0) -> Access:
        """Asks for a write; address and data are offered by themselves, from cycle `at` on."""
        access = Access(address, data, strobes, at)
        self._offers["aw"].waiting.append((access, (address,)))
        self._offers["w"].waiting.append((access, (data, strobes)))
        return access

    def read(self, address: int, at: int = 0) -> Access:
        """Asks for a read."""
        access = Access(address, None, 0, at)
        self._offers["ar"].waiting.append((access, (address,)))
        return access

    # --- a cycle ------------------------------------------------------------------------------------------------------

    async def _run(self) -> None:
        dut, rising, falling = self.dut, RisingEdge(self.dut.clk), FallingEdge(self.dut.clk)
        while True:
            ready = self._drive()
            await falling
            if int(dut.rst.value):
                self.forget()
            else:
                self._see(ready)
            await rising

    def _drive(self) -> dict[str, bool]:
        dut = self.dut
        for name, offer in self._offers.items():
            if not offer.shown and offer.waiting and offer.waiting[0][0].at <= self.cycle and next(offer.willing):
                offer.shown = True
                for signal, value in zip(FORTH[name], offer.waiting[0][1], strict=True):
                    getattr(dut, f"s_axi_{signal}").value = value
            getattr(dut, f"s_axi_{name}valid").value = int(offer.shown)
        ready = {name: next(self._willing[name]) for name in BACK}
        for name, willing in ready.items():
            getattr(dut, f"s_axi_{name}ready").value = int(willing)
        return ready

    def _get(self, signal: str) -> int:
        return int(getattr(self.dut, f"s_axi_{signal}").value)

    def _see(self, ready: dict[str, bool]) -> None:
        irq = int(self.dut.irq.value)
        self.irqs.append(irq)
        for name in BACK:
            self._answer(name, ready[name])
        room = {name: offer.taken is None for name, offer in self._offers.items()}
        # What was taken whole before this cycle, and has a place for its answer, is done now.
        for name, parts in (("b", ("aw", "w")), ("r", ("ar",))):
            taken = [self._offers[part].taken for part in parts]
            if all(taken) and not self._get(f"{name}valid"):
                self._do(name, taken[0], irq)
                for part in parts:
                    self._offers[part].taken = None
        for name, offer in self._offers.items():
            accepts = bool(self._get(f"{name}ready"))
            assert accepts == room[name], f"cycle {self.cycle}: {name}ready {accepts}"
            if offer.shown and accepts:
                offer.taken, _ = offer.waiting.popleft()
                offer.shown = False
        self.cycle += 1

    def _do(self, name: str, access: Access | None, irq: int) -> None:
        assert access is not None
        access.done_at, access.irq = self.cycle, irq
        self._due[name] = access

    def _answer(self, name: str, ready: bool) -> None:
        """Holds a channel of answers to what is due on it, and to the rule that no offer is changed or withdrawn."""
        access = self._due[name]
        valid = self._get(f"{name}valid")
        assert bool(valid) == (access is not None), f"cycle {self.cycle}: {name}valid {valid}; due: {access}"
        if access is None:
            return
        offered = " ".join(str(getattr(self.dut, f"s_axi_{signal}").value) for signal in BACK[name])
        before, self._seen[name] = self._seen[name], offered
        assert before in (None, offered), f"{access}: its answer changes from {before} to {offered}"
        if before is None:
            access.response = self._get(f"{name}resp")
            self._check(access)
            self.done, self.refused = self.done + 1, self.refused + (access.response != OKAY)
        if ready:
            self._due[name] = self._seen[name] = None
            access.over.set()

    def _check(self, access: Access) -> None:
        """Holds an answer to the model, which is a step further then."""
        operands: dict[str, Any] = {"address": access.address, "cycle": access.done_at}
        seen: dict[str, Any] = {"response": access.response}
        if access.data is not None:
            self.steps.step(operands | {"data": access.data, "strobes": access.strobes}, seen)
            return
        data = self.dut.s_axi_rdata.value
        access.word = int(data) if data.is_resolvable else None
        self.steps.step(operands, seen | {"word": access.word, "irq": access.irq})
