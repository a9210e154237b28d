"""Streams that wait: a buffer that cuts the paths of a handshake, a queue in a RAM, and a list of free numbers."""

from typing import Any

from amaranth import Module, Mux, Shape, Signal, Value
from amaranth.lib import stream, wiring
from amaranth.lib.wiring import In, Out

from lightloom.rtl.fabric.fifos import RamFifo
from lightloom.rtl.fabric.pipeline import register


class Buffer(wiring.Component):
    """Two registers between two streams: no combinational path from one side to the other, at one transfer a cycle.

    Latency 1. `i.ready` says that the second register is empty, which takes what arrives while the first one waits.
    """

    def __init__(self, shape: Any):
        super().__init__({"i": In(stream.Signature(shape)), "o": Out(stream.Signature(shape))})

    def elaborate(self, platform: object) -> Module:
        m = Module()
        moves = Signal()  # the first register is empty, or is emptied
        held = Signal()  # the second one holds what came while it was not
        keeps = Signal()
        m.d.comb += [
            moves.eq(~self.o.valid | self.o.ready),
            self.i.ready.eq(~held),
            keeps.eq(~moves & ~held),
        ]
        incoming = Value.cast(self.i.payload)
        kept = register(m, keeps, incoming, "kept")
        first = Signal(len(incoming), reset_less=True)
        m.d.comb += Value.cast(self.o.payload).eq(first)
        with m.If(moves):
            m.d.sync += [self.o.valid.eq(held | self.i.valid), held.eq(0)]
            with m.If(held):
                m.d.sync += first.eq(kept)
            with m.Else():
                m.d.sync += first.eq(incoming)
        with m.Elif(self.i.valid):
            m.d.sync += held.eq(1)
        return m


class Queue(wiring.Component):
    """First in, first out, in a RAM with a synchronous read: latency 2, one transfer a cycle.

    It is always ready: whoever uses it never has more than `depth` items in it.
    """

    def __init__(self, shape: Any, depth: int):
        # A place more than items: for a cycle they may all be in the RAM, and its output register is a place. At least
        # three, so that the RAM has an address.
        self._fifo = RamFifo(Shape.cast(shape).width, max(depth + 1, 3))
        super().__init__({"i": In(stream.Signature(shape, always_ready=True)), "o": Out(stream.Signature(shape))})

    @property
    def level(self) -> Value:
        """How many items are inside."""
        return self._fifo.level

    def elaborate(self, platform: object) -> Module:
        m = Module()
        m.submodules.fifo = fifo = self._fifo
        m.d.comb += [
            fifo.w.payload.eq(Value.cast(self.i.payload)),
            fifo.w.valid.eq(self.i.valid),
            Value.cast(self.o.payload).eq(fifo.r.payload),
            self.o.valid.eq(fifo.r.valid),
            fifo.r.ready.eq(self.o.ready),
        ]
        return m


class PassingQueue(wiring.Component):
    """A `Queue` with a register behind it, into which an item goes at once where none waits: latency 1.

    Behind one that waits an item takes 3 cycles at least.
    """

    def __init__(self, shape: Any, depth: int):
        self._waiting = Queue(shape, depth)
        super().__init__({"i": In(stream.Signature(shape, always_ready=True)), "o": Out(stream.Signature(shape))})

    @property
    def level(self) -> Value:
        """How many items are inside."""
        return self._waiting.level + self.o.valid

    def elaborate(self, platform: object) -> Module:
        m = Module()
        m.submodules.waiting = waiting = self._waiting
        incoming, kept = Value.cast(self.i.payload), Value.cast(waiting.o.payload)
        moves = Signal()  # the register is empty, or is emptied
        past = Signal()
        m.d.comb += [
            moves.eq(~self.o.valid | self.o.ready),
            past.eq(moves & (waiting.level == 0)),
            waiting.i.valid.eq(self.i.valid & ~past),
            waiting.i.payload.eq(self.i.payload),
            waiting.o.ready.eq(moves),
        ]
        head = Signal(len(incoming), reset_less=True)
        m.d.comb += Value.cast(self.o.payload).eq(head)
        with m.If(moves):
            m.d.sync += [
                self.o.valid.eq(waiting.o.valid | (self.i.valid & past)),
                head.eq(Mux(past, incoming, kept)),
            ]
        return m


class FreeList(wiring.Component):
    """The numbers from 0 to count - 1 that are not in use: `o` gives one away, `i` takes one back (always ready).

    After reset all are free. Nothing depends on the contents of a RAM before it was written: each number is given away
    by a counter the first time, and comes from a queue of returned ones afterwards.
    """

    def __init__(self, count: int):
        self.count = count
        width = number_width(count)
        super().__init__({"i": In(stream.Signature(width, always_ready=True)), "o": Out(stream.Signature(width))})

    def elaborate(self, platform: object) -> Module:
        m = Module()
        m.submodules.returned = returned = Queue(number_width(self.count), self.count)
        fresh = Signal(range(self.count + 1))
        any_fresh = Signal()
        m.d.comb += [
            returned.i.valid.eq(self.i.valid),
            returned.i.payload.eq(self.i.payload),
            any_fresh.eq(fresh != self.count),
        ]
        with m.If(any_fresh):
            m.d.comb += [self.o.valid.eq(1), self.o.payload.eq(fresh)]
            with m.If(self.o.ready):
                m.d.sync += fresh.eq(fresh + 1)
        with m.Else():
            m.d.comb += [
                self.o.valid.eq(returned.o.valid),
                self.o.payload.eq(returned.o.payload),
                returned.o.ready.eq(self.o.ready),
            ]
        return m


def number_width(count: int) -> int:
    """Bits of a number from 0 to count - 1, at least one."""
    return max(1, (count - 1).bit_length())
