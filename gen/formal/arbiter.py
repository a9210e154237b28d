"""The arbiter of the memory port: AXI's rules, order, and everybody's turn."""

from functools import partial, reduce
from operator import or_
from typing import Any

from amaranth import Array, Cat, Const, Mux, Signal, Value

from lightloom.gen.formal.bench import Bench
from lightloom.gen.formal.properties import Induction, Property
from lightloom.gen.formal.streams import Tracker, buffer_invariant, held
from lightloom.rtl.memory.aborts import ABORT
from lightloom.rtl.memory.axi_read_arbiter import AxiReadArbiter
from lightloom.rtl.memory.read_timer import TIMEOUT_BITS, ReadTimer

SHAPE = {"reads": 16, "address_width": 8, "data_width": 32, "id_width": 2}


def _arbiter(count: int) -> tuple[AxiReadArbiter, Bench]:
    component = AxiReadArbiter(count, **SHAPE)
    # There is no abort but in benches that ask for one; of its end the others know nothing.
    return component, Bench(component, driven=set(ABORT))


def addresses(count: int) -> Bench:
    component, bench = _arbiter(count)
    in_turn(bench, component, "ar")
    return bench


def data(count: int) -> Bench:
    component, bench = _arbiter(count)
    to_whom_it_names(bench, component, "r", "beats")
    return bench


def in_turn(bench: Bench, component: Any, channel: str) -> None:
    """Addresses of an arbiter without an abort: one master a cycle, in order, number in the id, each in its turn."""
    bench.require("no_abort", ~component.aborting)
    m, port, masters = bench.m, component.m_axi, component.masters
    count = len(masters)
    takes = Cat(transfers(master, channel) for master in masters)
    one_at_a_time = (takes & (takes - 1)[:count]) == 0
    bench.require("one_master_a_cycle", one_at_a_time)
    valid, ready = offer(port, channel)
    held(bench, channel, valid, ready, payload_of(port, channel))
    for k, master in enumerate(masters):  # AXI's rule for masters
        keeps_offering(bench, master, channel, f"master{k}")

    # In order, with the master's number above its id.
    incoming = [Mux(takes[k], payload_of(one, channel, _number(k, count)), 0) for k, one in enumerate(masters)]
    tracker = Tracker(
        bench,
        most=2,
        enters=takes.any(),
        incoming=reduce(or_, incoming),
        leaves=valid & ready,
        offers=valid,
        outgoing=payload_of(port, channel),
    )
    buffer_invariant(bench, tracker, "addresses")

    # A master that waits sees each of the others once before it.
    if count > 1:
        who = bench.constant("who", range(count))
        bench.assume(who < count)
        waits = Signal()
        passed = Signal(range(count + 2))
        distance = Signal(range(count))
        last = Signal(range(count))
        above = bench.inner("asker_above")
        waiting = [getattr(master, f"{channel}valid") & ~transfers(master, channel) for master in masters]
        m.d.comb += waits.eq(Array(waiting)[who])
        with m.If(~waits):
            m.d.sync += passed.eq(0)
        with m.Elif(takes.any()):
            m.d.sync += passed.eq(passed + 1)
        ones = sum((bit for bit in above), start=Value.cast(0))
        m.d.comb += [
            last.eq(count - 1 - ones),
            distance.eq(Mux(who > last, who - last - 1, who + count - last - 1)),
        ]
        bench.require("turn", passed < count)
        bench.require("nearer_each_time", passed + distance < count)
        ranges = [above == (((1 << count) - 1) << k) & ((1 << count) - 1) for k in range(1, count + 1)]
        bench.require("above_is_a_range", reduce(or_, ranges))


def to_whom_it_names(bench: Bench, component: Any, channel: str, buffer: str) -> None:
    """Answers through an arbiter without an abort: to the master that the id names, once, in order."""
    bench.require("no_abort", ~component.aborting)
    port, masters = component.m_axi, component.masters
    count, low = len(masters), component.masters[0].signature.id_width
    valid, ready = offer(port, channel)
    somebody = getattr(port, f"{channel}id")[low:] < count
    valids = Cat(getattr(master, f"{channel}valid") for master in masters)
    bench.require("one_master_a_beat", (valids & (valids - 1)[:count]) == 0)
    for k, master in enumerate(masters):
        held(bench, f"{channel}{k}", *offer(master, channel), payload_of(master, channel))
    outgoing = [Mux(valids[k], payload_of(one, channel, _number(k, count)), 0) for k, one in enumerate(masters)]
    tracker = Tracker(
        bench,
        most=2,
        enters=valid & ready & somebody,
        incoming=payload_of(port, channel),
        leaves=reduce(or_, (transfers(master, channel) for master in masters)),
        offers=valids.any(),
        outgoing=reduce(or_, outgoing),
    )
    buffer_invariant(bench, tracker, buffer)
    before = port.signature.data_width if channel == "r" else 0  # bits of the payload below the id
    for register, holds in (("first", "o__valid"), ("kept", "held")):
        number = bench.inner(f"{buffer}/{register}")[before + low :][: component.number_width]
        bench.require(f"{register}_for_somebody", ~bench.inner(f"{buffer}/{holds}") | (number < count))
    if count & (count - 1):
        bench.reach("for_nobody", valid & ready & ~somebody)


