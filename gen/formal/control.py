"""The control of a traversal unit, for all time: what becomes of a ray, any one, whatever other rays do."""

from amaranth import Cat, Mux, Signal, Value
from amaranth.lib import data

from lightloom.gen.formal.bench import Bench
from lightloom.gen.formal.followed_ray import MOST_CHILDREN, Followed, Places, total
from lightloom.gen.formal.properties import Induction, Property
from lightloom.gen.formal.streams import held
from lightloom.golden_model.contract.formats import TRACE_ERRORS
from lightloom.rtl.config import Config
from lightloom.rtl.traversal.popped_visits import POPS
from lightloom.rtl.traversal.records import ADDRESS_BITS, node_result, push_list
from lightloom.rtl.traversal.stacks import LISTS

SMALL = Config.of(contexts=4, overlap=2, stack=4)


def life(config: Config) -> Bench:
    """What the rest of the unit sees of a ray, and what `gen.formal.stacks` assumes of the use of its stack."""
    ray = Followed(config)
    bench, component, m = ray.bench, ray.component, ray.bench.m
    places = Places(config, ray)
    visits = Signal(8)  # under way, as their limit counts them
    m.d.comb += visits.eq(ray.nodes + ray.leaves + places.chosen + places.results + places.over)

    held(bench, "finished", component.finished.valid, component.finished.ready, component.finished.payload)
    bench.require("context_is_free", ~ray.starts | ~ray.taken)
    asks = ray.asks_node | ray.asks_leaf
    bench.require("visits_of_its_ray", ~asks | (ray.begun & ~ray.done))
    bench.require("nothing_chosen_after_the_end", ~ray.bit("popped") | (~ray.ended & (~ray.due | ray.bit("fresh"))))
    dead = ray.ended | ray.bit("restart")
    bench.require("drops_what_was_chosen_before", ~(ray.bit("pops/met") & dead) | bench.inner("pops/dropped"))
    bench.require("overlap", visits <= ray.limit)
    bench.require("one_at_a_time_again", ~ray.again | (visits <= 1))
    bench.require("finished_once", ~ray.finishes | (ray.begun & ~ray.done))
    bench.require("finished_when_done", ~ray.finishes | ((visits == 0) & ~ray.due))
    bench.require("idle_without_rays", ~component.idle | ~ray.taken)

    # A failure is told by one side, or by both in one cycle; the result then goes by the node's.
    finished = component.finished.payload
    bench.require("fails_once", ~ray.fails.any() | ~ray.told.any())
    bench.require("fails_while_in", ~ray.fails.any() | (ray.begun & ~ray.done))
    bench.require("failure_is_told", ~ray.finishes | (finished.failed == ray.told.any()))
    bench.require("side_is_told", ~ray.finishes | (finished.by_leaf == (ray.told == 0b10)))

    entries = stack(config, ray, places)
    decision(config, ray, entries)
    bench.require("empty_when_finished", ~ray.finishes | (entries == 0))
    bench.require("begins_with_nothing", ~ray.root | ((visits == 0) & (entries == 0) & (places.lists == 0)))
    root(ray, places, visits, entries)
    invariant(config, ray, places, visits, entries)
    covers(config, ray, entries)
    return bench


