"""Runs designs in Amaranth's own simulator.

That works out anew what follows with every value that is set, which takes most of its time; and to compile a design
takes as long as some thousands of its cycles. So what a testbench sets is given together, and a design may run several
times.
"""

from collections.abc import Awaitable, Callable
from typing import Any

from amaranth import Cat, Const, Elaboratable, Signal, Value, ValueCastable
from amaranth.hdl import ShapeCastable
from amaranth.sim import Simulator

PERIOD = 1e-6
Testbench = Callable[[Any], Awaitable[None]]


class Together:
    """The context of a testbench, in which what was set is given before anything is read and before time passes."""

    def __init__(self, ctx: Any) -> None:
        self._ctx = ctx
        self._waiting: dict[int, tuple[Signal, int]] = {}
        self._joined: dict[tuple[int, ...], Value] = {}

    def set(self, what: Any, value: Any) -> None:
        shape = what.shape()
        if isinstance(what, ValueCastable) and isinstance(shape, ShapeCastable):
            value = shape.const(value)
        number, signal = Const.cast(value).value, Value.cast(what)
        if isinstance(signal, Signal):
            self._waiting[id(signal)] = signal, number & (1 << len(signal)) - 1
        else:  # a part of one, of which more may be waiting
            self.flush()
            self._ctx.set(signal, number)

    def flush(self) -> None:
        """Gives what was set."""
        if not self._waiting:
            return
        key = tuple(self._waiting)
        if key not in self._joined:
            self._joined[key] = Cat(signal for signal, _ in self._waiting.values())
        number = low = 0
        for signal, value in self._waiting.values():
            number |= value << low
            low += len(signal)
        self._waiting.clear()
        self._ctx.set(self._joined[key], number)

    def get(self, what: Any) -> Any:
        self.flush()
        return self._ctx.get(what)

    def tick(self, *domain: Any, **options: Any) -> Any:
        self.flush()
        return self._ctx.tick(*domain, **options)


class Simulation:
    """A design, compiled once, for any number of runs, each of which begins as the design does."""

    def __init__(self, dut: Elaboratable) -> None:
        self._simulator = Simulator(dut)
        self._simulator.add_clock(PERIOD)
        self._testbenches: tuple[Testbench, ...] = ()

    def run(self, *testbenches: Testbench, cycles: int | None = None) -> None:
        """Until all testbenches are over, or for so many cycles. All runs have as many testbenches."""
        if self._testbenches:
            self._simulator.reset()
        else:
            for number in range(len(testbenches)):
                self._simulator.add_testbench(self._part(number))
        assert len(self._testbenches) in (0, len(testbenches))
        self._testbenches = testbenches
        if cycles is None:
            self._simulator.run()
        else:
            self._simulator.run_until(cycles * PERIOD)

    def _part(self, number: int) -> Testbench:
        async def testbench(ctx: Any) -> None:
            together = Together(ctx)
            await self._testbenches[number](together)
            together.flush()

        return testbench


def simulate(dut: Elaboratable, *testbenches: Testbench, cycles: int | None = None) -> None:
    """One run of a design, with all of its testbenches at once."""
    Simulation(dut).run(*testbenches, cycles=cycles)
