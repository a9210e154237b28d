# amaranth: UnusedElaboratable=no
# (shapes that cannot be built are tried)
"""The rules of the block cache, one by one."""

import random
from collections.abc import Iterable
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from lightloom.rtl.memory.axi import AxiRead
from lightloom.rtl.memory.axi_checker import AxiChecker
from lightloom.rtl.memory.block_answers import PATIENCE
from lightloom.rtl.memory.block_cache import CALM, CROWD, BlockCache
from lightloom.rtl.memory.block_fill import BlockFill
from lightloom.verif.drivers.axi_ports import AmaranthSlave
from lightloom.verif.drivers.axi_slave import SLVERR, Wrong, hashed, wrong_ends
from tests.rtl.simulation import Simulation, simulate
from tests.rtl.watched import watched

SEED = 64
SMALL = {"sets": 4, "ways": 2, "misses": 8, "requests": 32, "tag_width": 12}


@cache
def compiled(shape: tuple[tuple[str, int], ...]) -> tuple[BlockCache, AxiChecker, Simulation]:
    """A cache of that shape, the checker beside it, and both in a simulator."""
    unit = BlockCache(**dict(shape))
    dut, checker = watched(unit)
    return unit, checker, Simulation(dut)


class Run:
    """Requests through a cache in Amaranth's simulator, one a cycle, answers always taken.

    `ticks`: cycles from one tick to the next, 0 for none; `memory`: how the memory answers, beside its latency;
    `prefetches`: blocks that are prefetched, by the cycle.
    """

    def __init__(
        self,
        latency: int = 10,
        ticks: int = 0,
        memory: dict[str, Any] | None = None,
        prefetches: dict[int, int] | None = None,
        **shape: int,
    ):
        self.cache, checker, self.simulation = compiled(tuple(sorted((SMALL | shape).items())))
        options = {"seed": SEED} | (memory or {})
        self.memory = AmaranthSlave(self.cache.m_axi, checker=checker, latency=latency, **options)
        self.ticks = ticks
        self.prefetches = prefetches or {}
        self.prefetching: list[int] = []
        """Cycles in which something may be on its way."""
        self.events: dict[str, list[int]] = {name: [] for name in ("hit", "miss", "merged", "stalled", "evicted")}
        self.sent_at: list[int] = []
        self.answers: dict[int, tuple[int, int, int]] = {}
        """Request number to cycle, error, data."""
        self.under_way: list[int] = []

    def __call__(self, *phases: Iterable[int | None], between: Any = lambda ctx, phase: None) -> "Run":
        """Requests the blocks of a phase, waits for all answers, calls `between`, and goes on with the next.

        None among the blocks is a cycle without a request.
        """

        async def testbench(ctx: Any) -> None:
            await self._run(ctx, [list(phase) for phase in phases], between)

        self.simulation.run(testbench)
        return self

    async def _run(self, ctx: Any, phases: list[list[int | None]], between: Any) -> None:
        cache, cycle, moved, number, waiting = self.cache, 0, 0, 0, 0
        ctx.set(cache.o.ready, 1)
        for index, phase in enumerate(phases):
            blocks = list(phase)
            while (
                blocks
                or waiting
                or cycle < moved + 5
                or cycle <= max(self.prefetches, default=0)
                or ctx.get(cache.prefetching)
            ):
                asks = bool(blocks) and blocks[0] is not None
                ctx.set(cache.i.valid, int(asks))
                if asks:
                    ctx.set(cache.i.payload, {"block": blocks[0], "tag": number})
                ctx.set(cache.prefetch.valid, int(cycle in self.prefetches))
                ctx.set(cache.prefetch.block, self.prefetches.get(cycle, 0))
                ctx.set(cache.tick, int(self.ticks > 0 and cycle % self.ticks == 0))
                self.memory.drive(ctx)
                self.memory.sample(ctx)
                self.under_way.append(self.memory.under_way)
                if ctx.get(cache.prefetching):
                    self.prefetching.append(cycle)
                if ctx.get(cache.o.valid):
                    answer = cache.o.payload
                    tag = ctx.get(answer.tag)
                    assert tag not in self.answers
                    self.answers[tag] = (cycle, ctx.get(answer.error), ctx.get(answer.data))
                    waiting, moved = waiting - 1, cycle
                if blocks and not asks:
                    blocks.pop(0)
                elif asks and ctx.get(cache.i.ready):
                    blocks.pop(0)
                    self.sent_at.append(cycle)
                    number, waiting, moved = number + 1, waiting + 1, cycle
                for name, cycles in self.events.items():
                    if ctx.get(getattr(cache, name)):
                        cycles.append(cycle)
                await ctx.tick()
                cycle += 1
                assert cycle < moved + 1000, "hangs"
            between(ctx, index)
            await ctx.tick()
            cycle += 1
            ctx.set(cache.invalidate, 0)

    def count(self) -> dict[str, int]:
        return {name: len(cycles) for name, cycles in self.events.items()}


