"""What waits: buffers, queues in a RAM, lists of free numbers."""

from functools import partial

from amaranth import Array, Const, Mux, Signal, Value

from lightloom.gen.formal.bench import Bench
from lightloom.gen.formal.properties import Induction, Property
from lightloom.gen.formal.streams import Tracker, held
from lightloom.rtl.fabric.queues import Buffer, FreeList, PassingQueue, Queue

WIDTH = 4
"""Bits of what waits: nothing depends on what they say."""


class FifoInside:
    """What a FIFO holds: a RAM that goes round, and the output register of a `buffered` one.

    Attributes: `out`, the register holds an item; `level`, items in the RAM; `slots`, of every place of the RAM whether
    it holds an item, and which.
    """

    def __init__(self, bench: Bench, path: str, name: str, *, buffered: bool = True):
        self._bench, self._path, self._name = bench, path, name
        self.out: Value = bench.inner(f"{path}/r__valid") if buffered else Const(0)
        self.level = bench.inner(f"{path}/inner_level" if buffered else f"{path}/level")
        self._consume = bench.inner(f"{path}/consume")
        self.depth = bench.depth(f"{path}/storage")
        self.slots = []
        for slot in range(self.depth):
            behind = Signal(range(2 * self.depth), name=f"{name}_behind{slot}")
            bench.m.d.comb += behind.eq(
                Mux(self._consume > slot, slot + self.depth - self._consume, slot - self._consume)
            )
            self.slots.append((behind < self.level, bench.peek(f"{path}/storage", slot, f"{name}{slot}")))

    def at(self, place: Value) -> Value:
        """The item at `place`, counted from the next one in the RAM."""
        index = Signal(range(2 * self.depth), name=f"{self._name}_index")
        round_ = Signal(range(2 * self.depth), name=f"{self._name}_round")
        self._bench.m.d.comb += [
            round_.eq(self._consume + place),
            index.eq(Mux(round_ >= self.depth, round_ - self.depth, round_)),
        ]
        return Array(data for _, data in self.slots)[index]


def buffer() -> Bench:
    component = Buffer(WIDTH)
    bench = Bench(component)
    i, o = component.i, component.o
    held(bench, "o", o.valid, o.ready, o.payload)
    tracker = Tracker(
        bench,
        most=2,
        enters=i.valid & i.ready,
        incoming=i.payload,
        leaves=o.valid & o.ready,
        offers=o.valid,
        outgoing=o.payload,
    )
    was_ready = bench.past(o.ready, "ready")
    bench.require("takes_when_released", ~was_ready | i.ready)
    bench.require("offers_what_it_has", o.valid == (tracker.count != 0))
    second, kept = bench.inner("held"), bench.inner("kept")
    bench.require("count_is_registers", tracker.count == o.valid + second)
    bench.require("second_is_kept", ~tracker.follows | (tracker.ahead == 0) | (kept == tracker.payload))
    return bench


def followed(component: Queue | PassingQueue, depth: int) -> tuple[Bench, Tracker]:
    """A queue in which one item is followed; whoever uses it never has more than `depth` items in it."""
    bench = Bench(component)
    i, o = component.i, component.o
    held(bench, "o", o.valid, o.ready, o.payload)
    leaves = o.valid & o.ready
    tracker = Tracker(
        bench, most=depth, enters=i.valid, incoming=i.payload, leaves=leaves, offers=o.valid, outgoing=o.payload
    )
    bench.assume(~i.valid | (tracker.count - leaves < depth))
    return bench, tracker


def queue(depth: int) -> Bench:
    component = Queue(WIDTH, depth)
    bench, tracker = followed(component, depth)
    i, o = component.i, component.o
    bench.require("has_room", ~i.valid | bench.inner("fifo/w__ready"))
    waited = bench.past((tracker.count != 0) & ~o.valid, "waited")
    bench.require("comes_out", ~waited | o.valid)
    inside = FifoInside(bench, "fifo", "item")
    bench.require("count_is_level", tracker.count == inside.level + inside.out)
    in_ram = tracker.follows & (tracker.ahead >= inside.out)
    bench.require("followed_in_ram", ~in_ram | (inside.at(tracker.ahead - inside.out) == tracker.payload))
    return bench


