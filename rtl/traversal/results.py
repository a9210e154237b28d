"""The way out of a traversal unit: what a finished ray is answered."""

from amaranth import Module, Mux, Signal
from amaranth.lib import data, stream, wiring
from amaranth.lib.wiring import In, Out

from lightloom.golden_model.contract.formats import HIT, RAY_RESULT, TRACE_ERRORS
from lightloom.rtl.config import Config
from lightloom.rtl.fabric.counters import Counter
from lightloom.rtl.fabric.layouts import packet_of
from lightloom.rtl.fabric.memory import Ram
from lightloom.rtl.traversal.intake import ray_status
from lightloom.rtl.traversal.records import Ports, failure, strobe


class Results(wiring.Component):
    """Puts a result together from what was kept of the ray, its best hit, and why it failed.

    Ports:

    - `start`: strobe, the status of the ray that takes a context.
    - `failed`: two strobes, of the node's and of the leaf's side.
    - `i`: stream of finished rays (`Control.finished`).
    - `hit_read`: the best hit, asked of the leaf stage.
    - `release`: strobe, nothing of the context is needed any more.
    - `o`: stream of RAY_RESULT with the ray's tag.
    """

    COUNTERS = (
        Counter("rays", "results given", lambda results: results.o.valid & results.o.ready),
        Counter(
            "errors",
            "rays that failed",
            lambda results: results.o.valid & results.o.ready & (results.o.payload.data.error != 0),
        ),
    )

    def __init__(self, config: Config):
        self._contexts = config.traversal.contexts
        self._failure = failure(config)
        context = config.traversal.context_bits
        self._finished = data.StructLayout({"context": context, "failed": 1, "by_leaf": 1})
        super().__init__(
            {
                "start": In(strobe(data.StructLayout({"context": context, "status": ray_status(config)}))),
                "failed": In(strobe(self._failure)).array(2),
                "i": In(stream.Signature(self._finished)),
                "hit_read": Out(Ports(config).hit_read),
                "release": Out(wiring.Signature({"valid": Out(1), "context": Out(context)})),
                "o": Out(stream.Signature(packet_of(RAY_RESULT, config.streams.tag_width))),
            }
        )

    def elaborate(self, platform: object) -> Module:
        m = Module()
        m.submodules.statuses = statuses = Ram(self.start.payload.status.shape(), self._contexts)
        m.d.comb += [
            statuses.w_en.eq(self.start.valid),
            statuses.w_addr.eq(self.start.payload.context),
            statuses.w_data.eq(self.start.payload.status),
        ]
        # All that is kept of a context is read in the cycle in which it comes, and anew while its result waits.
        moves = Signal()
        ray = Signal(self._finished, reset_less=True)
        asked = Signal(self._finished["context"].shape)
        with m.If(moves):
            m.d.sync += [self.o.valid.eq(self.i.valid), ray.eq(self.i.payload)]
        m.d.comb += [
            moves.eq(~self.o.valid | self.o.ready),
            self.i.ready.eq(moves),
            asked.eq(Mux(moves, self.i.payload.context, ray.context)),
            statuses.r_addr.eq(asked),
            self.hit_read.context.eq(asked),
            self.release.valid.eq(self.o.valid & self.o.ready),
            self.release.context.eq(ray.context),
        ]
        reasons = []
        for name, side in zip(("node", "leaf"), self.failed, strict=True):
            layout = data.StructLayout({key: self._failure[key].shape for key in ("error", "block")})
            m.submodules[f"failed_{name}"] = memory = Ram(layout, self._contexts)
            m.d.comb += [
                memory.w_en.eq(side.valid),
                memory.w_addr.eq(side.payload.context),
                memory.w_data.error.eq(side.payload.error),
                memory.w_data.block.eq(side.payload.block),
                memory.r_addr.eq(asked),
            ]
            reasons.append(memory.r_data)

        status, hit = statuses.r_data, self.hit_read.hit
        result: data.View = self.o.payload.data
        m.d.comb += [self.o.payload.tag.eq(status.tag), result.invalid.eq(status.invalid)]
        with m.If(status.no_tree):
            m.d.comb += [result.error.eq(TRACE_ERRORS["header"]), result.primitive.eq(-1)]
        with m.Elif(ray.failed):
            m.d.comb += [
                result.error.eq(Mux(ray.by_leaf, reasons[1].error, reasons[0].error)),
                result.block.eq(Mux(ray.by_leaf, reasons[1].block, reasons[0].block)),
                result.primitive.eq(-1),
            ]
        with m.Elif(status.any_hit):
            # Which of its hits was found first is nobody's business: it depends on the order of the visits.
            m.d.comb += result.primitive.eq(Mux(hit.primitive[31], -1, 0))
        with m.Else():
            m.d.comb += [result[name].eq(hit[name]) for name in HIT.names or ()]
        return m
