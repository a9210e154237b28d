"""The tables in docs/UNIT.md say what the formats and the hardware say."""

import re

import numpy as np
import pytest

from lightloom.golden_model.contract import bitpack
from lightloom.golden_model.contract.interfaces import PURE
from lightloom.pages import frozen, registers
from lightloom.pages.units import page
from lightloom.rtl.catalogue import CATALOGUE
from lightloom.rtl.config import PRESETS
from tests import ROOT

DOCS = ROOT / "docs"
PAGES = {unit: DOCS / f"{unit}.md" for unit in PURE}
TIMED = [unit for unit, page in PAGES.items() if page.exists() and "| preset | latency" in page.read_text("utf-8")]
DOCUMENTED = [unit for unit, page in PAGES.items() if page.exists() and "| input field |" in page.read_text("utf-8")]


def test_the_page_of_units_is_up_to_date() -> None:
    assert (DOCS / "units.md").read_text(encoding="utf-8") == page(), "python -m lightloom.pages.units > docs/units.md"


def test_the_page_of_registers_is_up_to_date() -> None:
    assert (DOCS / "registers.md").read_text(encoding="utf-8") == registers.page(), (
        "python -m lightloom.pages.registers > docs/registers.md"
    )


def test_the_page_of_what_is_frozen_is_up_to_date() -> None:
    assert (DOCS / "frozen.md").read_text(encoding="utf-8") == frozen.page(), (
        "python -m lightloom.pages.frozen > docs/frozen.md"
    )


def payload(dtype: np.dtype) -> list[tuple[str, int, int]]:
    """(field, highest bit, lowest bit) of each field, vectors as one."""
    spans: dict[str, tuple[int, int]] = {}
    for name, _, _, offset, width in bitpack.fields(dtype):
        lowest = spans.get(name, (0, offset))[1]
        spans[name] = offset + width - 1, lowest
    return [(name, *span) for name, span in spans.items()]


def test_the_ray_units_are_documented() -> None:
    assert {"ray_setup", "ray_triangle"} <= set(DOCUMENTED)


@pytest.mark.parametrize("unit", DOCUMENTED)
def test_payload_tables(unit: str) -> None:
    rows = re.findall(r"^\| `(\w+)` \| (\d+):(\d+) \|", (DOCS / f"{unit}.md").read_text(encoding="utf-8"), re.MULTILINE)
    said = [(name, int(high), int(low)) for name, high, low in rows]
    assert said == payload(PURE[unit].input) + payload(PURE[unit].output)


def test_latencies_are_documented() -> None:
    assert {*DOCUMENTED, "ray_triangle_half"} <= set(TIMED)


@pytest.mark.parametrize("unit", TIMED)
def test_latency_tables(unit: str) -> None:
    rows = re.findall(
        r"^\| (\w+) \| (\d+) \| (\d+) \|", (DOCS / f"{unit}.md").read_text(encoding="utf-8"), re.MULTILINE
    )
    said = {preset: (int(latency), int(interval)) for preset, latency, interval in rows}
    units = {preset: CATALOGUE[unit](config) for preset, config in PRESETS.items()}
    assert said == {preset: (made.latency, made.initiation_interval) for preset, made in units.items()}
