"""The control of a traversal unit among stages that answer at random: every ray is finished once, within its limits."""

import random
from collections import defaultdict
from functools import cache
from typing import Any

import pytest

from lightloom.golden_model.contract.formats import TIME_BITS, TRACE_ERRORS, WIDTH
from lightloom.rtl.config import Config
from lightloom.rtl.traversal.control import SURE, Control
from lightloom.rtl.traversal.node_decision import NEAR_BITS
from lightloom.rtl.traversal.popped_visits import POPS, PoppedVisits
from lightloom.rtl.traversal.run_ahead import FEW, WINDOW
from tests.rtl.simulation import Simulation, simulate

SEED = 1984
RAYS = 120
VISITS = 12
"""Of a ray, after which its nodes have no more children."""
PATIENCE = 400
"""Cycles in which something must happen."""
SMALL = Config.of(contexts=4, overlap=3, stack=6)


@cache
def compiled() -> tuple[Control, Simulation]:
    """The control, also in a simulator."""
    dut = Control(SMALL)
    return dut, Simulation(dut)


class Surroundings:
    """What is under way between the control and the stages, and what has become of the rays."""

    def __init__(self, dut: Control, overlap: int) -> None:
        self.dut, self.overlap = dut, overlap
        self.rng = random.Random(SEED + overlap)
        self.starting: list[int] = []  # contexts with a ray whose visits may not begin yet
        self.nodes: list[tuple[int, int, int]] = []  # visits: context, address, rank
        self.leaves: list[tuple[int, int]] = []
        self.visits: dict[int, int] = {}  # of each ray in a context, so far
        self.failed: dict[int, bool] = defaultdict(bool)
        self.leaving: list[int] = []  # contexts of rays that are finished
        self.offered = -1  # the visit whose result is offered
        self.finished = self.most = 0
        self.log: list[tuple[int, ...]] = []  # every visit and every ray that is finished, in their order

    def under_way(self, context: int) -> int:
        return sum(visit[0] == context for visit in [*self.nodes, *self.leaves])

    def offer_node(self, ctx: Any) -> None:
        """The result of a visit, which stays until it is taken."""
        if self.offered >= 0 or not self.nodes or self.rng.random() < 0.4:
            return
        self.offered = self.rng.randrange(len(self.nodes))
        context, address, rank = self.nodes[self.offered]
        result, rng = self.dut.node.payload, self.rng
        self.visits[context] += 1
        enough = self.visits[context] > VISITS
        ctx.set(result.context, context)
        ctx.set(result.address, address)
        ctx.set(result.rank, rank)
        ctx.set(result.error, TRACE_ERRORS["memory"] if rng.random() < 0.02 else 0)
        ctx.set(result.base, rng.getrandbits(20))
        ctx.set(result.leaf, rng.getrandbits(WIDTH))
        ctx.set(result.hits.count, 0 if enough else rng.choice([0, 1, 1, 2, 3, 4]))
        ctx.set(self.dut.node.valid, 1)

    def offer_leaf(self, ctx: Any) -> None:
        some = bool(self.leaves) and self.rng.random() < 0.4
        ctx.set(self.dut.leaf.valid, some)
        if some:
            context, address = self.leaves.pop(self.rng.randrange(len(self.leaves)))
            leaf = self.dut.leaf.payload
            ctx.set(leaf.context, context)
            ctx.set(leaf.address, address)
            ctx.set(leaf.hit, self.rng.random() < 0.05)
            ctx.set(leaf.error, TRACE_ERRORS["kind"] if self.rng.random() < 0.02 else 0)

    def strobe(self, ctx: Any, port: Any, contexts: list[int]) -> None:
        """One of the contexts, now and then."""
        some = bool(contexts) and self.rng.random() < 0.3
        ctx.set(port.valid, some)
        if some:
            ctx.set(port.context, contexts.pop(0))

    def see(self, ctx: Any) -> bool:
        """What the control does in this cycle; whether it is anything."""
        dut, moved = self.dut, False
        where = f"seed {SEED}, overlap {self.overlap}"
        for side in dut.failed:
            if ctx.get(side.valid):
                context = ctx.get(side.payload.context)
                assert not self.failed[context], f"{where}: a ray fails twice"
                self.failed[context] = moved = True
        if ctx.get(dut.node.valid) and ctx.get(dut.node.ready):
            self.nodes.pop(self.offered)
            self.offered, moved = -1, True
        for request, visits in ((dut.node_request, self.nodes), (dut.leaf_request, self.leaves)):
            if ctx.get(request.valid):
                payload = request.payload
                visit: Any = (ctx.get(payload.context), ctx.get(payload.address))
                assert visit[0] in self.visits, f"{where}: a visit of no ray"
                visits.append((*visit, ctx.get(payload.rank)) if visits is self.nodes else visit)
                self.log.append(visits[-1])
                self.most = max(self.most, self.under_way(visit[0]))
                moved = True
        if ctx.get(dut.finished.valid) and ctx.get(dut.finished.ready):
            context = ctx.get(dut.finished.payload.context)
            assert context in self.visits, f"{where}: a ray that is not there is finished"
            assert not self.under_way(context), f"{where}: a ray is finished before its visits"
            assert ctx.get(dut.finished.payload.failed) == self.failed.pop(context, False), where
            del self.visits[context]
            self.leaving.append(context)
            self.log.append((context,))
            self.finished += 1
            moved = True
        assert self.most <= self.overlap, f"{where}: {self.most} visits of a ray under way"
        return moved


