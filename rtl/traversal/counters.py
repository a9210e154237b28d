"""Counters of what happens in a traversal unit."""

from amaranth import Module, Signal
from amaranth.lib import wiring
from amaranth.lib.wiring import In, Out

from lightloom.golden_model.contract.interfaces import COUNTERS

COUNTER_BITS = 48


class Counters(wiring.Component):
    """Counters of COUNTER_BITS bits, which wrap around.

    Ports: `event_<name>`, one more of it in this cycle; `clear`, all become 0; `count_<name>`. Events come late in a
    cycle, so they are counted, and counters cleared, in the next.
    """

    def __init__(self) -> None:
        super().__init__(
            {
                "clear": In(1),
                **{f"event_{name}": In(1) for name in COUNTERS},
                **{f"count_{name}": Out(COUNTER_BITS) for name in COUNTERS},
            }
        )

    def elaborate(self, platform: object) -> Module:
        m = Module()
        clear = Signal()
        m.d.sync += clear.eq(self.clear)
        for name in COUNTERS:
            count, event = getattr(self, f"count_{name}"), Signal(name=f"was_{name}")
            m.d.sync += event.eq(getattr(self, f"event_{name}"))
            with m.If(clear):
                m.d.sync += count.eq(0)
            with m.Elif(event):
                m.d.sync += count.eq(count + 1)
        return m
