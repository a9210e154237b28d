"""The lines of the block cache: where a block is, whatever comes before and beside it. Bounded."""

from amaranth import Array, Signal

from lightloom.gen.formal.bench import Bench
from lightloom.gen.formal.properties import Bounded, Property
from lightloom.rtl.memory.block_lines import BlockLines, set_of

BLOCK_BITS = 3
"""Of the blocks' numbers: with two sets, four blocks to each."""


def lines(*, sets: int, ways: int, misses: int) -> Bench:
    """Follows one block, and for each line whether its data is awaited and whether it must stay."""
    component = BlockLines(sets=sets, ways=ways, misses=misses)
    bench = Bench(component, driven={"look", "step", "invalidate"})
    m, count, set_bits = bench.m, sets * ways, (sets - 1).bit_length()
    block = bench.constant("block_followed", BLOCK_BITS)
    invalidate = bench.any("invalidate")

    valid, current, done = _steps(bench, component, invalidate)
    allocate, touch = component.allocate, component.touch
    bench.assume(component.block < 1 << BLOCK_BITS)
    bench.assume(~allocate | (valid & ~component.found & component.available & done))
    bench.assume(~touch | (valid & component.found & ~component.awaited & done))

    pending, locked = _lines_under_way(bench, component, invalidate, count)
    filled = component.filled_line
    here = Signal()
    gone = Signal()  # it has given way before
    line = Signal(component.line_width)
    miss = Signal(len(component.miss))
    mine = Signal()  # the block that the outputs describe is the followed one
    m.d.comb += mine.eq(valid & (current == block))
    with m.If(invalidate | (component.filled & component.filled_error & (filled == line))):
        m.d.sync += here.eq(0)
    with m.If(allocate):
        with m.If(mine):
            m.d.sync += [here.eq(1), line.eq(component.victim), miss.eq(component.allocate_miss)]
        with m.Elif(component.victim == line):
            m.d.sync += [here.eq(0), gone.eq(gone | here)]

    bench.require("found_where_it_is", ~mine | (component.found == here))
    bench.require("its_line", ~(mine & here) | (component.line == line))
    bench.require("awaited_until_filled", ~(mine & here) | (component.awaited == pending[line]))
    bench.require("its_miss", ~(mine & here & pending[line]) | (component.miss == miss))
    gives = valid & ~component.found & component.available
    takes_mine = gives & here & (component.victim == line)
    bench.require("locked_stays", ~gives | ~locked[component.victim])
    bench.require("line_of_the_set", ~gives | (component.victim[:set_bits] == set_of(current, set_bits)))
    bench.require("line_in_range", ~gives | (component.victim < count))
    bench.require("eviction_is_told", ~takes_mine | component.evicts)
    bench.reach("evicted", takes_mine & allocate)
    bench.reach("failed", component.filled & component.filled_error & here & (filled == line))
    bench.reach("found_again", mine & here & ~pending[line])
    bench.reach("found_awaited", mine & here & pending[line] & done)
    bench.reach("found_in_the_cycle_after", mine & here & bench.past(allocate & mine, "put"))
    bench.reach("set_is_locked", valid & ~component.found & ~component.available)
    bench.reach("other_way_is_locked", takes_mine & allocate & locked[line ^ sets])
    bench.reach("found_after_eviction", mine & here & ~pending[line] & gone)
    bench.reach("forgotten", invalidate & here)
    return bench


def _steps(bench: Bench, component: BlockLines, invalidate: Signal) -> tuple[Signal, Signal, Signal]:
    """Two steps, as the cache takes them: what is looked up moves on when the one before it is done."""
    m = bench.m
    read_valid = Signal()
    valid = Signal()
    done = bench.any("done")
    read_block = Signal(BLOCK_BITS)
    current = Signal(BLOCK_BITS)
    m.d.comb += [
        component.step.eq(~valid | done),
        component.look.eq(~read_valid | component.step),
        component.invalidate.eq(invalidate),
    ]
    with m.If(component.look):
        m.d.sync += [read_valid.eq(bench.any("comes")), read_block.eq(component.block)]
    with m.If(component.step):
        m.d.sync += [valid.eq(read_valid), current.eq(read_block)]
    return valid, current, done


def _lines_under_way(bench: Bench, component: BlockLines, invalidate: Signal, count: int) -> tuple[Array, Array]:
    """Whether the data of each line is awaited, and whether it must stay.

    Lines are filled and released once each, in this order; nothing is forgotten while anything is under way.
    """
    m, allocate = bench.m, component.allocate
    pending, locked = (Array(Signal(name=f"{name}{k}") for k in range(count)) for name in ("pending", "locked"))
    filled, released = component.filled_line, component.release_line
    bench.assume(~component.filled | ((filled < count) & pending[filled]))
    bench.assume(~component.release | ((released < count) & locked[released] & ~pending[released]))
    for k in range(count):
        given = allocate & (component.victim == k)
        m.d.sync += [
            pending[k].eq((pending[k] & ~(component.filled & (filled == k))) | given),
            locked[k].eq((locked[k] & ~(component.release & (released == k))) | given),
        ]
        bench.assume(~invalidate | ~(locked[k] | allocate))
    return pending, locked


def properties() -> list[Property]:
    return [
        Property(
            unit="block_lines",
            name="where-a-block-is",
            says="a block is found where it was put, until it gives way; a locked line never does",
            method=Bounded(depth=10),
            build=lambda: lines(sets=2, ways=2, misses=2),
        )
    ]