def block_data(address: int) -> int:
    return hashed(address, 64)


def same_set(sets: int, count: int) -> list[int]:
    """Blocks of set 0, by the rule in docs/block_cache.md."""
    bits = sets.bit_length() - 1

    def set_of(block: int) -> int:
        result = 0
        while block:
            result, block = result ^ block % sets, block >> bits
        return result

    return [block for block in range(sets * count * 2) if set_of(block) == 0][:count]


def test_a_miss_then_hits() -> None:
    run = Run(sets=4, ways=2)([5, 5, 5], [5, 5])
    assert run.count() == {"hit": 2, "miss": 1, "merged": 2, "stalled": 0, "evicted": 0}
    assert run.memory.reads == [5 * 64]
    assert {answer[1:] for answer in run.answers.values()} == {(0, block_data(5 * 64))}
    # The hits come 3 cycles after their requests; those that waited in successive cycles.
    assert [run.answers[k][0] - run.sent_at[k] for k in (3, 4)] == [3, 3]
    woken = sorted(run.answers[k][0] for k in range(3))
    assert woken == list(range(woken[0], woken[0] + 3))
    # Request, address 3 cycles later, the memory's latency, and 5 more to the answer.
    assert woken[0] == run.sent_at[0] + 3 + 10 + 5


def test_rays_that_wait_for_a_block_are_woken_together_while_others_hit() -> None:
    run = Run(sets=4, ways=2)([1], [2, 2, 2, 2, 1, 1, 1, 1, 1])
    assert run.count() == {"hit": 5, "miss": 2, "merged": 3, "stalled": 0, "evicted": 0}
    hits, woken = ([run.answers[k][0] for k in numbers] for numbers in (range(5, 10), range(1, 5)))
    assert max(hits) < min(woken), "hits wait for a miss"
    assert max(woken) - min(woken) == 3


def test_a_block_that_was_prefetched_hits() -> None:
    run = Run(latency=10, prefetches={3: 5, 4: 6, 30: 5})([], [5, 6, 7])
    assert run.memory.reads == [5 * 64, 6 * 64, 7 * 64]
    assert run.count() == {"hit": 2, "miss": 1, "merged": 0, "stalled": 0, "evicted": 0}
    assert {answer[1:] for answer in run.answers.values()} == {(0, block_data(k * 64)) for k in (5, 6, 7)}
    # From the strobe on, until both are there; and for the look at the block that is there already.
    assert run.prefetching[0] == 4
    assert not set(range(25, 31)) & set(run.prefetching)


def test_a_request_joins_a_block_that_is_prefetched() -> None:
    run = Run(latency=30, prefetches={1: 5})([1, None, None, None, 5, 5])
    assert run.memory.reads == [1 * 64, 5 * 64]
    assert run.count() == {"hit": 0, "miss": 1, "merged": 2, "stalled": 0, "evicted": 0}
    assert {k: answer[1:] for k, answer in run.answers.items()} == {
        k: (0, block_data(64 * block)) for k, block in enumerate((1, 5, 5))
    }


@pytest.mark.parametrize("short", [{"misses": 1}, {"ways": 1, "sets": 2}, {"requests": 1}])
def test_nothing_is_prefetched_where_requests_would_have_to_wait_for_it(short: dict[str, Any]) -> None:
    """The only number, line or list entry belongs to a request."""
    run = Run(latency=50, prefetches={8: 3}, **short)([0])
    assert run.memory.reads == [0]
    assert run.count()["stalled"] == 0


def test_a_prefetch_that_fails_is_no_answer() -> None:
    """The block is read again when it is asked for."""
    run = Run(latency=3, prefetches={1: 5})
    run.memory.errors = {5 * 64: SLVERR}
    run([], [5], between=lambda ctx, phase: run.memory.errors.clear())
    assert run.memory.reads == [5 * 64, 5 * 64]
    assert run.answers[0][1:] == (0, block_data(5 * 64))


