"""The node stage of a traversal unit: the blocks of visited nodes against the rays that visit them.

One node a cycle. The whole stage stops while its result is not taken.
"""

from amaranth import Module, Mux, Signal, Value
from amaranth.lib import data, stream, wiring
from amaranth.lib.wiring import In, Out

from lightloom.golden_model.contract.formats import BLOCK_BYTES, NODE_BLOCK, NODE_KIND, TRACE_ERRORS
from lightloom.rtl.config import Config
from lightloom.rtl.fabric.counters import Counter
from lightloom.rtl.fabric.layouts import layout_of
from lightloom.rtl.fabric.memory import Ram
from lightloom.rtl.fabric.pipeline import register
from lightloom.rtl.intersection.node_test import NodeTest
from lightloom.rtl.traversal.records import (
    ADDRESS_BITS,
    ERROR_BITS,
    NODE_RAY,
    Ports,
    node_result,
    node_visit,
    strobe,
)

TESTED = ("count", "exponent", "origin", "lower_x", "lower_y", "lower_z", "upper_x", "upper_y", "upper_z")
"""What the node test needs of a block; it is called the same in NODE_TEST."""


class NodeStage(wiring.Component):
    """Looks up the ray, checks the block and tests the boxes (docs/traversal_unit.md).

    Ports:

    - `start`: strobe, what the test needs of the ray (NODE_RAY) in a context whose visits begin later.
    - `i`: stream of visits with the block as it came from memory; `error`: the memory answered with an error.
    - `o`: stream of `node_result`, in the same order.
    - `time_read`: how far the ray's best hit is, asked of the leaf stage.
    - `blocks`: blocks of the tree.
    - `tested`, `starved`, `stalled`: exactly one is high in a cycle: a node went in; none was there; one was there, or
      is inside, and the result was not taken.
    """

    COUNTERS = (
        Counter("node_busy", "cycles in which a block entered the node test", lambda nodes: nodes.tested),
        Counter(
            "node_stalled", "cycles in which the node test had to wait for the stacks", lambda nodes: nodes.stalled
        ),
    )

    def __init__(self, config: Config):
        self._core = NodeTest(config)
        self._contexts = config.traversal.contexts
        self._width = config.tree.width
        self._visit = node_visit(config)
        self._result = node_result(config)
        arriving = data.StructLayout({"data": 8 * BLOCK_BYTES, "tag": self._visit, "error": 1})
        start = data.StructLayout({"context": config.traversal.context_bits, "ray": layout_of(NODE_RAY)})
        super().__init__(
            {
                "start": In(strobe(start)),
                "i": In(stream.Signature(arriving)),
                "o": Out(stream.Signature(self._result)),
                "time_read": Out(Ports(config).time_read),
                "blocks": In(ADDRESS_BITS),
                "tested": Out(1),
                "starved": Out(1),
                "stalled": Out(1),
            }
        )

    @property
    def latency(self) -> int:
        """Cycles from the taking of a block to its result."""
        return 2 + self._core.latency

    def elaborate(self, platform: object) -> Module:
        m = Module()
        m.submodules.node_test = core = self._core
        m.submodules.rays = rays = Ram(self.start.payload.ray.shape(), self._contexts)

        advance = Signal()
        take = Signal()
        m.d.comb += [
            advance.eq(~self.o.valid | self.o.ready),
            take.eq(self.i.valid & advance),
            self.i.ready.eq(advance),
            self.tested.eq(take),
            self.starved.eq(~self.i.valid & advance),
            self.stalled.eq(~advance),
            core.en.eq(advance),
        ]

        # The block waits a cycle for its ray and for the distance of the ray's best hit; then all go into registers,
        # because a RAM has its output late in a cycle.
        held = Signal()
        with m.If(advance):
            m.d.sync += held.eq(self.i.valid)
        block = Signal(layout_of(NODE_BLOCK), reset_less=True)
        m.d.comb += Value.cast(block).eq(register(m, take, self.i.payload.data, "block_bits"))
        visit = Signal(self._visit)
        m.d.comb += Value.cast(visit).eq(register(m, take, self.i.payload.tag, "visit_bits"))
        memory_error = register(m, take, self.i.payload.error, "memory_error")
        m.d.comb += [
            rays.w_en.eq(self.start.valid),
            rays.w_addr.eq(self.start.payload.context),
            rays.w_data.eq(self.start.payload.ray),
            rays.r_en.eq(advance),
            rays.r_addr.eq(self.i.payload.tag.context),
            # The distance is read anew in every cycle, so that it is there when the stage moves on.
            self.time_read.context.eq(Mux(advance, self.i.payload.tag.context, visit.context)),
        ]
        test = Signal(core.i.shape(), reset_less=True)
        with m.If(advance):
            m.d.sync += [test[name].eq(rays.r_data[name]) for name in NODE_RAY.names or ()]
            m.d.sync += [test[name].eq(block[name]) for name in TESTED]
            m.d.sync += test.t_max.eq(self.time_read.time)
        m.d.comb += core.i.eq(test)

        error = self._error(m, memory_error, block, visit)
        beside_layout = data.StructLayout({name: member.shape for name, member in self._result if name != "hits"})
        beside = Signal(beside_layout)
        m.d.comb += [beside[name].eq(visit[name]) for name in self._visit.members]
        m.d.comb += [beside.error.eq(error), beside.base.eq(block.base), beside.leaf.eq(block.leaf)]
        valid, late = held, Value.cast(beside)
        for stage in range(core.latency + 1):
            later = Signal(name=f"valid{stage}")
            with m.If(advance):
                m.d.sync += later.eq(valid)
            valid, late = later, register(m, advance, late, f"beside{stage}")
        result = data.View(beside_layout, late)
        m.d.comb += [self.o.payload[name].eq(result[name]) for name in beside_layout.members]
        m.d.comb += [self.o.payload.hits.eq(core.o), self.o.valid.eq(valid)]
        return m

    def _error(self, m: Module, memory_error: Value, block: data.View, visit: data.View) -> Signal:
        """What is wrong with a block, as its number.

        Children lie behind their node, so no visit leads back; and inside the tree, so no address is beyond it.
        """
        error = Signal(ERROR_BITS)
        with m.If(memory_error):
            m.d.comb += error.eq(TRACE_ERRORS["memory"])
        with m.Elif((block.kind != NODE_KIND) | (block.count > self._width)):
            m.d.comb += error.eq(TRACE_ERRORS["kind"])
        with m.Elif((block.count != 0) & (block.base <= visit.address)):
            m.d.comb += error.eq(TRACE_ERRORS["order"])
        with m.Elif(block.base + block.count > self.blocks):
            m.d.comb += error.eq(TRACE_ERRORS["outside"])
        return error
