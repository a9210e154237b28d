"""Bench of the leaf stage: many contexts, several visits of each in flight, and what can be read when they are done."""

from collections import Counter, deque
from dataclasses import dataclass, field
from typing import Any

import cocotb
import numpy as np

from lightloom.golden_model.contract import bitpack
from lightloom.golden_model.contract.formats import (
    HIT,
    LEAF_RAY,
    TIME_BITS,
    TRACE_ERRORS,
    TRIANGLE_BLOCK,
    TRIANGLES_KIND,
)
from lightloom.verif.benches.bench import Bench
from lightloom.verif.drivers.stream import pattern
from lightloom.verif.vectors.leaf_vectors import Ray, Visit, leaf_scenario, payloads

HANG_CYCLES = 2000
BLOCK_BITS = 512


@dataclass
class Context:
    """A context of the stage and the ray that is in it."""

    ray: Ray | None = None
    began: bool = False
    given: int = 0
    """Visits handed over."""
    waiting: Counter[tuple[int, int, int]] = field(default_factory=Counter)
    """Of visits under way: (error, least, greatest value of `hit`)."""

    @property
    def outstanding(self) -> int:
        return sum(self.waiting.values())


class LeafBench(Bench):
    """The stage with a control that keeps all contexts busy, checked in every cycle.

    Everything is driven and looked at on the falling edge: what is seen then follows from the rising edge before, and
    what is driven takes effect at the next one.
    """

    def __init__(self, dut: Any) -> None:
        super().__init__(dut)
        run = self.run
        self.contexts: int = run["contexts"]
        self.latency: int = run["latency"]
        self.interval: int = run["interval"]
        self.start_latency: int = run["start_latency"]
        self.rays: int = run["rays"]
        self.context_bits = len(dut.started__context)
        self.events: Counter[str] = Counter()
        self.cycle = 0

    async def begin(self) -> None:
        # The payloads stay unknown to the simulator until there is something to say.
        await self.start({"start__valid": 0, "i__valid": 0})
        await self.falling

    async def step(self) -> None:
        """To the next cycle; counts the events of the one that begins."""
        await self.falling
        self.cycle += 1
        now = [name for name in ("test", "starved", "stalled") if int(getattr(self.dut, name).value)]
        assert len(now) == 1, f"cycle {self.cycle}: {now}"
        self.events[now[0]] += 1

    def drive_start(self, context: int, ray: Ray) -> None:
        self.dut.start__valid.value = 1
        self.dut.start__payload.value = context | ray.data << self.context_bits

    def drive_visit(self, context: int, visit: Visit) -> None:
        error = visit.memory_error << BLOCK_BITS
        self.dut.i__valid.value = 1
        self.dut.i__payload.value = context | (visit.block | error) << self.context_bits

    def done(self) -> tuple[int, int, int] | None:
        """(context, error, hit) of a visit that is done."""
        if not int(self.dut.done__valid.value):
            return None
        return int(self.dut.done__context.value), int(self.dut.done__error.value), int(self.dut.done__hit.value)

    def ask(self, context: int) -> None:
        """All read ports, for the next cycle."""
        for port in (self.dut.time_read__0__context, self.dut.time_read__1__context, self.dut.hit_read__context):
            port.value = context

    def check_reads(self, ray: Ray, visits: int, where: str) -> None:
        """What was asked for one cycle before is the state after so many visits of the ray."""
        wanted_hit, wanted_time = ray.bests[visits], ray.times[visits]
        hit = int(self.dut.hit_read__hit.value)
        assert hit == wanted_hit, f"{where}: hit {hit:#x}, model {wanted_hit:#x}, ray {ray.data:#x}"
        for port in (self.dut.time_read__0__time, self.dut.time_read__1__time):
            time = int(port.value)
            assert time == wanted_time, f"{where}: time {time:#x}, model {wanted_time:#x}"


