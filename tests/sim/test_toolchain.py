"""What is compiled once and kept."""

from pathlib import Path

import pytest

from lightloom.sim import toolchain


def test_object_files_are_named_by_what_they_are_made_of(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of other options, or by another compiler, they are others: those of another checkout are not linked."""
    monkeypatch.setenv("LIGHTLOOM_CACHE", str(tmp_path))
    compiled: list[str] = []

    def run(command: list[str], **_: object) -> str:
        compiled.append(command[-1])
        Path(command[-1]).touch()
        return ""

    monkeypatch.setattr(toolchain, "run", run)
    made = toolchain.verilated_runtime("_vpi")
    assert toolchain.verilated_runtime("_vpi") == made
    assert len(compiled) == len(made) == 3
    with monkeypatch.context() as patch:
        patch.setattr(toolchain, "compiler_version", lambda: "1.2.3")
        assert not set(made) & set(toolchain.verilated_runtime("_vpi"))
    monkeypatch.setattr(toolchain, "RUNTIME", [*toolchain.RUNTIME, "-O0"])
    assert not set(made) & set(toolchain.verilated_runtime("_vpi"))
    assert len(compiled) == 9
