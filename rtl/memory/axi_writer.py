"""Writes blocks to memory, each as one burst, and knows when all of them are written."""

from amaranth import Cat, Const, Module, Mux, ResetInserter, Signal, Value
from amaranth.lib import data, stream
from amaranth.lib.wiring import Component, In, Out

from lightloom.golden_model.contract.formats import BLOCK_BYTES, WRITE_ERRORS
from lightloom.rtl.fabric.queues import Buffer, Queue
from lightloom.rtl.memory.aborts import ABORT, end_of_abort
from lightloom.rtl.memory.axi import BLOCK_BITS, INCR, OFFSET_BITS, AxiWrite, is_error

WRITE_ERROR_BITS = 2
CONTENT = data.StructLayout({"data": BLOCK_BITS, "strobes": BLOCK_BYTES})


def block_write(address_width: int) -> data.StructLayout:
    """A block to be written: its address without the bits that are zero, its bytes, and which of them are written."""
    return data.StructLayout({"block": address_width - OFFSET_BITS, **CONTENT.members})


class AxiWriter(Component):
    """A block every cycle, or as many cycles as it has beats; up to `writes` of them under way.

    Ports: `i`, stream of `block_write`; `m_axi`, an AXI4 write master whose only id is 0, so that writes take effect in
    the order in which they came, also two of one block. An address and its data go their own ways: neither waits for
    the other.

    `idle`: all blocks that were taken are written and answered. Nothing is ordered against it but by waiting: a reader
    of what was written waits for it. Only blocks between the byte addresses `base` and `limit`, which is the first
    beyond them, are written, all of a block or nothing of it; both count in the cycle in which a block is taken.

    `error`, one of WRITE_ERRORS, says of `error_block` that it was answered with an error, or was not written because
    it lies outside. That is the first one since `clear`, a strobe; the other blocks are written as if nothing was.

    `abort` and its like are those of `rtl.memory.aborts`: no block is taken from the next cycle on, those that were are
    written whole, and when the last one is answered all is as after a reset. Or, while `timed`, when in the time
    between two ticks nothing moved; then nobody knows which of them are written.
    """

    def __init__(self, *, writes: int, address_width: int, data_width: int, id_width: int):
        """`writes`: the greatest number of blocks under way; the rest are the widths of the port."""
        if writes < 1:
            raise ValueError(f"writes must be at least 1, not {writes}")
        self.writes = writes
        axi = AxiWrite(address_width=address_width, data_width=data_width, id_width=id_width)
        super().__init__(
            {
                "i": In(stream.Signature(block_write(address_width))),
                "m_axi": Out(axi),
                "base": In(address_width),
                "limit": In(address_width + 1),
                "idle": Out(1),
                "clear": In(1),
                "error": Out(WRITE_ERROR_BITS),
                "error_block": Out(address_width - OFFSET_BITS),
                **ABORT,
            }
        )

    def elaborate(self, platform: object) -> Module:
        m = Module()
        addresses, contents = Buffer(self.m_axi.signature.address_width - OFFSET_BITS), Buffer(CONTENT)
        unanswered = Queue(addresses.i.payload.shape(), self.writes)
        m.submodules.addresses = addresses
        m.submodules.contents = contents
        m.submodules.unanswered = ResetInserter(self.aborting)(unanswered)
        under_way = Signal(range(self.writes + 1))
        begins = Signal()
        ends = Signal()
        refuses = Signal()

        block = self.i.payload.block
        accepted = Signal()
        allowed = Signal()
        m.d.comb += [
            self.i.ready.eq(addresses.i.ready & contents.i.ready & (under_way != self.writes) & ~self.aborting),
            accepted.eq(self.i.valid & self.i.ready),
            allowed.eq((Cat(Const(0, OFFSET_BITS), block) >= self.base) & (block < self.limit[OFFSET_BITS:])),
            begins.eq(accepted & allowed),
            refuses.eq(accepted & ~allowed),
            contents.i.valid.eq(begins),
            contents.i.payload.data.eq(self.i.payload.data),
            contents.i.payload.strobes.eq(self.i.payload.strobes),
        ]
        for blocks in (addresses, unanswered):
            m.d.comb += [blocks.i.valid.eq(begins), blocks.i.payload.eq(block)]

        self._send(m, addresses, contents)
        port = self.m_axi
        m.d.comb += [
            port.bready.eq(1),
            ends.eq(port.bvalid & (port.bid == 0) & (under_way != 0)),  # an answer to nothing is nobody's
            unanswered.o.ready.eq(ends),
            self.idle.eq(under_way == 0),
        ]
        m.d.sync += under_way.eq(under_way + begins - ends)
        self._tell(m, failed=ends & is_error(port.bresp), failed_block=unanswered.o.payload, refuses=refuses)

        stirs, awaited = (port.awvalid, port.wvalid, port.bvalid), port.awvalid | port.wvalid | (under_way != 0)
        with m.If(end_of_abort(m, self, stirs=stirs, awaited=awaited)):
            m.d.sync += under_way.eq(0)
        return m

    def _send(self, m: Module, addresses: Buffer, contents: Buffer) -> None:
        """Addresses, and beside them beats, from a block's lowest bits up."""
        port = self.m_axi
        axi = port.signature
        beat = Signal(range(axi.block_beats))
        content = contents.o.payload
        m.d.comb += [
            port.awvalid.eq(addresses.o.valid),
            port.awaddr.eq(Cat(Const(0, OFFSET_BITS), addresses.o.payload)),
            port.awid.eq(0),
            port.awlen.eq(axi.block_beats - 1),
            port.awsize.eq(axi.beat_size),
            port.awburst.eq(INCR),
            addresses.o.ready.eq(port.awready),
            port.wvalid.eq(contents.o.valid),
            port.wdata.eq(content.data.word_select(beat, len(port.wdata))),
            port.wstrb.eq(content.strobes.word_select(beat, len(port.wstrb))),
            port.wlast.eq(beat == axi.block_beats - 1),
            contents.o.ready.eq(port.wready & port.wlast),
        ]
        with m.If(port.wvalid & port.wready):
            m.d.sync += beat.eq(Mux(port.wlast, 0, beat + 1))

    def _tell(self, m: Module, *, failed: Value, failed_block: Value, refuses: Value) -> None:
        """The first error; of two at a time, that of the block that came first."""
        none = WRITE_ERRORS["none"]
        with m.If(self.aborting):
            m.d.sync += self.error.eq(none)
        with m.Elif(self.clear | (self.error == none)):
            refused = Mux(refuses, WRITE_ERRORS["outside"], none)
            m.d.sync += [
                self.error.eq(Mux(failed, WRITE_ERRORS["memory"], refused)),
                self.error_block.eq(Mux(failed, failed_block, self.i.payload.block)),
            ]