@pytest.mark.parametrize("overlap", [1, 2, 3])
def test_every_ray_is_finished_once(overlap: int) -> None:
    assert finish_all(overlap).most == overlap, "fewer visits at a time than there may be"


def test_no_visit_at_a_time_stands_for_one() -> None:
    assert finish_all(0).log == finish_all(1).log, f"seed {SEED}"


def finish_all(asked: int) -> Surroundings:
    """What has become of all rays, with `overlap` as it is asked for."""
    dut, simulation = compiled()
    overlap = max(asked, 1)
    around = Surroundings(dut, overlap)
    rng = around.rng

    async def testbench(ctx: Any) -> None:
        ctx.set(dut.overlap, asked)
        ctx.set(dut.levels, 2)
        ctx.set(dut.root, 1)
        ctx.set(dut.time_read.time, (1 << TIME_BITS) - 1)  # nothing is beyond the best hit
        ctx.set(dut.node_request.ready, 1)
        ctx.set(dut.leaf_request.ready, 1)
        for slot in range(WIDTH):
            ctx.set(dut.node.payload.hits.slot[slot], slot)
        sent = idle = 0
        while around.finished < RAYS:
            ctx.set(dut.start.valid, sent < RAYS and rng.random() < 0.5)
            ctx.set(dut.finished.ready, rng.random() < 0.5)
            ctx.set(dut.node.valid, around.offered >= 0)
            ctx.set(dut.backlog, rng.random() < 0.3)
            ctx.set(dut.starved, rng.random() < 0.1)
            around.offer_node(ctx)
            around.offer_leaf(ctx)
            around.strobe(ctx, dut.started, around.starting)
            around.strobe(ctx, dut.release, around.leaving)
            if ctx.get(dut.start.valid) and ctx.get(dut.start.ready):
                context = ctx.get(dut.start_context)
                assert context not in around.visits, f"seed {SEED}, overlap {overlap}: context {context} is taken"
                around.visits[context], sent = 0, sent + 1
                around.starting.append(context)
            idle = 0 if around.see(ctx) else idle + 1
            assert idle < PATIENCE, f"seed {SEED}, overlap {overlap}: hangs after {around.finished} rays"
            await ctx.tick()
            held = bool(around.visits or around.leaving)
            assert ctx.get(dut.idle) == (not held), f"seed {SEED}, overlap {overlap}: idle, and a context holds a ray"

    simulation.run(testbench)
    return around


