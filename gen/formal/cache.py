"""The block cache and its lists of waiting requests: bounded proofs of small ones, whatever the memory does."""

from functools import partial

from amaranth import Array, Cat, Mux, Signal

from lightloom.gen.formal.bench import Bench
from lightloom.gen.formal.properties import Bounded, Property
from lightloom.gen.formal.streams import held
from lightloom.rtl.memory.axi import INCR
from lightloom.rtl.memory.block_cache import BlockCache
from lightloom.rtl.memory.waiters import Waiters

TAGS = 4
"""Requests under way have different tags, 0 to 3, so that an answer says which request it is for."""


def waiters(misses: int, requests: int) -> Bench:
    component = Waiters(misses=misses, requests=requests, tag_width=2, line_width=2)
    bench = Bench(component)
    m, o = bench.m, component.o
    takes = o.valid & o.ready
    waits = [Signal(name=f"waits{tag}") for tag in range(TAGS)]
    whose = [Signal(range(misses), name=f"whose{tag}") for tag in range(TAGS)]
    listed = [Signal(name=f"listed{k}") for k in range(misses)]  # has a list that may grow
    filled = [Signal(name=f"filled{k}") for k in range(misses)]  # its block has come, its number is not free yet
    free_again = [Signal(name=f"free_again{k}") for k in range(misses)]  # it has had a list before
    over = [Signal(name=f"over{k}") for k in range(misses)]  # so is its read
    line = [Signal(2, name=f"line{k}") for k in range(misses)]
    error = [Signal(name=f"error{k}") for k in range(misses)]
    answered = [Signal(name=f"answered{tag}") for tag in range(TAGS)]
    its_line = [Signal(2, name=f"its_line{tag}") for tag in range(TAGS)]
    its_error = [Signal(name=f"its_error{tag}") for tag in range(TAGS)]

    # What the cache does: it adds where there is room, to a list that is not closed, and closes each list once. A read
    # ends with that or later; where later, nothing comes in between but what has passed.
    bench.assume(component.miss < misses)
    bench.assume(component.filled_miss < misses)
    bench.assume(~component.add | (component.ready & ~Array(waits)[component.tag]))
    bench.assume(~component.add | (component.first == ~Array(listed)[component.miss]))
    bench.assume(~component.add | ~Array(filled)[component.miss])
    bench.assume(~component.filled | (Array(listed)[component.filled_miss] & ~Array(filled)[component.filled_miss]))
    ending = component.filled_miss
    bench.assume(~component.ended | ((Array(filled)[ending] | component.filled) & ~Array(over)[ending]))
    alone = Signal()
    leaves = component.filled & ~component.ended
    m.d.sync += alone.eq((alone | leaves) & ~component.passed)
    bench.assume(~alone | ~(component.filled | component.ended))
    bench.require("passes_once", ~component.passed | alone)
    for k in range(misses):
        freed = component.free & (component.free_miss == k)
        m.d.sync += [
            over[k].eq((over[k] | (component.ended & (ending == k))) & ~freed),
            listed[k].eq((listed[k] | (component.add & (component.miss == k))) & ~freed),
            filled[k].eq((filled[k] | (component.filled & (component.filled_miss == k))) & ~freed),
        ]
        m.d.sync += free_again[k].eq(free_again[k] | freed)
        bench.require(f"freed{k}_once_filled_and_over", ~freed | (filled[k] & over[k]))
        with m.If(component.filled & (component.filled_miss == k)):
            m.d.sync += [line[k].eq(component.filled_line), error[k].eq(component.filled_error)]
    for tag in range(TAGS):
        mine = component.filled & (component.filled_miss == whose[tag])
        with m.If(waits[tag] & ~answered[tag] & mine):
            m.d.sync += [
                answered[tag].eq(1),
                its_line[tag].eq(component.filled_line),
                its_error[tag].eq(component.filled_error),
            ]
        with m.If(takes & (o.payload.tag == tag)):
            m.d.sync += [waits[tag].eq(0), answered[tag].eq(0)]
        with m.If(component.add & (component.tag == tag)):
            m.d.sync += [
                waits[tag].eq(1),
                whose[tag].eq(component.miss),
                answered[tag].eq(component.filled & (component.filled_miss == component.miss)),
                its_line[tag].eq(component.filled_line),
                its_error[tag].eq(component.filled_error),
            ]
    tag = o.payload.tag
    held(bench, "o", o.valid, o.ready, o.payload)
    bench.require("only_who_waits", ~o.valid | Array(waits)[tag])
    bench.require("only_when_filled", ~o.valid | Array(answered)[tag])
    bench.require("its_line", ~o.valid | (o.payload.line == Array(its_line)[tag]))
    bench.require("its_error", ~o.valid | (o.payload.error == Array(its_error)[tag]))
    others = [waits[k] & answered[k] & (tag != k) & (its_line[k] == o.payload.line) for k in range(TAGS)]
    # Lines of lists that are being answered are different: they are locked.
    for k in range(TAGS):
        bench.assume(~(component.filled & waits[k] & answered[k]) | (its_line[k] != component.filled_line))
    bench.require("last_is_last", ~(o.valid & o.payload.last) | ~Cat(others).any())
    later = Signal()
    m.d.sync += later.eq(later | (component.ended & ~component.filled))
    bench.reach("over_later", component.free & later)
    bench.reach("list_of_two", takes & o.payload.last & bench.past(takes & ~o.payload.last, "not_last"))
    bench.reach("full", ~component.ready)
    bench.reach("failed", takes & o.payload.error)
    bench.reach("miss_used_again", component.add & component.first & Array(free_again)[component.miss])
    bench.reach("answer_waits", o.valid & bench.past(o.valid & ~o.ready, "not_taken"))
    if misses > 1:
        bench.reach("two_lists_filled", Cat(filled).all())
        bench.reach("added_while_answered", component.add & o.valid)

    # Released, everything whose block has come is answered: at most two cycles a list and one a request.
    idle = Signal(range(32))
    m.d.sync += idle.eq(Mux(component.add | component.filled | ~o.ready, 0, idle + (idle != 31)))
    waiting = Cat(a & w for a, w in zip(answered, waits, strict=True)).any()
    bench.require("drains", ~waiting | (idle <= 2 * misses + requests + 3))
    return bench


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
        data_width=512,
    )
    bench = Bench(component, driven={"m_axi__rdata", "m_axi__rlast", "base", "invalidate"})
    m, i, o, axi = bench.m, component.i, component.o, component.m_axi
    tag, number = i.payload.tag, o.payload.tag
    enters, leaves = i.valid & i.ready, o.valid & o.ready
    asked = axi.arvalid & axi.arready
    ids = range(1 << len(axi.arid))
    reading = [Signal(name=f"reading{k}") for k in ids]
    block_of = [Signal(block_bits, name=f"block_of{k}") for k in ids]
    waits = [Signal(name=f"waits{k}") for k in range(tags)]
    wants = [Signal(block_bits, name=f"wants{k}") for k in range(tags)]
    comes = axi.rvalid & axi.rready
    m.d.comb += [axi.rdata.eq(Array(block_of)[axi.rid]), axi.rlast.eq(1), component.base.eq(0)]
    for k in ids:
        with m.If(comes & (axi.rid == k)):
            m.d.sync += reading[k].eq(0)
        with m.If(asked & (axi.arid == k)):
            m.d.sync += [reading[k].eq(1), block_of[k].eq(axi.araddr >> 6)]
    for k in range(tags):
        with m.If(leaves & (number == k)):
            m.d.sync += waits[k].eq(0)
        with m.If(enters & (tag == k)):
            m.d.sync += [waits[k].eq(1), wants[k].eq(i.payload.block)]
    bench.assume(i.payload.block < 1 << block_bits)
    bench.assume(~i.valid | ~Array(waits)[tag])
    bench.assume(~axi.rvalid | Array(reading)[axi.rid])
    bench.assume(~component.prefetch.valid | ((component.prefetch.block < 1 << block_bits) & prefetches))

    was_read = Signal(1 << block_bits)  # blocks
    used_number = Signal(len(reading))  # of a miss, before
    oldest = Signal(len(axi.arid))  # of two reads
    with m.If(asked):
        m.d.sync += was_read.eq(was_read | (1 << axi.araddr[6 : 6 + block_bits]))
        m.d.sync += used_number.eq(used_number | (1 << axi.arid))
        m.d.sync += oldest.eq(Mux(Array(reading)[axi.arid ^ 1], axi.arid ^ 1, axi.arid))

    failed = Signal()  # some read has failed
    ticks = Signal(2)
    m.d.sync += [failed.eq(failed | (comes & axi.rresp[1])), ticks.eq(ticks + (component.tick & (ticks != 2)))]

    # AXI, on the side of the memory.
    address = Cat(axi.araddr, axi.arid, axi.arlen, axi.arsize, axi.arburst)
    held(bench, "ar", axi.arvalid, axi.arready, address)
    bench.require("whole_block", ~axi.arvalid | ((axi.araddr[:6] == 0) & (axi.arlen == 0) & (axi.arburst == INCR)))
    bench.require("id_is_free", ~axi.arvalid | ~Array(reading)[axi.arid])
    bench.require("id_in_range", ~axi.arvalid | (axi.arid < misses))
    # But for a read that was given up, which takes two ticks: it may still be under way when its block is read again.
    already = [reading[k] & (block_of[k] == axi.araddr[6:]) for k in ids]
    bench.require("block_read_once_at_a_time", ~axi.arvalid | ~Cat(already).any() | (ticks == 2))

    # Requests and answers.
    held(bench, "o", o.valid, o.ready, o.payload)
    bench.require("only_who_waits", ~o.valid | Array(waits)[number])
    right = o.payload.data == Array(wants)[number]
    bench.require("its_block", ~o.valid | o.payload.error | right)
    bench.require("no_error_of_its_own", ~(o.valid & o.payload.error) | failed | (ticks == 2))
    # What is on its way, somebody waits for or `prefetching` tells of; but for reads that were given up.
    bench.require(
        "quiet", Cat(waits).any() | component.prefetching | ~(axi.arvalid | Cat(reading).any()) | (ticks == 2)
    )
    still = ~(Cat(waits).any() | component.prefetching | i.valid | component.prefetch.valid)
    bench.require("stays_quiet", ~bench.past(still, "still") | ~component.prefetching)
    wanted = Cat(waits[k] & (wants[k] == axi.araddr[6 : 6 + block_bits]) for k in range(tags)).any()
    only_prefetch = Signal()  # a read, and none that a request has begun
    m.d.sync += only_prefetch.eq((only_prefetch | (asked & ~wanted)) & ~component.miss)
    if prefetches:
        bench.reach("hits_prefetched", component.hit & only_prefetch & ~failed)
        bench.reach("joins_prefetch", component.merged & only_prefetch & ~failed)
    events = component.hit + component.miss + component.merged
    bench.require("one_event_a_cycle", events <= 1)
    bench.reach("answered", leaves & ~o.payload.error)
    bench.reach("answer_waits", o.valid & bench.past(o.valid & ~o.ready, "not_taken"))
    bench.reach("merged", component.merged)
    bench.reach("found", component.hit)
    bench.reach("address_waits", axi.arvalid & bench.past(axi.arvalid & ~axi.arready, "no_address"))
    if again:
        bench.reach("late", comes & ~failed & bench.past(leaves & o.payload.error, "given_up"))
        bench.reach("answered_with_error", leaves & o.payload.error)
        bench.reach("read_again", asked & was_read.bit_select(axi.araddr[6 : 6 + block_bits], 1))
        bench.reach("number_used_again", asked & used_number.bit_select(axi.arid, 1))
    if misses > 1:
        bench.reach("two_reads", Cat(reading).all())
        bench.reach("reads_out_of_order", comes & Cat(reading).all() & (axi.rid != oldest))
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