@pytest.mark.parametrize("waiting", range(CALM + 2))
def test_prefetches_start_while_few_reads_wait(waiting: int) -> None:
    """For a port that takes none: beside CALM - 1 reads one starts, beside CALM none."""
    cache = BlockCache(sets=16, ways=2, misses=16, requests=16, tag_width=4)
    started: list[int] = []

    async def testbench(ctx: Any) -> None:
        for number in range(waiting):
            ctx.set(cache.i.valid, 1)
            ctx.set(cache.i.payload, {"block": number, "tag": number})
            await ctx.tick().until(cache.i.ready)
        ctx.set(cache.i.valid, 0)
        await ctx.tick().repeat(8)
        ctx.set(cache.prefetch.valid, 1)
        ctx.set(cache.prefetch.block, 100)
        for _ in range(8):
            await ctx.tick()
            ctx.set(cache.prefetch.valid, 0)
            started.append(ctx.get(cache.prefetched))

    simulate(cache, testbench)
    assert sum(started) == (waiting < CALM)


@pytest.mark.parametrize("misses", [1, 2, 3])
def test_prefetches_whose_answers_wait_are_counted(misses: int) -> None:
    """Their blocks have come and their numbers are used again, but answers are not taken, so lists are not over."""
    cache = BlockCache(sets=4, ways=4, misses=misses, requests=32, tag_width=12)
    dut, checker = watched(cache)
    memory = AmaranthSlave(cache.m_axi, checker=checker, latency=4, seed=SEED)
    prefetches = {60 + 25 * k: block for k, block in enumerate((2, 3, 5, 6, 7, 8, 9))}

    async def testbench(ctx: Any) -> None:
        for cycle in range(400):
            ctx.set(cache.o.ready, cycle < 40)
            ctx.set(cache.i.valid, cycle in (0, 40))
            ctx.set(cache.i.payload, {"block": 1, "tag": cycle})
            ctx.set(cache.prefetch.valid, cycle in prefetches)
            ctx.set(cache.prefetch.block, prefetches.get(cycle, 0))
            memory.drive(ctx)
            memory.sample(ctx)
            asked = cycle < min(prefetches)  # what is under way then was not prefetched
            assert asked or ctx.get(cache.prefetching) or not memory.under_way, f"cycle {cycle}"
            await ctx.tick()

    simulate(dut, testbench)
    assert len(memory.reads) > misses + 1


def test_crowded() -> None:
    """It says that CROWD reads wait for a port that takes none."""
    cache = BlockCache(sets=16, ways=2, misses=16, requests=16, tag_width=4)

    async def testbench(ctx: Any) -> None:
        ctx.set(cache.i.valid, 1)
        for number in range(CROWD + 2):
            ctx.set(cache.i.payload, {"block": number, "tag": number})
            await ctx.tick().until(cache.i.ready)
            ctx.set(cache.i.valid, 0)
            await ctx.tick().repeat(8)
            assert ctx.get(cache.crowded) == (number + 1 >= CROWD)
            ctx.set(cache.i.valid, 1)

    simulate(cache, testbench)


def test_hits_go_first_but_not_for_ever() -> None:
    """Beside a hit in every cycle, each of those that have waited is answered after PATIENCE hits."""
    run = Run(sets=4, ways=2)([1], [2, 2, 2, 2] + [1] * 60)
    assert {k: answer[1:] for k, answer in run.answers.items()} == {
        k: (0, block_data(64 * block)) for k, block in enumerate([1, 2, 2, 2, 2] + [1] * 60)
    }
    woken = sorted(run.answers[k][0] for k in range(1, 5))
    cycles = sorted(cycle for cycle, _, _ in run.answers.values())
    assert np.diff(woken).tolist() == [PATIENCE + 1] * 3
    assert set(range(woken[0], woken[-1])) <= set(cycles), "a cycle without an answer"


def test_misses_are_under_way_at_once() -> None:
    run = Run(latency=100, sets=16, ways=2, misses=6)([0] * 3, [k for j in range(60) for k in (0, 100 + j)])
    assert run.memory.most_under_way == 6
    steady = run.under_way[200:-150]
    assert np.mean(steady) > 6 * 0.9
    assert run.count()["hit"] == 60
    assert run.count()["stalled"] > 500


