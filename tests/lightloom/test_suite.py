"""`lightloom policies --suite`: cases, what is kept of them, what they say together, and the measure of flicker."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lightloom.gen.pages.suite_page import markdown_table
from lightloom.golden_model.scene.files.load import load_scene
from lightloom.golden_model.stimuli.layouts.catalogue import BUDGETS, LAYOUTS, SEEDS, write_layout
from lightloom.policies.case import cases
from lightloom.policies.still import jump, still_frames, still_from
from lightloom.policies.suite import geometric_means, table

from .conftest import Run

SMALL = ["--frames", "3", "--size", "24x16", "--reference-rays", "16", "--seeds", "1", "--layouts", "corridor"]


def test_the_whole_suite_has_every_case() -> None:
    names = [case.name for case in cases()]
    assert len(set(names)) == len(names) == len(LAYOUTS) * len(BUDGETS) * len(SEEDS)


def test_cases_are_kept(cli: Run, tmp_path: Path) -> None:
    """A second run computes nothing, and says the same; so it does when others have been computed in between."""
    out = tmp_path / "suite"
    outcome = cli("policies", "--suite", *SMALL, "--out", str(out), "--json")
    assert outcome.code == 0, outcome
    report = json.loads(outcome.out)
    assert {row["budget"] for row in report["rows"]} == set(BUDGETS)
    assert list(report["means"]) == report["policies"] == ["round-robin", "visibility", "influence"]
    for row in report["rows"]:
        assert set(row["errors"]) == set(report["policies"])
        assert 0.95 < row["least_share"] <= row["greatest_share"] <= 1
        assert 0.5 < row["energy"] < 1.5
        for page in row["pages"]:
            assert (out / page / "index.html").exists()
            assert f"{page}/film.webp" in (out / "index.html").read_text()
    assert (out / "suite.md").read_text().count("\n") == 2 + len(BUDGETS)

    assert [bar["name"] for bar in report["bars"] if bar["figure"] is None] != []
    shown = (out / "index.html").read_bytes()
    first = times_of(out)
    other = cli("policies", "--suite", *SMALL, "--policies", "round-robin", "--out", str(out), "--json")
    assert other.code == 0, other
    both = times_of(out)
    assert len(both) == 2 * len(first)
    assert first.items() < both.items(), "what was there is as it was"
    pages = {page for row in report["rows"] for page in row["pages"]}
    assert not pages & {page for row in json.loads(other.out)["rows"] for page in row["pages"]}
    again = cli("policies", "--suite", *SMALL, "--out", str(out), "--json")
    assert json.loads(again.out)["cases"] == report["cases"]
    assert times_of(out) == both
    assert (out / "index.html").read_bytes() == shown, "figures, films and pages are those of the first run again"


def times_of(suite: Path) -> dict[Path, int]:
    """When the figures, films and pages of each case were written."""
    kinds = ("policies.json", "film.webp", "index.html")
    return {path: path.stat().st_mtime_ns for kind in kinds for path in (suite / "cases").rglob(kind)}


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--suite", "--layouts", "coridor"], "did you mean corridor"),
        (["--suite", "--seeds", "4"], "--seeds 4: must be 1 to 3"),
        (["--suite", "cornell-box"], "leave scene out"),
        (["--suite", "--budget", "100"], "leave budget out"),
        (["cornell-box", "--layouts", "corridor"], "--layouts: is for --suite"),
        (["cornell-box", "--bars"], "--bars: is for --suite"),
        (["--suite", "--before", "nowhere.json"], "--before nowhere.json: cannot be read"),
        (["--suite", "--jobs", "0"], "--jobs 0: must be at least 1"),
        ([], "SCENE is missing"),
    ],
)
def test_bad_input(cli: Run, arguments: list[str], said: str, tmp_path: Path) -> None:
    outcome = cli("policies", *arguments, "--out", str(tmp_path / "out"))
    assert outcome.code == 2
    assert said in outcome.err
    assert not (tmp_path / "out").exists()


def figures(layout: str, seed: int, **errors: float) -> dict[str, Any]:
    each = {"energy": 1.0, "flip": 0.1, "jump": None, "darkened": 0.0, "oldest": 3, "never_shown": seed}
    each |= {"lag": 4 + seed, "lag_turns": 0.5, "least_share": 0.9 if seed else None, "greatest_share": 1.0}
    each |= {"true_error": 0.03 if seed else None, "true_energy": 0.99, "true_noise": 0.001}
    policies = {name: {"error": error, **each} for name, error in errors.items()}
    return {
        "layout": layout,
        "budget": "scarce",
        "seed": seed,
        "rays": 100,
        "policies": policies,
        "page": f"cases/{seed}",
    }


def test_the_worst_comes_first() -> None:
    """By the last policy's mean error against that of the better of the others; and the worst run of all seeds."""
    rows = table(
        [
            figures("torch", 0, first=0.4, second=0.2, last=0.1),
            figures("corridor", 0, first=0.2, second=0.4, last=0.1),
            figures("corridor", 1, first=0.2, second=0.4, last=0.3),
        ]
    )
    assert [row["layout"] for row in rows] == ["corridor", "torch"]
    assert [row["against_best"] for row in rows] == pytest.approx([1.0, 0.5])
    assert [row["worst_run"] for row in rows] == pytest.approx([1.5, 0.5])
    assert [rows[0][name] for name in ("least_share", "lag", "never_shown", "jump")] == [0.9, 5, 1, None]
    assert [row["true_error"] for row in rows] == [0.03, None]
    assert "| E true |" in next(markdown_table(rows))
    assert "E true" not in next(markdown_table(rows[1:]))
    header, _, first, second = markdown_table(rows)
    assert header.count("|") == first.count("|") == second.count("|")
    assert "| > 5 (0.5) |" in first
    assert "| 4 (0.5) |" in second
    assert geometric_means(rows) == pytest.approx({"first": 1, "second": 1, "last": 0.5})


def test_still_frames(tmp_path: Path) -> None:
    """Of a dimmer those in which the lamp holds its level; of a walk those in which the camera stands."""
    dimmer = load_scene(write_layout("dimmer", 0, tmp_path))
    assert still_frames(dimmer, 48) == set(range(1, 48)) - {8, 9, 28, 29}
    room = load_scene(write_layout("room", 0, tmp_path))
    assert still_frames(room, 48) == {1, 2, 3, 4, *range(29, 48)}
    assert still_frames(load_scene(write_layout("flicker", 0, tmp_path)), 48) == set()


def test_jump_counts_what_is_seen_to_change() -> None:
    picture = np.full((4, 4, 3), 0.2, dtype=np.float32)
    other = picture.copy()
    assert jump(picture, other, picture, 1.0) == 0
    other[0, 0, 1] = 0.3
    other[3, 3] = 0.201
    assert jump(picture, other, picture, 1.0) == 1 / 16
    assert jump(other, picture, picture, 1.0) == 0, "it comes back to what it ought to be"
    assert jump(picture, other, np.full_like(picture, 0.5), 1.0) == 0, "it is on its way"
    middle = picture.copy()
    middle[0, 0, 1] = 0.24
    assert jump(picture, other, middle, 1.0) == 1 / 16, "it overshoots by more than it was short"


def test_every_still_frame_has_a_frame_that_it_is_like() -> None:
    assert still_from({1, 2, 5, 6, 9}) == {0, 4, 8}
    assert still_from(set()) == set()
