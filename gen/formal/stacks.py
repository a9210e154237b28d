"""The stacks of a traversal unit: what a list of entries says is what is read, the nearest on top. Bounded."""

from amaranth import Mux, Signal, Value
from amaranth.lib import data

from lightloom.gen.formal.bench import Bench
from lightloom.gen.formal.properties import Bounded, Property
from lightloom.rtl.config import Config
from lightloom.rtl.traversal.records import STACK_ENTRY
from lightloom.rtl.traversal.stacks import LISTS, Stacks

SMALL = Config.of(contexts=4, overlap=2, stack=4)
KINDS = data.StructLayout({"a_full_list": 1, "one_below_the_top": 1, "what_replaced_another": 1})


def entries(config: Config) -> Bench:
    """Follows one place of one stack. Lists and reads of the others come between its own."""
    component = Stacks(config)
    bench = Bench(component)
    m, push, item, read, written = bench.m, component.push, component.push.payload, component.read, component.written
    who = bench.constant("who", len(item.context))
    place = bench.constant("place", range(config.traversal.stack))
    pending = Signal(range(LISTS + 2))  # lists of this stack that are not written yet
    known = Signal()
    stored = Signal(STACK_ENTRY)

    # Whoever uses them never fills a stack beyond its end, and reads what is written.
    top = Signal(8)
    m.d.comb += top.eq(item.height + (item.last - item.first))
    bench.assume(~push.valid | ((item.first <= item.last) & (top < config.traversal.stack)))
    bench.assume(~push.valid | ~item.again | (item.first == item.last))
    reads = read.en & (read.context == who) & (read.position == place)
    bench.assume(~reads | (known & (pending == 0)))

    enters = push.valid & push.ready & (item.context == who)
    comes = written.valid & (written.context == who)
    m.d.sync += pending.eq(pending + enters - comes)
    index = Signal(3)
    expected = Signal(STACK_ENTRY)
    m.d.comb += [
        index.eq(item.last - (place - item.height)),
        expected.entry.eq(item.entry[index]),
        expected.address.eq(item.base + Mux(item.again, 0, item.slot[index])),
        expected.leaf.eq(~item.again & item.leaf.bit_select(item.slot[index], 1)),
        expected.rank.eq(Mux(item.again, item.first, 0)),
        expected.near_below.eq(Mux(index == item.last, item.near_below, item.near.bit_select(index + 1, 1))),
    ]
    # What kind of list the entry is of: as long as the stack, with others above it, written over another.
    kinds, shown_kinds = (Signal(KINDS, name=name) for name in ("kinds", "shown_kinds"))
    with m.If(enters & (item.height <= place) & (place <= top)):
        m.d.sync += [
            known.eq(1),
            stored.eq(expected),
            kinds.a_full_list.eq(item.last - item.first == config.traversal.stack - 1),
            kinds.one_below_the_top.eq(place != top),
            kinds.what_replaced_another.eq(known),
        ]

    shows = Signal()
    shown = Signal(STACK_ENTRY)  # since the last read: what the place held then
    with m.If(read.en):
        m.d.sync += [shows.eq(reads), shown.eq(stored), shown_kinds.eq(kinds)]
    bench.require("what_was_pushed", ~shows | (Value.cast(read.entry) == Value.cast(shown)))
    bench.require("written_once", ~comes | (pending != 0))
    bench.require("lists_in_bounds", pending <= LISTS)
    bench.reach("read", shows)
    for name in KINDS.members:
        bench.reach(f"read_of_{name}", shows & shown_kinds[name])
    bench.reach("read_of_the_rest_of_a_node", shows & (shown.rank != 0))
    bench.reach("two_lists_of_a_stack", pending == 2)
    bench.reach("other_lists_before", comes & (pending == 1) & bench.past(written.valid & ~comes, "others"))
    bench.reach("full", ~push.ready)
    bench.reach("goes_on_after_full", enters & bench.past(~push.ready, "was_full"))
    return bench


def properties() -> list[Property]:
    return [
        Property(
            unit="stacks",
            name="entries",
            says="a place reads as the last list over it says, nearest on top; each list written once",
            method=Bounded(depth=8),
            build=lambda: entries(SMALL),
            arrays=True,
        )
    ]
