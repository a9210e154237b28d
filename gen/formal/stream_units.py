# amaranth: UnusedElaboratable=no
# (a unit is also made only to ask for its latency)
"""Units of fixed latency: the handshake, for every unit and preset.

Nothing of the handshake depends on the data, so the datapath is cut away: in its place stands a core of the same
latency whose results are free. That makes the proofs of the largest units as small as those of the least.
"""

from functools import reduce
from operator import add

from amaranth import Array, Const, Module, Mux, Signal, Value

from gen.formal.bench import Bench
from gen.formal.properties import Induction, Property
from gen.formal.streams import Tracker, held
from golden_model.units import UNITS
from rtl.catalogue import CATALOGUE
from rtl.config import PRESETS, Config
from rtl.pipeline import Core, StreamUnit, register


class FreeCore(Core):
    """Stands for any core of its unit and latency: results are free, and move only with `en`."""

    def __init__(self, core: Core):
        super().__init__(core.unit.name, core.latency)
        self.free = Signal(len(Value.cast(self.o)))

    def elaborate(self, platform: object) -> Module:
        m = Module()
        m.d.comb += Value.cast(self.o).eq(register(m, self.en, self.free, "result"))
        return m


def handshake(unit: str, config: Config) -> Bench:
    """The bench of one unit: the stream wrapper as it is, around a free core."""
    component = CATALOGUE[unit](config)
    assert isinstance(component, StreamUnit)
    assert component.latency > 0
    component.core = free = FreeCore(component.core)
    latency = component.latency
    bench = Bench(component)
    m, i, o = bench.m, component.i, component.o
    m.d.comb += free.free.eq(bench.any("result", len(free.free)))
    enters, leaves = i.valid & i.ready, o.valid & o.ready
    held(bench, "o", o.valid, o.ready, o.payload)
    # What comes out for a tag is that tag: the data beside it is the core's, `latency` enabled cycles after its operands.
    tracker = Tracker(
        bench,
        most=latency,
        enters=enters,
        incoming=i.payload.tag,
        leaves=leaves,
        offers=o.valid,
        outgoing=o.payload.tag,
    )
    bench.require("ready_without_valid", i.ready == (o.ready | ~o.valid))

    # Where the followed transfer is: stages from the input. It moves whenever the pipeline does.
    place = Signal(range(latency + 1), name="place")
    released = Signal(range(latency + 1), name="released")  # cycles since then in which the output was free
    with m.If(i.ready):
        m.d.sync += place.eq(Mux(tracker.picks, 0, place + 1))
    with m.If(tracker.picks):
        m.d.sync += released.eq(0)
    with m.Elif(o.ready & (released != latency)):
        m.d.sync += released.eq(released + 1)
    bench.require("drains", ~tracker.follows | (released < latency))

    # The induction's invariant: how many are inside, and where the followed one stands among them.
    valids = [bench.inner(f"valid{stage}") for stage in range(latency)]
    tags = [bench.inner(f"tag{stage}") for stage in range(latency)]
    beyond = [Mux(stage > place, valid, 0) for stage, valid in enumerate(valids)]
    bench.require("count_is_stages", tracker.count == reduce(add, valids, Const(0)))
    bench.require("place_in_range", ~tracker.follows | (place < latency))
    bench.require("stage_is_valid", ~tracker.follows | Array(valids)[place])
    bench.require("stage_has_tag", ~tracker.follows | (Array(tags)[place] == tracker.payload))
    bench.require("order", ~tracker.follows | (tracker.ahead == reduce(add, beyond, Const(0))))
    bench.require("moved", ~tracker.follows | (released <= place))
    return bench


def properties() -> list[Property]:
    """One for each unit and preset."""
    return [
        Property(
            unit=unit,
            name=f"stream-{preset}",
            says="payload holds; no tag lost, made up, doubled or overtaken; empty after reset; drains",
            method=Induction(depth=1),
            build=lambda unit=unit, config=config: handshake(unit, config),
            quick=(unit, preset) in {("float_add", "full"), ("node_test", "base")},
        )
        for unit in UNITS
        for preset, config in PRESETS.items()
    ]
