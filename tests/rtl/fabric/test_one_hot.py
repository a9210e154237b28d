"""Masks of which at most one bit is set: every input of small widths, and the round robin against a model."""

import random
from collections.abc import Callable
from typing import Any

import pytest
from amaranth import Module, Signal, Value
from amaranth.sim import Simulator

from lightloom.rtl.fabric.one_hot import above_lowest, any_of, lowest, next_of, number_of, pick
from tests.rtl.simulation import simulate

SEED = 1999
WIDTHS = range(1, 9)


def of_every_mask(width: int, function: Callable[[Module, Signal], Value]) -> list[int]:
    """What logic makes of every mask of that width, in order."""
    m = Module()
    mask = Signal(width)
    value = Value.cast(function(m, mask))
    out = Signal(len(value) or 1)
    m.d.comb += out.eq(value)
    seen = []

    async def testbench(ctx: Any) -> None:
        for number in range(1 << width):
            ctx.set(mask, number)
            seen.append(ctx.get(out))

    simulator = Simulator(m)
    simulator.add_testbench(testbench)
    simulator.run()
    return seen


@pytest.mark.parametrize("width", WIDTHS)
def test_lowest(width: int) -> None:
    masks = range(1 << width)
    assert of_every_mask(width, lambda m, mask: lowest(m, "low", mask)) == [mask & -mask for mask in masks]
    above = [(masks[-1] & ~((mask & -mask) | ((mask & -mask) - 1))) if mask else 0 for mask in masks]
    assert of_every_mask(width, lambda m, mask: above_lowest(m, "low", mask)) == above


@pytest.mark.parametrize("width", WIDTHS)
def test_number_of(width: int) -> None:
    numbers = of_every_mask(width, lambda m, mask: number_of(mask))
    assert [numbers[1 << bit] for bit in range(width)] == list(range(width))
    assert numbers[0] == 0


@pytest.mark.parametrize("width", WIDTHS)
def test_pick_and_any_of(width: int) -> None:
    values = random.Random(SEED).sample(range(1, 256), width)
    picked = of_every_mask(width, lambda m, mask: pick(mask, values))
    assert [picked[1 << bit] for bit in range(width)] == values
    assert picked[0] == 0
    assert of_every_mask(width, lambda m, mask: any_of(mask)) == [int(mask > 0) for mask in range(1 << width)]


def test_pick_ends_with_the_shorter_list() -> None:
    assert of_every_mask(3, lambda m, mask: pick(mask, [7, 9])) == [0, 7, 9, 7 | 9] * 2


def after(last: int, wanted: int, width: int) -> int:
    """The next wanted place above `last`, round and round."""
    return next(place % width for place in range(last + 1, last + 1 + width) if wanted >> place % width & 1)


@pytest.mark.parametrize("width", WIDTHS)
def test_round_robin(width: int) -> None:
    """Also that what is not taken does not count as a turn."""
    m = Module()
    wanted = Signal(width)
    take = Signal()
    chosen = Signal(width)
    m.d.comb += chosen.eq(next_of(m, "turn", wanted, take))
    rng = random.Random(SEED + width)

    async def testbench(ctx: Any) -> None:
        last = width - 1
        for cycle in range(300):
            mask, taken = rng.getrandbits(width) & rng.getrandbits(width), rng.random() < 0.6
            ctx.set(wanted, mask)
            ctx.set(take, taken and mask > 0)
            expected = 1 << after(last, mask, width) if mask else 0
            assert ctx.get(chosen) == expected, f"seed {SEED + width}, cycle {cycle}: {mask:#b} after {last}"
            if taken and mask:
                last = after(last, mask, width)
            await ctx.tick()

    simulate(m, testbench)
