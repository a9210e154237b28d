"""A register table as hardware, behind an AXI4-Lite port."""

from amaranth import Cat, Const, Module, Mux, Signal, Value
from amaranth.lib import wiring
from amaranth.lib.wiring import In, Out

from lightloom.rtl.registers.axi_lite import DATA_BITS, LANES, OKAY, SLVERR, AxiLite
from lightloom.rtl.registers.table import Access, Field, Register, RegisterTable

WORD_BITS = (LANES - 1).bit_length()
"""Of a byte address, the lowest ones, which are not looked at."""


class RegisterBlock(wiring.Component):
    """Ports: `s_axi`, and by the names of the fields what they are (what they read as, of read-only ones an input);
    `<name>_set` sets an event. A strobe is high in the cycle after its write is done, when all else that was written
    with it holds already.

    A read that finds no register, and a write that finds none, or one without anything to write, or one that is held,
    is answered with SLVERR; it reads 0 and changes nothing. The lowest two bits of an address are not looked at. Bytes
    without their strobe keep what they are.

    A read of the lower half of a register of 64 bits keeps its upper half; a read of an upper half gives what was kept
    last. So a counter is read whole by its lower half first, as long as no other lower half is read in between.

    A write is done in the cycle after both its address and its data have come, in either order, and when the answer to
    the one before is taken. Addresses, data and answers wait in registers of their own; all outputs of the port are
    registers. A write takes two cycles at least, and so does a read; neither waits for the other.
    """

    def __init__(self, table: RegisterTable):
        self.table = table
        ports: dict[str, wiring.Member] = {"s_axi": In(AxiLite(table.address_width))}
        for one in table.fields:
            ports[one.name] = (In if one.access is Access.RO else Out)(one.width)
            if one.access is Access.W1C:
                ports[f"{one.name}_set"] = In(1)
        super().__init__(ports)

    def elaborate(self, platform: object) -> Module:
        m = Module()
        self._write(m)
        self._read(m)
        return m

    # --- writes -------------------------------------------------------------------------------------------------------

    def _write(self, m: Module) -> None:
        port = self.s_axi
        address = Signal(self.table.address_width - WORD_BITS, reset_less=True, name="write_address")
        data = Signal(DATA_BITS, reset_less=True, name="write_data")
        strobes = Signal(LANES, reset_less=True, name="write_strobes")
        addressed, given = Signal(name="write_addressed"), Signal(name="write_given")  # what has come
        done = Signal(name="write_done")
        m.d.comb += [
            port.awready.eq(~addressed),
            port.wready.eq(~given),
            done.eq(addressed & given & ~port.bvalid),
        ]
        with m.If(port.awvalid & ~addressed):
            m.d.sync += [addressed.eq(1), address.eq(port.awaddr[WORD_BITS:])]
        with m.If(port.wvalid & ~given):
            m.d.sync += [given.eq(1), data.eq(port.wdata), strobes.eq(port.wstrb)]
        with m.If(port.bready):
            m.d.sync += port.bvalid.eq(0)

        refused = Signal(init=1, name="write_refused")
        taken = {one.name: Signal(name=f"{one.name}_taken") for one in self.table.registers if one.writable}
        with m.Switch(address):
            for register in self.table.registers:
                if register.writable:
                    held: Value = getattr(self, register.held_by) if register.held_by else Const(0)
                    with m.Case(register.offset // LANES):
                        m.d.comb += [refused.eq(held), taken[register.name].eq(done & ~held)]
        for register in self.table.registers:
            if register.writable:
                self._fields(m, register, taken[register.name], data, strobes)
        with m.If(done):
            m.d.sync += [addressed.eq(0), given.eq(0), port.bvalid.eq(1), port.bresp.eq(Mux(refused, SLVERR, OKAY))]

    def _fields(self, m: Module, register: Register, taken: Value, data: Value, strobes: Value) -> None:
        """What a write of a register does to its fields."""
        mask = Cat(strobe.replicate(8) for strobe in strobes)
        for low, one in register.fields:
            port = getattr(self, one.name)
            bits, written = data[low : low + one.width], mask[low : low + one.width]
            if one.access is Access.W1P:
                m.d.sync += port.eq(taken & bits & written)
            elif one.access is Access.W1C:
                cleared = taken & bits & written
                m.d.sync += port.eq(getattr(self, f"{one.name}_set") | (port & ~cleared))
            elif one.access is Access.RW:
                held = Signal(one.width, init=one.reset, name=f"{one.name}_held")
                m.d.comb += port.eq(held)
                with m.If(taken):
                    m.d.sync += held.eq((bits & written) | (held & ~written))

    # --- reads --------------------------------------------------------------------------------------------------------

    def _read(self, m: Module) -> None:
        port = self.s_axi
        address = Signal(self.table.address_width - WORD_BITS, reset_less=True, name="read_address")
        addressed = Signal(name="read_addressed")
        done = Signal(name="read_done")
        m.d.comb += [port.arready.eq(~addressed), done.eq(addressed & ~port.rvalid)]
        with m.If(port.arvalid & ~addressed):
            m.d.sync += [addressed.eq(1), address.eq(port.araddr[WORD_BITS:])]
        with m.If(port.rready):
            m.d.sync += port.rvalid.eq(0)

        kept = Signal(DATA_BITS, name="upper_half")
        found, word = Signal(name="read_found"), Signal(DATA_BITS, name="read_word")
        with m.Switch(address):
            for register in self.table.registers:
                value = Cat(self._reads_as(one) for _, one in register.fields)
                with m.Case(register.offset // LANES):
                    m.d.comb += [found.eq(1), word.eq(value[:DATA_BITS])]
                    if register.width > DATA_BITS:
                        with m.If(done):
                            m.d.sync += kept.eq(value[DATA_BITS:])
                if register.width > DATA_BITS:
                    with m.Case(register.offset // LANES + 1):
                        m.d.comb += [found.eq(1), word.eq(kept)]
        with m.If(done):
            m.d.sync += [
                *(addressed.eq(0), port.rvalid.eq(1)),
                *(port.rdata.eq(word), port.rresp.eq(Mux(found, OKAY, SLVERR))),
            ]

    def _reads_as(self, one: Field) -> Value:
        return Const(0, 1) if one.access is Access.W1P else getattr(self, one.name)