@pytest.mark.parametrize("short", [{"misses": 2}, {"requests": 2}, {"ways": 2, "sets": 2}])
def test_what_runs_out_makes_requests_wait(short: dict[str, int]) -> None:
    shape: dict[str, Any] = {"sets": 8, "ways": 2, "misses": 8, "requests": 16} | short
    blocks = same_set(2, 6) if "ways" in short else list(range(20, 26))
    run = Run(**shape)(blocks)
    assert run.count()["stalled"] > 10
    assert run.memory.most_under_way == 2
    assert [run.answers[k][2] for k in range(6)] == [block_data(64 * block) for block in blocks]


def test_a_hit_behind_a_request_that_waits_is_not_lost() -> None:
    run = Run(sets=2, ways=1, misses=1, requests=1)([0], [1, 2, 3, 3, 0, 0])
    assert len(run.answers) == 7


def test_blocks_that_were_hit_stay() -> None:
    """The one line of the set that was never hit is given away again and again."""
    first, second, third, *others = same_set(4, 24)
    phases: list[list[int]] = [[first, second, third, others[0]], [first, second, third]]
    for block in others[1:]:
        phases += [[block]]
    run = Run(sets=4, ways=4)(*phases, [first, second, third])
    assert run.count()["hit"] == 6
    assert run.count()["evicted"] == len(others) - 1
    assert len(run.memory.reads) == 3 + len(others)


def test_when_all_lines_were_hit_any_may_go() -> None:
    """Over many sets of four lines that were all hit, a fifth block takes each of the four ways now and then, and the
    others count as not used from then on."""
    sets = 32
    gone = []
    columns = [list(range(sets * way, sets * (way + 1))) for way in range(5)]
    run = Run(latency=1, sets=sets, ways=4, misses=32, requests=64)(
        *columns[:4], *columns[:4], columns[4], *columns[:4]
    )
    # Blocks of column k are in all sets; in the last round a block misses where it was replaced.
    for way in range(4):
        before = 4 * sets + 4 * sets + sets + way * sets
        gone.append(sum(run.answers[before + k][0] - run.sent_at[before + k] > 3 for k in range(sets)))
    assert run.count()["evicted"] > sets
    assert all(2 <= count <= 30 for count in gone), gone


def test_a_line_is_not_given_away_while_it_is_awaited() -> None:
    rng = random.Random(SEED)
    run = Run(latency=12, sets=2, ways=2, misses=8, requests=32)([rng.randrange(12) for _ in range(150)])
    counts = run.count()
    assert counts["hit"] + counts["miss"] + counts["merged"] == 150
    assert len(run.memory.reads) == counts["miss"]
    rng = random.Random(SEED)
    assert all(run.answers[k][2] == block_data(64 * rng.randrange(12)) for k in range(150))


def test_errors_reach_all_that_wait_and_are_forgotten() -> None:
    run = Run(sets=4, ways=2, data_width=128)
    run.memory.errors = {7 * 64 + 16: SLVERR}  # the second of four beats

    def mend(ctx: Any, phase: int) -> None:
        if phase == 1:
            run.memory.errors = {}

    run([7, 6, 7], [7], [7, 7], [7], between=mend)
    assert [run.answers[k][1] for k in range(7)] == [1, 0, 1, 1, 0, 0, 0]
    assert run.answers[6][2] == block_data(7 * 64)
    assert run.memory.reads.count(7 * 64) == 3


def test_invalidate_forgets_all() -> None:
    run = Run(sets=4, ways=2)

    def move(ctx: Any, phase: int) -> None:
        ctx.set(run.cache.invalidate, int(phase == 0))
        ctx.set(run.cache.base, 0x4000)

    run([1, 2, 3], [1, 2, 3], [1, 2, 3], between=move)
    assert run.memory.reads == [64, 128, 192, 0x4040, 0x4080, 0x40C0]
    assert run.answers[8][2] == block_data(0x40C0)


def test_lines_count_as_unused_when_all_is_forgotten() -> None:
    """Three of the four lines of each set were hit. When all blocks are forgotten any of the four may be given away
    first, not the same one again and again."""
    sets, ways = 16, 4
    columns = [list(range(sets * way, sets * (way + 1))) for way in range(2 * ways)]
    hot = columns[: ways - 1] * 4
    run = Run(latency=1, sets=sets, ways=ways, misses=16, requests=64)
    before = 0

    def forget(ctx: Any, phase: int) -> None:
        nonlocal before
        if phase == len(hot) - 1:
            ctx.set(run.cache.invalidate, 1)
            before = run.count()["evicted"]

    run(*hot, *columns[ways:], between=forget)
    assert run.count()["hit"] >= (ways - 1) * sets
    # From the line that was not hit alone, all but the first of a set's new blocks push the one before out: 3 in 4.
    assert 0 < run.count()["evicted"] - before < 2 * sets


