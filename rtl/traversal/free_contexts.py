"""The contexts of a traversal unit that hold no ray, and which of them the next ray gets."""

from amaranth import Module, Signal
from amaranth.lib.wiring import Component, In, Out

from lightloom.rtl.config import Config
from lightloom.rtl.fabric.one_hot import lowest, number_of
from lightloom.rtl.traversal.masks import only_if


class FreeContexts(Component):
    """Gives away the lowest free context; which one is known a cycle before.

    Ports:

    - `reserved_valid`: there is one for the next ray, with the number `reserved_number`. `take`: the ray is there.
    - `start`: the mask of the context that a ray takes in this cycle; 0: none does.
    - `released`: the mask of a context that is free again; 0: none is.
    - `idle`: no context holds a ray.
    """

    def __init__(self, config: Config):
        contexts = config.traversal.contexts
        super().__init__(
            {
                "take": In(1),
                "reserved_valid": Out(1),
                "reserved_number": Out(config.traversal.context_bits),
                "start": Out(contexts),
                "released": In(contexts),
                "idle": Out(1),
            }
        )

    def elaborate(self, platform: object) -> Module:
        m = Module()
        contexts = len(self.start)
        taken = Signal(contexts)  # holds a ray
        reserved = Signal(contexts)
        free = Signal(contexts)
        first_free = Signal(contexts)
        takes = Signal()
        m.d.comb += [
            free.eq(~taken & ~reserved),
            first_free.eq(lowest(m, "free", free)),
            takes.eq(self.take & self.reserved_valid),
            self.start.eq(only_if(takes, reserved)),
            self.idle.eq(~taken.any()),
        ]
        m.d.sync += taken.eq((taken | self.start) & ~self.released)
        with m.If(takes | ~self.reserved_valid):
            m.d.sync += [
                reserved.eq(first_free),
                self.reserved_valid.eq(free.any()),
                self.reserved_number.eq(number_of(first_free)),
            ]
        return m