async def run(dut: object, overlap: int, give: str) -> LeafBench:
    """All rays through the stage, up to `overlap` visits of each in flight, visits offered in the pattern `give`."""
    bench = LeafBench(dut)
    rng = bench.rng
    scenario = deque(leaf_scenario(bench.rays, bench.seed))
    contexts = [Context() for _ in range(bench.contexts)]
    starting: set[int] = set()
    offered: int | None = None  # the context whose visit is on the stream
    begun: deque[int] = deque()  # contexts that wait to be read
    asked: tuple[int, int] | None = None  # the context that was read, and after how many visits
    willing = pattern(give, rng)
    finished = idle = 0
    await bench.begin()
    while finished < bench.rays:
        await bench.step()
        idle += 1
        assert idle < HANG_CYCLES, f"seed {bench.seed}: the stage hangs"
        where = f"seed {bench.seed}, cycle {bench.cycle}"
        if asked:
            number, visits = asked
            ray = contexts[number].ray
            assert ray
            bench.check_reads(ray, visits, f"{where}: context {number} after {visits} of {len(ray.visits)} visits")
            if visits == len(ray.visits):
                contexts[number] = Context()
                finished += 1
            asked = None

        if int(bench.dut.started__valid.value):
            number = int(bench.dut.started__context.value)
            assert number in starting, f"{where}: context {number} did not start"
            starting.remove(number)
            begun.append(number)
        # What a visit has changed is read as soon as it may be, what a start has, if there is no visit.
        reading: int | None = None
        done = bench.done()
        if done:
            idle = 0
            reading, error, hit = done
            waiting = contexts[reading].waiting
            kinds = [(error, low, high) for low, high in ((0, 0), (1, 1), (0, 1)) if low <= hit <= high]
            kind = next((kind for kind in kinds if waiting[kind]), None)
            assert kind, f"{where}: context {reading} done with error {error}, hit {hit}; waits for {waiting}"
            waiting[kind] -= 1
        elif begun:
            reading = begun.popleft()
            contexts[reading].began = True
        bench.ask(rng.randrange(bench.contexts) if reading is None else reading)
        if reading is not None and not contexts[reading].outstanding:
            asked = reading, contexts[reading].given

        if offered is None and next(willing):
            able = [
                k
                for k, one in enumerate(contexts)
                if one.ray and one.began and one.given < len(one.ray.visits) and one.outstanding < overlap
            ]
            if able:
                offered = rng.choice(able)
                context = contexts[offered]
                assert context.ray
                bench.drive_visit(offered, context.ray.visits[context.given])
        # `ready` does not depend on what is offered.
        if offered is None:
            bench.dut.i__valid.value = 0
        elif int(bench.dut.i__ready.value):
            context = contexts[offered]
            assert context.ray
            visit = context.ray.visits[context.given]
            low, high = visit.must_hit, visit.must_hit if overlap == 1 else visit.may_hit
            context.waiting[(visit.error, low & context.ray.any_hit, high & context.ray.any_hit)] += 1
            context.given += 1
            offered = None

        free = [k for k, one in enumerate(contexts) if not one.ray]
        if free and scenario:
            number = rng.choice(free)
            contexts[number].ray = ray = scenario.popleft()
            starting.add(number)
            bench.drive_start(number, ray)
        else:
            bench.dut.start__valid.value = 0
    return bench


@cocotb.test()
@cocotb.parametrize(how=[(1, "always"), (4, "always"), (2, "bursts"), (7, "half")])
async def rays(dut: object, how: tuple[int, str]) -> None:
    """Rays with up to so many visits in flight: hit, time, errors and hits of any-hit rays are the model's."""
    overlap, give = how
    bench = await run(dut, overlap, give)
    tests = sum(visit.tests for ray in leaf_scenario(bench.rays, bench.seed) for visit in ray.visits)
    assert bench.events["test"] == tests


def plain_visit(count: int, kind: int = TRIANGLES_KIND, depth: float = 2, error: bool = False) -> Visit:
    """A visit of one or two triangles across the way of `plain_ray`, at t = depth."""
    block = np.zeros(1, TRIANGLE_BLOCK)
    block["kind"], block["count"], block["mask"] = kind, count, 0xFF
    block["order"], block["primitive"] = (0, 2, 3), (8, 5)
    block["vertices"] = (-1, -1, depth, 1, -1, depth, 1, 1, depth, -1, 1, depth)
    return Visit(payloads(block)[0], error, 0, 0)


def plain_ray() -> Ray:
    """A ray from 0 along z, without limit."""
    ray = np.zeros(1, LEAF_RAY)
    ray["shear"], ray["axis"], ray["t_max"] = (0, 0, 1), 2, np.inf
    ray["rate"], ray["scale"], ray["mask"] = 1, 256, 0xFF
    return Ray(payloads(ray)[0])


async def begin_all(bench: LeafBench) -> None:
    """A plain ray in every context, begun in successive cycles; each is reported once, after `start_latency`."""
    ray, first = plain_ray(), bench.cycle + 1
    begun: list[int] = []
    for k in range(bench.contexts + 40):
        await bench.step()
        if int(bench.dut.started__valid.value):
            assert bench.cycle == first + bench.start_latency + len(begun)
            begun.append(int(bench.dut.started__context.value))
        if k < bench.contexts:
            bench.drive_start(k, ray)
        else:
            bench.dut.start__valid.value = 0
    assert begun == list(range(bench.contexts))


