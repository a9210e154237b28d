"""The writer of blocks: what was taken is written, whole and once, in order and within bounds, and the fence knows."""

from dataclasses import dataclass
from functools import partial

from amaranth import Cat, Mux, Signal, Value

from lightloom.gen.formal.bench import Bench
from lightloom.gen.formal.properties import Bounded, Induction, Property
from lightloom.gen.formal.queues import FifoInside
from lightloom.gen.formal.streams import Tracker, buffer_invariant, held
from lightloom.golden_model.contract.axi_rules import AXI_RULES, is_masters
from lightloom.golden_model.contract.formats import BLOCK_BYTES, WRITE_ERRORS
from lightloom.rtl.memory.axi import BLOCK_BITS, INCR, OFFSET_BITS
from lightloom.rtl.memory.axi_checker import AxiChecker
from lightloom.rtl.memory.axi_writer import AxiWriter

# A count up to a power of two: one that is a value too small lacks a bit.
SHAPE = {"writes": 4, "address_width": 9, "id_width": 1}
ABORT = {"abort", "tick", "timed"}


@dataclass(frozen=True)
class Writing:
    """What happens at a writer's ports, and how much is under way."""

    accepts: Value
    """A block is taken that lies within the bounds."""
    refuses: Value
    answers: Value
    """An answer to a block, of the id that the writer has."""
    count: Signal
    """Blocks taken and not answered."""
    addresses: Signal
    """Of them, those whose address was not taken."""
    contents: Signal
    """Of them, those whose last beat was not taken."""


def _writer(data_width: int, *, aborts: bool = False) -> tuple[AxiWriter, Bench, Writing]:
    """A writer beside a memory that answers what it has taken, in any time, and other ids whenever it likes."""
    component = AxiWriter(**SHAPE, data_width=data_width)
    bench = Bench(component, driven=ABORT)
    m, i, port = bench.m, component.i, component.m_axi
    if aborts:
        m.d.comb += [getattr(component, name).eq(bench.any(name)) for name in sorted(ABORT)]
    else:
        bench.require("no_abort", ~component.aborting)
    most = SHAPE["writes"] + 1
    count, addresses, contents = (
        Signal(range(most), name=name) for name in ("count", "addresses_left", "contents_left")
    )
    first = Value.cast(Cat(Value.cast(0).replicate(OFFSET_BITS), i.payload.block))
    within = (first >= component.base) & (first + BLOCK_BYTES <= component.limit)
    accepted = i.valid & i.ready
    accepts = accepted & within
    answers = port.bvalid & port.bready & (port.bid == 0)
    m.d.sync += [
        count.eq(count + accepts - answers),
        addresses.eq(addresses + accepts - (port.awvalid & port.awready)),
        contents.eq(contents + accepts - (port.wvalid & port.wready & port.wlast)),
    ]
    bench.assume(~port.bvalid | (port.bid != 0) | ((count > addresses) & (count > contents)))
    # The invariant: registers of the buffers, and the count.
    for name, left in (("addresses", addresses), ("contents", contents)):
        valid, second = bench.inner(f"{name}/o__valid"), bench.inner(f"{name}/held")
        bench.require(f"{name}_are_registers", left == valid + second)
        bench.require(f"{name}_first_before_second", valid | ~second)
        bench.require(f"{name}_are_under_way", left <= count)
    bench.require("count_is_exact", bench.inner("under_way") == count)
    bench.require("no_more_than_may_be", count < most)
    return component, bench, Writing(accepts, accepted & ~within, answers, count, addresses, contents)


def addresses(data_width: int) -> Bench:
    component, bench, writing = _writer(data_width)
    port, axi = component.m_axi, component.m_axi.signature
    payload = Cat(Value.cast(getattr(port, name)) for name, _ in axi.payload("aw"))
    held(bench, "aw", port.awvalid, port.awready, payload)
    tracker = Tracker(
        bench,
        most=2,
        enters=writing.accepts,
        incoming=component.i.payload.block,
        leaves=port.awvalid & port.awready,
        offers=port.awvalid,
        outgoing=port.awaddr[OFFSET_BITS:],
    )
    buffer_invariant(bench, tracker, "addresses")
    whole = (port.awlen == axi.block_beats - 1) & (port.awsize == axi.beat_size) & (port.awburst == INCR)
    bench.require("a_block", whole & (port.awaddr[:OFFSET_BITS] == 0) & (port.awid == 0))
    bench.reach("refused", writing.refuses)
    bench.reach("ahead_of_its_data", writing.addresses < writing.contents)
    bench.reach("behind_its_data", writing.addresses > writing.contents)
    return bench


