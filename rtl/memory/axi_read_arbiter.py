"""Several AXI4 read masters on one port."""

from amaranth import Cat, Module, Mux, ResetInserter, Signal
from amaranth.lib.wiring import Component, In, Out

from lightloom.rtl.fabric.counters import Counter
from lightloom.rtl.fabric.queues import Buffer
from lightloom.rtl.memory.aborts import ABORT, end_of_abort
from lightloom.rtl.memory.axi import AxiRead
from lightloom.rtl.memory.axi_sharing import addresses_in_turn, answers_to_masters


class AxiReadArbiter(Component):
    """One address and one beat a cycle; addresses in turn among the masters that offer one.

    Ports: `masters`, an array of `count` AXI4 read ports, and `m_axi`, whose ids are a master's with the master's
    number above them. Both channels go through a buffer of two registers, so that neither side's ready is combinational
    in the other's: a cycle of latency each. Data goes to the master that its id names, and nowhere if it names none; a
    master that does not take its data holds up the others'.

    `abort`, a strobe: from the next cycle on no address is offered but one that is already, which AXI does not let go.
    `aborting` is high from then until all bursts have come to their end; their beats are taken and dropped. The masters
    are to be held in reset by it. The end is there when as many beats have come as were asked for; or, while `timed` is
    high, when from one `tick` to the next there was no address and no beat, however many have come.
    """

    COUNTERS = (
        Counter("beats", "beats of data from the memory", lambda arbiter: arbiter.m_axi.rvalid & arbiter.m_axi.rready),
    )

    def __init__(self, count: int, *, reads: int, address_width: int, data_width: int, id_width: int):
        """`id_width` is that of the masters, which have at most `reads` bursts of a block each under way in all."""
        if count < 1:
            raise ValueError(f"an arbiter needs at least one master, not {count}")
        if reads < 1:
            raise ValueError(f"reads must be at least 1, not {reads}")
        self.count, self.reads = count, reads
        self.number_width = (count - 1).bit_length()
        widths = {"address_width": address_width, "data_width": data_width}
        super().__init__(
            {
                "masters": In(AxiRead(**widths, id_width=id_width)).array(count),
                "m_axi": Out(AxiRead(**widths, id_width=id_width + self.number_width)),
                **ABORT,
            }
        )

    def elaborate(self, platform: object) -> Module:
        m = Module()
        port = self.m_axi
        axi = port.signature

        addresses = Buffer(axi.payload("ar"))
        empties = Signal()  # the buffer, also of an address that waits behind the one that is offered
        m.submodules.addresses = ResetInserter(empties)(addresses)
        asks = Signal(self.count)
        m.d.comb += asks.eq(Cat(master.arvalid for master in self.masters))
        addresses_in_turn(m, self, "ar", asks, addresses)

        beats = Buffer(axi.payload("r"))
        m.submodules.beats = ResetInserter(self.aborting)(beats)
        answers_to_masters(m, self, "r", beats)

        # The count of beats is right if each burst has its beats, wherever the memory puts RLAST.
        left = Signal(range(self.reads * axi.block_beats + 1))  # beats of the addresses that were taken
        asked = Signal()
        came = Signal()
        m.d.comb += empties.eq((self.abort | self.aborting) & (~port.arvalid | port.arready))
        m.d.sync += [
            asked.eq(port.arvalid & port.arready),
            came.eq(port.rvalid & port.rready),
            left.eq(left + Mux(asked, axi.block_beats, 0) - (came & (left != 0))),
        ]
        stirs, awaited = (port.arvalid, port.rvalid), port.arvalid | asked | (left != 0)
        with m.If(end_of_abort(m, self, stirs=stirs, awaited=awaited)):
            m.d.sync += left.eq(0)
        return m
