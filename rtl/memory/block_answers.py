"""The blocks of a cache, and its answers: hits, and requests that have waited (`rtl.memory.block_cache`)."""

from amaranth import Cat, Module, Mux, Signal, Value
from amaranth.lib import data, stream, wiring
from amaranth.lib.wiring import In, Out

from lightloom.rtl.fabric.memory import Ram
from lightloom.rtl.fabric.pipeline import register
from lightloom.rtl.fabric.queues import number_width
from lightloom.rtl.memory.axi import BLOCK_BITS
from lightloom.rtl.memory.waiters import waiter

PATIENCE = 7
"""Hits that may go before a request that has waited for its block."""


def block_answer(tag_width: int) -> data.StructLayout:
    """A block, and whose answer it is; with an `error` the block means nothing."""
    return data.StructLayout({"data": BLOCK_BITS, "tag": tag_width, "error": 1})


class BlockAnswers(wiring.Component):
    """Reads a block a cycle, for a hit or for a request that has waited.

    Ports: `hit`, stream of requests whose block is there: {line, error, tag}. `waited`, stream of `waiter`, whose tag
    has a bit more above it: nobody wants the answer. `write`, with `en`: `data` is part `lane` of the block in `line`.
    `o`, stream of `block_answer`, a cycle after its hit or waiter was taken.

    A hit goes before those that have waited: they are answered in the cycles of requests that miss, of which there is
    one for each of them, so that neither lookup nor answers pause. But not more than PATIENCE hits in a row.

    A line is never read and written in one cycle: it is written while its block is awaited, and read when it has come.
    A hit reads in the cycle in which it is found, so it does not matter when its line is given to another.
    """

    def __init__(self, *, depth: int, data_width: int, tag_width: int):
        """`depth` lines of parts of `data_width` bits."""
        self.depth, self.data_width, self.tag_width = depth, data_width, tag_width
        self.lanes = BLOCK_BITS // data_width
        line = number_width(depth)
        write = {"en": 1, "line": line, "lane": number_width(self.lanes), "data": data_width}
        super().__init__(
            {
                "hit": In(stream.Signature(data.StructLayout({"line": line, "error": 1, "tag": tag_width}))),
                "waited": In(stream.Signature(waiter(line_width=line, tag_width=tag_width + 1))),
                "write": In(wiring.Signature({name: Out(width) for name, width in write.items()})),
                "o": Out(stream.Signature(block_answer(tag_width))),
            }
        )

    def elaborate(self, platform: object) -> Module:
        m = Module()
        hit, waited = self.hit.payload, self.waited.payload
        moves = Signal()  # an answer may be given
        hits_ahead = Signal(range(PATIENCE + 1))  # that went before the request that has waited
        turn = Signal()  # and now goes before a hit
        hit_first = Signal()
        drains = Signal()
        answers = Signal()
        line = Signal(len(hit.line))
        m.d.comb += [
            moves.eq(~self.o.valid | self.o.ready),
            turn.eq(self.waited.valid & (hits_ahead == PATIENCE)),
            hit_first.eq(self.hit.valid & ~turn),
            self.hit.ready.eq(moves & ~turn),
            self.waited.ready.eq(moves & ~hit_first),
            drains.eq(self.waited.valid & self.waited.ready),
            answers.eq((hit_first & moves) | (drains & ~waited.tag[self.tag_width])),
            line.eq(Mux(hit_first, hit.line, waited.line)),
        ]
        with m.If(self.waited.ready | ~self.waited.valid):
            m.d.sync += hits_ahead.eq(0)
        with m.Elif(self.hit.valid & self.hit.ready):
            m.d.sync += hits_ahead.eq(hits_ahead + 1)
        with m.If(moves):
            m.d.sync += self.o.valid.eq(answers)
        m.d.comb += self.o.payload.data.eq(Cat(self._part(m, lane, answers, line) for lane in range(self.lanes)))
        for name in ("tag", "error"):
            value = Mux(hit_first, hit[name], waited[name][: len(self.o.payload[name])])
            m.d.comb += self.o.payload[name].eq(register(m, answers, value, f"answer_{name}"))
        return m

    def _part(self, m: Module, lane: int, reads: Value, line: Value) -> Value:
        """Part `lane` of the block that is read."""
        m.submodules[f"blocks{lane}"] = memory = Ram(self.data_width, self.depth)
        m.d.comb += [
            memory.w_en.eq(self.write.en & (self.write.lane == lane)),
            memory.w_addr.eq(self.write.line),
            memory.w_data.eq(self.write.data),
            memory.r_en.eq(reads),
            memory.r_addr.eq(line),
        ]
        return Value.cast(memory.r_data)