def data(data_width: int) -> Bench:
    """Follows one beat, any one, of the followed block."""
    component, bench, writing = _writer(data_width)
    m, port, axi = bench.m, component.m_axi, component.m_axi.signature
    lanes = data_width // 8
    which = bench.constant("which", range(axi.block_beats))
    bench.assume(which < axi.block_beats)

    def beat_of(data: Value, strobes: Value) -> Value:
        return Cat(data.word_select(which, data_width), strobes.word_select(which, lanes))

    held(bench, "w", port.wvalid, port.wready, Cat(port.wdata, port.wstrb, port.wlast))
    number = Signal(range(axi.block_beats + 1))  # of the beat that is offered
    moves = port.wvalid & port.wready
    m.d.sync += number.eq(Mux(moves, Mux(number == axi.block_beats - 1, 0, number + 1), number))
    followed = Signal(data_width + lanes)
    tracker = Tracker(
        bench,
        most=2,
        enters=writing.accepts,
        incoming=beat_of(component.i.payload.data, component.i.payload.strobes),
        leaves=moves & port.wlast,
        offers=port.wvalid,
        outgoing=Mux(number == which, Cat(port.wdata, port.wstrb), followed),
    )
    m.d.comb += followed.eq(tracker.payload)
    bench.require("as_many_beats", port.wlast == (number == axi.block_beats - 1))
    bench.require("beat_is_number", bench.inner("beat") == number if axi.block_beats > 1 else number == 0)
    bench.require("none_while_empty", port.wvalid | (number == 0))
    bench.require("in_range", number < axi.block_beats)
    for register, place in (("first", 0), ("kept", 1)):
        held_block = bench.inner(f"contents/{register}")
        mine = tracker.follows & (tracker.ahead == place)
        beat = beat_of(held_block[:BLOCK_BITS], held_block[BLOCK_BITS:])
        bench.require(f"{register}_is_it", ~mine | (beat == tracker.payload))
    bench.require("count_is_registers", tracker.count == writing.contents)
    bench.reach("mixed_strobes", moves & tracker.follows & ~port.wstrb.all() & port.wstrb.any())
    return bench


def fence(data_width: int) -> Bench:
    component, bench, writing = _writer(data_width)
    port = component.m_axi
    bench.require("idle_when_all_is_answered", component.idle == (writing.count == 0))
    offers = port.awvalid | port.wvalid
    bench.require("idle_offers_nothing", ~component.idle | ~offers)
    waits = component.i.valid & ~component.i.ready
    room = writing.count < SHAPE["writes"]
    bench.require(
        "takes_what_it_has_room_for", ~(waits & room) | (bench.inner("addresses/held") | bench.inner("contents/held"))
    )
    bench.require("takes_answers", port.bready)
    bench.reach("all_under_way", writing.count == SHAPE["writes"])
    bench.reach("idle_again", component.idle & bench.past(writing.answers, "answered"))
    bench.reach("answer_to_nothing", port.bvalid & (port.bid != 0) & component.idle)
    return bench


