"""The control of a traversal unit: what becomes of a ray, any one, whatever the others and the stages do. Bounded."""

from amaranth import Array, Cat, Mux, Signal, Value

from gen.formal.bench import Bench
from gen.formal.properties import Bounded, Property
from gen.formal.streams import held
from rtl.config import Config
from rtl.traversal.control import Control

SMALL = Config(contexts=4, overlap=2, stack=4)


def life(config: Config) -> Bench:
    """Follows one context. The stages answer each visit once, in any order and after any time, with any result."""
    component = Control(config)
    bench = Bench(component)
    m = bench.m
    start, started, node, leaf = component.start, component.started, component.node, component.leaf
    finished, release = component.finished, component.release
    who = bench.constant("who", range(config.contexts))
    taken = Signal()  # the context has a ray,
    begun = Signal()  # whose visits may begin,
    done = Signal()  # that is finished
    nodes = Signal(range(config.overlap + 2))  # visits under way
    leaves = Signal(range(config.overlap + 2))
    failed = Signal()

    starts = start.valid & start.ready & (component.start_context == who)
    begins = started.valid & (started.context == who)
    ends = finished.valid & finished.ready & (finished.payload.context == who)
    frees = release.valid & (release.context == who)
    asks_node = component.node_request.valid & (component.node_request.payload.context == who)
    asks_leaf = component.leaf_request.valid & (component.leaf_request.payload.context == who)
    node_comes = node.valid & (node.payload.context == who)
    leaf_comes = leaf.valid & (leaf.payload.context == who)
    fails = [one.valid & (one.payload.context == who) for one in component.failed]
    m.d.sync += [
        taken.eq((taken | starts) & ~frees),
        begun.eq((begun | begins) & ~frees),
        done.eq((done | ends) & ~frees),
        nodes.eq(nodes + asks_node - (node_comes & node.ready)),
        leaves.eq(leaves + asks_leaf - leaf_comes),
        failed.eq((failed | fails[0] | fails[1]) & ~starts),
    ]

    # The surroundings: a tree that the header reader accepts, and stages that answer what they were asked.
    for name in ("levels", "overlap"):
        port = getattr(component, name)
        bench.assume(port == bench.constant(f"{name}_of_the_run", len(port)))
    bench.assume((component.levels != 0) & (component.levels <= config.stack))
    bench.assume(~begins | (taken & ~begun))
    bench.assume(~frees | done)
    bench.assume(~node_comes | (nodes != 0))
    bench.assume(~leaf_comes | (leaves != 0))
    bench.assume(~node.valid | (node.payload.hits.count <= 8))
    waits = bench.past(node.valid & ~node.ready, "node_waits")
    before = bench.past(Value.cast(node.payload), "node")
    bench.assume(~waits | (node.valid & (Value.cast(node.payload) == before)))

    limit = Signal(range(config.overlap + 1))
    m.d.comb += limit.eq(Mux(component.overlap > config.overlap, config.overlap, component.overlap))
    held(bench, "finished", finished.valid, finished.ready, finished.payload)
    bench.require("context_is_free", ~starts | ~taken)
    bench.require("visits_of_its_ray", ~(asks_node | asks_leaf) | (begun & ~done))
    bench.require("one_request_each", nodes + leaves + asks_node + asks_leaf <= config.overlap + 1)
    bench.require("overlap", nodes + leaves <= Mux(limit == 0, 1, limit))
    ended = finished.valid & (finished.payload.context == who)
    bench.require("finished_once", ~ended | (begun & ~done))
    bench.require("finished_when_done", ~ended | (nodes + leaves == 0))
    bench.require("fails_once", ~(fails[0] | fails[1]) | ~failed)
    bench.require("fails_on_one_side", ~(fails[0] & fails[1]))
    bench.require("failure_is_told", ~ended | (finished.payload.failed == failed))
    bench.require("idle_without_rays", ~component.idle | ~taken)
    planes = [bench.inner(f"height{bit}") for bit in range(config.stack.bit_length())]
    height = Cat(Array(plane)[who] for plane in planes)
    bench.require("stack_in_bounds", height <= config.stack)
    bench.reach("node_asked", asks_node)
    return bench


def properties() -> list[Property]:
    return [
        Property(
            unit="control",
            name="life-of-a-ray",
            says="out once, only if in; visits within overlap; stack in bounds; a failure told once",
            method=Bounded(depth=13),
            build=lambda: life(SMALL),
            reach=8,
        )
    ]
