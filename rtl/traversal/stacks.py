"""The stacks of a traversal unit, one a context, all in one RAM."""

from amaranth import Cat, Module, Mux, Signal, Value
from amaranth.lib import data, stream, wiring
from amaranth.lib.wiring import In, Out

from lightloom.rtl.config import Config
from lightloom.rtl.fabric.fifos import RamFifo
from lightloom.rtl.fabric.memory import Ram
from lightloom.rtl.traversal.records import (
    ADDRESS_BITS,
    RANK_BITS,
    STACK_ENTRY,
    push_list,
    stack_read,
    strobe,
)

LISTS = 5
"""Lists inside: a node seldom leaves more than one entry, and then the nodes after it leave none."""


class Stacks(wiring.Component):
    """Writes lists of entries, one entry a cycle, and reads one entry a cycle.

    How high the stacks are is known to whoever uses them. Ports:

    - `push`: stream of `push_list`; their entries are written from `last` to `first`, so that the nearest is on top, in
      the next cycle at the earliest.
    - `written`: strobe, a list of this context has been written.
    - `backlog`: after this cycle there is more to be written.
    - `near_leaf`: strobe, an entry that has been written is a block of triangles and near: it is likely to be visited.
    - `read`: the entry at `position` of the context's stack is there one cycle after an `en`, until the next one.
    """

    def __init__(self, config: Config):
        self._contexts = config.traversal.contexts
        self._stack = config.traversal.stack
        context = config.traversal.context_bits
        super().__init__(
            {
                "push": In(stream.Signature(push_list(config))),
                "written": Out(wiring.Signature({"valid": Out(1), "context": Out(context)})),
                "backlog": Out(1),
                "near_leaf": Out(strobe(data.StructLayout({"address": ADDRESS_BITS}))),
                "read": In(stack_read(config)),
            }
        )

    def elaborate(self, platform: object) -> Module:
        m = Module()
        m.submodules.entries = entries = Ram(STACK_ENTRY, self._contexts * self._stack)
        written: data.View = entries.w_data

        def place(context: Value, position: Value) -> Value:
            # Contexts are a power of two: position * contexts + context, without an adder.
            return Cat(context, position)[: len(entries.r_addr)]

        # One list is being written, the others wait in a queue; where that is empty, the next one goes past it.
        pushed = self.push.payload
        m.submodules.lists = lists = RamFifo(len(Value.cast(pushed)), LISTS - 1)
        item = Signal(pushed.shape(), reset_less=True)
        writing = Signal()
        moves = Signal()
        past = Signal()
        last = Signal()  # the entry that is written is the list's last
        m.d.comb += [
            moves.eq(~writing | last),
            past.eq(moves & (lists.level == 0)),
            lists.w.payload.eq(Value.cast(pushed)),
            lists.w.valid.eq(self.push.valid & ~past),
            lists.r.ready.eq(moves),
            self.push.ready.eq(lists.w.ready),
            self.backlog.eq((lists.level != 0) | (writing & ~last)),
        ]
        with m.If(moves):
            m.d.sync += [
                writing.eq(lists.r.valid | (self.push.valid & past)),
                Value.cast(item).eq(Mux(past, Value.cast(pushed), lists.r.payload)),
            ]
        done = Signal(RANK_BITS)  # entries of this list that are written
        index = Signal(RANK_BITS)
        near = Signal()
        near_address = Signal(ADDRESS_BITS, reset_less=True)
        m.d.comb += [
            index.eq(item.last - done),
            last.eq(index == item.first),
            entries.w_en.eq(writing),
            entries.w_addr.eq(place(item.context, item.height + done)),
            written.entry.eq(item.entry[index]),
            written.address.eq(item.base + Mux(item.again, 0, item.slot[index])),
            written.leaf.eq(~item.again & item.leaf.bit_select(item.slot[index], 1)),
            written.rank.eq(Mux(item.again, item.first, 0)),
            near.eq(item.near.bit_select(index, 1)),
            self.near_leaf.payload.address.eq(near_address),
            written.near_below.eq(Mux(done == 0, item.near_below, item.near.bit_select((index + 1)[:RANK_BITS], 1))),
            self.written.valid.eq(writing & last),
            self.written.context.eq(item.context),
            entries.r_en.eq(self.read.en),
            entries.r_addr.eq(place(self.read.context, self.read.position)),
            self.read.entry.eq(entries.r_data),
        ]
        m.d.sync += [
            self.near_leaf.valid.eq(writing & written.leaf & near),
            near_address.eq(written.address),
        ]
        with m.If(writing):
            m.d.sync += done.eq(Mux(last, 0, done + 1))
        return m
