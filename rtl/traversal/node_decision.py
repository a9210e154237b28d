"""What the result of a node leads to: the nearest child is visited, the rest goes onto the stack."""

from amaranth import Cat, Module, Mux, Signal, Value, signed
from amaranth.lib import data, stream, wiring
from amaranth.lib.wiring import In, Out

from lightloom.golden_model.contract.formats import TIME_BITS, TRACE_ERRORS, WIDTH
from lightloom.rtl.config import Config
from lightloom.rtl.fabric.queues import Buffer
from lightloom.rtl.traversal.masks import one_hot, only_if
from lightloom.rtl.traversal.records import (
    ERROR_BITS,
    RANK_BITS,
    failure,
    leaf_visit,
    node_result,
    node_visit,
    push_list,
    strobe,
)

NEAR_BITS = TIME_BITS - 8
"""Two distances are near each other if their highest 8 bits, those above these, are the same."""


class NodeDecision(wiring.Component):
    """Decides on a result a cycle, by the rule of docs/wide_traversal.md#the-order-of-visits.

    Ports:

    - `node`: stream of `node_result`.
    - `context`: the mask of the ray whose result is decided on; 0: none is there. What is asked of it comes in the same
      cycle: `is_dead`, it makes no more visits; `is_strict`, it makes one at a time; `height` of its stack; `is_near`,
      whose top is near.
    - `push`: stream of `push_list`. The result is taken when this is ready, and what follows from it happens then:
    - `forward_node`, `forward_leaf`: strobes, the nearest child is to be visited.
    - `pushes`, `ends`, `fails`, `restarts`: the ray's mask, if something goes onto its stack, if no child is visited at
      once, if the ray fails, if it has to begin again; else 0. `new_height`, `new_near`: of its stack, where something
      goes onto it.
    - `failed`: strobe, why it fails.
    - `visit`, `revisit`: the node was visited, with a rank above 0.
    - `levels` of the tree.
    """

    def __init__(self, config: Config):
        self._config = config
        contexts, height = config.traversal.contexts, config.traversal.height_bits
        self._kept = data.StructLayout({"result": node_result(config), "mask": contexts})
        super().__init__(
            {
                "node": In(stream.Signature(node_result(config))),
                "context": Out(contexts),
                "is_dead": In(1),
                "is_strict": In(1),
                "height": In(height),
                "is_near": In(1),
                "push": Out(stream.Signature(push_list(config))),
                "forward_node": Out(strobe(node_visit(config))),
                "forward_leaf": Out(strobe(leaf_visit(config))),
                "pushes": Out(contexts),
                "ends": Out(contexts),
                "fails": Out(contexts),
                "restarts": Out(contexts),
                "new_height": Out(height),
                "new_near": Out(1),
                "failed": Out(strobe(failure(config))),
                "visit": Out(1),
                "revisit": Out(1),
                "levels": In(8),
            }
        )

    def elaborate(self, platform: object) -> Module:
        m = Module()
        # The buffer keeps what is decided here apart from the node stage, which stops as a whole. The ray's mask is
        # decoded in front of it: behind it, all that is decided in this cycle would wait for the decoder.
        m.submodules.results = results = Buffer(self._kept)
        node: data.View = results.o.payload.result
        m.d.comb += [
            results.i.valid.eq(self.node.valid),
            self.node.ready.eq(results.i.ready),
            results.i.payload.result.eq(self.node.payload),
            results.i.payload.mask.eq(one_hot(self.node.payload.context, self._config.traversal.contexts)),
            results.o.ready.eq(self.push.ready),
            self.context.eq(only_if(results.o.valid, results.o.payload.mask)),
        ]
        takes = Signal()
        rest = Signal(4)  # children beside the nearest
        above = Signal(range(self._config.traversal.stack + 8))  # the height with all of them
        forward, push, again, fail, restart = (
            Signal(name=name) for name in ("forwards", "push_some", "again", "fail", "restart")
        )
        error = Signal(ERROR_BITS)
        fits = self._fits(m, rest)
        m.d.comb += [
            takes.eq(results.o.valid & self.push.ready),
            rest.eq(node.hits.count - node.rank - 1),
            above.eq(self.height + rest),
            error.eq(node.error),
        ]
        with m.If(~self.is_dead):
            with m.If(node.error != 0):
                m.d.comb += fail.eq(1)
            with m.Elif(node.hits.count > node.rank):
                with m.If(rest == 0):
                    m.d.comb += forward.eq(1)
                with m.Elif(fits):
                    m.d.comb += [forward.eq(1), push.eq(1)]
                with m.Elif(self.height != self._config.traversal.stack):
                    m.d.comb += [forward.eq(1), push.eq(1), again.eq(1)]
                with m.Elif(self.is_strict):
                    # One visit at a time never needs more than `levels` entries: the header is wrong.
                    m.d.comb += [fail.eq(1), error.eq(TRACE_ERRORS["header"])]
                with m.Else():
                    m.d.comb += restart.eq(1)
        m.d.comb += [
            self.push.valid.eq(takes & push),
            self.pushes.eq(only_if(takes & push, self.context)),
            self.ends.eq(only_if(takes & ~forward, self.context)),
            self.fails.eq(only_if(takes & fail, self.context)),
            self.restarts.eq(only_if(takes & restart, self.context)),
            self.new_height.eq(Mux(again, self.height + 1, above)),
            self.failed.valid.eq(takes & fail),
            self.failed.payload.context.eq(node.context),
            self.failed.payload.error.eq(error),
            self.failed.payload.block.eq(node.address),
            self.visit.eq(takes & (node.error == 0)),
            self.revisit.eq(self.visit & (node.rank != 0)),
        ]
        self._go_on(m, node, takes & forward)
        self._put_down(m, node, again)
        return m

    def _fits(self, m: Module, rest: Value) -> Signal:
        """Whether all the rest has a place, so that `levels` places are left: height + rest + levels <= stack."""
        spare = Signal(signed(9))  # entries beyond those that the levels of the tree need; as constant as the tree
        fits = Signal()
        m.d.sync += spare.eq(self._config.traversal.stack - self.levels)
        m.d.comb += fits.eq(self.height <= spare - rest)
        return fits

    def _go_on(self, m: Module, node: data.View, forward: Value) -> None:
        """To the nearest child."""
        slot = node.hits.slot[node.rank]
        leaf = node.leaf.bit_select(slot, 1)
        for child, leads in ((self.forward_node, forward & ~leaf), (self.forward_leaf, forward & leaf)):
            m.d.comb += [
                child.valid.eq(leads),
                child.payload.context.eq(node.context),
                child.payload.address.eq(node.base + slot),
            ]

    def _put_down(self, m: Module, node: data.View, again: Value) -> None:
        """What goes onto the stack: the rest of the children, or, if `again`, the node itself."""
        first = Signal(RANK_BITS)
        nearness = Signal(WIDTH)  # of the children to the one that the ray goes on to
        cells = [node.hits.entry[k][NEAR_BITS:] for k in range(WIDTH)]
        item: data.View = self.push.payload
        m.d.comb += [
            first.eq(node.rank + 1),
            nearness.eq(Cat(cell == node.hits.entry[node.rank][NEAR_BITS:] for cell in cells)),
            self.new_near.eq(nearness.bit_select(first, 1)),
            item.context.eq(node.context),
            item.height.eq(self.height),
            item.first.eq(first),
            item.last.eq(Mux(again, first, node.hits.count - 1)),
            item.again.eq(again),
            item.base.eq(Mux(again, node.address, node.base)),
            item.leaf.eq(node.leaf),
            item.slot.eq(node.hits.slot),
            item.entry.eq(node.hits.entry),
            item.near.eq(nearness),
            item.near_below.eq(self.is_near),
        ]
