"""The block cache and its lists of waiting requests: bounded proofs of small ones, whatever the memory does."""

from dataclasses import dataclass
from functools import partial

from amaranth import Array, Cat, Mux, Signal, Value

from lightloom.gen.formal.bench import Bench
from lightloom.gen.formal.properties import Bounded, Property
from lightloom.gen.formal.streams import held
from lightloom.rtl.memory.axi import BLOCK_BITS, INCR, OFFSET_BITS
from lightloom.rtl.memory.block_cache import BlockCache
from lightloom.rtl.memory.waiters import Waiters

TAGS = 4
"""Requests under way have different tags, 0 to 3, so that an answer says which request it is for."""


@dataclass(frozen=True)
class Lists:
    """The lists of waiting requests, as they have to be."""

    takes: Value
    """A request is answered."""
    waits: list[Signal]
    """By tag: its request waits."""
    whose: list[Signal]
    """By tag: the miss in whose list it waits."""
    answered: list[Signal]
    """By tag: its block has come."""
    its_line: list[Signal]
    """By tag: where its block is."""
    its_error: list[Signal]
    """By tag: its block has failed."""
    listed: list[Signal]
    """By miss: it has a list that may grow."""
    filled: list[Signal]
    """By miss: its block has come, its number is not free yet."""
    over: list[Signal]
    """By miss: so is its read."""
    free_again: list[Signal]
    """By miss: it has had a list before."""


def _lists(bench: Bench, component: Waiters, misses: int) -> Lists:
    o = component.o
    lists = Lists(
        takes=o.valid & o.ready,
        waits=[Signal(name=f"waits{tag}") for tag in range(TAGS)],
        whose=[Signal(range(misses), name=f"whose{tag}") for tag in range(TAGS)],
        answered=[Signal(name=f"answered{tag}") for tag in range(TAGS)],
        its_line=[Signal(2, name=f"its_line{tag}") for tag in range(TAGS)],
        its_error=[Signal(name=f"its_error{tag}") for tag in range(TAGS)],
        listed=[Signal(name=f"listed{k}") for k in range(misses)],
        filled=[Signal(name=f"filled{k}") for k in range(misses)],
        over=[Signal(name=f"over{k}") for k in range(misses)],
        free_again=[Signal(name=f"free_again{k}") for k in range(misses)],
    )
    _as_the_cache_does(bench, component, lists, misses)
    for k in range(misses):
        _follow_miss(bench, component, lists, k)
    for tag in range(TAGS):
        _follow_tag(bench, component, lists, tag)
    return lists


def _as_the_cache_does(bench: Bench, component: Waiters, lists: Lists, misses: int) -> None:
    """It adds where there is room, to a list that is not closed, and closes each list once.

    A read ends with that or later; where later, nothing comes in between but what has passed.
    """
    listed, filled, ending = Array(lists.listed), Array(lists.filled), component.filled_miss
    bench.assume(component.miss < misses)
    bench.assume(component.filled_miss < misses)
    bench.assume(~component.add | (component.ready & ~Array(lists.waits)[component.tag]))
    bench.assume(~component.add | (component.first == ~listed[component.miss]))
    bench.assume(~component.add | ~filled[component.miss])
    bench.assume(~component.filled | (listed[component.filled_miss] & ~filled[component.filled_miss]))
    bench.assume(~component.ended | ((filled[ending] | component.filled) & ~Array(lists.over)[ending]))
    alone = Signal()
    leaves = component.filled & ~component.ended
    bench.m.d.sync += alone.eq((alone | leaves) & ~component.passed)
    bench.assume(~alone | ~(component.filled | component.ended))
    bench.require("passes_once", ~component.passed | alone)


def _follow_miss(bench: Bench, component: Waiters, lists: Lists, k: int) -> None:
    m, over, listed, filled = bench.m, lists.over[k], lists.listed[k], lists.filled[k]
    freed = component.free & (component.free_miss == k)
    m.d.sync += [
        over.eq((over | (component.ended & (component.filled_miss == k))) & ~freed),
        listed.eq((listed | (component.add & (component.miss == k))) & ~freed),
        filled.eq((filled | (component.filled & (component.filled_miss == k))) & ~freed),
    ]
    m.d.sync += lists.free_again[k].eq(lists.free_again[k] | freed)
    bench.require(f"freed{k}_once_filled_and_over", ~freed | (filled & over))


def _follow_tag(bench: Bench, component: Waiters, lists: Lists, tag: int) -> None:
    m, waits, answered = bench.m, lists.waits[tag], lists.answered[tag]
    says = [lists.its_line[tag].eq(component.filled_line), lists.its_error[tag].eq(component.filled_error)]
    mine = component.filled & (component.filled_miss == lists.whose[tag])
    with m.If(waits & ~answered & mine):
        m.d.sync += [answered.eq(1), *says]
    with m.If(lists.takes & (component.o.payload.tag == tag)):
        m.d.sync += [waits.eq(0), answered.eq(0)]
    with m.If(component.add & (component.tag == tag)):
        m.d.sync += [
            waits.eq(1),
            lists.whose[tag].eq(component.miss),
            answered.eq(component.filled & (component.filled_miss == component.miss)),
            *says,
        ]


