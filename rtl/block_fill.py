"""What comes back from the memory, put together to blocks: the read data channel of `rtl.block_cache`."""

from amaranth import Const, Module, Mux, Signal
from amaranth.lib.memory import Memory
from amaranth.lib.wiring import Component, In, Out

from rtl.axi import AxiRead, is_error
from rtl.pipeline import register
from rtl.queues import number_width


class BlockFill(Component):
    """Remembers for every miss which line it fills; takes a beat a cycle, of any misses in any order.

    Ports: `start` says that the burst with the id `miss` is for line `line` (before its first beat comes). `r` is the
    read data channel, always taken. One cycle after a beat, `write` asks for its `data` to be written to part `lane` of
    line `line`; with a block's last beat comes `filled`, and `error` if any of its beats was one.
    """

    def __init__(self, *, axi: AxiRead, misses: int, line_width: int):
        self.axi, self.misses, self.line_width = axi, misses, line_width
        self.lanes = axi.block_beats
        members = {name: member for name, member in axi.members.items() if name.startswith("r")}
        super().__init__(
            {
                "start": In(1),
                "start_miss": In(number_width(misses)),
                "start_line": In(line_width),
                **members,
                "write": Out(1),
                "line": Out(line_width),
                "lane": Out(number_width(self.lanes)),
                "data": Out(axi.data_width),
                "filled": Out(1),
                "miss": Out(number_width(misses)),
                "error": Out(1),
            }
        )

    def elaborate(self, platform: object) -> Module:
        m = Module()
        m.submodules.lines = lines = Memory(shape=self.line_width, depth=max(self.misses, 2), init=[])
        writes = lines.write_port()
        reads = lines.read_port()
        incoming = self.rid[: len(self.miss)]
        m.d.comb += [
            writes.en.eq(self.start),
            writes.addr.eq(self.start_miss),
            writes.data.eq(self.start_line),
            self.rready.eq(1),
            reads.en.eq(self.rvalid),
            reads.addr.eq(incoming),
        ]

        valid = Signal()
        m.d.sync += valid.eq(self.rvalid)
        beat_failed = register(m, self.rvalid, is_error(self.rresp), "beat_failed")
        last = register(m, self.rvalid, self.rlast, "last")
        m.d.comb += [
            self.write.eq(valid),
            self.line.eq(reads.data),
            self.data.eq(register(m, self.rvalid, self.rdata, "beat")),
            self.miss.eq(register(m, self.rvalid, incoming, "beat_miss")),
            self.filled.eq(valid & last),
        ]

        if self.lanes == 1:
            m.d.comb += [self.lane.eq(0), self.error.eq(beat_failed)]
            return m
        # Of each miss the number of the next beat and whether one failed, a vector over the misses for each bit: zero
        # after reset and after the last beat.
        chosen = Signal(self.misses)
        m.d.comb += chosen.eq(Mux(valid, Const(1, self.misses) << self.miss, 0))
        following = Signal(len(self.lane))
        m.d.comb += following.eq(self.lane + 1)
        for k, after in enumerate(following):
            plane = Signal(self.misses, name=f"beats{k}")
            m.d.comb += self.lane[k].eq(plane.bit_select(self.miss, 1))
            m.d.sync += plane.eq(plane & ~chosen | Mux(after & ~last, chosen, 0))
        failed = Signal(self.misses)
        m.d.comb += self.error.eq(beat_failed | failed.bit_select(self.miss, 1))
        m.d.sync += failed.eq(failed & ~chosen | Mux(self.error & ~last, chosen, 0))
        return m