@pytest.mark.parametrize(
    ("backlog", "starved", "near", "most"),
    [(1, 1, 1, 1), (0, 1, 0, SURE), (0, 1, 1, SMALL.traversal.overlap), (0, 0, 1, SMALL.traversal.overlap)],
    ids=["while requests wait", "far children", "near children", "nothing waits"],
)
def test_how_far_a_ray_runs_ahead(backlog: int, starved: int, near: int, most: int) -> None:
    """One ray, whose root has more children than there may be visits under way, none of which ever comes back."""
    dut, simulation = compiled()
    asked = 0

    async def testbench(ctx: Any) -> None:
        nonlocal asked
        ctx.set(dut.overlap, SMALL.traversal.overlap)
        ctx.set(dut.levels, 1)
        ctx.set(dut.backlog, backlog)
        ctx.set(dut.starved, starved)
        ctx.set(dut.time_read.time, (1 << TIME_BITS) - 1)
        ctx.set(dut.start.valid, 1)
        await ctx.tick().until(dut.start.ready)
        ctx.set(dut.start.valid, 0)
        ctx.set(dut.started.valid, 1)
        await ctx.tick()
        ctx.set(dut.started.valid, 0)
        await ctx.tick().until(dut.node_request.valid)
        hits = dut.node.payload.hits
        ctx.set(dut.node.payload.base, 2)
        ctx.set(hits.count, SMALL.traversal.overlap + 2)
        for slot in range(WIDTH):
            ctx.set(hits.slot[slot], slot)
            ctx.set(hits.entry[slot], 0 if near else slot << NEAR_BITS)
        ctx.set(dut.node.valid, 1)
        await ctx.tick().until(dut.node.ready)
        ctx.set(dut.node.valid, 0)
        for _ in range(40):
            asked += ctx.get(dut.node_request.valid)
            await ctx.tick()

    simulation.run(testbench)
    assert asked == most


def test_no_ray_has_more_visits_than_there_may_be() -> None:
    """Whatever `overlap` says: of a unit for 2, which has bits for 3, a ray whose node has 4 children."""
    config = Config.of(contexts=2, overlap=2, stack=6)
    dut = Control(config)
    asked = 0

    async def testbench(ctx: Any) -> None:
        nonlocal asked
        ctx.set(dut.node_request.ready, 1)
        await rays_begin(ctx, dut, 1, levels=1)
        ctx.set(dut.overlap, 3)
        ctx.set(dut.backlog, 0)
        await node_result(ctx, dut, 0, 4, 0)
        for _ in range(40):
            asked += ctx.get(dut.node_request.valid)
            await ctx.tick()

    simulate(dut, testbench)
    assert asked == config.traversal.overlap


@pytest.mark.parametrize("leaf", [0, 1])
def test_no_visit_is_lost_while_requests_wait(leaf: int) -> None:
    """Chosen as long as there is room; then all of them come, in their order."""
    dut = PoppedVisits(SMALL)
    turn = dut.leaf if leaf else dut.node
    chosen: list[int] = []
    came: list[int] = []

    async def testbench(ctx: Any) -> None:
        ctx.set(dut.read.entry.leaf, leaf)
        for cycle in range(40):
            ctx.set(turn.ready, cycle >= 20)
            chooses = cycle < 20 and ctx.get(dut.room)
            ctx.set(dut.chosen.valid, chooses)
            if chooses:
                chosen.append(len(chosen) % SMALL.traversal.contexts)
                ctx.set(dut.chosen.payload.context, chosen[-1])
            if ctx.get(turn.valid) and ctx.get(turn.ready):
                came.append(ctx.get(turn.payload.context))
            await ctx.tick()

    simulate(dut, testbench)
    assert len(chosen) == POPS
    assert came == chosen


async def rays_begin(ctx: Any, dut: Control, count: int, *, levels: int) -> None:
    """Rays in contexts from 0 up ask for their roots; nothing is beyond a best hit, and `backlog` is high."""
    for port, value in ((dut.overlap, SMALL.traversal.overlap), (dut.levels, levels), (dut.root, 1), (dut.backlog, 1)):
        ctx.set(port, value)
    ctx.set(dut.time_read.time, (1 << TIME_BITS) - 1)
    for slot in range(WIDTH):
        ctx.set(dut.node.payload.hits.slot[slot], slot)
    ctx.set(dut.start.valid, 1)
    for context in range(count):
        await ctx.tick().until(dut.start.ready)
        ctx.set(dut.started.valid, 1)
        ctx.set(dut.started.context, context)
    ctx.set(dut.start.valid, 0)
    await ctx.tick()
    ctx.set(dut.started.valid, 0)
    await ctx.tick().repeat(20)


