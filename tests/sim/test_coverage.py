"""What Verilator's counts become, and exclusions that are checked."""

from pathlib import Path

import pytest

from lightloom.sim.coverage import Exclusion, Point, exclusions, read_points, share, untaken

LINES = (
    r"C '\1f\2/tmp/x/unit.v\1l\2{line}\1n\2{column}\1page\2{page}/unit\1o\2{what}\1h\2TOP.unit' {count}",
    "# SystemC::Coverage-3",
)
VERILOG = "module unit;\n  assign z = a ? b : c;\n  assign y = a ? c : b;\nendmodule\n"


def record(line: int, column: int, page: str, what: str, count: int) -> str:
    text = LINES[0].format(line=line, column=column, page=page, what=what, count=count)
    return text.replace(r"\1", "\1").replace(r"\2", "\2")


@pytest.fixture
def counted(tmp_path: Path) -> Path:
    path = tmp_path / "coverage.dat"
    records = [
        record(2, 14, "v_branch", "cond_then", 5),
        record(2, 14, "v_branch", "cond_else", 0),
        record(3, 14, "v_branch", "cond_then", 0),
        record(3, 14, "v_branch", "cond_then", 4),  # another instance
        record(3, 14, "v_branch", "cond_else", 1),
        record(2, 3, "v_toggle", "z[0]:0->1", 7),
        record(1, 1, "v_line", "block", 9),
    ]
    path.write_text("\n".join([LINES[1], *records]) + "\n")
    return path


def test_points(counted: Path) -> None:
    points = read_points(counted)
    assert points[Point("unit.v", 3, 14, "unit", "branch", "cond_then")] == 4
    assert {kind: share(n for p, n in points.items() if p.kind == kind) for kind in ("branch", "toggle", "block")} == {
        "branch": (3, 4),
        "toggle": (1, 1),
        "block": (1, 1),
    }


def test_a_branch_that_is_not_taken_needs_a_reason(counted: Path) -> None:
    points = read_points(counted)
    missed, wrong = untaken("unit", points, VERILOG, [])
    assert [(each.point.line, each.point.what, each.source, each.reason) for each in missed] == [
        (2, "cond_else", "assign z = a ? b : c;", None)
    ]
    assert not wrong
    reason = Exclusion(branches=[(r"assign z = a \?", "cond_else")], reason="a is always high")
    assert untaken("unit", points, VERILOG, [reason])[0][0].reason == "a is always high"
    assert (
        untaken("other", points, VERILOG, [Exclusion(unit="unit", branches=[("z", "*")], reason="")])[0][0].reason
        is None
    )


def test_an_exclusion_that_is_taken_is_an_error(counted: Path) -> None:
    _, wrong = untaken("unit", read_points(counted), VERILOG, [Exclusion(branches=[("assign y", "*")], reason="never")])
    assert len(wrong) == 2
    assert wrong[0] == "unit.v:3: cond_else of `assign y = a ? c : b;` was taken, yet excluded: never"


def test_the_exclusions_have_reasons() -> None:
    for each in exclusions():
        assert len(each.reason) > 20, each
