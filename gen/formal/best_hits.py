# amaranth: UnusedElaboratable=no
# (a unit is also made only to ask for its latency)
"""The best hits of a traversal unit: the best of all results so far, for all time; its distance, bounded."""

from amaranth import Cat, Module, Mux, Signal, Value
from amaranth.lib import wiring

from lightloom.gen.formal.bench import Bench
from lightloom.gen.formal.properties import Bounded, Induction, Property
from lightloom.golden_model.contract.formats import HIT, TIME_BITS
from lightloom.golden_model.contract.interfaces import PURE
from lightloom.rtl.config import Config
from lightloom.rtl.fabric.layouts import layout_of
from lightloom.rtl.fabric.pipeline import Core
from lightloom.rtl.traversal.best_hits import BestHits

SMALL = Config.of(contexts=4)


class MixedCore(Core):
    """Stands for the unit that computes distances: what matters is which t and which ray it is given."""

    def __init__(self) -> None:
        super().__init__(PURE["ray_time"], 0)

    def elaborate(self, platform: object) -> Module:
        m = Module()
        m.d.comb += self.o.high.eq(mixed(self.i.t, self.i.rate, self.i.scale))
        return m


def mixed(t: Value, rate: Value, scale: Value) -> Value:
    """Something that tells apart what its operands are."""
    return (t ^ rate ^ (scale << 16))[:TIME_BITS]


def is_number(t: Value) -> Value:
    """Neither NaN nor infinity nor subnormal."""
    return (t[23:31] != 0xFF) & ((t[23:31] != 0) | (t[:23] == 0))


def in_order(t: Value) -> Value:
    """A number as an integer that is ordered as it is; the zeros are equal."""
    return Mux(t[31], -t[:31], t[:31])


class Followed:
    """One context, any one, whatever happens to the others, and what its surroundings keep to.

    Attributes: the `bench` and the `component`; `who`; strobes of the context: `begins`, a ray does; `comes`, a result.
    """

    def __init__(self, config: Config):
        self.component = component = BestHits(config)
        component._ray_time = MixedCore()
        self.bench = bench = Bench(component)
        start, result = component.start, component.result
        self.who = bench.constant("who", range(config.traversal.contexts))
        self.begins = start.valid & (start.payload.context == self.who)
        self.comes = result.valid & (result.payload.context == self.who)
        # Results come where they were announced; their t is a number, and no unit makes a subnormal one.
        self.coming, self.announced = (Signal(len(self.who), name=name, reset_less=True) for name in ("next", "now"))
        bench.m.d.sync += [self.coming.eq(component.coming.context), self.announced.eq(self.coming)]
        bench.assume(~result.valid | (result.payload.context == self.announced))
        bench.assume(is_number(result.payload.data.t))
        # A ray begins in an idle context, and its results come later.
        bench.assume(~self.comes | ~(self.begins | bench.past(self.begins, "begins")))

    def asked(self, port: wiring.PureInterface, name: str, *, when: Value) -> Value:
        """The context's word was asked for in the cycle before this one."""
        return self.bench.past((port.context == self.who) & when, f"{name}_asked")


