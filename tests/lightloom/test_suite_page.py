"""docs/suite.md: made of the figures beside it, which a later build is held against."""

import json
from pathlib import Path

from lightloom.pages.suite import DOCS, page, write
from lightloom.policies.bars import against_before, bars


def test_the_page_says_what_the_figures_say() -> None:
    report = json.loads((DOCS / "suite.json").read_text(encoding="utf-8"))
    assert (DOCS / "suite.md").read_text(encoding="utf-8") == page(report), "python -m lightloom.pages.suite FILE"
    assert report["policies"] == ["round-robin", "visibility", "influence"]
    assert not report["versions"]["commit"].endswith("-dirty")
    assert (DOCS / "suite.json").stat().st_size < 300_000


def test_it_is_written_from_what_a_run_leaves(tmp_path: Path) -> None:
    """Of suite.json what is not made of the rest; it can be held against itself."""
    report = json.loads((DOCS / "suite.json").read_text(encoding="utf-8"))
    write(report | {"rows": [], "means": {}, "bars": []}, tmp_path)
    assert json.loads((tmp_path / "suite.json").read_text(encoding="utf-8")) == report
    assert (tmp_path / "suite.md").read_bytes() == (DOCS / "suite.md").read_bytes()
    ratio = against_before(report["cases"], report["cases"], "influence")
    (shown,) = (bar.figure for bar in bars(report) if bar.name.endswith("to that of round-robin"))
    assert ratio == shown


def test_the_readme_says_so_too() -> None:
    report = json.loads((DOCS / "suite.json").read_text(encoding="utf-8"))
    found = {bar.name: bar.figure for bar in bars(report)}
    mean = found["geometric mean of E over layouts and budgets, to that of round-robin"]
    worst = found["E of a layout and budget, to the better of visibility and round-robin"]
    readme = " ".join((DOCS.parent / "README.md").read_text(encoding="utf-8").split())
    assert f"is {mean:.3f} times round-robin's, and at worst {worst:.3f} times that of the better of two" in readme
