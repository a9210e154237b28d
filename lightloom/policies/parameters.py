"""What a policy's parameters are and mean, read from the class itself, and how two policies differ."""

import ast
import inspect
import textwrap
from dataclasses import fields
from typing import Any

from lightloom.golden_model.maintenance.selection.policy import INFLUENCES, RANGES, Policy

CHOICES = {"influence": INFLUENCES}
"""What parameters that are no numbers may be."""


def parameters(policy: Policy) -> list[dict[str, Any]]:
    """All parameters of a policy: name, value, range (or choices, or neither: yes or no) and meaning."""
    meanings = field_docs(Policy)
    return [
        {
            "name": field.name,
            "value": getattr(policy, field.name),
            "range": RANGES.get(field.name),
            "choices": CHOICES.get(field.name),
            "meaning": meanings[field.name],
        }
        for field in fields(policy)
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


def field_docs(kind: type) -> dict[str, str]:
    """The docstrings below the fields of a dataclass, by field; a field without one has an empty text."""
    (tree,) = ast.parse(textwrap.dedent(inspect.getsource(kind))).body
    assert isinstance(tree, ast.ClassDef)
    found = {field.name: "" for field in fields(kind)}
    for statement, following in zip(tree.body, tree.body[1:], strict=False):
        if isinstance(statement, ast.AnnAssign) and isinstance(statement.target, ast.Name):
            text = following.value if isinstance(following, ast.Expr) else None
            if isinstance(text, ast.Constant) and isinstance(text.value, str):
                found[statement.target.id] = " ".join(text.value.split())
    return found