def _answers_each_once(bench: Bench, component: Waiters, lists: Lists) -> None:
    o, tag = component.o, component.o.payload.tag
    held(bench, "o", o.valid, o.ready, o.payload)
    bench.require("only_who_waits", ~o.valid | Array(lists.waits)[tag])
    bench.require("only_when_filled", ~o.valid | Array(lists.answered)[tag])
    bench.require("its_line", ~o.valid | (o.payload.line == Array(lists.its_line)[tag]))
    bench.require("its_error", ~o.valid | (o.payload.error == Array(lists.its_error)[tag]))
    listed = list(zip(lists.waits, lists.answered, lists.its_line, strict=True))
    others = [
        waits & answered & (tag != k) & (line == o.payload.line) for k, (waits, answered, line) in enumerate(listed)
    ]
    # Lines of lists that are being answered are different: they are locked.
    for waits, answered, line in listed:
        bench.assume(~(component.filled & waits & answered) | (line != component.filled_line))
    bench.require("last_is_last", ~(o.valid & o.payload.last) | ~Cat(others).any())


def _reaches_lists(bench: Bench, component: Waiters, lists: Lists, misses: int) -> None:
    o, takes = component.o, lists.takes
    later = Signal()
    bench.m.d.sync += later.eq(later | (component.ended & ~component.filled))
    bench.reach("over_later", component.free & later)
    bench.reach("list_of_two", takes & o.payload.last & bench.past(takes & ~o.payload.last, "not_last"))
    bench.reach("full", ~component.ready)
    bench.reach("failed", takes & o.payload.error)
    bench.reach("miss_used_again", component.add & component.first & Array(lists.free_again)[component.miss])
    bench.reach("answer_waits", o.valid & bench.past(o.valid & ~o.ready, "not_taken"))
    if misses > 1:
        bench.reach("two_lists_filled", Cat(lists.filled).all())
        bench.reach("added_while_answered", component.add & o.valid)


def waiters(misses: int, requests: int) -> Bench:
    component = Waiters(misses=misses, requests=requests, tag_width=2, line_width=2)
    bench = Bench(component)
    lists = _lists(bench, component, misses)
    _answers_each_once(bench, component, lists)
    _reaches_lists(bench, component, lists, misses)
    # Released, everything whose block has come is answered: at most two cycles a list and one a request.
    idle = Signal(range(32))
    restarts = component.add | component.filled | ~component.o.ready
    bench.m.d.sync += idle.eq(Mux(restarts, 0, idle + (idle != 31)))
    waiting = Cat(a & w for a, w in zip(lists.answered, lists.waits, strict=True)).any()
    bench.require("drains", ~waiting | (idle <= 2 * misses + requests + 3))
    return bench


@dataclass(frozen=True)
class Traffic:
    """What happens at a cache's ports, and what is under way."""

    enters: Value
    """A request is taken."""
    leaves: Value
    """An answer is taken."""
    asked: Value
    """The address of a read is taken."""
    comes: Value
    """The block of a read comes."""
    reading: list[Signal]
    """By AXI id: its read is under way."""
    block_of: list[Signal]
    """By AXI id: what it reads, or has read last."""
    waits: list[Signal]
    """By tag: its request waits for an answer."""
    wants: list[Signal]
    """By tag: the block that it asks for, or has asked for last."""
    failed: Signal
    """Some read has failed."""
    ticks: Signal
    """Ticks of the clock for timeouts so far; 2 are enough for a read to be given up, and counted no further."""

    @property
    def nobody_waits(self) -> Value:
        return ~Cat(self.waits).any()

    @property
    def may_have_given_up(self) -> Value:
        return self.ticks == 2