def offer(port: Any, channel: str) -> tuple[Value, Value]:
    """`valid` and `ready` of a channel."""
    return getattr(port, f"{channel}valid"), getattr(port, f"{channel}ready")


def transfers(port: Any, channel: str) -> Value:
    valid, ready = offer(port, channel)
    return valid & ready


def payload_of(port: Any, channel: str, number: Value | None = None) -> Value:
    """What a channel has; `number` is put above the id."""
    fields = [(name, Value.cast(getattr(port, name))) for name, _ in port.signature.payload(channel)]
    above = Const(0, 0) if number is None else number
    return Cat(Cat(value, above) if name == f"{channel}id" else value for name, value in fields)


def keeps_offering(bench: Bench, port: Any, channel: str, name: str) -> None:
    """AXI's rule for whoever offers something: it stays until it is taken."""
    valid, ready = offer(port, channel)
    waits = bench.past(valid & ~ready, f"{name}_waits")
    before = bench.past(payload_of(port, channel), name)
    bench.assume(~waits | (valid & (payload_of(port, channel) == before)))


def aborts(count: int) -> Bench:
    """A memory that gives the beats which it was asked for, when it likes, but some from one tick to the next while
    there is a clock; and masters that forget all when told to."""
    component, bench = _arbiter(count)
    m, port, masters = bench.m, component.m_axi, component.masters
    beats = port.signature.block_beats
    tick, timed = bench.any("tick"), bench.any("timed")
    m.d.comb += [component.abort.eq(bench.any("abort")), component.tick.eq(tick), component.timed.eq(timed)]
    asked, came = port.arvalid & port.arready, port.rvalid & port.rready
    left = Signal(range(component.reads * beats + 1))
    m.d.sync += left.eq(left + Mux(asked, beats, 0) - came)
    bench.assume(~port.rvalid | (left != 0))
    bench.assume(~asked | (left <= (component.reads - 1) * beats))
    silent = ~(port.arvalid | port.rvalid)
    silence = Signal()
    m.d.sync += silence.eq(silent & (silence | tick))
    bench.assume(~(timed & tick & silence & silent) | (left == 0))

    late_asked, late_came = bench.inner("asked"), bench.inner("came")
    bench.require("count_is_exact", left + late_came == bench.inner("left") + Mux(late_asked, beats, 0))
    bench.require("counted_before_it_came", ~late_came | (bench.inner("left") != 0))
    before = _abort_rules(bench, component)
    ends = before & ~component.aborting
    quiet = ~Cat(master.rvalid for master in masters).any()
    bench.require("gives_nothing", ~before | quiet)
    bench.require("ends_when_all_is_over", ~ends | ((left == 0) & ~port.arvalid & quiet))
    bench.require("silence", ~bench.inner("silence") | silence)
    over = Signal(2)  # cycles since all was over, without a clock
    done = component.aborting & ~component.abort & ~timed & (left == 0) & ~port.arvalid
    m.d.sync += over.eq(Mux(done, over + (over != 3), 0))
    bench.require("ends_then", over <= 2)
    settled = Mux(over == 2, (bench.inner("left") == 0) & ~late_asked, ~(late_asked & (over != 0)))
    bench.require("counted_then", ~done | settled)
    bench.require("first_before_second", bench.inner("addresses/o__valid") | ~bench.inner("addresses/held"))
    bench.reach("beats_come", before & came & (left > 1))
    bench.reach("address_waits", before & component.aborting & bench.past(port.arvalid & ~port.arready, "waited"))
    bench.reach("again", component.aborting & component.abort & (left != 0))
    bench.reach("goes_on", port.arvalid & ~component.aborting & bench.past(ends, "ended"))
    bench.reach("ends_by_the_clock", ends & bench.past(timed & component.aborting & (left == 0), "timed"))
    return bench