def errors(data_width: int) -> Bench:
    component, bench, writing = _writer(data_width)
    port, block = component.m_axi, component.i.payload.block
    out = bench.inner("unanswered/fifo/r__valid")
    oldest = bench.inner("unanswered/fifo/r__payload")
    tracker = Tracker(
        bench,
        most=SHAPE["writes"],
        enters=writing.accepts,
        incoming=block,
        leaves=writing.answers,
        offers=out,
        outgoing=oldest,
    )
    bench.require("count_is_count", tracker.count == writing.count)
    inside = FifoInside(bench, "unanswered/fifo", "block")
    bench.require("count_is_level", tracker.count == inside.level + inside.out)
    in_ram = tracker.follows & (tracker.ahead >= inside.out)
    bench.require("followed_in_ram", ~in_ram | (inside.at(tracker.ahead - inside.out) == tracker.payload))
    came = bench.past(writing.accepts, "came")
    bench.require("one_on_its_way", inside.out | (inside.level == (came & (inside.level != 0))))
    bench.require("address_comes_later", inside.out | (inside.level == 0) | (writing.addresses == 1))
    answerable = (writing.count > writing.addresses) & (writing.count > writing.contents)
    bench.require("oldest_is_there", ~answerable | out)

    none, memory, outside = (WRITE_ERRORS[name] for name in ("none", "memory", "outside"))
    open_ = (component.error == none) | component.clear
    fails = writing.answers & port.bresp[1]
    mine = tracker.follows & (tracker.ahead == 0)
    expected = Mux(open_, Mux(fails, memory, Mux(writing.refuses, outside, none)), component.error)
    bench.require("first_error", component.error == bench.past(expected, "error"))
    told = bench.past(open_ & fails & mine, "failed")
    bench.require("block_that_failed", ~told | (component.error_block == bench.past(tracker.payload, "block")))
    refused = bench.past(open_ & ~fails & writing.refuses, "refused")
    bench.require("block_that_was_refused", ~refused | (component.error_block == bench.past(block, "its")))
    stays = bench.past((component.error != none) & ~component.clear, "stays")
    bench.require("block_stays", ~stays | (component.error_block == bench.past(component.error_block, "told")))
    bench.reach("fails_with_others_behind_it", told & (writing.count > 1))
    bench.reach("refused_beside_a_failure", bench.past(open_ & fails & writing.refuses, "both"))
    bench.reach("fails_with_clear", bench.past(component.clear & fails & (component.error == outside), "again"))
    return bench


def aborts(data_width: int) -> Bench:
    """A memory that answers in time, as far as there is a time, and a writer that is aborted at any time."""
    component, bench, writing = _writer(data_width, aborts=True)
    m, port = bench.m, component.m_axi
    offered = port.awvalid | port.wvalid
    silent = ~(offered | port.bvalid)
    silence = Signal()
    m.d.sync += silence.eq(silent & (silence | component.tick))
    ticks = component.timed & component.tick & silence & silent
    bench.assume(~ticks | (writing.count == 0))
    for channel in ("aw", "w"):
        payload = Cat(Value.cast(getattr(port, name)) for name, _ in port.signature.payload(channel))
        held(bench, channel, getattr(port, f"{channel}valid"), getattr(port, f"{channel}ready"), payload)

    before = bench.past(component.aborting, "aborting")
    ends = before & ~component.aborting
    over = (writing.count == 0) & ~offered
    bench.require("aborts_at_once", ~bench.past(component.abort, "abort") | component.aborting)
    bench.require("takes_nothing", ~(component.aborting & component.i.ready))
    bench.require("ends_when_all_is_over", ~ends | over)
    as_new = (component.error == WRITE_ERRORS["none"]) & (bench.inner("unanswered/fifo/level") == 0)
    bench.require("as_after_a_reset", ~ends | (component.idle & as_new))
    bench.require("silence", ~bench.inner("silence") | silence)
    bench.require("queue_is_reset", ~(before & component.aborting) | (bench.inner("unanswered/fifo/level") == 0))
    bench.require("error_is_cleared", ~(before & component.aborting) | (component.error == WRITE_ERRORS["none"]))
    waits = Signal(2)  # cycles since all was over, without a clock
    done = component.aborting & ~component.abort & ~component.timed & over
    m.d.sync += waits.eq(Mux(done, waits + (waits != 3), 0))
    bench.require("ends_then", waits <= 1)
    bench.reach("aborted_with_all_under_way", component.aborting & (writing.count == SHAPE["writes"]))
    bench.reach("data_goes_on", before & component.aborting & port.wvalid & port.wready)
    bench.reach("address_goes_on", before & component.aborting & port.awvalid & port.awready)
    bench.reach("goes_on", writing.accepts & bench.past(ends, "ended"))
    bench.reach("ends_by_the_clock", ends & bench.past(component.timed & component.aborting, "timed"))
    return bench


