"""Loads a tree when no ray is under way."""

from amaranth import Module, Signal
from amaranth.lib import wiring
from amaranth.lib.wiring import In, Out


class Loader(wiring.Component):
    """Turns requests to load a tree into one strobe each, at a time when nothing depends on the tree before.

    Ports:

    - `load`: strobe, a tree is to be loaded from byte address `base`. Several before the loading begins are one, of the
      last one's base.
    - `idle`: no ray is under way. `busy`: the header is being read.
    - `loading`: a tree has been asked for, and its header has not been read yet: no ray may enter.
    - `go`: strobe, read the header at `next_base`; what caches hold is worth nothing any more.
    """

    def __init__(self, address_width: int):
        super().__init__(
            {
                "load": In(1),
                "base": In(address_width),
                "idle": In(1),
                "busy": In(1),
                "loading": Out(1),
                "go": Out(1),
                "next_base": Out(address_width),
            }
        )

    def elaborate(self, platform: object) -> Module:
        m = Module()
        asked = Signal()
        base = Signal(self.base.shape(), reset_less=True)
        m.d.comb += [
            self.go.eq(asked & self.idle & ~self.busy),
            self.loading.eq(asked | self.busy),
            self.next_base.eq(base),
        ]
        with m.If(self.load):
            m.d.sync += [asked.eq(1), base.eq(self.base)]
        with m.Elif(self.go):
            m.d.sync += asked.eq(0)
        return m
