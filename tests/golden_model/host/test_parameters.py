"""Parameters are declared once: what they may be is held, what they are can be listed."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest

from lightloom.golden_model.engine.sampling.running_average import Blending
from lightloom.golden_model.engine.sampling.settings import Sampling
from lightloom.golden_model.engine.selection.policy import Policy
from lightloom.golden_model.host.errors import InputError
from lightloom.golden_model.host.parameters import Parameter, check, choice, flag, number, parameters
from lightloom.golden_model.machine.budget_controller import BudgetPolicy
from lightloom.golden_model.machine.cost_model import Machine, RayCounts


@dataclass(frozen=True)
class Example:
    count: int = number(2, 0, 8, "Things.")
    share: float = number(0.5, 0.0, 1.0, "Part of them.")
    rows: int = number(3, 1, None, "As many as there are.")
    bins: tuple[int, int] = number((1, 2), 1, 4, "Where they begin.")
    kind: str = choice("round", ("round", "square"), "Of which kind.")
    closed: bool = flag(False, "Whether they are.")
    inner: list[int] = field(default_factory=list)

    def __post_init__(self) -> None:
        check(self, "example")


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"count": ()}, "example count \\(\\): must be 0 to 8"),
        ({"count": (1, 2)}, "must be 0 to 8"),
        ({"share": (0.5,)}, "must be 0.0 to 1.0"),
        ({"bins": ()}, "example bins \\(\\): must be several numbers, each 1 to 4"),
        ({"bins": 3}, "must be several numbers, each 1 to 4"),
    ],
)
def test_one_number_is_not_several(wrong: dict[str, Any], said: str) -> None:
    with pytest.raises(InputError, match=said):
        Example(**wrong)


def test_parameters_are_listed_in_order_and_said_in_words() -> None:
    assert [(each.name, each.default, each.allowed, each.says) for each in parameters(Example).values()] == [
        ("count", 2, "0 to 8", "Things."),
        ("share", 0.5, "0.0 to 1.0", "Part of them."),
        ("rows", 3, "1 or more", "As many as there are."),
        ("bins", (1, 2), "1 to 4", "Where they begin."),
        ("kind", "round", "round, square", "Of which kind."),
        ("closed", False, "yes, no", "Whether they are."),
    ]


def test_what_is_allowed_is_taken() -> None:
    Example(count=0, share=1, rows=10**9, bins=(4, 4), kind="square", closed=True)
    Example(count=np.int64(8), share=np.float32(0.1), closed=np.bool_(True))  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"count": 9}, "example count 9: must be 0 to 8"),
        ({"count": 2.0}, "example count 2.0: must be whole, 0 to 8"),
        ({"count": True}, "example count True: must be 0 to 8"),
        ({"count": "2"}, "example count 2: must be 0 to 8"),
        ({"share": float("nan")}, "example share nan: must be 0.0 to 1.0"),
        ({"rows": 0}, "example rows 0: must be 1 or more"),
        ({"bins": (1, 5)}, r"example bins \(1, 5\): must be 1 to 4"),
        ({"kind": "flat"}, "example kind flat: must be one of round, square"),
        ({"closed": 1}, "example closed 1: must be True or False"),
    ],
)
def test_anything_else_is_refused_by_name(wrong: dict[str, Any], said: str) -> None:
    with pytest.raises(InputError, match=f"^{said}$"):
        Example(**wrong)


@pytest.mark.parametrize("kind", [Policy, Machine, BudgetPolicy, RayCounts, Sampling, Blending])
def test_every_number_of_the_model_has_a_meaning_and_is_held_to_its_range(kind: type) -> None:
    declared = parameters(kind)
    assert declared
    for each in declared.values():
        assert each.says
        for value in _outside(each):
            with pytest.raises(InputError, match=rf" {each.name} "):
                kind(**{each.name: value})


def _outside(each: Parameter) -> list[Any]:
    """Values below and above the range of a number."""
    if each.range is None:
        return []
    low, high = each.range
    ends = [low - 1] if high is None else [low - 1, high + 1]
    return [(*each.default[:-1], end) if isinstance(each.default, tuple) else end for end in ends]