# --- reads that do not end as they should -----------------------------------------------------------------------------

WIDTHS = (32, 64, 128, 256, 512)


@pytest.mark.parametrize("data_width", WIDTHS)
def test_a_read_that_ends_wrongly_fails(data_width: int) -> None:
    """Those that wait for the block get the error, all others their blocks; no number is used before the read that had
    it is over (the memory watches that), so nothing that comes late is taken for another block's."""
    beats = 512 // data_width
    for name, (answer, ends) in wrong_ends(beats).items():
        run = Run(latency=3, misses=2, data_width=data_width)
        run.memory.wrong = {64 * 7: answer}

        def mend(ctx: Any, phase: int, run: Run = run) -> None:
            run.memory.wrong = {}

        others = list(range(8, 14))
        run([7, 6, 7], [7, *others], between=mend)
        extra = name == "a beat too many"  # the block was whole before that
        errors = [run.answers[k][1] for k in range(len(run.answers))]
        assert errors == [int(not extra), 0, int(not extra)] + [0] * (1 + len(others)), name
        for k, block in enumerate([7, 6, 7, 7, *others]):
            assert errors[k] or run.answers[k][2] == block_data(64 * block), f"{name}: request {k}"
        assert run.memory.reads.count(64 * 7) == 1 + (not extra), name
        assert run.memory.most_under_way == 2
        # The number of a read that may not be over is not used again.
        ids = set(run.memory.asked[-6:])
        assert len(ids) == 1 + (ends or extra), f"{name}: {ids}"


def test_without_numbers_all_that_is_not_there_fails_at_once() -> None:
    run = Run(latency=3, misses=1, data_width=128)
    run.memory.wrong = {64 * 7: Wrong(beats=4)}  # no RLAST, for ever
    run([5], [7], [8, 5, 9, 7, 5])
    assert [run.answers[k][1] for k in range(7)] == [0, 1, 1, 0, 1, 1, 0]
    assert run.answers[6][2] == block_data(64 * 5)
    assert run.memory.reads == [64 * 5, 64 * 7]
    assert [run.answers[k][0] - run.sent_at[k] for k in range(2, 7)] == [3] * 5


