"""What a property is, how it is shown, and what came of it."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Literal

from lightloom.gen.formal.bench import Bench

Status = Literal["proved", "failed", "undecided", "vacuous", "timed out"]
"""Undecided: the induction found a step that it cannot exclude, and no counterexample. Vacuous: something that has to
be possible is not, under the assumptions and within the cycles looked at, so that the proof says nothing of it."""

HOLDS: Status = "proved"


@dataclass(frozen=True, kw_only=True)
class Induction:
    """For all time: `depth` cycles from reset, and from any `depth` cycles in which it held to the next."""

    depth: int = 2

    def __str__(self) -> str:
        return f"induction k={self.depth}"


@dataclass(frozen=True, kw_only=True)
class Bounded:
    """For the first `depth` cycles from reset; where a datapath has no state, one cycle says all."""

    depth: int

    def __str__(self) -> str:
        return f"bounded {self.depth}"


@dataclass(frozen=True, kw_only=True)
class Combinational:
    """For all operands of logic without state."""

    depth: int = 1

    def __str__(self) -> str:
        return "all operands"


@dataclass(frozen=True, kw_only=True)
class Exhaustive:
    """By trying every input; `inputs` of them."""

    inputs: int
    depth: int = 1

    def __str__(self) -> str:
        return f"{self.inputs:,} inputs"


@dataclass(frozen=True, kw_only=True)
class Property:
    """One row of the table."""

    unit: str
    """The unit, or the module that units share."""
    name: str
    """Together with the unit's it is unique."""
    says: str
    """What holds, in one line."""
    method: Induction | Bounded | Combinational | Exhaustive
    build: Callable[[], Bench] | None = None
    """Makes the bench that a solver is given."""
    check: Callable[[], str] | None = None
    """Exhaustive ones: tries all inputs and returns what is wrong with the first that is, or nothing."""
    reach: int = 0
    """Cycles in which all that the bench calls reachable must be reached, where the proof is for all time; 0 where
    there is nothing of the kind. A bounded proof says nothing of what comes later than its bound: there it is that."""
    arrays: bool = False
    """The solver is given memories as arrays: slower than registers in all benches but those of which it says so."""
    quick: bool = False
    """Part of the subset that every test run takes."""

    def __post_init__(self) -> None:
        if isinstance(self.method, Bounded) and self.reach:
            raise ValueError(f"{self.key}: what a bounded proof has to reach, it has to reach within its bound")

    @property
    def key(self) -> str:
        return f"{self.unit}/{self.name}"

    @property
    def reach_within(self) -> int:
        """Cycles in which all covers must be reached; 0: there are none."""
        return self.method.depth if isinstance(self.method, Bounded) else self.reach

    def bench(self) -> Bench:
        """Makes the bench. Raises ValueError if what it has to reach is not asked for, or the other way round."""
        assert self.build is not None
        bench = self.build()
        if bool(bench.covers) != bool(self.reach_within):
            raise ValueError(f"{self.key}: {len(bench.covers)} covers to be reached in {self.reach_within} cycles")
        return bench

    @property
    def covers(self) -> list[str]:
        """What has to be possible, by the labels of the bench."""
        return self.bench().covers if self.reach_within else []


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """What came of one property."""

    property: Property
    solver: str
    status: Status
    seconds: float
    note: str = ""
    """What failed, in one line."""
    trace: str = ""
    """The counterexample's waves, a path below the folder of the run."""
    reached: dict[str, int] = field(default_factory=dict)
    """The first cycle after the reset in which each cover was reached, in the order in which they were found."""

    def as_row(self) -> dict[str, object]:
        """A flat dict for tables and JSON."""
        return {
            "unit": self.property.unit,
            "property": self.property.name,
            "says": self.property.says,
            "method": str(self.property.method),
            "depth": self.property.method.depth,
            "solver": self.solver,
            "status": self.status,
            "seconds": round(self.seconds, 2),
            "note": self.note,
            "trace": self.trace,
            "reached": self.reached,
        }
