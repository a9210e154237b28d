# amaranth: UnusedElaboratable=no
# (cores are also made that no graph takes)
"""One graph at every interval: the results of an interpreter, at full rate and with both sides stalling at random."""

import random
from itertools import pairwise

import pytest

from lightloom.rtl.fabric.pipeline import INTERVALS, StreamUnit
from tests.rtl.fabric.streams import exchange
from tests.rtl.fabric.toys import MASK, WIDTH, Graph, GraphCore

SEED = 1966
OPERATIONS = 12
TAG = 4


def packed(fields: list[int]) -> int:
    return sum(field << WIDTH * k for k, field in enumerate(fields))


@pytest.mark.parametrize("interval", INTERVALS)
def test_random_graphs(interval: int) -> None:
    seed = SEED + interval
    graph = Graph(seed)
    unit = StreamUnit(GraphCore(graph, interval), TAG)
    rng = random.Random(seed)
    operands = [[rng.randint(0, MASK) for _ in range(graph.inputs)] for _ in range(OPERATIONS)]
    given, wanted = (
        [packed([*fields, k % (1 << TAG)]) for k, fields in enumerate(rows)]
        for rows in (operands, [graph.results(one) for one in operands])
    )
    full, stalled = exchange(unit, given, [(1, 1), (0.5, 0.5)], seed)
    assert full.received == stalled.received == wanted, f"seed {seed}"
    assert {after - before for before, after in pairwise(full.sent_at)} == {unit.initiation_interval}
    assert {out - into for into, out in zip(full.sent_at, full.received_at, strict=True)} == {unit.latency}
