"""The control of a traversal unit: what each ray does next.

A visit of a ray is counted from the request for its block until all that follows from it has happened. The result of a
node sends the ray on to its nearest child and puts the rest on its stack; a ray with fewer visits under way than it may
have takes another from its stack.
"""

from amaranth import Const, Module, Mux, Signal, Value
from amaranth.lib import data, stream, wiring
from amaranth.lib.wiring import In, Out

from lightloom.rtl.config import Config
from lightloom.rtl.fabric.counters import Counter
from lightloom.rtl.fabric.one_hot import next_of, number_of
from lightloom.rtl.traversal.free_contexts import FreeContexts
from lightloom.rtl.traversal.masks import one_hot, only_if
from lightloom.rtl.traversal.node_decision import NodeDecision
from lightloom.rtl.traversal.popped_visits import PoppedVisits
from lightloom.rtl.traversal.rays import Events, Rays
from lightloom.rtl.traversal.records import (
    ADDRESS_BITS,
    ERROR_BITS,
    Ports,
    failure,
    leaf_visit,
    node_result,
    node_visit,
    strobe,
)
from lightloom.rtl.traversal.run_ahead import RunAhead
from lightloom.rtl.traversal.stacks import Stacks

SURE = 2
"""Visits of a ray under way up to which the next one may be any; beyond, only one that is near."""


