"""Counters of what happens in a traversal unit."""

from amaranth import Module, Signal
from amaranth.lib import wiring
from amaranth.lib.wiring import In, Out

COUNTER_BITS = 48

COUNTERS: dict[str, str] = {
    "cycles": "cycles in which a ray was in the unit",
    "rays": "results given",
    "node_tests": "nodes visited",
    "revisits": "of these again, for the rest of their children",
    "triangle_tests": "triangles tested",
    "leaf_visits": "blocks of triangles visited",
    "node_busy": "cycles in which a block entered the node test",
    "node_starved": "cycles in which there was none",
    "node_stalled": "cycles in which the node test had to wait for the stacks",
    "triangle_busy": "cycles in which a triangle entered the triangle test",
    "triangle_starved": "cycles in which there was no block of triangles",
    "triangle_stalled": "cycles for a block of which the ray sees no triangle, and of waiting where a test takes two",
    "node_hits": "blocks found in the node cache",
    "node_misses": "blocks that the node cache asked the memory for",
    "node_merged": "blocks that it was waiting for already",
    "triangle_hits": "blocks found in the triangle cache",
    "triangle_misses": "blocks that the triangle cache asked the memory for",
    "triangle_merged": "blocks that it was waiting for already",
    "beats": "beats of data from the memory",
    "errors": "rays that failed",
}
"""Name and meaning of every counter; the busy, starved and stalled cycles of a unit add up to `cycles`."""


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
