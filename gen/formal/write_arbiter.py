"""The arbiter of write ports: AXI's rules, data behind its addresses, everybody's turn and answers, and aborts."""

from dataclasses import dataclass
from functools import partial, reduce
from operator import or_

from amaranth import Array, Cat, Mux, Signal, Value, signed

from lightloom.gen.formal.arbiter import in_turn, offer, payload_of, to_whom_it_names, transfers
from lightloom.gen.formal.bench import Bench
from lightloom.gen.formal.properties import Bounded, Induction, Property
from lightloom.gen.formal.streams import Tracker, buffer_invariant, held
from lightloom.golden_model.contract.axi_rules import AXI_RULES, is_masters
from lightloom.rtl.memory.aborts import ABORT
from lightloom.rtl.memory.axi_checker import AxiChecker
from lightloom.rtl.memory.axi_write_arbiter import AxiWriteArbiter

# A count up to a power of two: one that is a value too small lacks a bit.
SHAPE = {"writes": 4, "address_width": 8, "data_width": 256, "id_width": 1}


def _arbiter(count: int, driven: set[str] | None = None) -> tuple[AxiWriteArbiter, Bench]:
    component = AxiWriteArbiter(count, **SHAPE)
    # There is no abort but in benches that ask for one; of its end the others know nothing.
    return component, Bench(component, driven=set(ABORT) if driven is None else driven)


def addresses(count: int) -> Bench:
    component, bench = _arbiter(count)
    in_turn(bench, component, "aw")
    return bench


def answers(count: int) -> Bench:
    component, bench = _arbiter(count)
    to_whom_it_names(bench, component, "b", "answers")
    return bench


@dataclass(frozen=True)
class Masters:
    """What masters of whole blocks do at an arbiter."""

    begins: Value
    """Whose address is taken, a bit each."""
    gives: Value
    """Whose data is taken, a bit each."""
    sender: Signal
    """Whose data comes next, a bit each; nothing where nobody's does."""


def _masters(bench: Bench, component: AxiWriteArbiter) -> Masters:
    """Masters keep AXI's rules, and put WLAST on the last beat of a block; they are in reset while an abort lasts."""
    m, masters, count = bench.m, component.masters, component.count
    beats = masters[0].signature.block_beats
    begins = Cat(transfers(master, "aw") for master in masters)
    gives = Cat(transfers(master, "w") for master in masters)
    sender = Signal(count, name="sender_now")
    m.d.comb += sender.eq(Mux(bench.inner("senders/o__valid"), bench.inner("senders/first"), 0))
    alive = ~component.aborting
    for k, master in enumerate(masters):
        for channel in ("aw", "w"):
            valid, ready = offer(master, channel)
            waits = bench.past(valid & ~ready & alive, f"{channel}{k}_waits")
            payload = payload_of(master, channel)
            kept = valid & (payload == bench.past(payload, f"{channel}{k}_before"))
            bench.assume(~(waits & alive) | kept)
        number = Signal(range(beats), name=f"number{k}")  # of its next beat
        m.d.sync += number.eq(Mux(alive & gives[k], Mux(number == beats - 1, 0, number + 1), Mux(alive, number, 0)))
        bench.assume(~(master.wvalid & alive) | (master.wlast == (number == beats - 1)))
        mine = alive & sender[k]
        bench.require(f"number{k}", ~alive | (number == Mux(mine, bench.inner("beat"), 0)))
    one = bench.inner("senders/first")
    bench.require("one_sender", ~bench.inner("senders/o__valid") | ((one != 0) & ((one & (one - 1)[:count]) == 0)))
    other = bench.inner("senders/kept")
    bench.require("one_behind", ~bench.inner("senders/held") | ((other != 0) & ((other & (other - 1)[:count]) == 0)))
    bench.require("sender_before_the_next", bench.inner("senders/o__valid") | ~bench.inner("senders/held"))
    bench.require("no_beat_without_sender", bench.inner("senders/o__valid") | (bench.inner("beat") == 0))
    return Masters(begins, gives, sender)


