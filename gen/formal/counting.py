"""The counters of a traversal unit, and what puts the beats of a block together."""

from functools import partial

from amaranth import Array, Mux, Signal

from gen.formal.bench import Bench
from gen.formal.properties import Induction, Property
from golden_model.units import COUNTERS
from rtl.axi import AxiRead
from rtl.block_fill import BlockFill
from rtl.traversal.counters import COUNTER_BITS, Counters


def counters() -> Bench:
    component = Counters()
    bench = Bench(component)
    clear = bench.past(component.clear, "clear")
    for name in COUNTERS:
        count = getattr(component, f"count_{name}")
        expected = Signal(COUNTER_BITS, name=f"expected_{name}")
        event = bench.past(getattr(component, f"event_{name}"), name)
        bench.m.d.sync += expected.eq(Mux(clear, 0, expected + event))
        bench.require(name, count == expected)
    return bench


def fill(data_width: int, misses: int) -> Bench:
    """Follows one miss, any one; beats of the others come between its own."""
    axi = AxiRead(address_width=32, data_width=data_width, id_width=3)
    component = BlockFill(axi=axi, misses=misses, line_width=3)
    bench = Bench(component)
    m, lanes = bench.m, component.lanes
    who = bench.constant("who", range(misses))
    bench.assume(who < misses)
    under_way = Signal()
    line = Signal(3)
    beats = Signal(range(lanes + 1))
    failed = Signal()
    starts = component.start & (component.start_miss == who)
    beat = component.rvalid & (component.rid == who)
    m.d.sync += under_way.eq((under_way | starts) & ~(beat & component.rlast))
    with m.If(starts):
        m.d.sync += [line.eq(component.start_line), beats.eq(0), failed.eq(0)]
    with m.If(beat):
        m.d.sync += [beats.eq(beats + 1), failed.eq(failed | component.rresp[1])]
    # The memory answers what was asked, in bursts of a block; a miss is not started again before its last beat.
    bench.assume(~starts | ~under_way)
    bench.assume(~beat | under_way)
    bench.assume(~beat | (component.rlast == (beats == lanes - 1)))
    bench.assume(~component.rvalid | (component.rid < misses))
    bench.assume(~component.start | (component.start_miss < misses))

    came = bench.past(beat, "beat")
    bench.require("always_taken", component.rready)
    bench.require("written_when_it_comes", ~came | component.write)
    bench.require("nothing_else_written", component.write == bench.past(component.rvalid, "rvalid"))
    bench.require("to_its_line", ~came | (component.line == bench.past(line, "line")))
    bench.require("to_its_place", ~came | (component.lane == bench.past(beats, "beats")))
    bench.require("its_data", ~came | (component.data == bench.past(component.rdata, "rdata")))
    ends = bench.past(beat & component.rlast, "ends")
    bench.require("filled_with_the_last", (component.filled & (component.miss == who)) == ends)
    bench.require("any_error", ~ends | (component.error == bench.past(failed | component.rresp[1], "error")))
    bench.reach("filled_with_error", component.filled & component.error)

    # The invariant: what the component remembers of the miss.
    bench.require("line_remembered", ~under_way | (bench.peek("lines", who, "remembered") == line))
    bench.require("beats_in_range", beats <= lanes)
    bench.require("beats_under_way", ~under_way | (beats < lanes))
    if lanes > 1:
        # A beat is counted in the cycle after it came.
        expected = Signal(range(lanes + 1))
        m.d.comb += expected.eq(Mux(under_way, beats - came, Mux(came, lanes - 1, 0)))
        for k in range((lanes - 1).bit_length()):
            plane = bench.inner(f"beats{k}")
            bench.require(f"counted{k}", Array(plane)[who] == expected[k])
        remembered = Array(bench.inner("failed"))[who]
        seen = remembered | (came & bench.inner("beat_failed"))
        bench.require("failure_remembered", Mux(under_way | came, failed == seen, ~remembered))
    else:
        bench.require("failure_seen", ~came | (failed == bench.inner("beat_failed")))
    bench.require("starts_without_failure", ~under_way | (beats != 0) | ~failed)
    return bench


def properties() -> list[Property]:
    return [
        Property(
            unit="counters",
            name="count",
            says="every counter is the number of its events since the last clear, a cycle late",
            method=Induction(depth=1),
            build=counters,
            quick=True,
        ),
        *(
            Property(
                unit="block_fill",
                name=f"beats-{width}",
                says="beats of any misses in any order: each to its line and place; whole, and failed, when it is",
                method=Induction(depth=2),
                build=partial(fill, width, 5),
                reach=512 // width + 4,
                quick=width == 128,
            )
            for width in (64, 128, 512)
        ),
    ]
