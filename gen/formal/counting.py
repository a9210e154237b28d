"""The counters of a traversal unit, and what puts the beats of a block together."""

from functools import partial
from typing import NamedTuple

from amaranth import Array, Const, Mux, Signal, Value

from lightloom.gen.formal.bench import Bench
from lightloom.gen.formal.properties import Induction, Property
from lightloom.rtl.fabric.counters import COUNTER_BITS, Counters
from lightloom.rtl.memory.axi import AxiRead
from lightloom.rtl.memory.block_fill import BlockFill
from lightloom.rtl.traversal.unit import COUNTERS


def counters() -> Bench:
    component = Counters(one.name for one in COUNTERS)
    bench = Bench(component)
    clear = bench.past(component.clear, "clear")
    for name in component.names:
        count = getattr(component, f"count_{name}")
        expected = Signal(COUNTER_BITS, name=f"expected_{name}")
        event = bench.past(getattr(component, f"event_{name}"), name)
        bench.m.d.sync += expected.eq(Mux(clear, 0, expected + event))
        bench.require(name, count == expected)
    return bench


def fill(data_width: int, misses: int) -> Bench:
    """Follows one miss, any one. The memory may do whatever it likes: any beat at any time, with or without RLAST."""
    axi = AxiRead(address_width=32, data_width=data_width, id_width=3)
    component = BlockFill(axi=axi, misses=misses, line_width=3)
    bench = Bench(component)
    m, lanes = bench.m, component.lanes
    who = bench.constant("who", range(misses))
    bench.assume(who < misses)
    looks = bench.inner("look") & (bench.inner("looked") == who)
    beat = component.rvalid & component.rready & (component.rid == who)
    starts = component.start & (component.start_miss == who)
    wanted = Signal()
    aged = Signal()  # wanted, and found so by a look
    given_up = Signal()
    line = Signal(3)
    beats = Signal(range(lanes))  # the number of the next one, at most the last one's
    failed = Signal()
    # A number is started when it is free.
    bench.assume(~starts | ~(wanted | given_up))
    bench.assume(~component.start | (component.start_miss < misses))
    at_end = beats == lanes - 1
    right = at_end & component.rlast
    wrong = at_end ^ component.rlast
    late = looks & wanted & aged
    fills = wanted & ((beat & (right | wrong)) | late)
    ends = beat & (wanted | given_up) & right
    m.d.sync += [
        wanted.eq((wanted & ~fills) | starts),
        aged.eq((aged | (looks & wanted)) & ~fills),
        given_up.eq((given_up | (fills & ~ends)) & ~ends),
        beats.eq(Mux(ends, 0, beats + (beat & (wanted | given_up) & ~at_end))),
        failed.eq((failed | (beat & wanted & component.rresp[1])) & ~fills),
    ]
    with m.If(starts):
        m.d.sync += line.eq(component.start_line)

    mine = component.miss == who
    came = bench.past(beat & wanted, "beat")
    filled, ended = bench.past(fills, "fills"), bench.past(ends, "ends")
    bench.require("written_while_awaited", (component.write & mine) == came)
    bench.require("to_its_line", ~(came | filled) | (component.line == bench.past(line, "line")))
    bench.require("to_its_place", ~came | (component.lane == bench.past(beats, "beats")))
    bench.require("its_data", ~came | (component.data == bench.past(component.rdata, "rdata")))
    bench.require("filled_when_it_ends", (component.filled & mine) == filled)
    bench.require("free_when_over", (component.ended & mine) == ended)
    error = bench.past(wrong | late | failed | component.rresp[1], "error")
    bench.require("any_error", ~filled | (component.error == error))
    for name, case in {
        "right": right & ~failed,
        "failed": right & failed if lanes > 1 else right & component.rresp[1],
        "without_last": at_end & ~component.rlast,
        "early_last": ~at_end & component.rlast if lanes > 1 else Const(1),
    }.items():
        bench.reach(name, wanted & beat & case)
    bench.reach("late", late)
    bench.reach("free_after_all", given_up & ends)

    _alone(bench, component, misses)
    _remembered(bench, who, lanes, _Miss(wanted, aged, given_up, line, beats, failed))
    return bench


class _Miss(NamedTuple):
    """The followed miss: awaited, and so at a look; given up, its read under way; its line, the next beat, an error."""

    wanted: Signal
    aged: Signal
    given_up: Signal
    line: Signal
    beats: Signal
    failed: Signal


def _alone(bench: Bench, component: BlockFill, misses: int) -> None:
    """An event that leaves its number in use is by itself until it has passed."""
    m = bench.m
    alone = Signal()
    leaves = component.filled & ~component.ended
    m.d.sync += alone.eq((alone | leaves) & ~component.passed)
    bench.require("alone", ~alone | ~(component.write | component.filled | component.ended))
    bench.require("held_meanwhile", bench.inner("hold") == (alone | leaves))
    looking = bench.inner("looking")
    waits = looking & component.rvalid & component.rready
    bench.require("looks_wait_one_cycle", ~(waits & bench.past(waits, "waits")))
    bench.require("yields", bench.inner("yields") == bench.past(waits, "waited"))
    bench.require("looked_in_range", bench.inner("looked") < misses)


def _remembered(bench: Bench, who: Value, lanes: int, miss: _Miss) -> None:
    """The invariant: what the component remembers of the miss."""
    wanted, aged, given_up, line, beats, failed = miss
    bench.require("line_remembered", ~wanted | (bench.peek("lines", who, "remembered") == line))
    bench.require("wanted", Array(bench.inner("wanted"))[who] == wanted)
    bench.require("marked", Array(bench.inner("marked"))[who] == (aged | given_up))
    bench.require("one_of_both", ~(wanted & given_up) & (wanted | ~aged) & (wanted | ~failed))
    bench.require("idle_at_the_first", wanted | given_up | (beats == 0))
    for k in range((lanes - 1).bit_length()):
        bench.require(f"counted{k}", Array(bench.inner(f"place{k}"))[who] == beats[k])
    if lanes > 1:
        bench.require("failure_remembered", Array(bench.inner("failed"))[who] == failed)
    else:
        bench.require("no_failure_before", ~failed)


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
                says="any beats at any time: each to its line and place; whole, failed, late and over when it is",
                method=Induction(depth=2),
                build=partial(fill, width, 5),
                reach=512 // width + 16,
                quick=width == 128,
            )
            for width in (64, 128, 512)
        ),
    ]