def order(count: int) -> Bench:
    """Follows one address, any one: when it is first, its master's data is taken, a block's beats, and no other."""
    component, bench = _arbiter(count)
    bench.require("no_abort", ~component.aborting)
    m, beats = bench.m, component.m_axi.signature.block_beats
    masters = _masters(bench, component)
    number = Signal(range(beats))  # of the next beat of the one that is first
    taken = masters.gives.any()
    m.d.sync += number.eq(Mux(taken, Mux(number == beats - 1, 0, number + 1), number))
    tracker = Tracker(
        bench,
        most=2,
        enters=masters.begins.any(),
        incoming=masters.begins,
        leaves=taken & (number == beats - 1),
        offers=masters.sender.any(),
        outgoing=masters.sender,
    )
    buffer_invariant(bench, tracker, "senders")
    bench.require("beat_is_number", bench.inner("beat") == number)
    mine = tracker.follows & (tracker.ahead == 0)
    bench.require("only_its_data", ~mine | ((masters.gives & ~tracker.payload) == 0))
    bench.require("only_what_has_an_address", ~taken | masters.sender.any())
    bench.require(
        "its_data_goes",
        ~mine | bench.inner("beats/held") | (Cat(master.wready for master in component.masters) == tracker.payload),
    )
    if count > 1:
        bench.reach("another_waits", mine & (tracker.count == 2) & Cat(one.wvalid for one in component.masters).all())
    return bench


def data(count: int) -> Bench:
    """Beats through the buffer: what masters give, in the order in which it is taken."""
    component, bench = _arbiter(count)
    bench.require("no_abort", ~component.aborting)
    port, masters = component.m_axi, component.masters
    gives = _masters(bench, component).gives
    bench.require("one_master_a_beat", (gives & (gives - 1)[:count]) == 0)
    held(bench, "w", *offer(port, "w"), payload_of(port, "w"))
    incoming = [Mux(gives[k], payload_of(master, "w"), 0) for k, master in enumerate(masters)]
    tracker = Tracker(
        bench,
        most=2,
        enters=gives.any(),
        incoming=reduce(or_, incoming),
        leaves=transfers(port, "w"),
        offers=port.wvalid,
        outgoing=payload_of(port, "w"),
    )
    buffer_invariant(bench, tracker, "beats")
    return bench


def _beats_at_the_port(bench: Bench, component: AxiWriteArbiter, masters: Masters) -> Signal:
    """The number of the next beat: as many as a block has, the last one marked, whoever they are from."""
    m, port, beats = bench.m, component.m_axi, component.m_axi.signature.block_beats
    number = Signal(range(beats))
    m.d.sync += number.eq(Mux(transfers(port, "w"), Mux(number == beats - 1, 0, number + 1), number))
    valid, second = bench.inner("beats/o__valid"), bench.inner("beats/held")
    after = Array([*range(1, beats), 0])
    bench.require("last_is_marked", ~port.wvalid | (port.wlast == (number == beats - 1)))
    bench.require("next_last", ~second | (bench.inner("beats/kept")[-1] == (after[number] == beats - 1)))
    place = Mux(second, after[after[number]], Mux(valid, after[number], number))
    bench.require("beats_follow", bench.inner("beat") == place)
    bench.require("in_range", number < beats)
    bench.require("beats_first_before_second", valid | ~second)
    writes = bench.inner("beats/i__payload")
    strobes = writes[SHAPE["data_width"] : -1]
    bench.require("gives_missing_beats", ~(component.aborting & masters.sender.any()) | bench.inner("beats/i__valid"))
    bench.require("writes_nothing", ~(component.aborting & bench.inner("beats/i__valid")) | (strobes == 0))
    return number


def _inside(bench: Bench, component: AxiWriteArbiter, bursts: tuple[Signal, Signal, Signal], offered: Value) -> Value:
    """What is under way is in the buffers; whether a burst begins that the component counts in the next cycle."""
    port = component.m_axi
    left, waiting, unsent = bursts
    valid, second = bench.inner("beats/o__valid"), bench.inner("beats/held")
    ends_inside = Mux(valid & port.wlast, 1, 0) + Mux(second & bench.inner("beats/kept")[-1], 1, 0)
    senders = bench.inner("senders/o__valid") + bench.inner("senders/held")
    bench.require("unsent_are_inside", unsent == senders + ends_inside)
    inside = bench.inner("addresses/o__valid") + bench.inner("addresses/held")
    bench.require("waiting_are_inside", waiting == inside)
    bench.require("addresses_first_before_second", bench.inner("addresses/o__valid") | ~bench.inner("addresses/held"))
    bench.require("all_are_left", (waiting <= left) & (unsent <= left))
    late_begun, late_answered = bench.inner("begun"), bench.inner("answered")
    bench.require("count_is_exact", left + late_answered == bench.inner("left") + late_begun)
    bench.require("begun_is_offered", ~late_begun | offered)  # its sender has just come into an empty buffer, or waits
    bench.require("counted_before_it_came", ~late_answered | (bench.inner("left") != 0))
    return late_begun