@cocotb.test()
@cocotb.parametrize(triangles=[1, 2])
async def full_rate(dut: object, triangles: int) -> None:
    """Always offered a visit: a test every `interval` cycles, and each visit done after `latency`.

    A visit is taken while the one before it is tested, and waits for it."""
    bench = LeafBench(dut)
    await bench.begin()
    await begin_all(bench)
    bench.events.clear()
    count = 100
    visit = plain_visit(triangles)
    taken: list[int] = []
    done: list[int] = []
    for _ in range(count * triangles * bench.interval + bench.latency + 20):
        await bench.step()
        if bench.done():
            done.append(bench.cycle)
            assert bench.done() == ((len(done) - 1) % bench.contexts, 0, 0)
        if len(taken) == count:
            bench.dut.i__valid.value = 0
            continue
        bench.drive_visit(len(taken) % bench.contexts, visit)
        if int(bench.dut.i__ready.value):
            taken.append(bench.cycle)
    assert bench.events["test"] == count * triangles
    extra = triangles * bench.interval - 1
    assert (count - 2) * (extra + 1) <= taken[-1] - taken[0] <= (count - 1) * (extra + 1)
    latencies = {end - begin for begin, end in zip(taken, done, strict=True)}
    least, greatest = bench.latency + triangles - 1, bench.latency + 2 * extra
    assert all(least <= latency <= greatest for latency in latencies), f"{latencies}, declared {bench.latency}"


@cocotb.test()
async def starts_while_all_tests_hit(dut: object) -> None:
    """A better hit with every test: where that leaves no room to work out where a ray starts, it waits, and then begins
    once."""
    bench = LeafBench(dut)
    await bench.begin()
    await begin_all(bench)
    tests, given, begun = 60, 0, []
    for k in range(tests * bench.interval + bench.latency + 40):
        await bench.step()
        if int(bench.dut.started__valid.value):
            begun.append(bench.cycle)
        if given < tests:
            bench.drive_visit(0, plain_visit(1, depth=200 - given))  # each nearer than the one before
            given += int(bench.dut.i__ready.value)
        else:
            bench.dut.i__valid.value = 0
        bench.dut.start__valid.value = 0
        if k == bench.latency:
            bench.drive_start(1, plain_ray())
    assert len(begun) == 1
    bench.ask(0)
    await bench.step()
    hit = bitpack.unpack(
        np.frombuffer(int(bench.dut.hit_read__hit.value).to_bytes(20, "little"), np.uint32).reshape(1, -1), HIT
    )
    assert hit["t"][0] == 200 - (tests - 1)
    assert int(bench.dut.time_read__0__time.value) < 1 << TIME_BITS


@cocotb.test()
async def bad_blocks(dut: object) -> None:
    """What is no block of triangles, or came with an error, is reported and tests nothing."""
    bench = LeafBench(dut)
    await bench.begin()
    await begin_all(bench)
    bench.events.clear()
    cases = [(kind, 1, False) for kind in range(16)] + [(TRIANGLES_KIND, count, False) for count in range(4)]
    cases += [(kind, count, True) for kind in (0, TRIANGLES_KIND) for count in range(4)]
    seen = []
    spacing = 2 * bench.interval  # cycles that a visit may take
    for k in range(spacing * len(cases) + bench.latency + 20):
        await bench.step()
        done = bench.done()
        if done:
            seen.append(done[1])
        bench.dut.i__valid.value = 0
        if k % spacing == 0 and k // spacing < len(cases):
            kind, count, error = cases[k // spacing]
            bench.drive_visit(k % bench.contexts, plain_visit(count, kind, error=error))
    wanted = [
        "memory" if error else "none" if kind == TRIANGLES_KIND and count in (1, 2) else "kind"
        for kind, count, error in cases
    ]
    assert [TRACE_ERRORS[name] for name in wanted] == seen
    assert bench.events["test"] == 1 + 1 + 2  # kind 2 with one triangle twice, with two once


@cocotb.test()
async def reset_in_flight(dut: object) -> None:
    """A reset forgets starts and visits that are under way."""
    bench = LeafBench(dut)
    await bench.begin()
    await begin_all(bench)
    for k in range(bench.latency // 2):
        await bench.step()
        bench.drive_start(k % bench.contexts, plain_ray())
        bench.drive_visit(k % bench.contexts, plain_visit(2))
    bench.dut.rst.value = 1
    await bench.falling
    bench.dut.rst.value = 0
    bench.dut.start__valid.value = 0
    bench.dut.i__valid.value = 0
    for _ in range(bench.latency + 40):
        await bench.step()
        assert not int(bench.dut.done__valid.value)
        assert not int(bench.dut.started__valid.value)
    await begin_all(bench)
