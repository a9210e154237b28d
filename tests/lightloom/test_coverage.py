"""`lightloom coverage` on the smallest unit, and its page."""

import json
from html.parser import HTMLParser
from pathlib import Path

import pytest

from lightloom.gen.pages.coverage_page import coverage_page, percent
from lightloom.hardware import benches, coverage
from tests.lightloom.conftest import Run

UNIT = "float_compare"


@pytest.fixture
def few(monkeypatch: pytest.MonkeyPatch) -> None:
    """Enough for all of the smallest unit's bins."""
    monkeypatch.setattr(benches, "OPERANDS", 1000)
    monkeypatch.setattr(coverage, "MANY", 2000)


def test_the_smallest_unit_is_covered(cli: Run, few: None, tmp_path: Path) -> None:
    out = tmp_path / "coverage"
    done = cli("coverage", UNIT, "--out", out, "--json")
    assert done.code == 0, done
    report = json.loads(done.out)
    assert report == json.loads((out / "coverage.json").read_text())
    (row,) = report["rows"]
    assert (row["unit"], row["tests"], row["configuration"]) == (UNIT, 8, "base")
    assert row["branches_taken"] == row["branches"] > 10
    assert row["toggles_seen"] > 0.95 * row["toggles"]
    assert row["bins_filled"] == row["bins"] > 50
    assert f"module {UNIT}(" in (out / f"{UNIT}.v").read_text()
    page = (out / "index.html").read_text()
    HTMLParser().feed(page)
    assert "100.0 %" in page
    assert "<script" not in page


def test_what_is_not_reached_is_told() -> None:
    missed = {"unit": "u", "module": "m", "line": 3, "column": 7, "arm": "cond_else", "source": "a ? <b> : c"}
    figures = {"toggles": 10, "toggles_seen": 9, "bins": 2, "bins_filled": 1, "tests": 1, "seconds": 1.0}
    measured = {
        "row": {"unit": "u", "configuration": "base", "branches": 10, "branches_taken": 8, **figures}
        | {"branches_explained": 1, "core_branches": 0, "core_branches_taken": 0},
        "bins": [{"unit": "u", "group": "g", "bin": name, "count": count} for name, count in (("one", 1), ("none", 0))],
        "untaken": [missed | {"reason": None}, missed | {"line": 4, "reason": "c is never asked for"}],
        "wrong": [],
    }
    report = coverage.report_of([measured], "lightloom coverage u")
    assert coverage.faults(report) == [
        "8 of 10 branches are taken (1 cannot be), less than 95%",
        "u.v:3:7: cond_else of `a ? <b> : c` is not taken, and nothing says why",
        "u: g: none: never seen",
    ]
    page = coverage_page(report)
    assert "a ? &lt;b&gt; : c" in page
    assert "c is never asked for" in page
    assert "80.0 %" in page


def test_a_share_is_whole_only_if_it_is() -> None:
    assert [percent(*each) for each in ((9999, 10000), (3, 3), (0, 7), (0, 0))] == ["99.9 %", "100.0 %", "0.0 %", "–"]  # noqa: RUF001


def test_unknown_unit(cli: Run) -> None:
    cli("coverage", "float_cube").refused("float_cube")
