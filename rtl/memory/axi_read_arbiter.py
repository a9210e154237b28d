"""Several AXI4 read masters on one port."""

from amaranth import Cat, Module, Mux, ResetInserter, Signal
from amaranth.lib import data
from amaranth.lib.wiring import Component, In, Out

from lightloom.rtl.fabric.counters import Counter
from lightloom.rtl.fabric.one_hot import any_of, next_of, number_of
from lightloom.rtl.fabric.queues import Buffer
from lightloom.rtl.memory.axi import AxiRead


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
        self.count, self.reads = count, reads
        self.number_width = (count - 1).bit_length()
        widths = {"address_width": address_width, "data_width": data_width}
        super().__init__(
            {
                "masters": In(AxiRead(**widths, id_width=id_width)).array(count),
                "m_axi": Out(AxiRead(**widths, id_width=id_width + self.number_width)),
                "abort": In(1),
                "tick": In(1),
                "timed": In(1),
                "aborting": Out(1),
            }
        )

    def elaborate(self, platform: object) -> Module:
        m = Module()
        port, masters = self.m_axi, self.masters
        id_width = len(masters[0].arid)

        # --- addresses ------------------------------------------------------------------------------------------------
        names: tuple[str, ...] = ("araddr", "arid", "arlen", "arsize", "arburst")
        fields = data.StructLayout({name: len(getattr(port, name)) for name in names})
        addresses = Buffer(fields)
        empties = Signal()  # the buffer, also of an address that waits behind the one that is offered
        m.submodules.addresses = ResetInserter(empties)(addresses)
        asks = Signal(self.count)
        m.d.comb += [asks.eq(Cat(master.arvalid for master in masters)), addresses.i.valid.eq(asks.any())]
        chosen = next_of(m, "asker", asks, addresses.i.valid & addresses.i.ready)
        for name in names:
            if name != "arid":
                each = [Mux(chosen[k], getattr(master, name), 0) for k, master in enumerate(masters)]
                m.d.comb += addresses.i.payload[name].eq(any_of(each))
        ids = [Mux(chosen[k], master.arid, 0) for k, master in enumerate(masters)]
        m.d.comb += addresses.i.payload.arid.eq(Cat(any_of(ids), number_of(chosen)))
        for k, master in enumerate(masters):
            m.d.comb += master.arready.eq(chosen[k] & addresses.i.ready)
        m.d.comb += [port.arvalid.eq(addresses.o.valid), addresses.o.ready.eq(port.arready)]
        m.d.comb += [getattr(port, name).eq(addresses.o.payload[name]) for name in names]

        # --- data -----------------------------------------------------------------------------------------------------
        names = ("rdata", "rid", "rresp", "rlast")
        fields = data.StructLayout({name: len(getattr(port, name)) for name in names})
        beats = Buffer(fields)
        m.submodules.beats = ResetInserter(self.aborting)(beats)
        # An id that names no master is no master's: its beats are taken and dropped.
        somebody = port.rid[id_width:] < self.count
        m.d.comb += [beats.i.valid.eq(port.rvalid & somebody), port.rready.eq(beats.i.ready)]
        m.d.comb += [beats.i.payload[name].eq(getattr(port, name)) for name in names]
        beat = beats.o.payload
        ready = []
        for k, master in enumerate(masters):
            mine = Signal(name=f"mine{k}")
            m.d.comb += [
                mine.eq(beat.rid[id_width:] == k if self.number_width else 1),
                master.rvalid.eq(beats.o.valid & mine),
                master.rdata.eq(beat.rdata),
                master.rid.eq(beat.rid[:id_width]),
                master.rresp.eq(beat.rresp),
                master.rlast.eq(beat.rlast),
            ]
            ready.append(mine & master.rready)
        m.d.comb += beats.o.ready.eq(any_of(ready))

        # --- the end of it all ----------------------------------------------------------------------------------------
        # Without ticks there is nothing but the count of beats, which is right if each burst has its beats, wherever
        # the memory puts RLAST. With them only silence counts: whether a burst that has ended early goes on, or one is
        # longer than it was asked for, no count can tell, nor a bit for each id.
        beats_of_block = port.signature.block_beats
        left = Signal(range(self.reads * beats_of_block + 1))  # beats of the addresses that were taken
        asked = Signal()
        came = Signal()
        silent = Signal()
        silence = Signal()  # since the last tick
        over = Signal()
        m.d.comb += [
            empties.eq((self.abort | self.aborting) & (~port.arvalid | port.arready)),
            silent.eq(~(self.abort | port.arvalid | port.rvalid)),
            over.eq(Mux(self.timed, self.tick & silence & silent, ~(port.arvalid | asked | (left != 0)))),
        ]
        m.d.sync += [
            asked.eq(port.arvalid & port.arready),
            came.eq(port.rvalid & port.rready),
            left.eq(left + Mux(asked, beats_of_block, 0) - (came & (left != 0))),
            silence.eq(silent & (silence | self.tick)),
            self.aborting.eq(self.abort | (self.aborting & ~over)),
        ]
        with m.If(self.aborting & over):
            m.d.sync += left.eq(0)
        return m
