# amaranth: UnusedElaboratable=no
# (cores are also made only to see whether they can be)
"""Where register stages stand, and the stream around a core of any interval."""

import random
from itertools import combinations, pairwise

import pytest
from amaranth import Module, Value

from lightloom.rtl.config import Config
from lightloom.rtl.fabric.pipeline import Core, StreamUnit, balanced_cuts, register, slots_of
from lightloom.rtl.intersection.ray_time import RayTime
from tests.rtl.fabric.streams import Transfers, exchange
from tests.rtl.fabric.toys import WIDTH, Multiply

SEED = 1959
TAG = 6


def longest(delays: list[int], cuts: set[int]) -> int:
    """The longest delay between two stages; the inputs count as one, and what comes after the last one too."""
    ends = [0, *(cut + 1 for cut in sorted(cuts)), len(delays)]
    return max(sum(delays[start:end]) for start, end in pairwise(ends))


@pytest.mark.parametrize("count", range(1, 9))
def test_cuts_are_balanced(count: int) -> None:
    rng = random.Random(SEED + count)
    for _ in range(20):
        delays = [rng.randint(1, 30) for _ in range(count)]
        assert balanced_cuts(delays, 0) == set()
        for depth in range(1, count + 1):
            cuts = balanced_cuts(delays, depth)
            least = min(longest(delays, {count - 1, *some}) for some in combinations(range(count - 1), depth - 1))
            assert len(cuts) == depth
            assert count - 1 in cuts
            assert longest(delays, cuts) == least, f"seed {SEED + count}: {delays}, {depth} stages: {cuts}"


@pytest.mark.parametrize("interval", [0, 33, -1])
def test_no_such_interval(interval: int) -> None:
    with pytest.raises(ValueError, match=f"^ray_time: interval must be 1 to 32, not {interval}$"):
        RayTime(Config(), interval=interval)


class Passing(Core):
    """Gives its first operand back after `latency` cycles, but only what it was given in slot 0; else ones."""

    def __init__(self, latency: int, interval: int):
        super().__init__(Multiply.unit_of(), latency, interval=interval)

    def elaborate(self, platform: object) -> Module:
        m = Module()
        value: Value = self.i.a
        if self.initiation_interval > 1:
            value = value | (~slots_of(self.phase)[0]).replicate(WIDTH)
        for stage in range(self.latency):
            value = register(m, self.en, value, f"stage{stage}")
        m.d.comb += self.o.z.eq(value)
        return m


def ready_by_the_rule(seen: Transfers, interval: int) -> list[bool]:
    """When an operation may be taken: the pipeline moves, and it is empty or whole intervals after the last one."""
    expected, last = [], 0
    for cycle, waits in enumerate(seen.waits):
        inside = sum(sent < cycle for sent in seen.sent_at) - sum(out < cycle for out in seen.received_at)
        expected.append(not waits and (not inside or last % interval == 0))
        if cycle in seen.sent_at:
            last = 0
        last += not waits
    return expected


# Latencies below, at and above whole intervals.
@pytest.mark.parametrize(
    ("latency", "interval"), [(3, 1), (1, 2), (4, 2), (5, 2), (7, 3), (3, 8), (8, 8), (25, 8), (40, 32)]
)
def test_stream(latency: int, interval: int) -> None:
    unit = StreamUnit(Passing(latency, interval), TAG)
    assert unit.latency == latency
    assert unit.initiation_interval == min(interval, latency + 1)
    rng = random.Random(SEED)
    operands = [rng.getrandbits(WIDTH - 1) for _ in range(1 << 5)]
    payloads = [a | rng.getrandbits(WIDTH) << WIDTH | k << 2 * WIDTH for k, a in enumerate(operands)]
    wanted = [a | k << WIDTH for k, a in enumerate(operands)]
    runs = exchange(unit, payloads, [(1, 1), (0.5, 0.5), (0.1, 1), (1, 0.1)], SEED)
    for seen in runs:
        assert seen.received == wanted, f"seed {SEED}"
        assert seen.ready == ready_by_the_rule(seen, interval), f"seed {SEED}"
    full = runs[0]
    assert {after - before for before, after in pairwise(full.sent_at)} == {unit.initiation_interval}
    assert {out - into for into, out in zip(full.sent_at, full.received_at, strict=True)} == {latency}


def test_stream_of_a_core_without_registers() -> None:
    """It is nothing but wires: no operation is inside."""
    unit = StreamUnit(Multiply(0), TAG)
    seen = exchange(unit, [3 | 5 << WIDTH | 9 << 2 * WIDTH] * 8, [(1, 1), (0.5, 0.5)], SEED)
    for run in seen:
        assert run.received == [15 | 9 << WIDTH] * 8
        assert run.sent_at == run.received_at
