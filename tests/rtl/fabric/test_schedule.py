"""Which core does which operation, and when: places against what they promise."""

import random
from collections import defaultdict
from collections.abc import Sequence

import pytest

from lightloom.rtl.fabric.schedule import Place, Schedule

SEED = 1977


def placed(interval: int, wanted: Sequence[tuple[str, int, str | None]]) -> tuple[Schedule, list[Place]]:
    """The places of operations (kind, first time, stand-in), on the fewest cores."""
    counted = Schedule(interval)
    for kind, ready, stand_in in wanted:
        counted.place(kind, ready, stand_in)
    schedule = Schedule(interval, counted)
    return schedule, [schedule.place(*one) for one in wanted]


@pytest.mark.parametrize("interval", range(1, 33))
def test_places_of_random_operations(interval: int) -> None:
    """No slot of a core is given twice, none was free earlier, and there are no more cores than needed."""
    rng = random.Random(SEED + interval)
    kinds = [rng.choice("abc") for _ in range(rng.randint(1, 70))]
    wanted = [(kind, rng.randint(0, 50), None) for kind in kinds]
    schedule, places = placed(interval, wanted)
    taken: defaultdict[str, set[tuple[int, int]]] = defaultdict(set)
    for (kind, ready, _), place in zip(wanted, places, strict=True):
        cores = -(-kinds.count(kind) // interval)
        assert place.kind == kind
        assert 0 <= place.number < cores
        assert place.time >= ready
        slots = [(number, time % interval) for time in range(ready, place.time) for number in range(cores)]
        assert set(slots) <= taken[kind], f"seed {SEED + interval}: {place} might have been earlier"
        slot = (place.number, place.time % interval)
        assert slot not in taken[kind], f"seed {SEED + interval}: {place}"
        taken[kind].add(slot)
        assert schedule.shares(kind) == (interval > 1 and kinds.count(kind) > 1)


def test_each_its_own_core_until_all_are_counted() -> None:
    schedule = Schedule(4)
    assert [schedule.place("a", 3) for _ in range(3)] == [Place("a", number, 3) for number in range(3)]
    assert not schedule.shares("a")


def test_an_operation_too_many() -> None:
    schedule, _ = placed(2, [("a", 0, None)] * 4)
    with pytest.raises(AssertionError, match="2 cores of a have no slot left"):
        schedule.place("a", 0)


def load(interval: int, products: int, differences: int) -> tuple[int, int]:
    """How many cores of two kinds operations need of which the former may be done by cores of the latter."""
    wanted = [*[("product", 0, "difference")] * products, *[("difference", 0, None)] * differences]
    _, places = placed(interval, wanted)
    assert all(place.kind == "difference" for place in places[products:])
    cores = {kind: {place.number for place in places if place.kind == kind} for kind in ("product", "difference")}
    return len(cores["product"]), len(cores["difference"])


@pytest.mark.parametrize(
    ("interval", "products", "differences", "cores"),
    [
        (1, 13, 3, (13, 3)),
        (2, 13, 3, (6, 2)),  # one product goes where a slot is free
        (2, 13, 4, (7, 2)),  # none is free
        (2, 12, 3, (6, 2)),  # a free slot saves nothing
        (8, 13, 3, (1, 1)),
        (8, 13, 4, (2, 1)),  # four are free, but five would have to go
        (16, 13, 3, (0, 1)),
        (16, 13, 4, (1, 1)),
        (16, 13, 0, (1, 0)),  # nobody stands in
    ],
)
def test_stand_ins_save_a_core_or_do_nothing(
    interval: int, products: int, differences: int, cores: tuple[int, int]
) -> None:
    assert load(interval, products, differences) == cores


def test_operations_of_a_kind_have_one_stand_in() -> None:
    schedule = Schedule(4)
    schedule.place("a", 0, "b")
    with pytest.raises(AssertionError, match="a has two stand-ins"):
        schedule.place("a", 0)