async def node_result(ctx: Any, dut: Control, context: int, count: int, leaf: int) -> None:
    """Of a visit, until it is taken: the children are `count` nodes, but leaves where `leaf` has a bit."""
    ctx.set(dut.node.payload.context, context)
    ctx.set(dut.node.payload.hits.count, count)
    ctx.set(dut.node.payload.leaf, leaf)
    ctx.set(dut.node.valid, 1)
    await ctx.tick().until(dut.node.ready)
    ctx.set(dut.node.valid, 0)


def test_one_visit_at_a_time_is_for_the_ray_that_began_again() -> None:
    """Its stack is full, so it begins again, with one visit at a time; the next ray in its context has as many as it
    may. The other contexts are taken all the time."""
    dut, simulation = compiled()
    overlap, root = SMALL.traversal.overlap, 1
    children = overlap + 2

    async def testbench(ctx: Any) -> None:
        async def asked(cycles: int = 40) -> list[int]:
            addresses = []
            for _ in range(cycles):
                if ctx.get(dut.node_request.valid):
                    assert ctx.get(dut.node_request.payload.context) == 0
                    addresses.append(ctx.get(dut.node_request.payload.address))
                await ctx.tick()
            return addresses

        await rays_begin(ctx, dut, SMALL.traversal.contexts, levels=1)
        ctx.set(dut.finished.ready, 1)
        ctx.set(dut.node.payload.base, 100)
        for count in (SMALL.traversal.stack, 2):  # all but one of its places, and the last one
            await node_result(ctx, dut, 0, count, 0)
            assert await asked() == [100]
        await node_result(ctx, dut, 0, 2, 0)
        assert await asked() == [root]
        ctx.set(dut.backlog, 0)
        await node_result(ctx, dut, 0, children, 0)
        assert await asked() == [100], "one visit at a time of a ray that began again"
        for child in range(1, children):
            await node_result(ctx, dut, 0, 0, 0)
            assert await asked() == [100 + child]
        await node_result(ctx, dut, 0, 0, 0)
        for _ in range(10):
            if ctx.get(dut.finished.valid):
                break
            await ctx.tick()
        assert ctx.get(dut.finished.valid)
        assert ctx.get(dut.finished.payload) == {"context": 0, "failed": 0, "by_leaf": 0}

        ctx.set(dut.release.valid, 1)
        await ctx.tick()
        ctx.set(dut.release.valid, 0)
        await rays_begin(ctx, dut, 1, levels=1)
        ctx.set(dut.backlog, 0)
        await node_result(ctx, dut, 0, children, 0)
        assert await asked() == [100, *range(101, 100 + overlap)]

    simulation.run(testbench)


@pytest.mark.parametrize(("starved", "runs_ahead"), [(WINDOW + 1, False), (WINDOW, True), (1, True)])
def test_no_ray_runs_ahead_while_visits_of_nodes_wait(starved: int, runs_ahead: bool) -> None:
    """But it does where the node test was without a node within WINDOW cycles; it is `starved` cycles before it could.

    What a busy ray goes on to holds up FEW visits of others, which have none under way. One more ray has one under way,
    and would run ahead: what it has chosen by the end comes right behind them.
    """
    dut, simulation = compiled()
    busy, *others, ahead = range(FEW + 2)
    asked: list[int] = []

    async def testbench(ctx: Any) -> None:
        await rays_begin(ctx, dut, SMALL.traversal.contexts, levels=2)
        for context in (*others, ahead):
            await node_result(ctx, dut, context, 3, 0b1)  # to a leaf, with two nodes on the stack
        for context in others:
            ctx.set(dut.leaf.payload.context, context)
            ctx.set(dut.leaf.valid, 1)
            await node_result(ctx, dut, busy, 1, 0)
        ctx.set(dut.leaf.valid, 0)
        for cycle in range(30):
            ctx.set(dut.starved, cycle == 20 - starved)
            ctx.set(dut.backlog, cycle < 20)  # until visits wait for their turn
            await node_result(ctx, dut, busy, 1, 0)
        while ctx.get(dut.node_request.valid):
            asked.append(ctx.get(dut.node_request.payload.context))
            await ctx.tick()

    simulation.run(testbench)
    assert asked[: FEW + 1] == [busy, *others]
    assert (ahead in asked) == runs_ahead