def passing_queue(depth: int) -> Bench:
    component = PassingQueue(WIDTH, depth)
    bench, tracker = followed(component, depth)
    i, o = component.i, component.o
    bench.require("has_room", ~bench.inner("waiting/i__valid") | bench.inner("waiting/fifo/w__ready"))
    bench.require("passes", o.valid | ~bench.past(i.valid & (tracker.count == 0), "came_alone"))
    empty = (tracker.count != 0) & ~o.valid
    bench.require("comes_out", ~(empty & bench.past(empty & bench.past(empty, "waited"), "waited_longer")))
    inside = FifoInside(bench, "waiting/fifo", "item")
    before = inside.out + o.valid  # items that are not in the RAM
    bench.require("count_is_level", tracker.count == inside.level + before)
    in_output = tracker.follows & inside.out & (tracker.ahead == o.valid)
    bench.require("followed_in_output", ~in_output | (bench.inner("waiting/fifo/r__payload") == tracker.payload))
    in_ram = tracker.follows & (tracker.ahead >= before)
    bench.require("followed_in_ram", ~in_ram | (inside.at(tracker.ahead - before) == tracker.payload))
    bench.reach("past_the_ram", o.valid & o.ready & ~inside.out & (inside.level == 0))
    return bench


def free_list(count: int) -> Bench:
    component = FreeList(count)
    bench = Bench(component)
    m, i, o = bench.m, component.i, component.o
    given = Signal(count)  # who has which number
    number = Signal(count)
    back = Signal(count)
    m.d.comb += [
        number.eq(Mux(o.valid & o.ready, 1 << o.payload, 0)),
        back.eq(Mux(i.valid, 1 << i.payload, 0)),
    ]
    m.d.sync += given.eq((given | number) & ~back)
    bench.assume(~i.valid | ((i.payload < count) & (given & back).any()))
    held(bench, "o", o.valid, o.ready, o.payload)
    bench.require("below_count", ~o.valid | (o.payload < count))
    bench.require("not_given_twice", (given & number) == 0)
    some = bench.past((~given).any() & ~o.valid, "some")
    bench.require("free_one_comes", ~some | o.valid | given.all())
    bench.reach("all_given", given.all())
    bench.reach("given_again", o.valid & o.ready & (bench.inner("fresh") == count))

    # What is not given away is either fresh or, once each, in the queue of those that came back.
    fresh = bench.inner("fresh")
    inside = FifoInside(bench, "returned/fifo", "number")
    places = [(inside.out, bench.inner("returned/fifo/r__payload")), *inside.slots]
    waiting = [Mux(there, 1 << data, 0)[:count] for there, data in places]
    everyone = Signal(count)
    m.d.comb += everyone.eq((1 << fresh) - 1)
    bench.require("fresh_in_range", fresh <= count)
    together = 0
    for k, one in enumerate(waiting):
        bench.require(f"number{k}_apart", (one & (given | ~everyone | together)) == 0)
        bench.require(f"number{k}_in_range", ~places[k][0] | (places[k][1] < count))
        together = together | one
    bench.require("all_accounted_for", (given | together) == everyone)
    return bench


def properties() -> list[Property]:
    return [
        Property(
            unit="buffer",
            name="stream",
            says="payload holds; nothing lost, made up, doubled or overtaken; both sides free of each other",
            method=Induction(depth=1),
            build=buffer,
            reach=5,
            quick=True,
        ),
        *(
            Property(
                unit="queue",
                name=f"depth{depth}",
                says="a FIFO of its depth that always has room, in order, payload holds, comes out",
                method=Induction(depth=1),
                build=partial(queue, depth),
                reach=3 * depth + 2,
                quick=depth == 3,
            )
            for depth in (1, 3, 8)
        ),
        *(
            Property(
                unit="passing_queue",
                name=f"depth{depth}",
                says="a FIFO of its depth that always has room, in order, payload holds, passes where none waits",
                method=Induction(depth=2),
                build=partial(passing_queue, depth),
                reach=3 * depth + 2,
                quick=depth == 3,
            )
            for depth in (1, 3, 8)
        ),
        *(
            Property(
                unit="free_list",
                name=f"count{count}",
                says="a number is never given to two; all of them can be had; none is lost",
                method=Induction(depth=1),
                build=partial(free_list, count),
                reach=2 * count + 4,
                quick=count == 3,
            )
            for count in (1, 3, 6)
        ),
    ]
