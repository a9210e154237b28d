# amaranth: UnusedElaboratable=no
# (an array is also made only to ask for its ports)
"""Several traversal units that share one stream of rays, one of results and one memory port."""

from dataclasses import replace

from amaranth import Cat, Const, Module, Mux, ResetInserter, Signal, Value
from amaranth.lib import wiring

from lightloom.rtl.config import Config
from lightloom.rtl.fabric.one_hot import any_of, next_of
from lightloom.rtl.fabric.queues import Buffer
from lightloom.rtl.fabric.unit import Role, UnitComponent
from lightloom.rtl.memory.axi_read_arbiter import AxiReadArbiter
from lightloom.rtl.traversal.unit import COUNTERS, EVENTS, Traversal


def traversal(config: Config) -> UnitComponent:
    """`config.traversal.units` traversal units behind the ports of one."""
    return Traversal(config) if config.traversal.units == 1 else TraversalArray(config)


class TraversalArray(UnitComponent):
    """`config.traversal.units` units, at least two, with the ports of one (`rtl.traversal.unit`).

    A ray goes to a unit that is ready, results come from one that has one, both in turn. Results pass a buffer, and so
    do the memory port's channels: a cycle each. `loaded` is high when all units have loaded the tree, `load_error` is
    that of the first unit that has one. The counters are the sums of the units', a cycle later: `count_cycles` counts
    the cycles of each. `aborting` is high until all units have come to the end of their reads.
    """

    EVENTS = EVENTS

    def __init__(self, config: Config):
        if config.traversal.units < 2:
            raise ValueError(f"an array has at least two units, not {config.traversal.units}")
        self._units = [Traversal(config) for _ in range(config.traversal.units)]
        unit = self._units[0]
        axi = unit.m_axi.signature
        self._arbiter = AxiReadArbiter(
            config.traversal.units,
            reads=config.traversal.units * unit.reads,
            address_width=axi.address_width,
            data_width=axi.data_width,
            id_width=axi.id_width,
        )
        ports = {
            name: replace(port, meaning=f"{port.meaning}, of all units together") if port.role is Role.COUNTER else port
            for name, port in unit.ports.items()
        }
        super().__init__(unit.unit, config.streams.tag_width, memory=self._arbiter.m_axi.signature, ports=ports)

    @property
    def forgetting(self) -> Value:
        return self.aborting

    def elaborate(self, platform: object) -> Module:
        m = Module()
        units = self._units
        m.submodules.arbiter = arbiter = self._arbiter
        for k, unit in enumerate(units):
            m.submodules[f"unit{k}"] = unit
            wiring.connect(m, unit.m_axi, arbiter.masters[k])
            m.d.comb += [
                unit.load.eq(self.load & ~self.aborting),
                unit.base.eq(self.base),
                unit.overlap.eq(self.overlap),
                unit.read_timeout.eq(self.read_timeout),
                # What waits in this port's buffer no unit knows of any more: until it is taken, no unit's abort ends.
                unit.abort.eq(self.abort | (self.aborting & self.m_axi.arvalid)),
                unit.count_clear.eq(self.count_clear),
            ]
        wiring.connect(m, arbiter.m_axi, wiring.flipped(self.m_axi))
        m.d.comb += self.aborting.eq(any_of(unit.aborting for unit in units))

        # A unit is only ever offered a ray while it is ready, so no offer is withdrawn.
        takes = Signal()
        chosen = next_of(m, "taker", Cat(unit.i.ready for unit in units), takes)
        m.d.comb += [self.i.ready.eq(chosen.any() & ~self.aborting), takes.eq(self.i.valid & self.i.ready)]
        for k, unit in enumerate(units):
            m.d.comb += [unit.i.payload.eq(self.i.payload), unit.i.valid.eq(takes & chosen[k])]

        # The buffer's `ready` does not wait for `valid`, so that the choice may change until a result is taken.
        results = Buffer(self.o.payload.shape())
        m.submodules.results = ResetInserter(self.aborting)(results)
        gives = Signal()
        chosen = next_of(m, "giver", Cat(unit.o.valid for unit in units), gives)
        each = [Mux(chosen[k], Value.cast(unit.o.payload), 0) for k, unit in enumerate(units)]
        m.d.comb += [
            results.i.valid.eq(chosen.any()),
            Value.cast(results.i.payload).eq(any_of(each)),
            gives.eq(results.i.valid & results.i.ready),
        ]
        m.d.comb += [unit.o.ready.eq(chosen[k] & results.i.ready) for k, unit in enumerate(units)]
        wiring.connect(m, results.o, wiring.flipped(self.o))

        m.d.comb += self.loaded.eq(Cat(unit.loaded for unit in units).all())
        for unit in reversed(units):
            with m.If(unit.load_error != 0):
                m.d.comb += self.load_error.eq(unit.load_error)
        for one in COUNTERS:
            count = f"count_{one.name}"
            total = sum((getattr(unit, count) for unit in units), Const(0))
            # An abort leaves nothing behind it, though the sum comes a cycle late.
            m.d.sync += getattr(self, count).eq(Mux(self.aborting, 0, total))
        return m
