"""When each operation of a graph is done, and by which core: the part of `rtl.fabric.dataflow` that knows no hardware.

A graph gets operands every `interval` cycles, and a core takes an operation in every cycle. So a core has `interval`
slots: slot k is the cycles k, k + interval, k + 2 interval, … after operands came. It can do as many operations of the
graph, each in a slot of its own, in which the next operands will find it free again.
"""

from collections import Counter, defaultdict
from collections.abc import Hashable
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
    """Gives operations their places, one after the other: each the first time at which a core has that slot free.

    There are as few cores of each kind as can do all operations, once another schedule has `counted` these: one that
    gives each a core of its own.
    """

    def __init__(self, interval: int, counted: "Schedule | None" = None):
        self.interval = interval
        self._asked: Counter[Kind] = Counter()
        self._stand_ins: dict[Kind, Kind | None] = {}
        self._loads = counted._fewest() if counted else None
        self._taken: defaultdict[Kind, list[set[int]]] = defaultdict(list)
        """The slots of each core that are taken."""
        for kind, load in (self._loads or {}).items():
            self._taken[kind] = [set() for _ in range(-(-load // interval))]

    def _fewest(self) -> Counter[Kind]:
        """How many operations cores of each kind do.

        Those that would need one more core of their kind, and find slots to spare at cores that can stand in, go there.
        """
        loads = Counter(self._asked)
        for kind, other in self._stand_ins.items():
            over, spare = loads[kind] % self.interval, -loads[other] % self.interval
            if other is not None and over <= spare:
                loads[kind] -= over
                loads[other] += over
        return loads

    def shares(self, kind: Kind) -> bool:
        """Whether cores of the kind do several operations each."""
        return self._loads is not None and self._loads[kind] > len(self._taken[kind])

    def place(self, kind: Kind, ready: int, stand_in: Kind | None = None) -> Place:
        """The place of an operation whose operands are there from cycle `ready` on.

        Cores of the kind `stand_in`, the same for all operations of a kind, may do it too.
        """
        self._asked[kind] += 1
        assert self._stand_ins.setdefault(kind, stand_in) == stand_in, f"{kind} has two stand-ins"
        if self._loads is None:
            self._taken[kind].append(set())
        elif stand_in is not None and all(len(taken) == self.interval for taken in self._taken[kind]):
            kind = stand_in
        cores = self._taken[kind]
        for time in range(ready, ready + self.interval):
            slot = time % self.interval
            for number, taken in enumerate(cores):
                if slot not in taken:
                    taken.add(slot)
                    return Place(kind, number, time)
        raise AssertionError(f"{len(cores)} cores of {kind} have no slot left")