def test_no_ray_runs_ahead_while_the_stacks_are_written() -> None:
    """What another ray leaves on its stack, an entry a cycle, delays the visit; a list of one entry does not."""

    def cycles_until_it_runs_ahead(children: int) -> int:
        """From a node of the other ray with so many children."""
        dut, simulation = compiled()
        ahead, other = 0, 1
        taken = []

        async def testbench(ctx: Any) -> None:
            await rays_begin(ctx, dut, 2, levels=1)
            await node_result(ctx, dut, ahead, 3, 0b1)  # to a leaf, with two nodes on the stack
            await ctx.tick().repeat(20)
            await node_result(ctx, dut, other, children, 0b1)
            await ctx.tick()  # it is in front of the stacks
            ctx.set(dut.backlog, 0)
            while not (ctx.get(dut.node_request.valid) and ctx.get(dut.node_request.payload.context) == ahead):
                taken.append(1)
                await ctx.tick()
                assert len(taken) < 50

        simulation.run(testbench)
        return len(taken)

    at_once, *delayed = [cycles_until_it_runs_ahead(children) for children in range(1, 6)]
    assert [cycles - at_once for cycles in delayed] == [0, 1, 2, 3]


@pytest.mark.parametrize(
    ("lists", "at_once", "later"),
    [
        ([(0, [5, 5]), (0, [5, 9])], [101, 1], []),
        ([(0, [5, 9]), (0, [5, 9])], [101], [1]),
        ([(0, [5, 9]), (0, [5, 5])], [101, 1], []),
        ([(0, [5, 5]), (0, [5, 9, 9])], [101], [102, 1]),
        ([(0, [5, 5, 5, 5])], [1, 2], [3]),
        ([(0, [5, 5, 5, 9])], [1, 2], []),
        ([(1, [4, 5, 5, 5])], [2, 3], []),
        ([(1, [5, 4, 5, 5])], [2], [3]),
    ],
    ids=[
        "near below far",
        "far below far",
        "far below near, which stands in for it while it is read",
        "far in place of near",
        "near below two near ones",
        "far below two near ones",
        "near a second child",
        "near the first child, which was visited before",
    ],
)
def test_which_entries_are_near(lists: list[tuple[int, list[int]]], at_once: list[int], later: list[int]) -> None:
    """The visits that a ray chooses from its stack while one of a leaf is under way, and when that is over.

    `lists`: its nodes before that, each the nearest child of the one before: the rank, and the highest 8 bits of the
    distances of the children. Child k of node n is visited as 100 n + k. It chooses a SUREth visit, and more if near.
    """
    dut, simulation = compiled()
    chosen: list[list[int]] = []

    async def testbench(ctx: Any) -> None:
        await rays_begin(ctx, dut, 1, levels=1)
        result = dut.node.payload
        for number, (rank, distances) in enumerate(lists):
            ctx.set(result.rank, rank)
            ctx.set(result.base, 100 * number)
            for place, distance in enumerate(distances):
                ctx.set(result.hits.entry[place], distance << NEAR_BITS)
            last = number == len(lists) - 1
            await node_result(ctx, dut, 0, len(distances), 1 << rank if last else 0)
            await ctx.tick().repeat(20)
        ctx.set(dut.starved, 1)
        ctx.set(dut.backlog, 0)
        for leaf_is_over in (0, 1):
            ctx.set(dut.leaf.valid, leaf_is_over)
            chosen.append([])
            for _ in range(20):
                if ctx.get(dut.node_request.valid):
                    chosen[-1].append(ctx.get(dut.node_request.payload.address))
                await ctx.tick()
                ctx.set(dut.leaf.valid, 0)

    simulation.run(testbench)
    assert chosen == [at_once, later]