@pytest.mark.parametrize("data_width", [32, 512])
def test_a_late_read_fails_and_gives_its_number_back_when_it_is_over(data_width: int) -> None:
    late = Wrong(beats=512 // data_width, last=frozenset({512 // data_width - 1}), after=250)
    run = Run(latency=3, ticks=50, misses=2, data_width=data_width)
    run.memory.wrong = {64 * 7: late, 64 * 8: late}
    fine = list(range(9, 15)) * 20

    def wait(ctx: Any, phase: int) -> None:
        if phase == 1:
            assert run.memory.under_way == 2

    run([7, 8, 7], [5], fine, fine, [7], between=wait)
    for k in range(3):
        cycle, error, _ = run.answers[k]
        assert error
        assert 50 < cycle - run.sent_at[0] < 2 * 50 + 60  # the second waits until what waits for the first is answered
    assert run.answers[3][1], "no number is left"
    errors = [run.answers[4 + k][1] for k in range(2 * len(fine))]
    back = errors.index(0)
    assert not any(errors[back:]), "numbers are back"
    assert run.answers[4 + back][2] == block_data(64 * fine[back % len(fine)])
    last = len(run.answers) - 1
    assert run.answers[last][1], "it is read again, and late again"


def test_beats_without_a_pause_do_not_put_off_the_look_for_late_reads() -> None:
    """A read that never ends, beside others whose beats come in every cycle in which one is taken."""
    misses, late, ticks = 4, 2, (5, 30)
    fill = BlockFill(axi=AxiRead(address_width=40, data_width=512, id_width=2), misses=misses, line_width=3)
    filled: list[tuple[int, int, int]] = []
    taken = 0

    async def testbench(ctx: Any) -> None:
        nonlocal taken
        ctx.set(fill.passed, 1)
        ctx.set(fill.rlast, 1)
        for cycle in range(60):
            ctx.set(fill.start, cycle == 0)
            ctx.set(fill.start_miss, late)
            ctx.set(fill.rvalid, cycle > 0)
            ctx.set(fill.rid, late ^ 1)
            ctx.set(fill.tick, cycle in ticks)
            taken += ctx.get(fill.rvalid) and ctx.get(fill.rready)
            if ctx.get(fill.filled):
                filled.append((cycle, ctx.get(fill.miss), ctx.get(fill.error)))
            await ctx.tick()

    simulate(fill, testbench)
    assert [row[1:] for row in filled] == [(late, 1)]
    # A look follows a beat, and there is one for each miss; a cycle more to begin, and one to tell.
    assert ticks[1] < filled[0][0] <= ticks[1] + 2 * misses + 2
    assert taken > 60 - 2 * 2 * misses, "and beats wait for looks alone"


def test_a_read_that_the_memory_does_not_accept_is_late_too() -> None:
    """Its address stays until it is taken; then its data are dropped."""
    run = Run(latency=3, ticks=40, misses=2, memory={"stall": 1.0})

    def open_(ctx: Any, phase: int) -> None:
        run.memory.manner = replace(run.memory.manner, stall=0.0)

    run([7, 8], [9] * 3, list(range(10, 30)), between=open_)
    assert [run.answers[k][1] for k in range(2)] == [1, 1]
    assert not any(run.answers[k][1] for k in range(8, 25))
    assert run.memory.reads[:2] == [64 * 7, 64 * 8]


@pytest.mark.parametrize("data_width", [32, 128, 512])
def test_any_wrong_ends_among_good_ones(data_width: int) -> None:
    """Late, short, long and without end, in any order and mixed: an answer is the block, or an error where that can be,
    and when the memory has done with all of them, all is well."""
    rng = random.Random(SEED + data_width)
    beats = 512 // data_width
    ends = [answer for answer, over in wrong_ends(beats).values() if over]
    ticks = 40 + 10 * beats
    ends += [Wrong(beats=beats, last=frozenset({beats - 1}), after=k * ticks) for k in (1, 3, 4)]
    memory = {"stall": 0.2, "reorder": True, "seed": SEED}
    run = Run(latency=8, ticks=ticks, misses=4, data_width=data_width, memory=memory)
    run.memory.wrong = {64 * block: rng.choice(ends) for block in rng.sample(range(40), 12)}
    wrong = dict(run.memory.wrong)
    phases = [[rng.randrange(40) for _ in range(100)] for _ in range(4)]

    def mend(ctx: Any, phase: int) -> None:
        if phase == 2:
            run.memory.wrong = {}

    run(*phases, [rng.randrange(40) for _ in range(50)], between=mend)
    blocks = [block for phase in phases for block in phase]
    for k, block in enumerate(blocks):
        cycle, error, data = run.answers[k]
        where = f"seed {SEED}, {data_width} bits, request {k}, block {block}"
        assert error or data == block_data(64 * block), where
        all_numbers = 4 in run.under_way[cycle - 8 : cycle]
        assert not error or 64 * block in wrong or all_numbers, f"{where}: error"
    assert sum(run.answers[k][1] for k in range(300)) > 20
    assert not any(run.answers[k][1] for k in range(400, 450))
    assert not run.memory.under_way


def test_numbers_of_all_bits_are_told_apart() -> None:
    """Blocks that differ in one bit of 32 are different blocks."""
    blocks = [0xDEADBEEF ^ 1 << bit for bit in range(32)]
    run = Run(sets=4, ways=16, misses=32, requests=64, latency=1)(blocks, blocks)
    assert run.count()["miss"] >= 32
    assert run.memory.reads[:32] == [64 * block for block in blocks]
    assert all(run.answers[k][2] == block_data(64 * blocks[k % 32]) for k in range(64))


@pytest.mark.parametrize(
    "wrong",
    [{"sets": 3}, {"sets": 1}, {"ways": 0}, {"misses": 0}, {"requests": 0}, {"data_width": 48}, {"id_width": 2}],
)
def test_shapes_that_cannot_be_built(wrong: dict[str, int]) -> None:
    with pytest.raises(ValueError, match=next(iter(wrong)) if "id_width" not in wrong else "ids"):
        BlockCache(**({"sets": 4, "ways": 2, "misses": 8, "requests": 8, "tag_width": 4} | wrong))
