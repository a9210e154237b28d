"""What a policy's parameters are and mean, as rows for JSON and pages, and how two policies differ."""

from typing import Any

from lightloom.golden_model.engine.selection.policy import Policy
from lightloom.golden_model.host import parameters as declared


def parameters(policy: Policy) -> list[dict[str, Any]]:
    """All parameters of a policy: name, value, range (or choices, or neither: yes or no) and meaning."""
    return [
        {
            "name": each.name,
            "value": getattr(policy, each.name),
            "range": each.range,
            "choices": each.choices,
            "meaning": each.says,
        }
        for each in declared.parameters(Policy).values()
    ]


def changed_parameters(policy: Policy, before: Policy | None) -> list[dict[str, Any]]:
    """As `parameters`, those that differ from the policy before, whose value is `before`; none for the first."""
    if before is None:
        return []
    return [
        row | {"before": getattr(before, row["name"])}
        for row in parameters(policy)
        if row["value"] != getattr(before, row["name"])
    ]
