"""Several AXI4 write masters on one port."""

from amaranth import Cat, Module, Mux, ResetInserter, Signal
from amaranth.lib.wiring import Component, In, Out

from lightloom.rtl.fabric.one_hot import any_of
from lightloom.rtl.fabric.queues import Buffer
from lightloom.rtl.memory.aborts import ABORT, end_of_abort
from lightloom.rtl.memory.axi import AxiWrite
from lightloom.rtl.memory.axi_sharing import addresses_in_turn, answers_to_masters, to_port


class AxiWriteArbiter(Component):
    """One address, one beat and one answer a cycle; addresses in turn among the masters that offer one.

    Ports: `masters`, an array of `count` AXI4 write ports that write whole blocks, and `m_axi`, whose ids are a
    master's with the master's number above them. All channels go through a buffer of two registers, so that neither
    side's ready is combinational in the other's: a cycle of latency each. Data follows the order of the addresses, as
    AXI4 wants it: a burst's data is taken from a master once its address has been, and a master that does not give it
    holds up the others'. Answers go to the master that their id names, and nowhere if it names none; a master that does
    not take its answer holds up the others'.

    `abort` and its like are those of `rtl.memory.aborts`: no address is taken from the next cycle on, those that were
    are offered, and answers are taken and dropped. The masters are to be held in reset by `aborting`. Of the bursts
    under way the beats that are still missing come from here, with no strobe: such a block is written in part. It is
    over when all bursts are answered, or, while `timed`, when in the time between two ticks nothing moved.
    """

    def __init__(self, count: int, *, writes: int, address_width: int, data_width: int, id_width: int):
        """`id_width` is that of the masters, which have at most `writes` bursts of a block each under way in all."""
        if count < 1:
            raise ValueError(f"an arbiter needs at least one master, not {count}")
        if writes < 1:
            raise ValueError(f"writes must be at least 1, not {writes}")
        self.count, self.writes = count, writes
        self.number_width = (count - 1).bit_length()
        widths = {"address_width": address_width, "data_width": data_width}
        super().__init__(
            {
                "masters": In(AxiWrite(**widths, id_width=id_width)).array(count),
                "m_axi": Out(AxiWrite(**widths, id_width=id_width + self.number_width)),
                **ABORT,
            }
        )

    def elaborate(self, platform: object) -> Module:
        m = Module()
        port, masters = self.m_axi, self.masters
        axi = port.signature
        addresses, beats, answers = (Buffer(axi.payload(channel)) for channel in axi.CHANNELS)
        senders = Buffer(self.count)  # whose data comes next: the masters in the order of their addresses, a bit each
        m.submodules.addresses = addresses
        m.submodules.senders = senders
        m.submodules.beats = beats
        m.submodules.answers = ResetInserter(self.aborting)(answers)

        may_begin = Signal()
        asks = Signal(self.count)
        begins = Signal()
        m.d.comb += [
            may_begin.eq(senders.i.ready & ~self.aborting),
            asks.eq(Cat(master.awvalid & may_begin for master in masters)),
            begins.eq(addresses.i.valid & addresses.i.ready),
            senders.i.valid.eq(begins),
        ]
        m.d.comb += senders.i.payload.eq(addresses_in_turn(m, self, "aw", asks, addresses))
        self._data(m, senders, beats)
        answers_to_masters(m, self, "b", answers)

        left = Signal(range(self.writes + 1))  # bursts whose addresses were taken, without their answers
        begun = Signal()
        answered = Signal()
        m.d.sync += [
            begun.eq(begins),
            answered.eq(port.bvalid & port.bready),
            left.eq(left + begun - (answered & (left != 0))),
        ]
        offered = port.awvalid | port.wvalid | senders.o.valid
        with m.If(end_of_abort(m, self, stirs=(offered, port.bvalid), awaited=offered | begun | (left != 0))):
            m.d.sync += left.eq(0)
        return m

    def _data(self, m: Module, senders: Buffer, beats: Buffer) -> None:
        """Beats of the first of the senders, until its block is whole; during an abort beats that write nothing."""
        masters, axi = self.masters, self.m_axi.signature
        sender = Signal(self.count)
        moves = Signal()
        beat = Signal(range(axi.block_beats))  # no bits wide where there is one
        last = Signal()
        m.d.comb += [
            sender.eq(senders.o.payload & (senders.o.valid & ~self.aborting).replicate(self.count)),
            last.eq(beat == axi.block_beats - 1),
            beats.i.valid.eq(
                Mux(self.aborting, senders.o.valid, (sender & Cat(master.wvalid for master in masters)).any())
            ),
            moves.eq(beats.i.valid & beats.i.ready),
            senders.o.ready.eq(moves & last),
        ]
        for name, _ in axi.payload("w"):
            each = [Mux(sender[k], getattr(master, name), 0) for k, master in enumerate(masters)]
            m.d.comb += beats.i.payload[name].eq(any_of(each))
        with m.If(self.aborting):
            m.d.comb += beats.i.payload.wlast.eq(last)
        for k, master in enumerate(masters):
            m.d.comb += master.wready.eq(sender[k] & beats.i.ready)
        with m.If(moves):
            m.d.sync += beat.eq(beat + 1)  # behind the last one it is 0 again: their number is a power of two
        to_port(m, self.m_axi, "w", beats)
