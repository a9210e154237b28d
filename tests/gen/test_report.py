"""Charts and wording of the report page."""

import xml.etree.ElementTree as ET

import pytest

from lightloom.gen.pages.pages import seconds
from lightloom.gen.pages.plots import nice_ticks, short, stacked_bars


@pytest.mark.parametrize("largest", [0.3, 1, 7, 10, 99, 300_000, 400_000, 123_456_789])
def test_ticks_reach_the_largest_value(largest: float) -> None:
    ticks = nice_ticks(largest)
    assert ticks[0] == 0
    assert ticks[-1] >= largest
    assert ticks[-2] < largest
    assert 2 <= len(ticks) <= 6


def test_bars_stand_on_each_other_below_the_limit() -> None:
    svg = ET.fromstring(stacked_bars([0, 1], {"indirect": [80, 60], "shadow": [20, 10]}, limit=100, limit_name="<100>"))
    bars = [(float(bar.get("y", "")), float(bar.get("height", ""))) for bar in svg.iter("rect")]
    (low, low_height), (high, high_height), *_ = bars
    assert high + high_height == pytest.approx(low, abs=0.11)
    assert low_height == pytest.approx(4 * high_height, abs=0.2)
    (line,) = (line for line in svg.iter("line") if line.get("class") == "limit")
    assert float(line.get("y1", "")) == pytest.approx(high, abs=0.11)
    assert "<100>" in "".join(svg.itertext())


def test_wording() -> None:
    assert [short(x) for x in (0, 999, 1500, 2_000_000, 3.2e9)] == ["0", "999", "1.5 k", "2 M", "3.2 G"]
    assert [seconds(x) for x in (0.0123, 12.34, 125)] == ["12 ms", "12.3 s", "2 min 05 s"]