@pytest.mark.parametrize(("cycles", "expected"), [(0, [1, 101]), (1, [1, 101]), *((k, [1]) for k in range(2, 8))])
def test_an_entry_that_was_read_says_nothing_of_what_comes_above_it(cycles: int, expected: list[int]) -> None:
    """A node's list of far children comes so many cycles after an entry was chosen that is above a near one.

    Where it comes while that entry is still read, it is taken for near.
    """
    dut, simulation = compiled()
    chosen: list[int] = []

    async def testbench(ctx: Any) -> None:
        async def ask(count: int) -> None:
            for _ in range(count):
                if ctx.get(dut.node_request.valid):
                    chosen.append(ctx.get(dut.node_request.payload.address))
                await ctx.tick()

        await rays_begin(ctx, dut, 1, levels=1)
        await node_result(ctx, dut, 0, 3, 0)  # to a node, with two near ones on the stack
        await ctx.tick().repeat(20)
        ctx.set(dut.starved, 1)
        ctx.set(dut.backlog, 0)
        await ask(1)
        ctx.set(dut.backlog, 1)
        await ask(cycles)
        ctx.set(dut.node.payload.base, 100)
        for place in (1, 2):
            ctx.set(dut.node.payload.hits.entry[place], 1 << NEAR_BITS)
        ctx.set(dut.node.payload.hits.count, 3)
        ctx.set(dut.node.payload.leaf, 0b1)
        ctx.set(dut.node.valid, 1)
        await ask(1)
        ctx.set(dut.node.valid, 0)
        ctx.set(dut.backlog, 0)
        await ask(20)

    simulation.run(testbench)
    assert chosen == expected


TIME = 1000


@pytest.mark.parametrize(("entry", "visited"), [(TIME - 1, True), (TIME, True), (TIME + 1, False)])
def test_an_entry_is_dropped_only_beyond_the_best_hit(entry: int, visited: bool) -> None:
    """At the distance of the best hit there may be a hit of a lower index, or a nearer one that rounds the same."""
    dut, simulation = compiled()
    leaves: list[int] = []

    async def testbench(ctx: Any) -> None:
        async def until(signal: Any) -> None:
            for _ in range(20):
                if ctx.get(signal):
                    return
                await ctx.tick()
            raise AssertionError("nothing happens")

        for port, value in ((dut.levels, 2), (dut.overlap, 1), (dut.root, 1), (dut.time_read.time, TIME)):
            ctx.set(port, value)
        ctx.set(dut.start.valid, 1)
        await until(dut.start.ready)
        context = ctx.get(dut.start_context)
        await ctx.tick()
        ctx.set(dut.start.valid, 0)
        ctx.set(dut.started.context, context)
        ctx.set(dut.started.valid, 1)
        await ctx.tick()
        ctx.set(dut.started.valid, 0)
        await until(dut.node_request.valid)

        # Two leaves: the nearer one is visited at once, the other one waits on the stack.
        await ctx.tick()
        result = dut.node.payload
        ctx.set(result, {"context": context, "address": 1, "rank": 0, "error": 0, "base": 2, "leaf": 0b11})
        ctx.set(result.hits.count, 2)
        for place, distance in enumerate((0, entry)):
            ctx.set(result.hits.slot[place], place)
            ctx.set(result.hits.entry[place], distance)
        ctx.set(dut.node.valid, 1)
        await ctx.tick()
        ctx.set(dut.node.valid, 0)
        ctx.set(dut.leaf.payload.context, context)
        while not ctx.get(dut.finished.valid):
            asked = ctx.get(dut.leaf_request.valid)
            if asked:
                leaves.append(ctx.get(dut.leaf_request.payload.address))
            await ctx.tick()
            ctx.set(dut.leaf.valid, asked)
            assert len(leaves) <= 2

    simulation.run(testbench, cycles=200)
    assert leaves == ([2, 3] if visited else [2])
