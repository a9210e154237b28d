"""A ray in the control of a traversal unit: what its surroundings may do, and where its visits are."""

from amaranth import Array, Cat, Mux, Signal, Value
from amaranth.lib import data

from lightloom.gen.formal.bench import Bench
from lightloom.gen.formal.queues import FifoInside
from lightloom.rtl.config import Config
from lightloom.rtl.traversal.control import Control
from lightloom.rtl.traversal.records import node_visit

MOST_CHILDREN = 8


def total(values: list[Value]) -> Value:
    return sum(values[1:], start=values[0])


class Followed:
    """One context, any one, and what its surroundings keep to: a tree that the header reader accepts, and stages that
    answer each visit once, in any order, after any time, with any result. All else that comes in may be anything.

    Attributes, of the context: `taken`, it has a ray, `begun`, whose visits may begin, `done`, that is finished;
    `nodes`, `leaves`: visits that the stages have; `ended`: the ray has failed, or has its only hit; `told`: of both
    sides whether they have said that it failed; `due`: it has to begin again; `again`: it has begun again; `limit`: how
    many visits may be under way.
    Strobes: `starts`, `finishes` (it is offered), `node_comes`, `leaf_comes`, `fails`, `hits`, `asks_node`,
    `asks_leaf`, `root` is chosen, `puts` a list on the stack, `begins_again`.
    """

    def __init__(self, config: Config):
        self.stack = config.traversal.stack
        self.component = component = Control(config)
        self.bench = bench = Bench(component)
        self.who = bench.constant("who", range(config.traversal.contexts))
        self.taken, self.begun, self.done, self.ended, self.due, self.again = (
            Signal(name=f"ray_{name}") for name in ("taken", "begun", "done", "ended", "due", "again")
        )
        most = range(config.traversal.overlap + 2)
        self.nodes, self.leaves = (Signal(most, name=f"{name}_out") for name in ("nodes", "leaves"))
        self.told = Signal(2)
        node, leaf, start = component.node, component.leaf, component.start
        self.starts = start.valid & start.ready & self.mine(component.start_context)
        begins = component.started.valid & self.mine(component.started.context)
        self.finishes = component.finished.valid & self.mine(component.finished.payload.context)
        frees = component.release.valid & self.mine(component.release.context)
        self.asks_node, self.asks_leaf = (
            request.valid & self.mine(request.payload.context)
            for request in (component.node_request, component.leaf_request)
        )
        self.node_comes = node.valid & node.ready & self.mine(node.payload.context)
        self.leaf_comes = leaf.valid & self.mine(leaf.payload.context)
        self.fails = Cat(side.valid & self.mine(side.payload.context) for side in component.failed)
        self.hits = self.leaf_comes & leaf.payload.hit
        self.root = self.bit("popped") & self.bit("fresh")  # the root is chosen
        self.begins_again = self.bit("decision/restarts")  # the stack cannot take what a node leaves
        self.puts = self.bit("decision/pushes")
        ends = self.fails.any() | self.hits
        bench.m.d.sync += [
            self.taken.eq((self.taken | self.starts) & ~frees),
            self.begun.eq((self.begun | begins) & ~frees),
            self.done.eq((self.done | (self.finishes & component.finished.ready)) & ~frees),
            self.nodes.eq(self.nodes + self.asks_node - self.node_comes),
            self.leaves.eq(self.leaves + self.asks_leaf - self.leaf_comes),
            self.told.eq(Mux(self.starts, 0, self.told | self.fails)),
            self.ended.eq((self.ended | ends) & ~self.starts),
            self.due.eq((self.due | self.begins_again) & ~self.root & ~ends),
            self.again.eq((self.again | (self.root & self.due)) & ~self.starts),
        ]
        self._assume(begins, frees)
        self.limit = Signal(range(config.traversal.overlap + 1))
        few = Mux(component.overlap > config.traversal.overlap, config.traversal.overlap, component.overlap)
        bench.m.d.comb += self.limit.eq(Mux(few == 0, 1, few))

    def _assume(self, begins: Value, frees: Value) -> None:
        """The surroundings: `begins`, its visits may begin; `frees`, the context is given back."""
        bench, component, node = self.bench, self.component, self.component.node
        for name in ("root", "levels", "overlap"):
            port = getattr(component, name)
            bench.assume(port == bench.constant(f"{name}_of_the_run", len(port)))
        bench.assume((component.levels != 0) & (component.levels <= self.stack))
        bench.assume(~begins | (self.taken & ~self.begun))
        bench.assume(~frees | self.done)
        bench.assume(~(node.valid & self.mine(node.payload.context)) | (self.nodes != 0))
        bench.assume(~self.leaf_comes | (self.leaves != 0))
        bench.assume(~node.valid | (node.payload.hits.count <= MOST_CHILDREN))
        waits = bench.past(node.valid & ~node.ready, "node_waits")
        before = bench.past(Value.cast(node.payload), "node")
        bench.assume(~waits | (node.valid & (Value.cast(node.payload) == before)))

    def mine(self, context: Value) -> Value:
        return context == self.who

    def bit(self, name: str) -> Value:
        """The context's bit of a mask of the control."""
        return self.bench.inner(name).bit_select(self.who, 1)

    def count(self, name: str, greatest: int) -> Value:
        """The context's count of those that the control holds as planes."""
        planes = [self.bench.inner(f"{name}{place}") for place in range(greatest.bit_length())]
        return Cat(Array(plane)[self.who] for plane in planes)


