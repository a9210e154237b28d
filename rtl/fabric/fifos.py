"""First in, first out: items in a memory that goes round, from the stream `w` to the stream `r`; `level` are inside."""

from amaranth import Module, Mux, Signal, Value
from amaranth.asserts import Initial
from amaranth.hdl import Assert, Assume
from amaranth.lib import stream, wiring
from amaranth.lib.wiring import In, Out

from lightloom.rtl.fabric.memory import Ram, RegisterFile


class _Fifo(wiring.Component):
    def __init__(self, width: int, depth: int):
        self.depth = depth
        super().__init__(
            {
                "w": In(stream.Signature(width)),
                "r": Out(stream.Signature(width)),
                "level": Out(range(depth + 1)),
            }
        )


class RegisterFifo(_Fifo):
    """`depth` items in registers, for few of them: latency 1."""

    def elaborate(self, platform: object) -> Module:
        m = Module()
        m.submodules.storage = storage = RegisterFile(self.w.payload.shape(), self.depth)
        takes = Signal()
        gives = Signal()
        produce, consume = _go_round(m, self.depth, self.level, takes, gives, platform)
        address, first = storage.read(0)
        m.d.comb += [
            self.w.ready.eq(self.level != self.depth),
            self.r.valid.eq(self.level != 0),
            takes.eq(self.w.valid & self.w.ready),
            gives.eq(self.r.valid & self.r.ready),
            storage.w_en.eq(takes),
            storage.w_addr.eq(produce),
            storage.w_data.eq(self.w.payload),
            address.eq(consume),
            self.r.payload.eq(first),
        ]
        return m


class RamFifo(_Fifo):
    """`depth` items, one in the output register of a RAM and the others in it: latency 2.

    The RAM never reads what it writes: an item is read when it is there, and written where none is.
    """

    def elaborate(self, platform: object) -> Module:
        m = Module()
        places = self.depth - 1
        m.submodules.storage = storage = Ram(self.w.payload.shape(), places)
        inner_level = Signal(range(places + 1))
        takes = Signal()
        moves = Signal()  # from the RAM to its output
        produce, consume = _go_round(m, places, inner_level, takes, moves, platform)
        m.d.comb += [
            self.w.ready.eq(inner_level != places),
            takes.eq(self.w.valid & self.w.ready),
            moves.eq((inner_level != 0) & (~self.r.valid | self.r.ready)),
            storage.w_en.eq(takes),
            storage.w_addr.eq(produce),
            storage.w_data.eq(self.w.payload),
            storage.r_en.eq(moves),
            storage.r_addr.eq(consume),
            self.r.payload.eq(storage.r_data),
            self.level.eq(inner_level + self.r.valid),
        ]
        with m.If(moves):
            m.d.sync += self.r.valid.eq(1)
        with m.Elif(self.r.ready):
            m.d.sync += self.r.valid.eq(0)
        return m


def _go_round(
    m: Module, depth: int, level: Signal, takes: Value, gives: Value, platform: object
) -> tuple[Signal, Signal]:
    """Where the next item goes, and where the first one is; `level` counts those in between."""
    produce = Signal(range(depth))
    consume = Signal(range(depth))
    with m.If(takes):
        m.d.sync += produce.eq(_next(produce, depth))
    with m.If(gives):
        m.d.sync += consume.eq(_next(consume, depth))
    with m.If(takes & ~gives):
        m.d.sync += level.eq(level + 1)
    with m.If(gives & ~takes):
        m.d.sync += level.eq(level - 1)
    if platform == "formal":  # an invariant, for the inductions of whatever has a FIFO inside
        between = Mux(produce > consume, produce - consume, depth + produce - consume)
        holds = Signal()
        m.d.comb += holds.eq(
            (produce < depth) & (consume < depth) & ((level == between) | ((produce == consume) & (level == 0)))
        )
        with m.If(Initial()):
            m.d.comb += Assume(holds)
        with m.Else():
            m.d.comb += Assert(holds)
    return produce, consume


def _next(place: Signal, depth: int) -> Value:
    return place + 1 if depth == 1 << len(place) else Mux(place == depth - 1, 0, place + 1)
