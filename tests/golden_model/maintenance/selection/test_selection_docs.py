"""docs/selection.md says what the policy and the format say."""

import re
from dataclasses import fields

from lightloom.golden_model.contract import formats
from lightloom.golden_model.maintenance.selection.policy import INFLUENCES, POLICIES, RANGES, Policy
from tests import ROOT
from tests.golden_model.test_renderer_docs import described

PAGE = (ROOT / "docs" / "selection.md").read_text(encoding="utf-8")


def written(value: object) -> str:
    """A value as the page writes it."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, tuple):
        return ", ".join(map(str, value))
    return f"{value:g}" if isinstance(value, float) else str(value)


def test_every_parameter_is_there_with_default_and_range() -> None:
    rows = re.findall(r"^\| `(\w+)` \| ([^|]+) \| ([^|]+) \| [^|]+ \|$", PAGE.split("## Parameters")[1], re.MULTILINE)
    expected = []
    for field in fields(Policy):
        value, allowed = getattr(Policy(), field.name), ", ".join(INFLUENCES)
        if isinstance(value, bool):
            allowed = "yes, no"
        elif field.name in RANGES:
            allowed = " to ".join(written(bound) for bound in RANGES[field.name])
        expected.append((field.name, written(value), allowed))
    assert rows == expected


def test_format_table() -> None:
    rows = re.findall(r"^\| `(\w+)` \| ([^|]+) \|", PAGE.split("### INFLUENCE")[1].split("\n## ")[0], re.MULTILINE)
    assert rows == described(formats.INFLUENCE)


def test_named_policies() -> None:
    section = PAGE.split("| policy | adds")[1].split("\n\n")[0]
    assert re.findall(r"^\| `([\w-]+)` \|", section, re.MULTILINE) == list(POLICIES)
