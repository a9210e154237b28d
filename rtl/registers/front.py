# amaranth: UnusedElaboratable=no
# (a front is also made only to ask for its registers)
"""A unit behind an AXI4-Lite port: what it has beside its memory, and its streams, as registers."""

from collections.abc import Callable

from amaranth import Cat, Const, Module, Mux, ResetInserter, Signal, Value
from amaranth.lib import wiring

from lightloom.golden_model.host.errors import InputError
from lightloom.rtl.config import PARAMETERS, Config
from lightloom.rtl.fabric.one_hot import any_of
from lightloom.rtl.fabric.queues import Buffer
from lightloom.rtl.fabric.unit import Port, Role, UnitComponent
from lightloom.rtl.registers.axi_lite import AxiLite
from lightloom.rtl.registers.register_block import RegisterBlock
from lightloom.rtl.registers.table import Access, halves, table_of
from lightloom.rtl.registers.unit_fields import ACCESS, RESULT_CAME, scalars, unit_fields

INTERRUPT = Port(role=Role.INTERRUPT, meaning="high while an event that is enabled has happened and is not cleared")


class RegisterFront(UnitComponent):
    """A unit with an AXI4-Lite port, `s_axi`, for its ports, and for operations by software; docs/registers.md.

    Its streams stay: hardware may use them while software uses registers. One bit more of the tag inside says whose an
    operation is, so each gets its own results. Where both offer operands, software's go first. Two results of software
    wait at most; those behind them wait in the unit, and so do those of the streams: software has to take what is its.

    `irq` is high while an event is pending and enabled. Where the unit forgets what is under way, operands of
    software that wait, and results that do, are forgotten too.
    """

    def __init__(self, make: Callable[[Config], UnitComponent], config: Config):
        """`make` gives the unit. Raises InputError where a tag leaves no room for the bit."""
        tag_width = config.streams.tag_width
        if tag_width + 1 not in PARAMETERS["tag_width"].values:
            raise InputError(f"tag_width {tag_width}: behind a bus a tag has a bit less, for one says whose it is")
        self._unit = unit = make(config.but(tag_width=tag_width + 1))
        self._block = RegisterBlock(table_of(unit_fields(unit, tag_width)))
        super().__init__(
            unit.unit,
            tag_width,
            memory=unit.m_axi.signature if hasattr(unit, "m_axi") else None,
            bus=AxiLite(self._block.table.address_width),
            ports={"irq": INTERRUPT},
        )
        self.table = self._block.table
        """Its registers."""

    def elaborate(self, platform: object) -> Module:
        m = Module()
        m.submodules.unit = unit = self._unit
        m.submodules.registers = block = self._block
        wiring.connect(m, wiring.flipped(self.s_axi), block.s_axi)
        if hasattr(unit, "m_axi"):
            wiring.connect(m, unit.m_axi, wiring.flipped(self.m_axi))
        for name, port in unit.ports.items():
            value = Value.cast(getattr(unit, name))
            if ACCESS[port.role] is Access.RO:
                m.d.comb += getattr(block, name).eq(value)
            else:
                m.d.comb += value.eq(self._written(name))
        self._operands(m)
        came = self._results(m)
        self._events(m, came)
        return m

    def _written(self, name: str) -> Value:
        """A field that software writes, or both of its halves."""
        block = self._block
        return Cat(getattr(block, each) for each in ([name] if hasattr(block, name) else halves(name)))

    def _operands(self, m: Module) -> None:
        """Operands of software, and between them those of the stream. None that is offered is withdrawn or changes."""
        unit, block = self._unit, self._block
        waits, stays, mine = Signal(name="operands_wait"), Signal(name="stream_stays"), Signal(name="software_offers")
        payload = unit.i.payload
        m.d.comb += [
            block.operands_wait.eq(waits),
            mine.eq(waits & ~stays),
            unit.i.valid.eq(mine | self.i.valid),
            self.i.ready.eq(unit.i.ready & ~mine),
            Value.cast(payload.data).eq(Mux(mine, self._operand_bits(), Value.cast(self.i.payload.data))),
            payload.tag.eq(Mux(mine, Cat(block.operand_tag, Const(1, 1)), self.i.payload.tag)),
        ]
        m.d.sync += stays.eq(self.i.valid & ~unit.i.ready & ~mine)
        with m.If(unit.forgetting | (mine & unit.i.ready)):
            m.d.sync += waits.eq(0)
        with m.Elif(block.submit):
            m.d.sync += waits.eq(1)

    def _operand_bits(self) -> Value:
        return Cat(self._written(name) for name, *_ in scalars("operand", self.unit.input))

    def _results(self, m: Module) -> Value:
        """Results to whom they belong. Returns whether one of software comes."""
        unit, block = self._unit, self._block
        results = Buffer(unit.o.payload.shape())
        m.submodules.results = ResetInserter(unit.forgetting)(results)
        mine, came = Signal(name="result_is_software_s"), Signal(name="result_came")
        result = results.o.payload
        m.d.comb += [
            mine.eq(unit.o.payload.tag[-1]),
            self.o.valid.eq(unit.o.valid & ~mine),
            self.o.payload.data.eq(unit.o.payload.data),
            self.o.payload.tag.eq(unit.o.payload.tag[:-1]),
            results.i.valid.eq(unit.o.valid & mine),
            Value.cast(results.i.payload).eq(Value.cast(unit.o.payload)),
            unit.o.ready.eq(Mux(mine, results.i.ready, self.o.ready)),
            came.eq(results.i.valid & results.i.ready),
            block.result_waits.eq(results.o.valid),
            results.o.ready.eq(block.release),
            block.result_tag.eq(result.tag[:-1]),
        ]
        bits = Value.cast(result.data)
        for name, offset, width, _ in scalars("result", self.unit.output):
            m.d.comb += getattr(block, name).eq(bits[offset : offset + width])
        return came

    def _events(self, m: Module, came: Value) -> None:
        """What has happened, and the interrupt."""
        block = self._block
        m.d.comb += getattr(block, f"{RESULT_CAME}_set").eq(came)
        for event in self._unit.EVENTS:
            before = Signal(init=1, name=f"{event.name}_before")  # after a reset nothing has happened
            level = Signal(name=f"{event.name}_level")
            m.d.comb += [
                level.eq(event.level(self._unit)),
                getattr(block, f"{event.name}_set").eq(level & ~before),
            ]
            m.d.sync += before.eq(level)
        names = (RESULT_CAME, *(event.name for event in self._unit.EVENTS))
        m.d.comb += self.irq.eq(any_of(getattr(block, name) & getattr(block, f"{name}_enable") for name in names))