def nearest(config: Config) -> Bench:
    """The best of the results, one after the other, at all read ports."""
    followed = Followed(config)
    bench, component, who, begins = followed.bench, followed.component, followed.who, followed.begins
    m, result = bench.m, component.result.payload
    found = Signal()
    best = Signal(layout_of(HIT))
    t = result.data.t
    lower, equal = in_order(t) < in_order(best.t), in_order(t) == in_order(best.t)
    lower_index = result.primitive.as_signed() < best.primitive.as_signed()
    better = followed.comes & result.tested & result.data.hit & (~found | lower | (equal & lower_index))
    with m.If(begins):
        m.d.sync += found.eq(0)
    with m.Elif(better):
        m.d.sync += [found.eq(1), best.primitive.eq(result.primitive)]
        m.d.sync += [best[name].eq(result.data[name]) for name in ("t", "u", "v", "front")]
    shown = Signal(layout_of(HIT))
    m.d.comb += shown.primitive.eq(-1)
    with m.If(found):
        m.d.comb += shown.eq(best)

    # What is read is what was true in the cycle of the question; the hit itself, where no better one came in it.
    hit_port, t_port = component.hit_read, component.best_read
    hit_asked = followed.asked(hit_port, "hit", when=~better)
    t_asked = followed.asked(t_port, "t", when=t_port.en)
    bench.require("hit", ~hit_asked | (Value.cast(hit_port.hit) == bench.past(shown, "shown")))
    bench.require("found", ~t_asked | (t_port.found == bench.past(found, "found")))
    bench.require("t", ~t_asked | ~t_port.found | (t_port.t == bench.past(best.t, "t")))
    bench.require("is_better", ~followed.comes | (bench.inner("better") == better))
    hits = followed.comes & result.tested & result.data.hit & found
    bench.reach("better_than_a_hit", better & found)
    bench.reach("as_far_with_a_lower_index", better & found & equal)
    bench.reach("as_far_with_a_higher_index", hits & equal & ~better)
    bench.reach("farther_than_a_hit", hits & ~lower & ~equal)
    bench.reach("next_result_of_the_same_ray", better & bench.past(better, "better_before"))

    # The induction's invariant: memories, and what is read ahead of the two results that come next.
    bench.require("found_bit", bench.inner("found").bit_select(who, 1) == found)
    held_t = {"nearest": best.t, "nearest_ahead": best.t}
    for name, value in (held_t | {"primitives_ahead": best.primitive, "hits": best}).items():
        held = bench.peek(name, who, f"{name}_of_who")
        bench.require(f"{name}_memory", ~found | (held == Value.cast(value)))
    bench.require("best_is_number", ~found | is_number(best.t))
    bench.require("following", bench.inner("following") == followed.coming)
    passing = bench.inner("passing")
    bench.require("passing_is_found", (followed.coming != who) | ~passing | found)
    compared = (followed.announced == who) & ~bench.past(begins, "begun")
    bench.require("found_ahead", ~compared | (bench.inner("found_best") == found))
    for name, memory, value in (("t", "nearest_ahead", best.t), ("primitive", "primitives_ahead", best.primitive)):
        ahead = Mux(passing, bench.inner(f"{name}_passing"), bench.inner(f"{memory}/r_data"))
        bench.require(f"{name}_ahead", (followed.coming != who) | ~found | (ahead == value))
        bench.require(f"{name}_compared", ~compared | ~found | (bench.inner(f"{name}_best") == value))
    return bench


