"""docs/results.md and docs/traversal_figures.md: made of the reports beside them, each of a commit that is known."""

import json
from pathlib import Path

import pytest

from lightloom.pages.measure import parts
from lightloom.pages.results import DOCS, PARTS, pages_of, write

KEPT = sorted((DOCS / PARTS).glob("*.json"))


def test_the_pages_say_what_the_reports_say() -> None:
    assert KEPT
    for name, text in pages_of(DOCS).items():
        assert (DOCS / name).read_text(encoding="utf-8") == text, "python -m lightloom.pages.results"


@pytest.mark.parametrize("file", KEPT, ids=lambda file: file.stem)
def test_a_report_is_of_a_known_commit_and_command(file: Path) -> None:
    report = json.loads(file.read_text(encoding="utf-8"))
    commit = report["versions"]["commit"]
    assert not commit.endswith("-dirty")
    assert file.stem in parts(Path("pdk"))
    assert file.stat().st_size < 300_000


def test_a_report_takes_the_place_of_the_one_of_its_name(tmp_path: Path) -> None:
    """The others stay; what is kept can be written again."""
    (tmp_path / PARTS).mkdir()
    write(KEPT, tmp_path)
    for name in pages_of(DOCS):
        assert (tmp_path / name).read_bytes() == (DOCS / name).read_bytes()
    newer = tmp_path / KEPT[0].name
    newer.write_text(KEPT[0].read_text(encoding="utf-8").replace("lightloom", "lightloom ", 1), encoding="utf-8")
    write([newer], tmp_path)
    assert len(list((tmp_path / PARTS).glob("*.json"))) == len(KEPT)
    assert (tmp_path / PARTS / newer.name).read_bytes() != KEPT[0].read_bytes()