def root(ray: Followed, places: Places, visits: Value, entries: Value) -> None:
    """A ray that begins, or begins again, asks for the root and all of its children, whatever its stack holds."""
    bench, component = ray.bench, ray.component
    on_its_way = Signal(name="root_on_its_way")  # from the choice to the request
    bench.m.d.sync += on_its_way.eq((on_its_way | ray.root) & ~ray.asks_node)
    asked = component.node_request.payload
    bench.require("root_is_a_node", ~on_its_way | ~ray.asks_leaf)
    bench.require("root_is_made", ~on_its_way | ~(bench.inner("pops/dropped") & ray.bit("pops/met")))
    whole = (asked.address == component.root) & (asked.rank == 0)
    bench.require("root_from_its_first_child", ~(on_its_way & ray.asks_node) | whole)

    # Until then it is the ray's only visit. What is said of an entry where it is read counts for nothing.
    alone = (places.chosen == 1) & (visits == 1) & (entries == 0) & (places.lists == 0)
    bench.require("root_alone", ~on_its_way | (alone & ~ray.ended & ~ray.bit("restart")))
    for place, (here, fresh) in enumerate(places.unread):
        bench.require(f"root_unread{place}", ~here | (fresh == on_its_way))
    for place, (here, visit) in enumerate([places.met, *places.waiting]):
        whole = (visit.address == component.root) & (visit.rank == 0)
        bench.require(f"root_read{place}", ~(on_its_way & here) | whole)
    entry = bench.inner("pops/visit")
    bench.require("root_is_no_entry", ~(on_its_way & places.met[0]) | ~entry[-3:].any())
    bench.require("root_waits_as_a_node", ~on_its_way | ~Cat(places.waiting_leaves).any())


def stack(config: Config, ray: Followed, places: Places) -> Signal:
    """The entries on the ray's stack: each is taken once, from the top, when it is written and before it can be written
    over. This is what `gen.formal.stacks` assumes of whoever uses the stacks."""
    bench, m = ray.bench, ray.bench.m
    put = data.View(push_list(config), bench.inner("decision/push__payload"))
    takes = ray.bit("popped") & ~ray.bit("fresh")
    reads = bench.inner("pops/asked_valid") & ray.mine(bench.inner("pops/read__context")) & bench.past(takes, "takes")
    entries, more, top = Signal(8), Signal(8), Signal(8)
    emptied = ray.fails.any() | ray.hits | ray.begins_again
    m.d.comb += more.eq(Mux(ray.puts, put.last - put.first + 1, 0))
    m.d.sync += [entries.eq(Mux(emptied, 0, entries - takes + more)), top.eq(entries - 1)]
    bench.require("stack_in_bounds", entries + more <= config.traversal.stack)
    bench.require("takes_what_is_there", ~takes | (entries != 0))
    bench.require("takes_the_top", ~reads | (bench.inner("pops/read__position") == top))
    bench.require("takes_what_is_written", ~reads | (places.lists == 0))
    bench.require("puts_on_top", ~ray.puts | (put.height == entries - takes))
    bench.require("puts_something", ~ray.puts | (put.first <= put.last))
    bench.require("one_entry_is_one", ~ray.puts | ~put.again | (put.first == put.last))
    return entries


def decision(config: Config, ray: Followed, entries: Value) -> None:
    """What the result of a node leads to, by docs/wide_traversal.md: its nearest child is asked for, the rest put down.
    All of it if `levels` places are left then, else one entry; and where that has no place the ray begins again."""
    bench = ray.bench
    node = data.View(node_result(config), bench.inner("decision/results/first")[: -config.traversal.contexts])
    put = data.View(push_list(config), bench.inner("decision/push__payload"))
    takes = bench.inner("decision/results/o__valid") & bench.inner("decision/push__ready")
    goes = takes & ray.mine(node.context) & ~ray.ended & ~ray.due
    good = goes & (node.error == 0)
    rest = node.hits.count - node.rank - 1
    all_of_it = entries + rest + ray.component.levels <= config.traversal.stack
    full = ~all_of_it & (entries == config.traversal.stack)
    stops = good & (rest > 0) & full
    bench.require("error_fails", ~goes | (node.error == 0) | ray.fails[0])
    bench.require("full_stack_begins_again", ray.begins_again == (stops & ~ray.bit("strict")))
    bench.require("alone_never_begins_again", ~ray.begins_again | (ray.limit > 1))
    bench.require("full_stack_fails", ~good | (ray.fails[0] == (stops & ray.bit("strict"))))

    slot = node.hits.slot[node.rank]
    nearest = (node.base + slot)[:ADDRESS_BITS]
    to_node, to_leaf = ray.component.node_request.payload, ray.component.leaf_request.payload
    asks_node = ray.asks_node & (to_node.address == nearest) & (to_node.rank == 0)
    asks_leaf = ray.asks_leaf & (to_leaf.address == nearest)
    asks = Mux(node.leaf.bit_select(slot, 1), asks_leaf, asks_node)
    bench.require("nearest_is_asked_for", ~good | (rest < 0) | stops | asks)

    bench.require("rest_is_put_down", ~good | (ray.puts == ((rest > 0) & ~full)))
    bench.require("one_entry_for_all", ~ray.puts | (put.again == ~all_of_it))
    bench.require("first_of_the_rest", ~ray.puts | (put.first == node.rank + 1))
    bench.require("last_of_the_rest", ~ray.puts | put.again | (put.last == node.hits.count - 1))
    bench.require("base_of_the_rest", ~ray.puts | (put.base == Mux(put.again, node.address, node.base)))
    same = Cat(put.leaf, Value.cast(put.slot), Value.cast(put.entry))
    bench.require("children_are_its_own", ~ray.puts | (same == Cat(node.leaf, node.hits.slot, node.hits.entry)))