def aborts(count: int) -> Bench:
    """A memory that answers what it has taken, in time as far as there is a time, and masters that forget all when told
    to."""
    component, bench = _arbiter(count, driven={"tick", "timed", "abort"})
    m, port = bench.m, component.m_axi
    for name in ("tick", "timed", "abort"):
        m.d.comb += getattr(component, name).eq(bench.any(name))
    masters = _masters(bench, component)
    most = SHAPE["writes"]
    begun, answered = masters.begins.any(), transfers(port, "b")
    asked, ended = transfers(port, "aw"), transfers(port, "w") & port.wlast
    # Bursts whose address was taken from a master: all; those that the port has not taken; those without their data.
    left, waiting, unsent = (Signal(range(most + 1), name=name) for name in ("all_left", "waiting", "unsent"))
    m.d.sync += [
        left.eq(left + begun - answered),
        waiting.eq(waiting + begun - asked),
        unsent.eq(unsent + begun - ended),
    ]
    bench.assume(~begun | (left < most))
    bench.assume(~port.bvalid | ((left > waiting) & (left > unsent)))
    offered = port.awvalid | port.wvalid | bench.inner("senders/o__valid")
    silent = ~(offered | port.bvalid)
    silence = Signal()
    m.d.sync += silence.eq(silent & (silence | component.tick))
    bench.assume(~(component.timed & component.tick & silence & silent) | (left == 0))
    for channel in ("aw", "w"):
        held(bench, channel, *offer(port, channel), payload_of(port, channel))

    number = _beats_at_the_port(bench, component, masters)
    late_begun = _inside(bench, component, (left, waiting, unsent), offered)

    closed = bench.past(component.aborting, "aborting")
    ends = closed & ~component.aborting
    quiet = ~Cat(master.bvalid for master in component.masters).any()
    bench.require("aborts_at_once", ~bench.past(component.abort, "abort") | component.aborting)
    bench.require("takes_nothing", ~component.aborting | ~(masters.begins | masters.gives).any())
    bench.require("gives_nothing", ~closed | quiet)
    bench.require("takes_answers", ~(closed & component.aborting) | port.bready)
    bench.require("ends_when_all_is_over", ~ends | ((left == 0) & ~offered & quiet))
    bench.require("silence", ~bench.inner("silence") | silence)
    over = Signal(2)  # cycles since all was over, without a clock
    done = component.aborting & ~component.abort & ~component.timed & (left == 0) & ~offered
    m.d.sync += over.eq(Mux(done, over + (over != 3), 0))
    bench.require("ends_then", over <= 2)
    settled = Mux(over == 2, (bench.inner("left") == 0) & ~late_begun, ~(late_begun & (over != 0)))
    bench.require("counted_then", ~done | settled)
    amid = component.aborting & bench.inner("senders/o__valid") & (bench.inner("beat") != 0)
    bench.reach("amid_a_block", amid & bench.past(masters.gives.any(), "gave"))
    bench.reach("all_its_beats_missing", closed & component.aborting & (unsent == 2) & (number == 0))
    bench.reach("answers_come", closed & answered & (left > 1))
    bench.reach("again", component.aborting & component.abort & (left != 0))
    bench.reach("goes_on", begun & bench.past(ends, "ended"))
    bench.reach("ends_by_the_clock", ends & bench.past(component.timed & component.aborting, "timed"))
    return bench


