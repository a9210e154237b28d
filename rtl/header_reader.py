"""Reads and checks the header of a tree in memory."""

from functools import reduce
from operator import xor

from amaranth import Cat, Const, Module, Mux, Signal, Value
from amaranth.lib import data
from amaranth.lib.wiring import Component, In, Out

from golden_model.formats import BVH_HEADER, BVH_MAGIC, BVH_VERSION, LOAD_ERRORS
from rtl.axi import INCR, AxiRead, is_error
from rtl.layouts import layout_of

LOAD_ERROR_BITS = 4
FIELDS = ("blocks", "root", "levels", "lattice_origin", "lattice_exponent")


class HeaderReader(Component):
    """Loads a tree: reads the block at `base` when `load` is high for a cycle, and says whether the tree can be used.

    Ports: `load` (ignored while `busy`), `base` (byte address, a multiple of 64), `m_axi`, an AXI4 read master whose
    only id is 0. `loaded` goes low with `load`, and high when the header has been found good; `load_error` is then, and
    until the next load, one of LOAD_ERRORS. `tree_base` is the `base` of the last load; `blocks`, `root`, `levels`,
    `lattice_origin` and `lattice_exponent` are fields of its header (BVH_HEADER): registers, to be used while `loaded`.

    Refused are a header wider than `width` children a node, or of more levels than a stack of `stack` entries allows.
    A load takes 2 cycles more than the memory takes for the block.
    """

    def __init__(self, *, width: int, stack: int, address_width: int = 40, data_width: int = 512, id_width: int = 1):
        self.width, self.stack = width, stack
        self.header = layout_of(BVH_HEADER)
        super().__init__(
            {
                "load": In(1),
                "base": In(address_width),
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
        m.d.comb += [
            self.m_axi.araddr.eq(self.tree_base),
            self.m_axi.arid.eq(0),
            self.m_axi.arlen.eq(axi.block_beats - 1),
            self.m_axi.arsize.eq(axi.beat_size),
            self.m_axi.arburst.eq(INCR),
            *(getattr(self, name).eq(header[name]) for name in FIELDS),
        ]

        with m.FSM(name="state") as fsm:
            m.d.comb += self.busy.eq(~fsm.ongoing("idle"))
            with m.State("idle"), m.If(self.load):
                m.d.sync += [self.tree_base.eq(self.base), self.loaded.eq(0), self.load_error.eq(LOAD_ERRORS["none"])]
                m.next = "address"
            with m.State("address"):
                m.d.comb += self.m_axi.arvalid.eq(1)
                m.d.sync += [folded.eq(0), failed.eq(0)]
                with m.If(self.m_axi.arready):
                    m.next = "data"
            with m.State("data"):
                m.d.comb += self.m_axi.rready.eq(1)
                with m.If(self.m_axi.rvalid & (self.m_axi.rid == 0)):
                    # Beats come from the lowest bits up: each goes in at the top and moves the others down.
                    bits = Value.cast(header)
                    m.d.sync += [
                        bits.eq(Cat(bits[axi.data_width :], self.m_axi.rdata)),
                        folded.eq(reduce(xor, words(self.m_axi.rdata), folded)),
                        failed.eq(failed | is_error(self.m_axi.rresp)),
                    ]
                    with m.If(self.m_axi.rlast):
                        m.next = "check"
            with m.State("check"):
                error = Signal.like(self.load_error)
                m.d.comb += error.eq(self._error(header, folded, failed))
                m.d.sync += [self.load_error.eq(error), self.loaded.eq(error == LOAD_ERRORS["none"])]
                m.next = "idle"
        return m

    def _error(self, header: data.View, folded: Value, failed: Value) -> Value:
        """The first thing that is wrong, as its number."""
        faults = {
            "memory": failed,
            "magic": header.magic != BVH_MAGIC,
            "version": header.version != BVH_VERSION,
            "check": folded != 0,
            "width": header.width > self.width,
            "levels": (header.levels == 0) | (header.levels > self.stack),
            "blocks": (header.root == 0) | (header.root >= header.blocks),
        }
        error: Value = Const(LOAD_ERRORS["none"], len(self.load_error))
        for name, wrong in reversed(faults.items()):
            error = Mux(wrong, LOAD_ERRORS[name], error)
        return error


def words(bits: Value) -> list[Value]:
    return [bits[first : first + 32] for first in range(0, len(bits), 32)]