def invariant(config: Config, ray: Followed, places: Places, visits: Value, entries: Value) -> None:
    """What the registers of the control say of the ray, and what is true of those that all rays share."""
    bench = ray.bench
    taken = ray.bit("free_contexts/taken")
    active, fresh, ended, restart = (ray.bit(name) for name in ("active", "fresh", "ended", "restart"))
    bench.require("taken_bit", taken == ray.taken)
    bench.require("active_bit", active + ray.finishes + ray.done == ray.begun)
    bench.require("begun_if_taken", ~ray.begun | ray.taken)
    bench.require("ended_bit", ended == ray.ended)
    bench.require("failing_bit", ray.bit("failing") == ray.told.any())
    bench.require("by_leaf_bit", ray.bit("by_leaf") == (ray.told == 0b10))
    bench.require("told_and_ended", ~ray.told.any() | ray.ended)
    bench.require("outstanding_count", ray.count("outstanding", config.traversal.overlap) == visits)
    bench.require("pending_count", ray.count("pending", LISTS) == places.lists)
    bench.require("height_count", ray.count("height", config.traversal.stack) == entries)

    nothing = (visits == 0) & (places.lists == 0) & (entries == 0)
    bench.require("idle_is_empty", active | (nothing & ~restart & ~ray.due & ~(fresh & (ray.begun | ~taken))))
    bench.require("not_begun_not_ended", ray.begun | ~taken | ~(ended | ray.due | ray.again))
    bench.require("fresh_is_empty", ~fresh | (nothing & ~ended & ~restart))
    bench.require("ended_is_empty", ~ended | ((entries == 0) & ~ray.due))
    bench.require("restart_is_empty", ~restart | ((entries == 0) & ~ended))
    bench.require("due_until_the_root", ~ray.due | restart | fresh)
    bench.require("restart_is_due", ~restart | ray.due)
    bench.require("due_is_strict", ~(ray.due & ~restart) | ray.bit("strict"))
    bench.require("again_is_strict", ~ray.again | ray.bit("strict"))
    bench.require("alone_is_strict", ~ray.taken | (ray.limit != 1) | ray.bit("strict"))
    bench.require("strict_is_one", ~ray.bit("strict") | (visits <= 1))

    # Shared: a context is kept for the next ray; visits on their way have their places; decoded masks.
    reserved, number = bench.inner("free_contexts/reserved"), bench.inner("free_contexts/reserved_number")
    bench.require(
        "reserved_one",
        reserved == Mux(bench.inner("free_contexts/reserved_valid"), 1 << number, 0)[: config.traversal.contexts],
    )
    bench.require("reserved_free", ~ray.bit("free_contexts/reserved") | ~taken)
    steps = [bench.inner(f"pops/{name}_valid") for name in ("asked", "read", "visit")]
    on_the_way = total([*steps, *(pops.level for pops in places.pops)])
    bench.require("on_their_way", (bench.inner("pops/on_their_way") == on_the_way) & (on_the_way <= POPS))
    (first, _), (second, _) = places.buffered
    bench.require("first_before_second", first | ~second)
    for place, (there, word) in enumerate(places.buffered):
        node, mask = (
            data.View(node_result(config), word[: -config.traversal.contexts]),
            word[-config.traversal.contexts :],
        )
        bench.require(f"mask{place}", ~there | (mask == (1 << node.context)[: config.traversal.contexts]))
        bench.require(f"children{place}", ~there | (node.hits.count <= MOST_CHILDREN))


