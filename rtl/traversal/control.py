"""The control of a traversal unit: what each ray does next.

A visit of a ray is counted from the request for its block until all that follows from it has happened. The result of a
node sends the ray on to its nearest child and puts the rest on its stack; a ray with fewer visits under way than it may
have takes another from its stack.
"""

from amaranth import Cat, Const, Module, Mux, Signal, Value, signed
from amaranth.lib import data, stream, wiring
from amaranth.lib.fifo import SyncFIFO
from amaranth.lib.wiring import In, Out

from lightloom.golden_model.contract.formats import TIME_BITS, TRACE_ERRORS, WIDTH
from lightloom.rtl.config import Config
from lightloom.rtl.fabric.one_hot import lowest, next_of, number_of
from lightloom.rtl.fabric.queues import Buffer
from lightloom.rtl.traversal.masks import Counts, minus, one_hot, plus, replace
from lightloom.rtl.traversal.records import (
    ADDRESS_BITS,
    ERROR_BITS,
    RANK_BITS,
    Ports,
    context_bits,
    failure,
    height_bits,
    leaf_visit,
    node_result,
    node_visit,
    strobe,
)
from lightloom.rtl.traversal.stacks import LISTS, Stacks

POPS = 6
"""Visits on their way from the stacks to a request: three in registers, the others wait for their turn. One a cycle
needs five."""
FEW = 2
"""Visits of nodes that may wait for their turn while others are chosen that may turn out to be needless."""
WINDOW = 8
"""Cycles for which a cycle without a node to test is remembered."""
SURE = 2
"""Visits of a ray under way up to which the next one may be any; beyond, only one that is near."""
NEAR_BITS = TIME_BITS - 8
"""Two distances are near each other if their highest 8 bits, those above these, are the same."""


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
      has none to test. They say whether a ray may have several visits under way (`calm` below); its results do not
      depend on them.
    - `idle`: no ray is in a context.
    - `visit`, `revisit`: a node was visited, with a rank above 0. What is wrong with a block makes it no visit.
    """

    def __init__(self, config: Config):
        self._config = config
        context = context_bits(config)
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
                "overlap": In(config.overlap.bit_length()),
                "backlog": In(1),
                "starved": In(1),
                "idle": Out(1),
                "visit": Out(1),
                "revisit": Out(1),
            }
        )

    def elaborate(self, platform: object) -> Module:
        m = Module()
        config, contexts = self._config, self._config.contexts
        m.submodules.stacks = stacks = Stacks(config)
        wiring.connect(m, stacks.near_leaf, wiring.flipped(self.near_leaf))

        # --- a bit a context ----------------------------------------------------------------------------------------
        taken = Signal(contexts)  # holds a ray
        active = Signal(contexts)  # its visits may begin, and the ray is not finished
        fresh = Signal(contexts)  # the root is to be visited
        ended = Signal(contexts)  # an any-hit ray has its hit, or the ray has failed; what is under way counts no more
        failing = Signal(contexts)
        by_leaf = Signal(contexts)
        restart = Signal(contexts)  # as ended, but then it begins again, strictly
        strict = Signal(contexts)  # one visit at a time
        near = Signal(contexts)  # the top of the stack is near the visit that was made instead of it
        outstanding = Counts("outstanding", contexts, config.overlap)
        height = Counts("height", contexts, config.stack)
        pending = Counts("pending", contexts, LISTS)  # lists on their way to the stack

        def mask(name: str, value: Value) -> Signal:
            result = Signal(contexts, name=name)
            m.d.comb += result.eq(value)
            return result

        def only_if(condition: Value, context: Value) -> Value:
            return context & condition.replicate(contexts)

        # --- the result of a node -----------------------------------------------------------------------------------
        # The buffer keeps what is decided here apart from the node stage, which stops as a whole. The ray's mask is
        # decoded in front of it: behind it, all that is decided in this cycle would wait for the decoder.
        kept = data.StructLayout({"result": node_result(config), "mask": contexts})
        m.submodules.results = results = Buffer(kept)
        node: data.View = results.o.payload.result
        node_take = Signal()
        m.d.comb += [
            results.i.valid.eq(self.node.valid),
            self.node.ready.eq(results.i.ready),
            results.i.payload.result.eq(self.node.payload),
            results.i.payload.mask.eq(one_hot(self.node.payload.context, contexts)),
            results.o.ready.eq(stacks.push.ready),
            node_take.eq(results.o.valid & stacks.push.ready),
        ]
        node_context = mask("node_context", only_if(results.o.valid, results.o.payload.mask))
        here = Signal(height_bits(config))  # the height of the ray's stack
        rest = Signal(4)  # children beside the nearest
        above = Signal(range(config.stack + 8))  # the height with all of them
        spare = Signal(signed(9))  # entries beyond those that the levels of the tree need; as constant as the tree
        fits = Signal()  # above + levels <= stack
        m.d.sync += spare.eq(config.stack - self.levels)
        m.d.comb += [
            here.eq(height.of(node_context)),
            rest.eq(node.hits.count - node.rank - 1),
            above.eq(here + rest),
            fits.eq(here <= spare - rest),
        ]
        forward, push, again, fail, begin_again = (
            Signal(name=name) for name in ("forward", "push", "again", "fail", "begin_again")
        )
        node_error = Signal(ERROR_BITS)
        m.d.comb += node_error.eq(node.error)
        dead = mask("dead", ended | restart)
        with m.If(~(node_context & dead).any()):
            with m.If(node.error != 0):
                m.d.comb += fail.eq(1)
            with m.Elif(node.hits.count > node.rank):
                with m.If(rest == 0):
                    m.d.comb += forward.eq(1)
                with m.Elif(fits):
                    m.d.comb += [forward.eq(1), push.eq(1)]
                with m.Elif(here != config.stack):
                    m.d.comb += [forward.eq(1), push.eq(1), again.eq(1)]
                with m.Elif((node_context & strict).any()):
                    # One visit at a time never needs more than `levels` entries: the header is wrong.
                    m.d.comb += [fail.eq(1), node_error.eq(TRACE_ERRORS["header"])]
                with m.Else():
                    m.d.comb += begin_again.eq(1)
        slot = node.hits.slot[node.rank]
        forward_leaf = Signal()
        forward_node = Signal()
        forward_address = Signal(ADDRESS_BITS)
        m.d.comb += [
            forward_leaf.eq(node_take & forward & node.leaf.bit_select(slot, 1)),
            forward_node.eq(node_take & forward & ~node.leaf.bit_select(slot, 1)),
            forward_address.eq(node.base + slot),
        ]
        nearness = Signal(WIDTH)
        cells = [node.hits.entry[k][NEAR_BITS:] for k in range(WIDTH)]
        m.d.comb += nearness.eq(Cat(cell == node.hits.entry[node.rank][NEAR_BITS:] for cell in cells))
        item: data.View = stacks.push.payload
        m.d.comb += [
            stacks.push.valid.eq(node_take & push),
            item.context.eq(node.context),
            item.height.eq(here),
            item.first.eq(node.rank + 1),
            item.last.eq(Mux(again, node.rank + 1, node.hits.count - 1)),
            item.again.eq(again),
            item.base.eq(Mux(again, node.address, node.base)),
            item.leaf.eq(node.leaf),
            item.slot.eq(node.hits.slot),
            item.entry.eq(node.hits.entry),
            item.near.eq(nearness),
            item.near_below.eq((node_context & near).any()),
        ]
        node_push = mask("node_push", only_if(node_take & push, node_context))
        node_end = mask("node_end", only_if(node_take & ~forward, node_context))
        node_fail = mask("node_fail", only_if(node_take & fail, node_context))
        node_restart = mask("node_restart", only_if(node_take & begin_again, node_context))
        m.d.comb += [
            self.visit.eq(node_take & (node.error == 0)),
            self.revisit.eq(self.visit & (node.rank != 0)),
            self.failed[0].valid.eq(node_take & fail),
            self.failed[0].payload.context.eq(node.context),
            self.failed[0].payload.error.eq(node_error),
            self.failed[0].payload.block.eq(node.address),
        ]

        # --- the end of a leaf --------------------------------------------------------------------------------------
        leaf: data.View = self.leaf.payload
        leaf_context = mask("leaf_context", only_if(self.leaf.valid, one_hot(leaf.context, contexts)))
        leaf_ends = mask("leaf_ends", only_if(leaf.hit | (leaf.error != 0), leaf_context) & ~ended)
        m.d.comb += [
            self.failed[1].valid.eq(leaf_ends.any() & (leaf.error != 0)),
            self.failed[1].payload.context.eq(leaf.context),
            self.failed[1].payload.error.eq(leaf.error),
            self.failed[1].payload.block.eq(leaf.address),
        ]

        # --- visits from the stacks: choose, read, wait for their turn ----------------------------------------------
        overlap = Signal(range(config.overlap + 1))
        m.d.comb += overlap.eq(Mux(self.overlap > config.overlap, config.overlap, self.overlap))
        some_height, some_outstanding, some_pending = (
            mask(name, counts.some())
            for name, counts in (("some_height", height), ("some_outstanding", outstanding), ("some_pending", pending))
        )
        # What a ray visits before its nearer visits are over may turn out to be needless: it is chosen only while a
        # test would have nothing to do otherwise, and beyond SURE only if it is likely to be needed all the same.
        calm = Signal()
        likely = near | outstanding.below(Const(SURE))
        room = ~some_outstanding | only_if(calm, ~strict & outstanding.below(overlap) & likely)
        # A stack that a list is being written to, or that the result of a node may change in this cycle, has to wait.
        waiting = mask("waiting", active & ~dead & (fresh | (some_height & room & ~some_pending & ~node_context)))
        under_way = Signal(range(POPS + 1))
        choose = Signal()
        popped = Signal(2)
        m.d.comb += choose.eq((under_way < POPS) & waiting.any())
        m.d.sync += under_way.eq(under_way + choose - popped)
        chosen = next_of(m, "pop", waiting, choose)
        pop = mask("pop", only_if(choose, chosen))

        # From the choice to the queue nothing waits. So the entry is read in the next cycle, before any list of the
        # same ray that comes after the choice is written over it.
        pop_layout = data.StructLayout({"context": context_bits(config), "position": height_bits(config), "fresh": 1})
        asked = Signal(pop_layout, reset_less=True)
        read = Signal(pop_layout, reset_less=True)
        asked_valid = Signal()
        read_valid = Signal()
        m.d.sync += [
            asked_valid.eq(choose),
            asked.context.eq(number_of(chosen)),
            asked.position.eq(height.of(chosen) - 1),
            asked.fresh.eq((chosen & fresh).any()),
            read_valid.eq(asked_valid),
            read.eq(asked),
        ]
        m.d.comb += [
            stacks.read.en.eq(asked_valid),
            stacks.read.context.eq(asked.context),
            stacks.read.position.eq(asked.position),
            self.time_read.context.eq(asked.context),
        ]
        # What comes out of the RAM is compared and no more; the cycle after that decides.
        entry: data.View = stacks.read.entry
        met = Signal(
            data.StructLayout({**node_visit(config).members, "leaf": 1, "beyond": 1, "near_below": 1}), reset_less=True
        )
        met_valid = Signal()
        m.d.sync += [
            met_valid.eq(read_valid),
            met.context.eq(read.context),
            met.address.eq(Mux(read.fresh, self.root, entry.address)),
            met.rank.eq(Mux(read.fresh, 0, entry.rank)),
            met.leaf.eq(~read.fresh & entry.leaf),
            met.beyond.eq(~read.fresh & (entry.entry > self.time_read.time)),
            met.near_below.eq(~read.fresh & entry.near_below),
        ]
        met_context = mask("met_context", only_if(met_valid, one_hot(met.context, contexts)))
        drop = Signal()
        m.d.comb += drop.eq(met_valid & (met.beyond | (met_context & dead).any()))

        # A leaf does not wait behind a node, nor a node behind a leaf: that would cost the other's test a cycle.
        node_waits = Signal(node_visit(config))
        leaf_waits = Signal(leaf_visit(config))
        pop_node = Signal()
        pop_leaf = Signal()
        m.submodules.node_pops = node_pops = SyncFIFO(width=len(Value.cast(node_waits)), depth=POPS)
        m.submodules.leaf_pops = leaf_pops = SyncFIFO(width=len(Value.cast(leaf_waits)), depth=POPS)
        m.d.comb += [
            node_pops.w_data.eq(Cat(met[name] for name in node_visit(config).members)),
            node_pops.w_en.eq(met_valid & ~drop & ~met.leaf),
            node_pops.r_en.eq(~forward_node),
            Value.cast(node_waits).eq(node_pops.r_data),
            pop_node.eq(node_pops.r_rdy),
            leaf_pops.w_data.eq(Cat(met[name] for name in leaf_visit(config).members)),
            leaf_pops.w_en.eq(met_valid & ~drop & met.leaf),
            leaf_pops.r_en.eq(~forward_leaf),
            Value.cast(leaf_waits).eq(leaf_pops.r_data),
            pop_leaf.eq(leaf_pops.r_rdy),
            popped.eq(drop + (pop_node & ~forward_node) + (pop_leaf & ~forward_leaf)),
        ]

        # --- whether visits may be chosen that may turn out to be needless ------------------------------------------
        recent = Signal(range(WINDOW + 1))
        m.d.sync += recent.eq(Mux(self.starved, WINDOW, recent - (recent != 0)))
        m.d.sync += calm.eq(~self.backlog & ((node_pops.level < FEW) | (recent != 0)))

        # --- requests: first those of nodes, which must never wait --------------------------------------------------
        m.d.comb += [
            self.node_request.valid.eq(forward_node | pop_node),
            self.node_request.payload.context.eq(Mux(forward_node, node.context, node_waits.context)),
            self.node_request.payload.address.eq(Mux(forward_node, forward_address, node_waits.address)),
            self.node_request.payload.rank.eq(Mux(forward_node, 0, node_waits.rank)),
            self.leaf_request.valid.eq(forward_leaf | pop_leaf),
            self.leaf_request.payload.context.eq(Mux(forward_leaf, node.context, leaf_waits.context)),
            self.leaf_request.payload.address.eq(Mux(forward_leaf, forward_address, leaf_waits.address)),
        ]

        # --- a ray takes a context, and gives it back ---------------------------------------------------------------
        # The context for the next ray is known a cycle before.
        reserved = Signal(contexts)
        reserved_valid = Signal()
        reserved_number = Signal(context_bits(config))
        free = mask("free", ~taken & ~reserved)
        first_free = mask("first_free", lowest(m, "free", free))
        start_take = Signal()
        m.d.comb += [
            self.start.ready.eq(reserved_valid),
            self.start_context.eq(reserved_number),
            start_take.eq(self.start.valid & self.start.ready),
            self.idle.eq(~taken.any()),
        ]
        with m.If(start_take | ~reserved_valid):
            m.d.sync += [
                reserved.eq(first_free),
                reserved_valid.eq(free.any()),
                reserved_number.eq(number_of(first_free)),
            ]
        start = mask("start", only_if(start_take, reserved))
        started = mask("started_context", only_if(self.started.valid, one_hot(self.started.context, contexts)))
        released = mask("released", only_if(self.release.valid, one_hot(self.release.context, contexts)))
        settled = mask("settled", ~some_outstanding & ~some_pending)
        done = mask("done", active & settled & ~some_height & ~fresh & ~restart)
        finish_moves = Signal()
        m.d.comb += finish_moves.eq(~self.finished.valid | self.finished.ready)
        finishing = next_of(m, "finish", done, finish_moves & done.any())
        finished = Signal(self.finished.payload.shape(), reset_less=True)
        with m.If(finish_moves):
            m.d.sync += [
                self.finished.valid.eq(done.any()),
                finished.context.eq(number_of(finishing)),
                finished.failed.eq((finishing & failing).any()),
                finished.by_leaf.eq((finishing & by_leaf).any()),
            ]
        m.d.comb += self.finished.payload.eq(finished)
        finish = mask("finish", only_if(finish_moves, finishing))

        # --- what becomes of it all ---------------------------------------------------------------------------------
        begins = mask("begins", restart & settled)
        emptied = node_fail | node_restart | leaf_ends
        first = only_if(~self.start.payload.skip, start)
        alone = only_if(self.overlap <= 1, start)
        pushed_near = only_if(nearness.bit_select((node.rank + 1)[:RANK_BITS], 1), node_push)
        m.d.sync += [
            taken.eq((taken | start) & ~released),
            active.eq((active | started) & ~finish),
            fresh.eq((fresh | first | begins) & ~pop),
            ended.eq((ended & ~start) | node_fail | leaf_ends),
            failing.eq((failing & ~start) | node_fail | only_if(leaf.error != 0, leaf_ends)),
            by_leaf.eq((by_leaf & ~start) | (only_if(leaf.error != 0, leaf_ends) & ~node_fail)),
            restart.eq((restart | node_restart) & ~begins & ~leaf_ends),
            strict.eq((strict & ~start) | alone | begins),
            near.eq((Mux(met.near_below, near | met_context, near & ~met_context) & ~node_push) | pushed_near),
        ]
        # The end of a visit counts a cycle late, when all else that follows from it has happened.
        visits = list[Value](outstanding.planes)
        for name, over in (("dropped", only_if(drop, met_context)), ("node", node_end), ("leaf", leaf_context)):
            ended_visits = Signal(contexts, name=f"{name}_visits_over")
            m.d.sync += ended_visits.eq(over)
            visits = minus(visits, ended_visits)
        outstanding.become(m, plus(visits, pop))
        lists = plus(pending.planes, node_push)
        written = one_hot(stacks.written.context, contexts)
        pending.become(m, minus(lists, only_if(stacks.written.valid, written)))
        entries = minus(height.planes, pop & ~fresh)
        entries = replace(entries, node_push, Mux(again, here + 1, above))
        height.become(m, replace(entries, emptied, Const(0, len(height.planes))))
        return m
