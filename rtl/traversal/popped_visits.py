"""The way of a visit from a ray's stack to its request: choose, read, wait for a turn."""

from typing import Any

from amaranth import Cat, Module, Mux, Signal, Value
from amaranth.lib import data, stream, wiring
from amaranth.lib.wiring import In, Out

from lightloom.rtl.config import Config
from lightloom.rtl.fabric.fifos import RegisterFifo
from lightloom.rtl.traversal.masks import one_hot, only_if
from lightloom.rtl.traversal.records import (
    ADDRESS_BITS,
    Ports,
    leaf_visit,
    node_visit,
    stack_read,
    strobe,
)

POPS = 6
"""Visits on their way from the stacks to a request: three in registers, the others wait for their turn. One a cycle
needs five."""


class PoppedVisits(wiring.Component):
    """Reads the entries of chosen rays, drops those that need no visit, and keeps the others until their turn comes.

    Ports:

    - `chosen`: strobe, a visit is to be made: of the root if the ray is `fresh`, else of the entry at `position` of its
      stack. Only while there is `room`.
    - `read`, `time_read`: entries, asked of the stacks, and how far best hits are, asked of the leaf stage.
    - `met`: the mask of the ray whose entry is decided on; 0: none is. In the same cycle `is_dead` says that the ray
      makes no more visits, `near_below` that the entry below this one is near, and `dropped` that this one is no visit.
    - `node`, `leaf`: streams of visits.
    - `nodes_waiting`: how many of nodes wait for their turn.
    - `root` of the tree.
    """

    def __init__(self, config: Config):
        self._contexts = config.traversal.contexts
        context = config.traversal.context_bits
        self._chosen = data.StructLayout({"context": context, "position": config.traversal.height_bits, "fresh": 1})
        self._visit = data.StructLayout({**node_visit(config).members, "leaf": 1, "beyond": 1, "near_below": 1})
        super().__init__(
            {
                "chosen": In(strobe(self._chosen)),
                "room": Out(1),
                "read": Out(stack_read(config)),
                "time_read": Out(Ports(config).time_read),
                "met": Out(config.traversal.contexts),
                "is_dead": In(1),
                "near_below": Out(1),
                "dropped": Out(1),
                "node": Out(stream.Signature(node_visit(config))),
                "leaf": Out(stream.Signature(leaf_visit(config))),
                "nodes_waiting": Out(range(POPS + 1)),
                "root": In(ADDRESS_BITS),
            }
        )

    def elaborate(self, platform: object) -> Module:
        m = Module()
        # From the choice to the queue nothing waits. So the entry is read in the next cycle, before any list of the
        # same ray that comes after the choice is written over it.
        asked = Signal(self._chosen, reset_less=True)
        read = Signal(self._chosen, reset_less=True)
        asked_valid = Signal()
        read_valid = Signal()
        m.d.sync += [
            asked_valid.eq(self.chosen.valid),
            asked.eq(self.chosen.payload),
            read_valid.eq(asked_valid),
            read.eq(asked),
        ]
        m.d.comb += [
            self.read.en.eq(asked_valid),
            self.read.context.eq(asked.context),
            self.read.position.eq(asked.position),
            self.time_read.context.eq(asked.context),
        ]
        # What comes out of the RAM is compared and no more; the cycle after that decides.
        entry: data.View = self.read.entry
        visit = Signal(self._visit, reset_less=True)
        visit_valid = Signal()
        m.d.sync += [
            visit_valid.eq(read_valid),
            visit.context.eq(read.context),
            visit.address.eq(Mux(read.fresh, self.root, entry.address)),
            visit.rank.eq(Mux(read.fresh, 0, entry.rank)),
            visit.leaf.eq(~read.fresh & entry.leaf),
            visit.beyond.eq(~read.fresh & (entry.entry > self.time_read.time)),
            visit.near_below.eq(~read.fresh & entry.near_below),
        ]
        m.d.comb += [
            self.met.eq(only_if(visit_valid, one_hot(visit.context, self._contexts))),
            self.near_below.eq(visit.near_below),
            self.dropped.eq(visit_valid & (visit.beyond | self.is_dead)),
        ]
        # A leaf does not wait behind a node, nor a node behind a leaf: that would cost the other's test a cycle.
        comes = visit_valid & ~self.dropped
        nodes = self._waiting(m, "nodes", comes & ~visit.leaf, visit, self.node)
        self._waiting(m, "leaves", comes & visit.leaf, visit, self.leaf)
        on_their_way = Signal(range(POPS + 1))
        leave = Signal(2)
        m.d.comb += [
            self.nodes_waiting.eq(nodes.level),
            leave.eq(self.dropped + (self.node.valid & self.node.ready) + (self.leaf.valid & self.leaf.ready)),
            self.room.eq(on_their_way < POPS),
        ]
        m.d.sync += on_their_way.eq(on_their_way + self.chosen.valid - leave)
        return m

    def _waiting(self, m: Module, name: str, comes: Value, visit: data.View, requests: Any) -> RegisterFifo:
        """A queue before the stream `requests`, with room for all visits. What `comes` has its fields from `visit`."""
        fields = requests.payload.shape().members
        m.submodules[name] = queue = RegisterFifo(len(Value.cast(requests.payload)), POPS)
        m.d.comb += [
            queue.w.payload.eq(Cat(visit[field] for field in fields)),
            queue.w.valid.eq(comes),
            queue.r.ready.eq(requests.ready),
            Value.cast(requests.payload).eq(queue.r.payload),
            requests.valid.eq(queue.r.valid),
        ]
        return queue
