"""What the control of a traversal unit knows of its rays, and what becomes of that as things happen to them."""

from dataclasses import dataclass

from amaranth import Const, Module, Signal, Value

from lightloom.rtl.config import Config
from lightloom.rtl.fabric.pipeline import named
from lightloom.rtl.traversal.masks import Counts, minus, plus, replace
from lightloom.rtl.traversal.stacks import LISTS


@dataclass(frozen=True, kw_only=True)
class Events:
    """What happens in a cycle: for each thing the mask of the ray, one at most, that it happens to."""

    start: Value
    """A ray takes the context."""
    start_root: Value
    """The same, and it has something to traverse."""
    start_strict: Value
    """The same, and it makes one visit at a time."""
    started: Value
    """Its visits may begin."""
    popped: Value
    """A visit of it is chosen: of the root, or the top of its stack."""
    met: Value
    """A visit that was chosen is decided on."""
    met_near: Value
    """The same, and the entry below it is near."""
    dropped: Value
    """The same, and it is not made."""
    node_push: Value
    """The result of a node puts something onto its stack."""
    node_push_near: Value
    """The same, and the new top is near."""
    new_height: Value
    """How high the stack of `node_push` is then: a number."""
    node_end: Value
    """The result of a node leads to no other visit."""
    node_fail: Value
    """The same, and the ray fails."""
    node_restart: Value
    """The same, and the ray has to begin again."""
    written: Value
    """A list has come to its stack."""
    leaf: Value
    """A visit of a leaf is over."""
    leaf_end: Value
    """The same, and it ends the ray."""
    leaf_fail: Value
    """The same, and it makes it fail."""
    finish: Value
    """The ray is finished."""


class Rays:
    """The state of all rays, a bit a context, or a count a context.

    Attributes: `active`, its visits may begin, and it is not finished; `fresh`, the root is to be visited; `ended`, an
    any-hit ray has its hit, or the ray has failed, and what is under way counts no more; `failing`, and `by_leaf`, why;
    `restart`, as ended, but then it begins again, strictly; `strict`, one visit at a time; `near`, the top of the stack
    is near the visit that was made instead of it. Counts: `outstanding` visits, `height` of the stack, `pending` lists
    on their way to it. What follows: `dead`, it makes no more of the visits that it has chosen; `some_outstanding`,
    `some_height`, `some_pending`; `settled`, nothing of it is under way; `begins` again; `done`, it can be finished.
    """

    def __init__(self, m: Module, config: Config):
        contexts = config.traversal.contexts
        self.active, self.fresh, self.ended, self.failing, self.by_leaf, self.restart, self.strict, self.near = (
            Signal(contexts, name=name)
            for name in ("active", "fresh", "ended", "failing", "by_leaf", "restart", "strict", "near")
        )
        self.outstanding = Counts("outstanding", contexts, config.traversal.overlap)
        self.height = Counts("height", contexts, config.traversal.stack)
        self.pending = Counts("pending", contexts, LISTS)
        self.dead = named(m, self.ended | self.restart, "dead")
        self.some_outstanding = named(m, self.outstanding.some(), "some_outstanding")
        self.some_height = named(m, self.height.some(), "some_height")
        self.some_pending = named(m, self.pending.some(), "some_pending")
        self.settled = named(m, ~self.some_outstanding & ~self.some_pending, "settled")
        self.begins = named(m, self.restart & self.settled, "begins")
        finishable = self.active & self.settled & ~self.some_height & ~self.fresh & ~self.restart
        self.done = named(m, finishable, "done")

    def become(self, m: Module, now: Events) -> None:
        """The state of the next cycle."""
        # What an entry that is read says of the one below it is taken for true of the top, though a list may have come
        # above it since: that costs a needless visit now and then, and no result depends on it.
        m.d.sync += [
            self.active.eq((self.active | now.started) & ~now.finish),
            self.fresh.eq((self.fresh | now.start_root | self.begins) & ~now.popped),
            self.ended.eq((self.ended & ~now.start) | now.node_fail | now.leaf_end),
            self.failing.eq((self.failing & ~now.start) | now.node_fail | now.leaf_fail),
            self.by_leaf.eq((self.by_leaf & ~now.start) | (now.leaf_fail & ~now.node_fail)),
            self.restart.eq((self.restart | now.node_restart) & ~self.begins & ~now.leaf_end),
            self.strict.eq((self.strict & ~now.start) | now.start_strict | self.begins),
            self.near.eq((((self.near & ~now.met) | now.met_near) & ~now.node_push) | now.node_push_near),
        ]
        # The end of a visit counts a cycle late, when all else that follows from it has happened.
        visits = list[Value](self.outstanding.planes)
        for name, over in (("dropped", now.dropped), ("node", now.node_end), ("leaf", now.leaf)):
            ended_visits = Signal(len(over), name=f"{name}_visits_over")
            m.d.sync += ended_visits.eq(over)
            visits = minus(visits, ended_visits)
        self.outstanding.become(m, plus(visits, now.popped))
        self.pending.become(m, minus(plus(self.pending.planes, now.node_push), now.written))
        emptied = now.node_fail | now.node_restart | now.leaf_end
        entries = minus(self.height.planes, now.popped & ~self.fresh)
        entries = replace(entries, now.node_push, now.new_height)
        self.height.become(m, replace(entries, emptied, Const(0, len(self.height.planes))))