class Control(wiring.Component):
    """Contexts, stacks and requests (docs/traversal_unit.md).

    Ports:

    - `start`: stream, a ray wants a context; `skip`: it has nothing to traverse. It gets `start_context`.
    - `started`: strobe, the ray's visits may begin.
    - `node`: stream of `node_result`.
    - `leaf`: strobe, a visited block of triangles; `hit` ends the ray, `error` (TRACE_ERRORS) makes it fail.
    - `node_request`, `leaf_request`: streams of visits. Whoever takes them has room for `contexts * overlap` of each.
    - `near_leaf`: strobe, a block of triangles that is likely to be visited soon (`rtl.traversal.stacks`).
    - `time_read`: how far the ray's best hit is, asked of the leaf stage.
    - `failed`: two strobes, of the node's and of the leaf's side: why a ray has failed, once a ray; both in one cycle
      where a node and a leaf of it fail together, and then the node's counts.
    - `finished`: stream of rays that are done; `failed`, and `by_leaf`: which side's strobe says why.
    - `release`: strobe, the context is free again.
    - `root`, `levels` of the tree; `overlap`: greatest number of visits of a ray under way (0 stands for 1).
    - `backlog`: requests wait in front of a cache, or many reads for the memory. `starved`: in this cycle the node test
      has none to test. They say whether a ray may have several visits under way (`rtl.traversal.run_ahead`); its
      results do not depend on them.
    - `idle`: no ray is in a context.
    - `visit`, `revisit`: a node was visited, with a rank above 0. What is wrong with a block makes it no visit.
    """

    COUNTERS = (
        Counter("node_tests", "nodes visited", lambda control: control.visit),
        Counter("revisits", "nodes visited again, for the rest of their children", lambda control: control.revisit),
    )

    def __init__(self, config: Config):
        self._config = config
        context = config.traversal.context_bits
        node_visits, leaf_visits = node_visit(config), leaf_visit(config)
        ports = Ports(config)
        leaf = data.StructLayout({**leaf_visits.members, "hit": 1, "error": ERROR_BITS})
        finished = data.StructLayout({"context": context, "failed": 1, "by_leaf": 1})
        super().__init__(
            {
                "start": In(stream.Signature(data.StructLayout({"skip": 1}))),
                "start_context": Out(context),
                "started": In(ports.started),
                "node": In(stream.Signature(node_result(config))),
                "leaf": In(strobe(leaf)),
                "node_request": Out(stream.Signature(node_visits)),
                "leaf_request": Out(stream.Signature(leaf_visits)),
                "near_leaf": Out(strobe(data.StructLayout({"address": ADDRESS_BITS}))),
                "time_read": Out(ports.time_read),
                "failed": Out(strobe(failure(config))).array(2),
                "finished": Out(stream.Signature(finished)),
                "release": In(ports.started),
                "root": In(ADDRESS_BITS),
                "levels": In(8),
                "overlap": In(config.traversal.overlap_bits),
                "backlog": In(1),
                "starved": In(1),
                "idle": Out(1),
                "visit": Out(1),
                "revisit": Out(1),
            }
        )

    def elaborate(self, platform: object) -> Module:
        m = Module()
        config, contexts = self._config, self._config.traversal.contexts
        rays = Rays(m, config)
        m.submodules.stacks = stacks = Stacks(config)
        m.submodules.decision = decision = NodeDecision(config)
        m.submodules.pops = pops = PoppedVisits(config)
        m.submodules.run_ahead = run_ahead = RunAhead()
        m.submodules.free_contexts = free = FreeContexts(config)
        wiring.connect(m, stacks.near_leaf, wiring.flipped(self.near_leaf))
        wiring.connect(m, decision.push, stacks.push)
        wiring.connect(m, pops.read, stacks.read)
        wiring.connect(m, pops.time_read, wiring.flipped(self.time_read))
        wiring.connect(m, wiring.flipped(self.node), decision.node)
        wiring.connect(m, decision.failed, wiring.flipped(self.failed[0]))
        m.d.comb += [
            decision.levels.eq(self.levels),
            decision.is_dead.eq((decision.context & rays.dead).any()),
            decision.is_strict.eq((decision.context & rays.strict).any()),
            decision.height.eq(rays.height.of(decision.context)),
            decision.is_near.eq((decision.context & rays.near).any()),
            self.visit.eq(decision.visit),
            self.revisit.eq(decision.revisit),
            pops.root.eq(self.root),
            pops.is_dead.eq((pops.met & rays.dead).any()),
            run_ahead.backlog.eq(self.backlog | stacks.backlog),
            run_ahead.starved.eq(self.starved),
            run_ahead.nodes_waiting.eq(pops.nodes_waiting),
            free.take.eq(self.start.valid),
            self.start.ready.eq(free.reserved_valid),
            self.start_context.eq(free.reserved_number),
            free.released.eq(only_if(self.release.valid, one_hot(self.release.context, contexts))),
            self.idle.eq(free.idle),
        ]
        self._request(m, decision, pops)
        rays.become(m, self._events(m, rays, stacks, decision, pops, free, run_ahead.allowed))
        return m

    def _events(
        self,
        m: Module,
        rays: Rays,
        stacks: Stacks,
        decision: NodeDecision,
        pops: PoppedVisits,
        free: FreeContexts,
        may_run_ahead: Value,
    ) -> Events:
        """What happens to rays in this cycle, by context."""
        contexts = self._config.traversal.contexts
        leaf, leaf_end = self._leaf(m, rays)
        return Events(
            start=free.start,
            start_root=only_if(~self.start.payload.skip, free.start),
            start_strict=only_if(self.overlap <= 1, free.start),
            started=only_if(self.started.valid, one_hot(self.started.context, contexts)),
            popped=self._choose(m, rays, decision, pops, may_run_ahead),
            met=pops.met,
            met_near=only_if(pops.near_below, pops.met),
            dropped=only_if(pops.dropped, pops.met),
            node_push=decision.pushes,
            node_push_near=only_if(decision.new_near, decision.pushes),
            new_height=decision.new_height,
            node_end=decision.ends,
            node_fail=decision.fails,
            node_restart=decision.restarts,
            written=only_if(stacks.written.valid, one_hot(stacks.written.context, contexts)),
            leaf=leaf,
            leaf_end=leaf_end,
            leaf_fail=only_if(self.leaf.payload.error != 0, leaf_end),
            finish=self._finish(m, rays),
        )

    def _request(self, m: Module, decision: NodeDecision, pops: PoppedVisits) -> None:
        """Requests: first those that follow from the result of a node, which must never wait."""
        for request, forward, waiting in (
            (self.node_request, decision.forward_node, pops.node),
            (self.leaf_request, decision.forward_leaf, pops.leaf),
        ):
            m.d.comb += [
                waiting.ready.eq(~forward.valid),
                request.valid.eq(forward.valid | waiting.valid),
                request.payload.eq(Mux(forward.valid, forward.payload, waiting.payload)),
            ]

    def _leaf(self, m: Module, rays: Rays) -> tuple[Signal, Signal]:
        """The ray of which a visit of a leaf is over, and that again if this ends the ray."""
        contexts = self._config.traversal.contexts
        leaf: data.View = self.leaf.payload
        visited = Signal(contexts, name="leaf_context")
        ends = Signal(contexts, name="leaf_ends")
        m.d.comb += [
            visited.eq(only_if(self.leaf.valid, one_hot(leaf.context, contexts))),
            ends.eq(only_if(leaf.hit | (leaf.error != 0), visited) & ~rays.ended),
            self.failed[1].valid.eq(ends.any() & (leaf.error != 0)),
            self.failed[1].payload.context.eq(leaf.context),
            self.failed[1].payload.error.eq(leaf.error),
            self.failed[1].payload.block.eq(leaf.address),
        ]
        return visited, ends

    def _choose(
        self, m: Module, rays: Rays, decision: NodeDecision, pops: PoppedVisits, may_run_ahead: Value
    ) -> Signal:
        """The ray of which a visit is chosen: of the root, or the top of its stack."""
        config, contexts = self._config, self._config.traversal.contexts
        overlap = Signal(range(config.traversal.overlap + 1))
        m.d.comb += overlap.eq(Mux(self.overlap > config.traversal.overlap, config.traversal.overlap, self.overlap))
        # What a ray visits before its nearer visits are over may turn out to be needless: it is chosen only while a
        # test would have nothing to do otherwise, and beyond SURE only if it is likely to be needed all the same.
        likely = rays.near | rays.outstanding.below(Const(SURE))
        ahead = only_if(may_run_ahead, ~rays.strict & rays.outstanding.below(overlap) & likely)
        room = ~rays.some_outstanding | ahead
        # A stack that a list is being written to, or that the result of a node may change in this cycle, has to wait.
        readable = rays.some_height & ~rays.some_pending & ~decision.context
        waiting = Signal(contexts)
        choose = Signal()
        popped = Signal(contexts)
        chosen = next_of(m, "pop", waiting, choose)
        m.d.comb += [
            waiting.eq(rays.active & ~rays.dead & (rays.fresh | (readable & room))),
            choose.eq(pops.room & waiting.any()),
            popped.eq(only_if(choose, chosen)),
            pops.chosen.valid.eq(choose),
            pops.chosen.payload.context.eq(number_of(chosen)),
            pops.chosen.payload.position.eq(rays.height.of(chosen) - 1),
            pops.chosen.payload.fresh.eq((chosen & rays.fresh).any()),
        ]
        return popped

    def _finish(self, m: Module, rays: Rays) -> Signal:
        """The ray that goes into the register of `finished`, if that is empty or is emptied."""
        moves = Signal()
        finished = Signal(self.finished.payload.shape(), reset_less=True)
        finish = Signal(self._config.traversal.contexts)
        chosen = next_of(m, "finish", rays.done, moves & rays.done.any())
        m.d.comb += [
            moves.eq(~self.finished.valid | self.finished.ready),
            finish.eq(only_if(moves, chosen)),
            self.finished.payload.eq(finished),
        ]
        with m.If(moves):
            m.d.sync += [
                self.finished.valid.eq(rays.done.any()),
                finished.context.eq(number_of(chosen)),
                finished.failed.eq((chosen & rays.failing).any()),
                finished.by_leaf.eq((chosen & rays.by_leaf).any()),
            ]
        return finish
