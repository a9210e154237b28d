"""The selection policy: ranges, and what each of the named ones adds."""

import re
from dataclasses import fields, replace
from typing import Any

import pytest

from lightloom.golden_model.host.errors import InputError
from lightloom.golden_model.maintenance.selection.policy import POLICIES, RANGES, Policy, policy_of


@pytest.mark.parametrize("name", RANGES)
def test_numbers_out_of_range_are_refused_by_name(name: str) -> None:
    low, high = RANGES[name]
    step = 1 if isinstance(low, int) else 0.125
    default = getattr(Policy(), name)
    for wrong in (low - step, high + step, float("nan"), True, "1"):
        value: Any = (*default[:-1], wrong) if isinstance(default, tuple) else wrong
        changed: dict[str, Any] = {name: value}
        with pytest.raises(InputError, match=rf"^policy {name} .*: must be .*{re.escape(str(low))} to {high}$"):
            replace(Policy(), **changed)


def test_every_number_has_a_range() -> None:
    numbers = {field.name for field in fields(Policy) if not isinstance(getattr(Policy(), field.name), bool | str)}
    assert numbers == set(RANGES)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"spread_bins": (5, 5, 9)}, "spread_bins"),
        ({"influence": "none"}, "influence none: must be one of off, volumes, footprints"),
        ({"sweep": 200, "probe": 57}, "together at most 256"),
        ({"invalidate": True, "heavy_updates": 0}, "heavy_updates"),
        ({"visibility_rays": 2.5}, "whole"),
    ],
)
def test_what_does_not_go_together_is_refused(wrong: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        Policy(**wrong)


def test_each_named_policy_has_all_of_the_one_before() -> None:
    robin, visible, variable, all_of_it = (policy_of(name) for name in POLICIES)
    assert (robin.visibility, robin.probe, robin.sweep) == (False, 256, 0)
    assert visible.visibility
    assert (visible.variability_bits, visible.notice, visible.influence) == (0, False, "off")
    assert (variable.variability_bits, variable.notice, variable.influence) == (2, False, "off")
    assert all_of_it == Policy()
    with pytest.raises(InputError, match="--policy best: unknown; choose one of round-robin, visibility"):
        policy_of("best")
