"""The way into a block cache: requests in their order, and prefetches where none comes (`rtl.memory.block_cache`)."""

from amaranth import Module, Mux, Signal, Value
from amaranth.lib import data, stream, wiring
from amaranth.lib.wiring import In, Out

from lightloom.rtl.fabric.pipeline import register
from lightloom.rtl.fabric.queues import Buffer
from lightloom.rtl.memory.block_lines import BLOCK_NUMBER_BITS

PREFETCH = wiring.Signature({"valid": Out(1), "block": Out(BLOCK_NUMBER_BITS)})
"""A strobe: the block is likely to be asked for soon."""


def block_request(tag_width: int) -> data.StructLayout:
    """The number of a block that is asked for, and the tag that its answer will have."""
    return data.StructLayout({"block": BLOCK_NUMBER_BITS, "tag": tag_width})


class BlockRequests(wiring.Component):
    """Holds three requests: one to be decided, one whose labels are read, and one that came while they could not move.

    Ports: `i`, stream of `block_request`; `prefetch`, of which what there is no room for is dropped. `look`: the labels
    of `block` are to be read; `step`: the request whose labels were read goes on to `o`. `o`, stream of requests to be
    decided: {block, tag, is_prefetch: nobody waits for it}. `busy`: one is inside.
    """

    def __init__(self, *, tag_width: int):
        request = block_request(tag_width)
        super().__init__(
            {
                "i": In(stream.Signature(request)),
                "prefetch": In(PREFETCH),
                "look": Out(1),
                "block": Out(BLOCK_NUMBER_BITS),
                "step": Out(1),
                "o": Out(stream.Signature(data.StructLayout({**request.members, "is_prefetch": 1}))),
                "busy": Out(1),
            }
        )

    def elaborate(self, platform: object) -> Module:
        m = Module()
        m.submodules.prefetches = prefetches = Buffer(BLOCK_NUMBER_BITS)
        read_valid = Signal()
        kept_valid = Signal()
        vacant = Signal()  # no request comes: a prefetch may
        kept = register(m, ~self.look & ~kept_valid, self.i.payload, "kept")
        incoming = Signal.like(self.i.payload)
        m.d.comb += [
            self.step.eq(~self.o.valid | self.o.ready),
            self.look.eq(~read_valid | self.step),
            self.i.ready.eq(~kept_valid),
            incoming.eq(Mux(kept_valid, kept, Value.cast(self.i.payload))),
            vacant.eq(~(kept_valid | self.i.valid)),
            # Nobody waits for a prefetch: what the buffer has no room for is dropped.
            prefetches.i.valid.eq(self.prefetch.valid),
            prefetches.i.payload.eq(self.prefetch.block),
            prefetches.o.ready.eq(self.look & vacant),
            self.block.eq(Mux(vacant, prefetches.o.payload, incoming.block)),
            self.busy.eq(prefetches.o.valid | read_valid | self.o.valid),
        ]
        with m.If(self.look):
            m.d.sync += [read_valid.eq(~vacant | prefetches.o.valid), kept_valid.eq(0)]
        with m.Elif(self.i.valid):
            m.d.sync += kept_valid.eq(1)
        with m.If(self.step):
            m.d.sync += self.o.valid.eq(read_valid)
        for name, value in (("block", self.block), ("tag", incoming.tag), ("is_prefetch", vacant)):
            read = register(m, self.look, value, f"read_{name}")
            m.d.comb += self.o.payload[name].eq(register(m, self.step, read, f"decided_{name}"))
        return m
