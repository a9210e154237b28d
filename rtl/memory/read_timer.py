"""The clock by which a read of the memory takes too long."""

from amaranth import Module, Signal
from amaranth.lib.wiring import Component, In, Out

TIMEOUT_BITS = 24


class ReadTimer(Component):
    """Gives a `tick` of one cycle every `timeout` + 1 cycles; never, where `timeout` is 0, and `runs` is low.

    Whoever finds a read under way at two ticks gives it up, after one to two such times.
    """

    def __init__(self) -> None:
        super().__init__({"timeout": In(TIMEOUT_BITS), "runs": Out(1), "tick": Out(1)})

    def elaborate(self, platform: object) -> Module:
        m = Module()
        elapsed = Signal(TIMEOUT_BITS)
        m.d.comb += self.runs.eq(self.timeout != 0)
        with m.If(elapsed >= self.timeout):
            m.d.sync += [elapsed.eq(0), self.tick.eq(self.runs)]
        with m.Else():
            m.d.sync += [elapsed.eq(elapsed + 1), self.tick.eq(0)]
        return m
