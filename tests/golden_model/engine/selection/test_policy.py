"""The selection policy: ranges, and what each of the named ones adds."""

import re
from dataclasses import fields, replace
from typing import Any

import pytest

from lightloom.golden_model.engine.selection.policy import MECHANISMS, POLICIES, Policy, policy_of
from lightloom.golden_model.host.errors import InputError
from lightloom.golden_model.host.parameters import parameters

PARAMETERS = parameters(Policy)
NUMBERS = {name: each.range for name, each in PARAMETERS.items() if each.range is not None}


def test_every_field_is_a_parameter() -> None:
    assert list(PARAMETERS) == [field.name for field in fields(Policy)]


@pytest.mark.parametrize("name", NUMBERS)
def test_numbers_out_of_range_are_refused_by_name(name: str) -> None:
    low, high = NUMBERS[name]
    assert high is not None
    step = 1 if isinstance(low, int) else 0.125
    default = getattr(Policy(), name)
    for wrong in (low - step, high + step, float("nan"), True, "1"):
        value: Any = (*default[:-1], wrong) if isinstance(default, tuple) else wrong
        changed: dict[str, Any] = {name: value}
        with pytest.raises(InputError, match=rf"^policy {name} .*: must be .*{re.escape(str(low))} to {high}$"):
            replace(Policy(), **changed)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"spread_bins": (5, 5, 9)}, "spread_bins"),
        ({"influence": "none"}, "influence none: must be one of off, volumes, footprints"),
        ({"sweep": 200, "probe": 57}, "together at most 256"),
        (
            {"influence": "footprints", "influence_records": 17},
            "influence_records 17 and footprint_rays 64: together at most 80",
        ),
        ({"dilation": 3, "guard": 3, "rings": 3, "within_map": False}, "together at most 8"),
        ({"dilation": 3, "guard": 3, "rings": 3, "by_region": True}, "together at most 8"),
        ({"dilation": 3, "guard": 2, "rings": 3}, "together at most 7"),
        ({"invalidate": True, "heavy_updates": 0}, "heavy_updates"),
        ({"visibility_rays": 2.5}, "visibility_rays 2.5: must be whole, 0 to 65535"),
        ({"notice": 1}, "notice 1: must be True or False"),
    ],
)
def test_what_does_not_go_together_is_refused(wrong: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        Policy(**wrong)


def test_each_named_policy_adds_to_visibility() -> None:
    robin, visible, variable, all_of_it = (policy_of(name) for name in POLICIES)
    assert (robin.visibility, robin.probe, robin.sweep) == (False, 256, 0)
    assert visible.visibility
    assert (visible.variability_bits, visible.notice, visible.influence) == (0, False, "off")
    assert (variable.variability_bits, variable.notice, variable.influence) == (2, False, "off")
    assert all_of_it == Policy()
    assert (all_of_it.variability_bits, all_of_it.notice, all_of_it.influence) == (0, True, "volumes")
    with pytest.raises(InputError, match="policy best: unknown; choose one of round-robin, visibility"):
        policy_of("best")


def test_mechanisms_are_switched_by_name() -> None:
    assert policy_of("influence-drift-notice") == replace(Policy(), drift=False, notice=False)
    assert policy_of("influence+variability-rings") == replace(Policy(), variability_bits=2, rings=0)
    assert policy_of("visibility+influence+notice+drift") == Policy()
    assert policy_of("round-robin+sweep-probe").sweep == Policy().sweep


@pytest.mark.parametrize("mechanism", MECHANISMS)
def test_each_mechanism_is_a_switch(mechanism: str) -> None:
    """Off differs from what a policy with all has, and on again is that."""
    everything = policy_of("influence+variability")
    assert policy_of(f"influence+variability-{mechanism}") != everything
    assert policy_of(f"influence+variability-{mechanism}+{mechanism}") == everything


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("influence-", "policy influence-: unknown; choose one of round-robin, visibility, variability, influence"),
        ("influencer", "policy influencer: unknown"),
        ("influence-Drift", "policy influence-Drift: unknown"),
        ("influence-drifts", "policy influence-drifts: drifts is unknown; choose of prediction, doubts, rim, lod"),
        ("", "policy : unknown"),
    ],
)
def test_what_is_no_policy(name: str, message: str) -> None:
    with pytest.raises(InputError, match=re.escape(message)):
        policy_of(name)
