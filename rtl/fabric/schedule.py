"""When each operation of a graph is done, and by which core: the part of `rtl.fabric.dataflow` that knows no hardware.

A graph gets operands every `interval` cycles, and a core takes an operation in every cycle. So a core has `interval`
turns: turn k is the cycles k, k + interval, k + 2 interval, … after operands came. It can do as many operations of the
graph, each in a turn of its own, in which the next operands will find it free again.
"""

from collections import Counter
from collections.abc import Hashable, Mapping
from dataclasses import dataclass

Kind = Hashable
"""Cores of one kind can stand in for each other."""


@dataclass(frozen=True)
class Place:
    """Which core does an operation, by its kind and number, and the cycle in which it is given the operands."""

    kind: Kind
    number: int
    time: int


class Schedule:
    """Gives operations their places, one after the other: each the first time at which a core has that turn free.

    There are as few cores of each kind as can do the `operations`, which are counted by kind; where these are not known
    yet, as many as are asked for.
    """

    def __init__(self, interval: int, operations: Mapping[Kind, int] | None = None):
        self.interval = interval
        self._expected = operations
        self._taken: dict[Kind, list[set[int]]] = {
            kind: [set() for _ in range(-(-count // interval))] for kind, count in (operations or {}).items()
        }
        """The turns of each core that are taken."""
        self.operations: Counter[Kind] = Counter()
        """Those that have a place."""

    def shares(self, kind: Kind) -> bool:
        """Whether cores of the kind do several operations each."""
        return self._expected is not None and self._expected[kind] > len(self._taken[kind])

    def place(self, kind: Kind, ready: int) -> Place:
        """The place of an operation whose operands are there from cycle `ready` on."""
        self.operations[kind] += 1
        cores = self._taken.setdefault(kind, [])
        if self._expected is None:
            cores.append(set())
        for time in range(ready, ready + self.interval):
            turn = time % self.interval
            for number, taken in enumerate(cores):
                if turn not in taken:
                    taken.add(turn)
                    return Place(kind, number, time)
        raise AssertionError(f"{kind}: {len(cores)} cores have no turn for operation {self.operations[kind]}")