def _followed(bench: Bench, component: BlockCache, tags: int, block_bits: int) -> Traffic:
    """Follows all reads and requests; what the memory gives is the number of the block that was asked for."""
    m, i, o, axi = bench.m, component.i, component.o, component.m_axi
    enters, leaves = i.valid & i.ready, o.valid & o.ready
    asked, comes = axi.arvalid & axi.arready, axi.rvalid & axi.rready
    ids = range(1 << len(axi.arid))
    reading = [Signal(name=f"reading{k}") for k in ids]
    block_of = [Signal(block_bits, name=f"block_of{k}") for k in ids]
    waits = [Signal(name=f"waits{k}") for k in range(tags)]
    wants = [Signal(block_bits, name=f"wants{k}") for k in range(tags)]
    m.d.comb += [axi.rdata.eq(Array(block_of)[axi.rid]), axi.rlast.eq(1), component.base.eq(0)]
    for k in ids:
        with m.If(comes & (axi.rid == k)):
            m.d.sync += reading[k].eq(0)
        with m.If(asked & (axi.arid == k)):
            m.d.sync += [reading[k].eq(1), block_of[k].eq(axi.araddr >> OFFSET_BITS)]
    for k in range(tags):
        with m.If(leaves & (o.payload.tag == k)):
            m.d.sync += waits[k].eq(0)
        with m.If(enters & (i.payload.tag == k)):
            m.d.sync += [waits[k].eq(1), wants[k].eq(i.payload.block)]
    failed = Signal()
    ticks = Signal(2)
    m.d.sync += [failed.eq(failed | (comes & axi.rresp[1])), ticks.eq(ticks + (component.tick & (ticks != 2)))]
    return Traffic(enters, leaves, asked, comes, reading, block_of, waits, wants, failed, ticks)


def _surroundings(bench: Bench, component: BlockCache, traffic: Traffic, block_bits: int, prefetches: bool) -> None:
    """Who asks, and the memory: a tag is free when it is used, and nothing comes that was not asked for."""
    i, axi, prefetch = component.i, component.m_axi, component.prefetch
    bench.assume(i.payload.block < 1 << block_bits)
    bench.assume(~i.valid | ~Array(traffic.waits)[i.payload.tag])
    bench.assume(~axi.rvalid | Array(traffic.reading)[axi.rid])
    bench.assume(~prefetch.valid | ((prefetch.block < 1 << block_bits) & prefetches))


def _keeps_the_rules_of_axi(bench: Bench, component: BlockCache, traffic: Traffic) -> None:
    axi, reading = component.m_axi, traffic.reading
    address = Cat(axi.araddr, axi.arid, axi.arlen, axi.arsize, axi.arburst)
    held(bench, "ar", axi.arvalid, axi.arready, address)
    whole = (axi.araddr[:OFFSET_BITS] == 0) & (axi.arlen == 0) & (axi.arburst == INCR)
    bench.require("whole_block", ~axi.arvalid | whole)
    bench.require("id_is_free", ~axi.arvalid | ~Array(reading)[axi.arid])
    bench.require("id_in_range", ~axi.arvalid | (axi.arid < component.misses))
    # But for a read that was given up: it may still be under way when its block is read again.
    already = Cat(
        one & (block == axi.araddr[OFFSET_BITS:]) for one, block in zip(reading, traffic.block_of, strict=True)
    )
    bench.require("block_read_once_at_a_time", ~axi.arvalid | ~already.any() | traffic.may_have_given_up)


def _answers_what_was_asked(bench: Bench, component: BlockCache, traffic: Traffic) -> None:
    o = component.o
    held(bench, "o", o.valid, o.ready, o.payload)
    bench.require("only_who_waits", ~o.valid | Array(traffic.waits)[o.payload.tag])
    right = o.payload.data == Array(traffic.wants)[o.payload.tag]
    bench.require("its_block", ~o.valid | o.payload.error | right)
    fails = o.valid & o.payload.error
    bench.require("no_error_of_its_own", ~fails | traffic.failed | traffic.may_have_given_up)
    events = component.hit + component.miss + component.merged
    bench.require("one_event_a_cycle", events <= 1)


def _tells_of_prefetches(bench: Bench, component: BlockCache, traffic: Traffic) -> None:
    """What is on its way, somebody waits for or `prefetching` tells of; but for reads that were given up."""
    told = ~traffic.nobody_waits | component.prefetching
    under_way = component.m_axi.arvalid | Cat(traffic.reading).any()
    bench.require("quiet", told | ~under_way | traffic.may_have_given_up)
    still = ~(told | component.i.valid | component.prefetch.valid)
    bench.require("stays_quiet", ~bench.past(still, "still") | ~component.prefetching)


def _reaches_prefetched(bench: Bench, component: BlockCache, traffic: Traffic) -> None:
    """Requests find what was prefetched, and join a prefetch that is under way."""
    block = _block_read(component, traffic)
    wanted = Cat(waits & (wants == block) for waits, wants in zip(traffic.waits, traffic.wants, strict=True)).any()
    only_prefetch = Signal()  # a read, and none that a request has begun
    bench.m.d.sync += only_prefetch.eq((only_prefetch | (traffic.asked & ~wanted)) & ~component.miss)
    bench.reach("hits_prefetched", component.hit & only_prefetch & ~traffic.failed)
    bench.reach("joins_prefetch", component.merged & only_prefetch & ~traffic.failed)


