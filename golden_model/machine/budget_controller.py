"""The ray budget that holds a frame time ([0010]): the next frame's budget from what the last frames took.

The work that a frame gives a unit is a part that does not depend on its rays and a part that does. From a frame of
`rays` rays, `cycles` of a unit in all and `ray_cycles` of them for the rays, follows the budget with which the unit
would have met the target: rays + (target - cycles) * rays / ray_cycles. That does not depend on the budget which the
frame had, so it holds for frames that were begun several budgets ago, and the budget approaches it from one side.
Integers throughout.
"""

from collections import deque
from dataclasses import dataclass

from lightloom.golden_model.host.errors import InputError
from lightloom.golden_model.host.parameters import check, number
from lightloom.golden_model.machine.cost_model import (
    MAINTENANCE,
    STAGES,
    FrameCounts,
    Machine,
    load,
    work,
)


@dataclass(frozen=True, kw_only=True)
class BudgetPolicy:
    """How the budget follows the load."""

    target: int = number(8_333_333, 1, 1 << 40, "frame time to hold, in cycles")
    least: int = number(1_000, 1, 1 << 32, "rays a frame that are traced however late it gets: maintenance never stops")
    most: int = number(10_000_000, 1, 1 << 32, "rays a frame at most")
    margin: int = number(
        8, 0, 128, "part of the target, in 1/256, that is kept free: what one frame takes more than the last"
    )
    rise: int = number(64, 1, 256, "largest step upwards, in 1/256 of the budget")
    fall: int = number(128, 1, 255, "largest step downwards, in 1/256 of the budget")
    gain: int = number(
        192, 1, 256, "part of the distance upwards that a step covers, in 1/256; downwards it is all of it"
    )
    still: int = number(4, 0, 64, "distances below this part of the budget, in 1/256, change nothing")
    window: int = number(
        3,
        1,
        16,
        "frames of which the tightest counts: a load that comes and goes does not drive the budget up and down",
    )

    def __post_init__(self) -> None:
        check(self, "budget")
        if self.least > self.most:
            raise InputError(f"budget least {self.least}: must be at most {self.most}, the most")


@dataclass(frozen=True, kw_only=True)
class Measured:
    """What one frame took."""

    rays: int
    """Rays of lightmap maintenance."""
    units: tuple[tuple[int, int], ...]
    """Of every unit that these rays load: (cycles of the frame in all, part of them for these rays, at least 1)."""
    interval: int = 0
    """Cycles since the frame before, 0 where unknown. Counts only where it is longer than the target: a frame may wait
    for its display time, or its stages for each other."""


class BudgetController:
    """The budget of each frame in turn."""

    def __init__(self, policy: BudgetPolicy, first: int):
        """`first`: budget of the first frames, until one of them has been measured."""
        self.policy = policy
        self.budget = min(max(first, policy.least), policy.most)
        """Rays for the next frame, `least` to `most`."""
        self._room: deque[int] = deque(maxlen=policy.window)

    def observe(self, measured: Measured) -> int:
        """Takes a frame that is done, in order of the frames; returns the next frame's budget."""
        policy, budget = self.policy, self.budget
        self._room.append(room(policy, measured))
        distance = min(self._room) - budget
        if abs(distance) * 256 < budget * policy.still:
            return budget
        if distance > 0:
            step = min(max(distance * policy.gain // 256, 1), max(budget * policy.rise // 256, 1))
        else:
            step = -min(-distance, max(budget * policy.fall // 256, 1))
        self.budget = min(max(budget + step, policy.least), policy.most)
        return self.budget


def room(policy: BudgetPolicy, measured: Measured) -> int:
    """The budget with which a frame would have met the target, `least` to `most`: the tightest unit decides."""
    target = policy.target - policy.target * policy.margin // 256
    late = measured.interval if measured.interval > policy.target else 0
    rays = policy.most
    for cycles, ray_cycles in measured.units:
        rays = min(rays, measured.rays + (target - max(cycles, late)) * measured.rays // ray_cycles)
    return max(rays, policy.least)


def measure(machine: Machine, counts: FrameCounts, interval: int = 0) -> Measured:
    """What a frame with these counts took on a machine."""
    cycles = work(machine, counts)
    total = load(cycles)
    rays = dict.fromkeys(total, 0)
    for stage in MAINTENANCE:
        rays[STAGES[stage]] += cycles[stage]
    units = tuple((total[unit], rays[unit]) for unit in total if rays[unit])
    return Measured(rays=counts.lightmap_rays.total, units=units, interval=interval)