def timed_aborts(count: int) -> Bench:
    """A memory that gives any beats for any address that it has taken, or none; but as long as it will give any, there
    is one at least every `timeout` cycles."""
    component, bench = _arbiter(count)
    m, port = bench.m, component.m_axi
    timer = ReadTimer()
    elapsed = bench.inner("elapsed", bench.add("timer", timer))
    timeout = bench.constant("timeout", TIMEOUT_BITS)
    bench.assume(timeout != 0)
    m.d.comb += [component.abort.eq(bench.any("abort")), timer.timeout.eq(timeout)]
    m.d.comb += [component.tick.eq(timer.tick), component.timed.eq(timer.runs)]
    asked = port.arvalid & port.arready
    silent = ~(port.arvalid | port.rvalid)
    owes = Signal()
    gap = Signal(TIMEOUT_BITS + 1)  # silent cycles before this one
    m.d.sync += [
        owes.eq(asked | (owes & ~bench.any("has_given_all"))),
        gap.eq(Mux(silent, gap + (gap != (1 << TIMEOUT_BITS + 1) - 1), 0)),
    ]
    bench.assume(~port.rvalid | owes)
    bench.assume(~owes | ~silent | (gap < timeout))

    before = _abort_rules(bench, component)
    ends = before & ~component.aborting
    bench.require("ends_when_nothing_will_come", ~ends | ~(owes | port.arvalid))
    bench.require("counts_from_nothing", ~ends | (bench.inner("left") == 0))
    ticks = Signal(2)  # since the last that came, with the one in this cycle
    m.d.sync += ticks.eq(Mux(silent & ~component.abort, ticks + (timer.tick & (ticks != 3)), 0))
    bench.require("ends_at_the_second_tick", ~component.aborting | (ticks < 2))
    bench.require("elapsed", (elapsed <= timeout) & (~timer.tick | (elapsed == 0)))
    silence = bench.inner("silence")
    bench.require("silence_is_time", ~silence | (gap >= Mux(timer.tick, timeout + 1, elapsed)))
    bench.require("silence_is_a_tick", silence == (ticks != 0))
    left = bench.inner("left")
    bench.reach("too_few_beats", ends & bench.past(left != 0, "short"))
    bench.reach("too_many_beats", component.aborting & owes & (left == 0) & bench.past(port.rvalid, "longer"))
    bench.reach("goes_on", port.arvalid & bench.past(ends, "ended"))
    return bench


def _abort_rules(bench: Bench, component: AxiReadArbiter) -> Signal:
    """What an abort is, whatever ends it; `aborting` in the cycle before."""
    port = component.m_axi
    held(bench, "ar", port.arvalid, port.arready, payload_of(port, "ar"))
    closed = component.abort | component.aborting
    waits = bench.past(port.arvalid & ~port.arready, "waits")
    bench.require("nothing_new", ~(bench.past(closed, "closed") & port.arvalid) | waits)
    bench.require("aborts_at_once", ~bench.past(component.abort, "abort") | component.aborting)
    before = bench.past(component.aborting, "aborting")
    bench.require("takes_all", ~(before & component.aborting) | port.rready)
    return before


def _number(k: int, count: int) -> Value:
    return Const(k, (count - 1).bit_length())


def properties() -> list[Property]:
    return [
        Property(
            unit="axi_read_arbiter",
            name="abort",
            says="after an abort no new address; beats counted, taken and dropped; over when all have come",
            method=Induction(depth=3),
            build=partial(aborts, 2),
            reach=20,
            quick=True,
        ),
        Property(
            unit="axi_read_arbiter",
            name="timed-abort",
            says="with a timeout an abort ends at the second tick of silence, when a memory in time will send no more",
            method=Induction(depth=2),
            build=partial(timed_aborts, 2),
            reach=24,
            quick=True,
        ),
    ] + [
        Property(
            unit="axi_read_arbiter",
            name=f"{channel}-{count}",
            says=says,
            method=Induction(depth=1),
            build=partial(build, count),
            reach=6,
            quick=count == 3,
        )
        for channel, build, says in (
            (
                "ar",
                addresses,
                "one master a cycle, in order, its number in the id, stable until taken; each in its turn",
            ),
            ("r", data, "a beat goes to the master that its id names, once, in order, stable until taken"),
        )
        for count in (1, 3, 4)
    ]
