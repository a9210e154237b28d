# amaranth: UnusedElaboratable=no
# (a unit is also made only to ask for its latency)
"""Units of fixed latency: the handshake, for every unit and preset.

Nothing of the handshake depends on the data, so the datapath is cut away: in its place stands a core of the same
latency whose results are free. That makes the proofs of the largest units as small as those of the least.
"""

from functools import partial
from typing import NamedTuple

from amaranth import Array, Cat, Const, Module, Mux, Signal, Value

from lightloom.gen.formal.bench import Bench
from lightloom.gen.formal.properties import Induction, Property
from lightloom.gen.formal.streams import held
from lightloom.golden_model.contract.interfaces import PURE
from lightloom.rtl.catalogue import stream_unit
from lightloom.rtl.config import PRESETS, Config
from lightloom.rtl.fabric.pipeline import Core, StreamUnit, register, slots_of

LONGEST = 160
"""Cycles in which an operation goes through any of the units: more than their latencies."""


class FreeCore(Core):
    """Stands for any core of its unit, latency and interval: results are free, and move only with `en`."""

    def __init__(self, unit: str, latency: int, interval: int):
        super().__init__(PURE[unit], latency, interval=interval)
        self.free = Signal(len(Value.cast(self.o)))

    def elaborate(self, platform: object) -> Module:
        m = Module()
        result = register(m, self.en, self.free, "result") if self.latency else self.free
        m.d.comb += Value.cast(self.o).eq(result)
        return m


def of_unit(unit: str, config: Config) -> Bench:
    """The bench of a unit of the catalogue."""
    component = stream_unit(unit, config)
    return handshake(unit, component.latency, component.core.initiation_interval, component.tag_width)


def handshake(unit: str, latency: int, interval: int, tag_width: int) -> Bench:
    """The stream wrapper as it is, around a free core."""
    free = FreeCore(unit, latency, interval)
    component = StreamUnit(free, tag_width)
    bench = Bench(component)
    if latency == 0:
        return _without_registers(bench, free, component)
    m, i, o = bench.m, component.i, component.o
    m.d.comb += free.free.eq(bench.any("result", len(free.free)))
    held(bench, "o", o.valid, o.ready, o.payload)
    advance = o.ready | ~o.valid
    enters = i.valid & i.ready

    # What is offered is what went in `latency` moves ago, if something did: one out for one in, in the order of entry.
    history = Signal(latency)
    with m.If(advance):
        m.d.sync += history.eq(Cat(enters, history))
    bench.require("out_as_in", o.valid == history[-1])

    # An operation is taken when nothing is under way, and whole intervals after the last one.
    moves = Signal(range(interval), name="moves_since")  # modulo the interval
    with m.If(advance):
        m.d.sync += moves.eq(Mux(enters, 1 % interval, Mux(moves == interval - 1, 0, moves + 1)))
    bench.require("ready_without_valid", i.ready == (advance & (~history.any() | (moves == 0))))

    # One transfer, any one, with its tag: how many moves ago it went in.
    picks = Signal()
    follows = Signal()
    place = Signal(range(latency + 1), name="place")
    tag = Signal(tag_width, name="tag", reset_less=True)
    released = Signal(range(latency + 1), name="released")  # cycles since then in which the output was free
    m.d.comb += picks.eq(bench.any("pick") & enters & ~follows)
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

    _invariant(bench, free, history, moves, _Followed(follows, place, tag, released))
    return bench


class _Followed(NamedTuple):
    """One transfer: whether it is under way, how many moves ago it went in, its tag, free cycles since."""

    follows: Signal
    place: Signal
    tag: Signal
    released: Signal


def _invariant(bench: Bench, free: FreeCore, history: Signal, moves: Signal, followed: _Followed) -> None:
    """The induction's invariant: stages, tags and slots are as the history says, and so is the followed one."""
    latency, interval = free.latency, free.initiation_interval
    follows, place, tag, released = followed
    stages = -(-(latency - 1) // interval)
    for stage in range(stages):
        inside = history[stage * interval : min((stage + 1) * interval, latency - 1)]
        bench.require(f"stage{stage}_is_history", bench.inner(f"valid{stage}") == inside.any())
    bench.require("output_is_history", bench.inner(f"valid{stages}") == history[-1])
    tags = [bench.inner(f"tag{stage}") for stage in range(-(-latency // interval))]
    bench.require("place_in_range", ~follows | (place < latency))
    bench.require("place_is_history", ~follows | history.bit_select(place, 1))
    bench.require("stage_has_tag", ~follows | (Array(tags)[place // interval] == tag))
    bench.require("moved", ~follows | (released <= place))
    if interval > 1:
        slots = Cat(slots_of(free.phase))
        bench.require("in_slot", slots == Mux(history.any(), Const(1, interval) << moves, 1))
        for age in range(1, latency + 1):
            bench.require(f"age{age}", ~history[age - 1] | (moves == age % interval))


def _without_registers(bench: Bench, free: FreeCore, component: StreamUnit) -> Bench:
    """Of latency 0: the two streams are one."""
    i, o = component.i, component.o
    bench.m.d.comb += free.free.eq(bench.any("result", len(free.free)))
    bench.require("offered_as_in", o.valid == i.valid)
    bench.require("taken_as_out", i.ready == o.ready)
    bench.require("its_tag", o.payload.tag == i.payload.tag)
    bench.reach("one_leaves", o.valid & o.ready)
    return bench


WRAPPED = [(0, 1), (1, 2), (2, 2), (5, 8), (8, 8), (9, 8), (9, 3), (20, 32), (54, 8), (58, 32)]
"""Latencies and intervals of which no unit is: below, at and above whole intervals; of ray_triangle's graph."""


def properties() -> list[Property]:
    """One for each unit and preset, and some for the wrapper alone."""
    quick = {("float_add", "stream-full"), ("node_test", "stream-base"), ("stream_unit", "latency9-interval3")}
    benches = {
        (unit, f"stream-{preset}"): partial(of_unit, unit, config)
        for unit in PURE
        for preset, config in PRESETS.items()
    }
    benches |= {
        ("stream_unit", f"latency{latency}-interval{interval}"): partial(
            handshake, "float_compare", latency, interval, 4
        )
        for latency, interval in WRAPPED
    }
    return [
        Property(
            unit=unit,
            name=name,
            says="payload holds; no tag lost, made up, doubled or overtaken; empty after reset; drains",
            method=Induction(depth=1),
            build=build,
            reach=LONGEST,
            quick=(unit, name) in quick,
        )
        for (unit, name), build in benches.items()
    ]
