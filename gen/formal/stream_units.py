# amaranth: UnusedElaboratable=no
# (a unit is also made only to ask for its latency)
"""Units of fixed latency: the handshake, for every unit and preset.

Nothing of the handshake depends on the data, so the datapath is cut away: in its place stands a core of the same
latency whose results are free. That makes the proofs of the largest units as small as those of the least.
"""

from functools import partial

from amaranth import Array, Cat, Module, Signal, Value

from lightloom.gen.formal.bench import Bench
from lightloom.gen.formal.properties import Induction, Property
from lightloom.gen.formal.streams import held
from lightloom.golden_model.contract.interfaces import UNITS
from lightloom.rtl.catalogue import CATALOGUE
from lightloom.rtl.config import PRESETS, Config
from lightloom.rtl.fabric.pipeline import Core, StreamUnit, register

LONGEST = 80
"""Cycles in which an operation goes through any of the units: more than their latencies."""


class FreeCore(Core):
    """Stands for any core of its unit and latency: results are free, and move only with `en`."""

    def __init__(self, core: Core):
        super().__init__(core.unit.name, core.latency, interval=core.initiation_interval)
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
    latency, interval = component.latency, component.initiation_interval
    bench = Bench(component)
    m, i, o = bench.m, component.i, component.o
    m.d.comb += free.free.eq(bench.any("result", len(free.free)))
    held(bench, "o", o.valid, o.ready, o.payload)
    advance = o.ready | ~o.valid
    if interval == 1:
        bench.require("ready_without_valid", i.ready == advance)
        takes = advance
    else:
        phase = free.phase
        bench.require("ready_without_valid", i.ready == (advance & phase))
        bench.require("ready_again", ~bench.past(advance & ~phase, "between") | phase)
        takes = advance & phase

    # What is offered is what went in `latency` moves ago, if something did: one out for one in, in the order of entry.
    history = Signal(latency)
    with m.If(advance):
        m.d.sync += history.eq(Cat(i.valid & takes, history))
    bench.require("out_as_in", o.valid == history[-1])

    # One transfer, any one, with its tag: how many moves ago it went in.
    picks = Signal()
    follows = Signal()
    place = Signal(range(latency + 1), name="place")
    tag = Signal(component.tag_width, name="tag", reset_less=True)
    released = Signal(range(latency + 1), name="released")  # cycles since then in which the output was free
    m.d.comb += picks.eq(bench.any("pick") & i.valid & i.ready & ~follows)
    with m.If(picks):
        m.d.sync += [follows.eq(1), place.eq(0), released.eq(0), tag.eq(i.payload.tag)]
    with m.Elif(follows):
        m.d.sync += released.eq(released + o.ready)
        with m.If(advance):
            m.d.sync += [place.eq(place + 1), follows.eq(place != latency - 1)]
    leaves = follows & (place == latency - 1)
    bench.require("its_turn", ~leaves | (o.valid & (o.payload.tag == tag)))
    bench.require("drains", ~follows | (released < latency))
    bench.reach("followed_one_leaves", leaves & o.ready)

    # The induction's invariant: the stages are the history, and the followed one is where it should be.
    valids = [bench.inner(f"valid{stage}") for stage in range(latency)]
    tags = [bench.inner(f"tag{stage}") for stage in range(-(-latency // interval))]
    bench.require("stages_are_history", Cat(valids) == history)
    bench.require("place_in_range", ~follows | (place < latency))
    bench.require("stage_is_valid", ~follows | history.bit_select(place, 1))
    bench.require("stage_has_tag", ~follows | (Array(tags)[place // interval] == tag))
    bench.require("moved", ~follows | (released <= place))
    if interval == 2:  # operations are in every other stage
        bench.require("follows_phase", ~follows | (place[0] == phase))
        for stage, valid in enumerate(valids):
            bench.require(f"phase{stage}", ~valid | (phase == stage % 2))
    return bench


def properties() -> list[Property]:
    """One for each unit and preset."""
    return [
        Property(
            unit=unit,
            name=f"stream-{preset}",
            says="payload holds; no tag lost, made up, doubled or overtaken; empty after reset; drains",
            method=Induction(depth=1),
            build=partial(handshake, unit, config),
            reach=LONGEST,
            quick=(unit, preset) in {("float_add", "full"), ("node_test", "base")},
        )
        for unit in UNITS
        for preset, config in PRESETS.items()
    ]