def silent_memory(data_width: int) -> Bench:
    """A memory that answers what it likes, also what it was not asked for; aborts with a clock end all the same.

    Two writes: their count leaves a number unused, so that one below nothing is more than may be under way.
    """
    writes = 2
    component = AxiWriter(**SHAPE | {"writes": writes}, data_width=data_width)
    bench = Bench(component, driven={"timed"})
    m, port = bench.m, component.m_axi
    m.d.comb += component.timed.eq(1)
    offered = port.awvalid | port.wvalid
    silent = ~(offered | port.bvalid | component.abort)
    ticks = Signal(2)  # since the last that came, with the one in this cycle
    m.d.sync += ticks.eq(Mux(silent, ticks + (component.tick & (ticks != 3)), 0))
    ends = bench.past(component.aborting, "aborting") & ~component.aborting
    bench.require("ends_at_the_second_tick", ~component.aborting | (ticks < 2))
    bench.require("silence_is_a_tick", bench.inner("silence") == (ticks != 0))
    bench.require("counts_from_nothing", ~ends | (component.idle & ~offered))
    bench.require("never_below_nothing", bench.inner("under_way") <= writes)
    for name in ("addresses", "contents"):
        bench.require(f"{name}_first_before_second", bench.inner(f"{name}/o__valid") | ~bench.inner(f"{name}/held"))
    bench.reach("too_few_answers", ends & bench.past(bench.inner("under_way") != 0, "short"))
    return bench


def rules(data_width: int) -> Bench:
    """The checker beside the port: the memory keeps its rules, so the writer keeps its own."""
    component = AxiWriter(**SHAPE | {"address_width": 13}, data_width=data_width)
    bench = Bench(component, driven={"timed", "tick"})
    m, port = bench.m, component.m_axi
    checker = AxiChecker(port.signature, writes=4, ahead=4)
    bench.add("checker", checker)
    m.d.comb += [getattr(checker.m_axi, name).eq(getattr(port, name)) for name in port.signature.members]
    for k, name in enumerate(AXI_RULES):
        if name.split("_")[0] in port.signature.CHANNELS:
            if is_masters(name):
                bench.require(name, ~checker.broken[k])
            else:
                bench.assume(~checker.broken[k])
    under_way = bench.inner("under_way")
    bench.reach("all_answered", component.idle & bench.past(port.bvalid & (under_way == 1), "last"))
    bench.reach("all_under_way", under_way == SHAPE["writes"])
    bench.reach("aborted", bench.past(component.aborting & (under_way != 0), "aborting") & component.aborting)
    return bench


def properties() -> list[Property]:
    return [
        *(
            Property(
                unit="axi_writer",
                name=f"{name}-{width}",
                says=says,
                method=Induction(depth=depth),
                build=partial(build, width),
                reach=reach,
                quick=quick,
            )
            for name, build, says, depth, width, reach, quick in (
                (
                    "addresses",
                    addresses,
                    "each block within the bounds once, in order, no other; stable until taken",
                    1,
                    256,
                    8,
                    True,
                ),
                (
                    "data",
                    data,
                    "each block's beats and strobes, whole, in order, none of another block's",
                    1,
                    256,
                    8,
                    False,
                ),
                ("data", data, "the same of a bus as wide as a block", 1, 512, 6, False),
                ("fence", fence, "idle if, and only if, all blocks that were taken are answered", 1, 256, 12, True),
                ("errors", errors, "the first error, with its block; none is lost to a clear", 2, 512, 12, True),
                (
                    "abort",
                    aborts,
                    "takes no block, writes what it took, ends when all is answered, as new",
                    2,
                    256,
                    16,
                    True,
                ),
                (
                    "silent-memory",
                    silent_memory,
                    "an abort with a clock ends whatever the memory answers",
                    1,
                    512,
                    12,
                    True,
                ),
            )
        ),
        Property(
            unit="axi_writer",
            name="rules",
            says="keeps all rules of AXI beside a memory that does",
            method=Bounded(depth=12),
            build=partial(rules, 256),
        ),
    ]