def silent_memory(count: int) -> Bench:
    """A memory that answers what it likes, also what it was not asked for; aborts with a clock end all the same."""
    component, bench = _arbiter(count, driven={"timed"})
    m, port = bench.m, component.m_axi
    m.d.comb += component.timed.eq(1)
    offered = port.awvalid | port.wvalid | bench.inner("senders/o__valid")
    silent = ~(offered | port.bvalid | component.abort)
    ticks = Signal(2)  # since the last that came, with the one in this cycle
    m.d.sync += ticks.eq(Mux(silent, ticks + (component.tick & (ticks != 3)), 0))
    ends = bench.past(component.aborting, "aborting") & ~component.aborting
    bench.require("ends_at_the_second_tick", ~component.aborting | (ticks < 2))
    bench.require("silence_is_a_tick", bench.inner("silence") == (ticks != 0))
    bench.require("counts_from_nothing", ~ends | (bench.inner("left") == 0))
    bench.require("offers_nothing", ~ends | ~offered)
    for name in ("addresses", "beats", "senders"):
        bench.require(f"{name}_first_before_second", bench.inner(f"{name}/o__valid") | ~bench.inner(f"{name}/held"))
    left = bench.inner("left")
    bench.reach("too_few_answers", ends & bench.past(left != 0, "short"))
    bench.reach("too_many_answers", component.aborting & (left == 0) & bench.past(port.bvalid, "more"))
    return bench


def rules(count: int) -> Bench:
    """The checker beside each master and beside the port: those that are for others to keep are kept, so all are."""
    component = AxiWriteArbiter(count, **SHAPE | {"address_width": 13})
    bench = Bench(component, driven=set(ABORT))
    m = bench.m
    watched = {"port": component.m_axi, **{f"master{k}": one for k, one in enumerate(component.masters)}}
    for place, port in watched.items():
        signature = port.signature if place == "port" else component.signature.members["masters"].signature
        checker = AxiChecker(signature, writes=8, ahead=4)
        bench.add(f"checker_of_{place}", checker)
        m.d.comb += [getattr(checker.m_axi, name).eq(getattr(port, name)) for name in signature.members]
        for k, name in enumerate(AXI_RULES):
            if name.split("_")[0] not in signature.CHANNELS:
                continue
            if is_masters(name) == (place == "port"):
                bench.require(f"{place}_{name}", ~checker.broken[k])
            else:
                bench.assume(~checker.broken[k])
    port = component.m_axi
    balance = Signal(signed(4))  # bursts whose address was taken at the port, less those whose data was
    m.d.sync += balance.eq(balance + transfers(port, "aw") - (transfers(port, "w") & port.wlast))
    bench.reach("data_ahead_of_its_address", balance < 0)
    answered = Signal(count)  # masters
    m.d.sync += answered.eq(answered | Cat(transfers(master, "b") for master in component.masters))
    bench.reach("answers_to_all", answered.all())
    return bench


def properties() -> list[Property]:
    shared = (
        (
            "aw",
            addresses,
            "one master a cycle, in order, its number in the id, stable until taken; each in its turn",
        ),
        ("order", order, "of each burst its master's data, when its address is first: all beats, and no other's"),
        ("w", data, "beats as they were given, once, in order, stable until taken"),
        ("b", answers, "an answer goes to the master that its id names, once, in order, stable until taken"),
    )
    return [
        *(
            Property(
                unit="axi_write_arbiter",
                name=f"{name}-{count}",
                says=says,
                method=Induction(depth=1),
                build=partial(build, count),
                reach=8,
                quick=count == 3 and name != "w",
            )
            for name, build, says in shared
            for count in (1, 3, 4)
        ),
        Property(
            unit="axi_write_arbiter",
            name="abort",
            says="no new burst; those begun get all beats, the missing ones write nothing; over when all is answered",
            method=Induction(depth=3),
            build=partial(aborts, 2),
            reach=20,
            quick=True,
        ),
        Property(
            unit="axi_write_arbiter",
            name="silent-memory",
            says="an abort with a clock ends at the second tick of silence, whatever the memory answers",
            method=Induction(depth=2),
            build=partial(silent_memory, 2),
            reach=20,
            quick=True,
        ),
        Property(
            unit="axi_write_arbiter",
            name="rules",
            says="keeps all rules of AXI towards the memory and the masters, beside such that do",
            method=Bounded(depth=10),
            build=partial(rules, 2),
        ),
    ]
