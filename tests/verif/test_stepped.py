"""Models that are stepped beside the hardware: what is said of the first step that differs; the cache's, by itself."""

import random

import pytest

from lightloom.verif.drivers.cache_model import CacheModel
from lightloom.verif.drivers.stepped import Stepped, Values


class Sum:
    """Adds up."""

    def __init__(self) -> None:
        self.total = 0

    def state(self) -> Values:
        return {"total": self.total}

    def step(self, operands: Values, seen: Values) -> Values:
        self.total += operands["add"]
        return {"total": self.total, "odd": self.total % 2}


def test_the_first_step_that_differs_is_named() -> None:
    steps = Stepped(Sum(), "sum", seed=8)
    steps.step({"add": 3}, {"total": 3, "odd": 1})
    steps.step({"add": 17}, {"total": 20})  # what is not seen is not held to anything
    message = "^seed 8: sum, step 2, add 5: total 0x1a; the model: total 0x19; its state before: total 0x14"
    with pytest.raises(AssertionError, match=message):
        steps.step({"add": 5}, {"total": 26, "odd": 1})


class Cache:
    """A cache of the same rules, with a choice of its own."""

    def __init__(self, ways: int, seed: int) -> None:
        self.lines: list[tuple[int, bool]] = [(-1, False)] * ways
        self.rng = random.Random(seed)

    def ask(self, block: int) -> tuple[bool, bool]:
        for way, (each, _) in enumerate(self.lines):
            if each == block:
                self.lines[way] = (block, True)
                return True, False
        free = [way for way, (_, used) in enumerate(self.lines) if not used]
        if not free:
            self.lines = [(each, False) for each, _ in self.lines]
        way = self.rng.choice(free or range(len(self.lines)))
        evicted = self.lines[way][0] >= 0
        self.lines[way] = (block, False)
        return False, evicted


@pytest.mark.parametrize("ways", [1, 3])
def test_no_choice_of_a_cache_is_wrong_and_every_other_answer_is(ways: int) -> None:
    rng = random.Random(31)
    cache, model = Cache(ways, 32), CacheModel(sets=1, ways=ways)
    steps = Stepped(model, "cache", seed=31)
    refused = 0
    for _ in range(400):
        block = rng.randrange(ways + 2)
        hit, evicted = cache.ask(block)
        content = list(model.sets[0])
        if len(content) == 1:  # all is known: a hit is told from a miss
            other = CacheModel(sets=1, ways=ways)
            other.sets = [set(content)]
            with pytest.raises(AssertionError, match="cache, step 0"):
                Stepped(other, "cache", seed=31).step({"block": block, "fails": False}, {"hit": not hit, "evicted": 0})
            refused += 1
        steps.step({"block": block, "fails": False}, {"hit": hit, "evicted": evicted})
    assert refused > 20
