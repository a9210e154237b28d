"""docs/selection.md says what the policy and the format say."""

import re

from lightloom.golden_model.contract import formats
from lightloom.golden_model.engine.selection.policy import POLICIES, Policy
from lightloom.golden_model.host.parameters import parameters
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


def test_every_parameter_is_there_with_default_range_and_meaning() -> None:
    table = PAGE.split("## Parameters")[1]
    rows = re.findall(r"^\| `(\w+)` \| ([^|]+) \| ([^|]+) \| ([^|]+) \|$", table, re.MULTILINE)
    assert rows == [
        (
            each.name,
            written(each.default),
            " to ".join(map(written, each.range)) if each.range else each.allowed,
            each.says,
        )
        for each in parameters(Policy).values()
    ]


def test_format_table() -> None:
    rows = re.findall(r"^\| `(\w+)` \| ([^|]+) \|", PAGE.split("### INFLUENCE")[1].split("\n## ")[0], re.MULTILINE)
    assert rows == described(formats.INFLUENCE)


def test_named_policies() -> None:
    section = PAGE.split("| policy | adds")[1].split("\n\n")[0]
    assert re.findall(r"^\| `([\w-]+)` \|", section, re.MULTILINE) == list(POLICIES)