def covers(config: Config, ray: Followed, entries: Value) -> None:
    """What has to be possible, each without another ray in the unit."""
    bench, component, m, reach = ray.bench, ray.component, ray.bench.m, ray.bench.reach
    node, leaf, started = component.node, component.leaf, component.started
    for valid, context in (
        (component.start.valid, component.start_context),
        *((port.valid, port.payload.context) for port in (node, leaf)),
        (started.valid, started.context),
    ):
        bench.narrow(~valid | ray.mine(context))
    result = node.payload
    bench.narrow(
        (ray.who == 0) & (component.levels == 1) & (ray.limit == config.traversal.overlap) & component.finished.ready
    )
    bench.narrow(Cat(component.root, result.base, result.address, Value.cast(result.hits.slot)) == 0)
    bench.narrow(Cat(entry == 1 for entry in result.hits.entry).all())
    bench.narrow(~ray.taken | ~component.start.valid)
    visited, hit = Signal(name="so_far_visited"), Signal(name="so_far_hit")
    m.d.sync += [
        visited.eq((visited | ray.asks_node | ray.asks_leaf) & ~ray.starts),
        hit.eq((hit | ray.hits) & ~ray.starts),
    ]
    dropped = bench.inner("pops/dropped") & ray.bit("pops/met")
    popped_leaf = bench.inner("pops/leaf__valid") & ~bench.inner("decision/forward_leaf__valid") & ray.asks_leaf
    reach("two_visits", ray.nodes + ray.leaves == 2)
    reach("two_results_in_one_cycle", ray.node_comes & ray.leaf_comes)
    reach("popped_leaf", popped_leaf)
    reach("popped_rest_of_a_node", ray.asks_node & (component.node_request.payload.rank != 0))
    reach("dropped_beyond_the_hit", dropped & ~ray.ended & ~ray.due)
    reach("dropped_after_the_end", dropped & ray.ended)
    reach("asks_after_the_end", (ray.asks_node | ray.asks_leaf) & ray.ended)
    reach("full_stack", entries == config.traversal.stack)
    reach("begins_again", ray.begins_again)
    reach("root_again", ray.root & ray.due)
    reach("finished_again", ray.finishes & ray.again & ~ray.told.any())
    reach("node_fails", ray.fails == 0b01)
    reach("leaf_fails", ray.fails == 0b10)
    reach("both_fail_in_one_cycle", ray.fails == 0b11)
    reach("too_many_levels", ray.fails[0] & (component.failed[0].payload.error == TRACE_ERRORS["header"]) & ray.again)
    reach("hit_ends_with_entries", ray.hits & (entries != 0))
    reach("finished_by_a_hit", ray.finishes & hit & ~ray.told.any())
    reach("result_after_the_end", ray.node_comes & ray.ended)
    reach("skipped_ray", ray.finishes & ~visited)


def properties() -> list[Property]:
    return [
        Property(
            unit="control",
            name="life-of-a-ray",
            says="out once, when done; visits within overlap; begins with the root; entries once; a failure told once",
            method=Induction(depth=1),
            build=lambda: life(SMALL),
            reach=28,
        )
    ]