class Places:
    """Where the visits and the lists of the followed ray are inside the control.

    Attributes: `chosen`, visits between the stack and their request; `results`, of nodes that wait for a decision;
    `over`, visits that are over and still counted; `lists`, on their way to the stack. And of the places of chosen
    visits, each with whether one of the ray is there: `unread`, and whether it is of the root; `met`, and `waiting`,
    nodes that wait for their turn, and what is known of the visit; `waiting_leaves`, no more than that.
    """

    def __init__(self, config: Config, ray: Followed):
        bench, bits = ray.bench, config.traversal.context_bits
        self.pops = [
            FifoInside(bench, f"pops/{kind}", f"popped_{kind}", buffered=False) for kind in ("nodes", "leaves")
        ]
        lists = FifoInside(bench, "stacks/lists", "list")
        asked, read, met = (
            (bench.inner(f"pops/{name}_valid") & ray.mine(word[:bits]), word)
            for name in ("asked", "read", "visit")
            for word in [bench.inner(f"pops/{name}")]
        )
        nodes, leaves = ([(there & ray.mine(word[:bits]), word) for there, word in pops.slots] for pops in self.pops)
        self.chosen = total([here for here, _ in (asked, read, met, *nodes, *leaves)])
        self.unread = [(here, word[-1]) for here, word in (asked, read)]
        self.met = (met[0], data.View(node_visit(config), met[1][: node_visit(config).size]))
        self.waiting = [(here, data.View(node_visit(config), word)) for here, word in nodes]
        self.waiting_leaves = [here for here, _ in leaves]
        self.buffered = [
            (bench.inner(f"decision/results/{valid}"), bench.inner(f"decision/results/{data}"))
            for valid, data in (("o__valid", "first"), ("held", "kept"))
        ]
        self.results = total([there & ray.mine(word[:bits]) for there, word in self.buffered])
        self.over = total([ray.bit(f"{name}_visits_over") for name in ("dropped", "node", "leaf")])
        out = lists.out & ray.mine(bench.inner("stacks/lists/r__payload")[:bits])
        writing = bench.inner("stacks/writing") & ray.mine(bench.inner("stacks/item")[:bits])
        self.lists = total([writing, out, *(there & ray.mine(word[:bits]) for there, word in lists.slots)])
