"""Work that proceeds in waves of the ray collector, several pieces of it side by side ([0059], [0063]).

A piece of work is a generator: it emits rays to the collector, yields, and finds their hits there when it goes on. Its
return value is its result. Pieces that run together share each wave, so that the rays of all emitters are collected
and traced together.
"""

from collections.abc import Generator
from typing import Any, TypeVar

from lightloom.golden_model.host.stopwatch import Stopwatch
from lightloom.golden_model.rays.collector import Collector

Result = TypeVar("Result")
Waves = Generator[None, None, Result]


def run_together(collector: Collector, clock: Stopwatch, *pieces: Waves[Any]) -> list[Any]:
    """Runs all pieces to their ends; returns their results in their order."""
    results: list[Any] = [None] * len(pieces)
    waiting = dict(enumerate(pieces))
    while waiting:
        for number, piece in list(waiting.items()):
            try:
                next(piece)
            except StopIteration as end:
                results[number] = end.value
                del waiting[number]
        if waiting:
            with clock("trace"):
                collector.run()
    return results