def distance(config: Config) -> Bench:
    """The distance of a ray, when it has started and what it visits is done; the end of each visit."""
    followed = Followed(config)
    bench, component, comes = followed.bench, followed.component, followed.comes
    m, start, result = bench.m, component.start, component.result.payload
    started, done = component.started, component.done
    is_started = started.valid & (started.context == followed.who)
    is_done = done.valid & (done.context == followed.who)

    # The surroundings: the results of a visit come one after the other, if its ray has started; a ray begins when the
    # one before it has nothing under way.
    more = Signal()
    before = Signal(result.shape())
    with m.If(component.result.valid):
        m.d.sync += [more.eq(~result.last), before.eq(result)]
    same_visit = (result.context == before.context) & (result.any_hit == before.any_hit)
    bench.assume(~component.result.valid | ~more | (result.last & same_visit))
    starting = Signal(config.traversal.contexts)
    running = Signal()
    visits = Signal(4)
    m.d.sync += [
        starting.eq((starting | start.valid << start.payload.context) & ~(started.valid << started.context)),
        running.eq((running | is_started) & ~followed.begins),
        visits.eq(visits + (comes & result.last) - is_done),
    ]
    quiet = (visits == 0) & ~(more & (before.context == followed.who))
    bench.assume(~start.valid | ~starting.bit_select(start.payload.context, 1))
    bench.assume(~followed.begins | quiet)
    bench.assume(~comes | running)

    _distances(followed, running & quiet)
    # A start waits for those before it, and for cycles without a better hit.
    waited = Signal(range(component.start_latency + config.traversal.contexts + 2))
    with m.If(followed.begins | ~starting.bit_select(followed.who, 1)):
        m.d.sync += waited.eq(0)
    with m.Elif(~bench.inner("better")):
        m.d.sync += waited.eq(waited + 1)
    bench.require("starts", waited < component.start_latency + config.traversal.contexts)
    bench.require("started_once", ~is_started | starting.bit_select(followed.who, 1))

    any_hit, first_of_two = _visit_ends(bench, component)
    asked = followed.asked(component.time_read[0], "time", when=running & quiet)
    was_better = Signal()
    with m.If(followed.begins | comes):
        m.d.sync += was_better.eq(~followed.begins & (was_better | bench.inner("better")))
    waits = bench.inner("starting/fifo/r__valid") & (bench.inner("starting/fifo/r__payload") == followed.who)
    bench.reach("distance_of_t_max", asked & ~was_better)
    bench.reach("distance_of_a_hit", asked & was_better)
    bench.reach("hit_is_told", is_done & done.hit)
    bench.reach("error_is_told", is_done & (done.error != 0))
    bench.reach("two_results_of_a_visit", comes & result.last & bench.past(comes & ~result.last, "one"))
    bench.reach("hit_of_the_first_of_two", comes & result.last & ~any_hit & first_of_two)
    bench.reach("two_visits_of_a_ray", visits == 2)
    bench.reach("start_waits_for_a_better_hit", waits & bench.inner("better"))
    bench.reach("two_starts_at_a_time", (starting & (starting - 1)[: len(starting)]).any())
    bench.reach("begins_a_second_ray", followed.begins & was_better)
    return bench


def _distances(followed: Followed, idle: Value) -> None:
    """The distance of the best t (`nearest` shows which results are better), with the constants of its ray.

    `idle`: the ray has started, and what it visits is done.
    """
    bench, component, comes = followed.bench, followed.component, followed.comes
    m, start, result = bench.m, component.start, component.result.payload
    t = Signal(32)
    ray = Signal(start.payload.shape())
    with m.If(followed.begins):
        m.d.sync += [t.eq(start.payload.t_max), ray.eq(start.payload)]
    with m.Elif(comes & bench.inner("better")):
        m.d.sync += t.eq(result.data.t)
    expected = bench.past(mixed(t, ray.rate, ray.scale), "distance")
    for k, port in enumerate(component.time_read):
        asked = followed.asked(port, f"time{k}", when=idle)
        bench.require(f"distance{k}", ~asked | (port.time == expected))


def _visit_ends(bench: Bench, component: BestHits) -> tuple[Signal, Value]:
    """The end of a visit comes a fixed time after its last result, and says what its results said.

    Whether this result ends the search, and whether one did that another one of its visit follows.
    """
    m, result, done = bench.m, component.result.payload, component.done
    any_hit = Signal()
    first_hit = Signal()
    m.d.comb += any_hit.eq(result.any_hit & result.tested & result.data.hit)
    with m.If(component.result.valid):
        m.d.sync += first_hit.eq(any_hit & ~result.last)
    end: Value = Cat(component.result.valid & result.last, result.context, any_hit | first_hit, result.error)
    for cycle in range(component.latency):
        end = bench.past(end, f"end{cycle}")
    told = Cat(done.valid, done.context, done.hit, done.error)
    bench.require("visit_over", (told == end) | ~(done.valid | end[0]))
    first_of_two = bench.past(component.result.valid & any_hit & ~result.last, "first_of_two")
    return any_hit, first_of_two


def properties() -> list[Property]:
    return [
        Property(
            unit="best_hits",
            name="nearest",
            says="the best hit of a context is the best of all its results so far, at every read port",
            method=Induction(depth=1),
            build=lambda: nearest(SMALL),
            reach=6,
            quick=True,
        ),
        Property(
            unit="best_hits",
            name="distance",
            says="the distance of the best hit, or of t_max, when visits are done; each visit's end told once",
            method=Bounded(depth=13),
            build=lambda: distance(SMALL),
        ),
    ]
