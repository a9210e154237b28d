"""Reads and checks the header of a tree in memory."""

from functools import reduce
from operator import xor

from amaranth import Cat, Const, Module, Mux, Signal, Value
from amaranth.lib import data
from amaranth.lib.wiring import Component, In, Out

from lightloom.golden_model.contract.formats import BVH_HEADER, BVH_MAGIC, BVH_VERSION, LOAD_ERRORS
from lightloom.rtl.fabric.layouts import layout_of
from lightloom.rtl.memory.axi import INCR, OFFSET_BITS, AxiRead, is_error

LOAD_ERROR_BITS = 4
FIELDS = ("blocks", "root", "levels", "lattice_origin", "lattice_exponent")


class HeaderReader(Component):
    """Loads a tree: reads the block at `base` when `load` is high for a cycle, and says whether the tree can be used.

    Ports: `load` (ignored while `busy`), `base` (byte address, a multiple of 64), `m_axi`, an AXI4 read master whose
    only id is 0. `loaded` goes low with `load`, and high when the header has been found good; `load_error` is then, and
    until the next load, one of LOAD_ERRORS. `tree_base` is the address that was read last; `blocks`, `root`, `levels`,
    `lattice_origin` and `lattice_exponent` are fields of its header (BVH_HEADER): registers, to be used while `loaded`.
    `tick`, a strobe: a header that is awaited at two of them is given up.

    Refused are a `base` that is no multiple of 64, without a read; a header wider than `width` children a node, or of
    more levels than a stack of `stack` entries allows; a tree beyond the end of the address space. An error of the
    memory is an error response, RLAST on another beat than the block's last or none on that, and a header that was
    given up. The read of such a header may still be under way; until a beat with RLAST has come that is the block's
    last or comes later, no other is begun, and a load fails at once. Beats of which no read is under way are dropped.

    A load takes 2 cycles more than the memory takes for the block.
    """

    def __init__(self, *, width: int, stack: int, address_width: int = 40, data_width: int = 512, id_width: int = 1):
        self.width, self.stack = width, stack
        self.header = layout_of(BVH_HEADER)
        super().__init__(
            {
                "load": In(1),
                "base": In(address_width),
                "tick": In(1),
                "m_axi": Out(AxiRead(address_width=address_width, data_width=data_width, id_width=id_width)),
                "busy": Out(1),
                "loaded": Out(1),
                "load_error": Out(LOAD_ERROR_BITS),
                "tree_base": Out(address_width),
                **{name: Out(self.header[name].shape) for name in FIELDS},
            }
        )

    def elaborate(self, platform: object) -> Module:
        m = Module()
        axi = self.m_axi.signature
        header = Signal(self.header, reset_less=True)
        folded = Signal(32)  # the exclusive or of the words so far
        failed = Signal()  # a beat so far was an error
        unaligned = Signal()
        waited = Signal()  # for the header, at a tick
        m.d.comb += [
            self.m_axi.araddr.eq(self.tree_base),
            self.m_axi.arid.eq(0),
            self.m_axi.arlen.eq(axi.block_beats - 1),
            self.m_axi.arsize.eq(axi.beat_size),
            self.m_axi.arburst.eq(INCR),
            *(getattr(self, name).eq(header[name]) for name in FIELDS),
        ]

        begins = Signal()
        reading, beat, at_end = self._read(m, begins)

        with m.FSM(name="state") as fsm:
            m.d.comb += self.busy.eq(~fsm.ongoing("idle"))
            with m.State("idle"), m.If(self.load):
                m.d.sync += [
                    *(self.loaded.eq(0), self.load_error.eq(LOAD_ERRORS["none"])),
                    *(folded.eq(0), failed.eq(reading), waited.eq(0), unaligned.eq(self.base[:OFFSET_BITS].any())),
                ]
                with m.If(reading | self.base[:OFFSET_BITS].any()):
                    m.next = "check"
                with m.Else():
                    m.d.comb += begins.eq(1)
                    m.d.sync += self.tree_base.eq(self.base)
                    m.next = "wait"
            with m.State("wait"):
                with m.If(self.tick):
                    m.d.sync += waited.eq(1)
                with m.If(beat):
                    # Beats come from the lowest bits up: each goes in at the top and moves the others down.
                    bits = Value.cast(header)
                    m.d.sync += [
                        bits.eq(Cat(bits[axi.data_width :], self.m_axi.rdata)),
                        folded.eq(reduce(xor, words(self.m_axi.rdata), folded)),
                        failed.eq(failed | is_error(self.m_axi.rresp) | (at_end ^ self.m_axi.rlast)),
                    ]
                    with m.If(at_end | self.m_axi.rlast):
                        m.next = "check"
                with m.Elif(self.tick & waited):
                    m.d.sync += failed.eq(1)
                    m.next = "check"
            with m.State("check"):
                error = Signal.like(self.load_error)
                m.d.comb += error.eq(self._error(header, folded, failed, unaligned))
                m.d.sync += [self.load_error.eq(error), self.loaded.eq(error == LOAD_ERRORS["none"])]
                m.next = "idle"
        return m

    def _read(self, m: Module, begins: Signal) -> tuple[Signal, Signal, Signal]:
        """The read, which may be under way for longer than it is waited for: whether it is, whether this is a beat of
        it, and whether the block's last one is due."""
        axi = self.m_axi.signature
        asks = Signal()
        reading = Signal()
        number = Signal(range(max(axi.block_beats, 2)))  # of the next beat; beats beyond the last are as that
        beat = Signal()
        at_end = Signal()
        m.d.comb += [
            self.m_axi.arvalid.eq(asks),
            self.m_axi.rready.eq(1),
            beat.eq(reading & ~asks & self.m_axi.rvalid & (self.m_axi.rid == 0)),
            at_end.eq(number == axi.block_beats - 1),
        ]
        with m.If(begins):
            m.d.sync += [asks.eq(1), reading.eq(1)]
        with m.Elif(self.m_axi.arready):
            m.d.sync += asks.eq(0)
        with m.If(beat & ~at_end):
            m.d.sync += number.eq(number + 1)
        with m.Elif(beat & self.m_axi.rlast):
            m.d.sync += [number.eq(0), reading.eq(0)]
        return reading, beat, at_end

    def _error(self, header: data.View, folded: Value, failed: Value, unaligned: Value) -> Value:
        """The first thing that is wrong, as its number."""
        first_block = self.tree_base[OFFSET_BITS:]
        faults = {
            "base": unaligned,
            "memory": failed,
            "magic": header.magic != BVH_MAGIC,
            "version": header.version != BVH_VERSION,
            "check": folded != 0,
            "width": header.width > self.width,
            "levels": (header.levels == 0) | (header.levels > self.stack),
            "blocks": (header.root == 0) | (header.root >= header.blocks),
            "size": first_block + header.blocks > 1 << len(first_block),
        }
        assert faults.keys() == LOAD_ERRORS.keys() - {"none"}
        error: Value = Const(LOAD_ERRORS["none"], len(self.load_error))
        for name, wrong in reversed(faults.items()):
            error = Mux(wrong, LOAD_ERRORS[name], error)
        return error


def words(bits: Value) -> list[Value]:
    return [bits[first : first + 32] for first in range(0, len(bits), 32)]