def _reaches_answers(bench: Bench, component: BlockCache, traffic: Traffic) -> None:
    o, axi = component.o, component.m_axi
    bench.reach("answered", traffic.leaves & ~o.payload.error)
    bench.reach("answer_waits", o.valid & bench.past(o.valid & ~o.ready, "not_taken"))
    bench.reach("merged", component.merged)
    bench.reach("found", component.hit)
    bench.reach("address_waits", axi.arvalid & bench.past(axi.arvalid & ~axi.arready, "no_address"))


def _reaches_reads_again(bench: Bench, component: BlockCache, traffic: Traffic) -> None:
    """Errors, and second reads of a block and by a miss."""
    m, axi, asked = bench.m, component.m_axi, traffic.asked
    fails = traffic.leaves & component.o.payload.error
    block = _block_read(component, traffic)
    was_read = Signal(1 << len(block))  # blocks
    used_number = Signal(len(traffic.reading))  # of a miss, before
    with m.If(asked):
        m.d.sync += [was_read.eq(was_read | (1 << block)), used_number.eq(used_number | (1 << axi.arid))]
    bench.reach("late", traffic.comes & ~traffic.failed & bench.past(fails, "given_up"))
    bench.reach("answered_with_error", fails)
    bench.reach("read_again", asked & was_read.bit_select(block, 1))
    bench.reach("number_used_again", asked & used_number.bit_select(axi.arid, 1))


def _reaches_two_reads(bench: Bench, component: BlockCache, traffic: Traffic) -> None:
    """Of two ids."""
    m, axi, reading = bench.m, component.m_axi, traffic.reading
    oldest = Signal(len(axi.arid))
    other = axi.arid ^ 1
    with m.If(traffic.asked):
        m.d.sync += oldest.eq(Mux(Array(reading)[other], other, axi.arid))
    bench.reach("two_reads", Cat(reading).all())
    bench.reach("reads_out_of_order", traffic.comes & Cat(reading).all() & (axi.rid != oldest))


def _block_read(component: BlockCache, traffic: Traffic) -> Value:
    """The block whose address is on the port."""
    return component.m_axi.araddr[OFFSET_BITS:][: len(traffic.block_of[0])]


def cache(
    *,
    sets: int,
    ways: int,
    misses: int,
    requests: int,
    tags: int,
    block_bits: int,
    again: bool = True,
    prefetches: bool = True,
) -> Bench:
    """Requests have `tags` different tags, all blocks have numbers of `block_bits`, and a block's data is its number.

    The memory answers reads in any order, at any time, with or without an error; some may take too long. `again`:
    errors, and second reads of a block and by a miss, are to be reached; that takes up to 15 cycles. `prefetches`:
    blocks may be prefetched.
    """
    component = BlockCache(
        sets=sets,
        ways=ways,
        misses=misses,
        requests=requests,
        tag_width=(tags - 1).bit_length(),
        address_width=32,
        data_width=BLOCK_BITS,
    )
    bench = Bench(component, driven={"m_axi__rdata", "m_axi__rlast", "base", "invalidate"})
    traffic = _followed(bench, component, tags, block_bits)
    _surroundings(bench, component, traffic, block_bits, prefetches)
    _keeps_the_rules_of_axi(bench, component, traffic)
    _answers_what_was_asked(bench, component, traffic)
    _tells_of_prefetches(bench, component, traffic)
    if prefetches:
        _reaches_prefetched(bench, component, traffic)
    _reaches_answers(bench, component, traffic)
    if again:
        _reaches_reads_again(bench, component, traffic)
    if misses > 1:
        _reaches_two_reads(bench, component, traffic)
    return bench


def properties() -> list[Property]:
    small = partial(cache, sets=2, ways=1, misses=2)
    return [
        *(
            Property(
                unit="waiters",
                name=f"lists-{misses}x{requests}",
                says="each request once, with its line, after its block; `last` is; numbers free again; drains",
                method=Bounded(depth=depth),
                build=partial(waiters, misses, requests),
            )
            for misses, requests, depth in ((1, 2, 12), (2, 3, 9))
        ),
        Property(
            unit="block_cache",
            name="answers",
            says="one miss at a time: each request once, with its block; AXI rules",
            method=Bounded(depth=15),
            build=partial(cache, sets=2, ways=1, misses=1, requests=2, tags=2, block_bits=2),
        ),
        *(
            Property(
                unit="block_cache",
                name=name,
                says="two misses at a time: AXI rules, no block read twice at a time, ids free when used",
                method=Bounded(depth=depth),
                build=build,
            )
            for name, depth, build in (
                ("reads", 16, partial(small, requests=2, tags=2, block_bits=2, prefetches=False)),
                ("prefetches", 11, partial(small, requests=2, tags=2, block_bits=2, again=False)),
                (
                    "reads-for-three",
                    10,
                    partial(small, requests=3, tags=4, block_bits=3, again=False, prefetches=False),
                ),
            )
        ),
    ]
