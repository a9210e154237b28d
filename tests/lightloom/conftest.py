"""The command line as a user calls it: `lightloom(...)` runs it in a process of its own, `cli(...)` in this one."""

import os
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import pytest

from lightloom import cli as front_door

PROGRAM = Path(sys.executable).with_name("lightloom")


@dataclass(frozen=True)
class Outcome:
    code: int
    out: str
    err: str

    def refused(self, *words: str) -> None:
        """Bad input: code 2, nothing on stdout, one line on stderr that names what is wrong."""
        assert self.code == 2, self
        assert self.out == "", self
        lines = self.err.splitlines()
        # Stages that ended well may be told before the error.
        assert [line for line in lines if line.startswith("error: ")] == lines[-1:], self
        assert "Traceback" not in self.err
        for word in words:
            assert word in lines[-1], (word, lines[-1])


Run = Callable[..., Outcome]


@pytest.fixture
def cli(capfd: pytest.CaptureFixture[str]) -> Run:
    """Runs a command line in this process."""

    def run(*arguments: object) -> Outcome:
        capfd.readouterr()
        code = front_door.run([str(argument) for argument in arguments])
        captured = capfd.readouterr()
        return Outcome(code, captured.out, captured.err)

    return run


@pytest.fixture
def lightloom(tmp_path: Path) -> Run:
    """Runs a command line as a process of its own, in `tmp_path`."""

    def run(*arguments: object, timeout: float = 300) -> Outcome:
        command = [str(PROGRAM), *(str(argument) for argument in arguments)]
        done = subprocess.run(
            command, cwd=tmp_path, env={**os.environ}, capture_output=True, text=True, timeout=timeout
        )
        return Outcome(done.returncode, done.stdout, done.stderr)

    return run


@pytest.fixture
def quick_verilog(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whoever asks for all units gets the smallest only; every unit can still be emitted and simulated by name."""
    # What works by name has to have its own view of the whole catalogue before.
    import lightloom.gen.emit
    import lightloom.hardware.describe
    import lightloom.sim.bulk

    monkeypatch.setattr(
        "lightloom.rtl.catalogue.CATALOGUE", {"float_compare": lightloom.gen.emit.CATALOGUE["float_compare"]}
    )


@pytest.fixture
def quickly_built(monkeypatch: pytest.MonkeyPatch) -> None:
    """For some hundreds of rays it does not matter how fast the simulation is, but how soon it is there.

    It is the one that the other tests of the base preset have built.
    """
    from lightloom.sim.traversal import TraversalUnit

    for module in ("lightloom.sim.traversal", "lightloom.bench.traversal"):
        monkeypatch.setattr(f"{module}.TraversalUnit", partial(TraversalUnit, level=1))


@pytest.fixture
def coarse_cornell_box(monkeypatch: pytest.MonkeyPatch) -> None:
    """`cornell-box` with 1,100 texels instead of 31,000: where maps matter only in that there are some."""
    from lightloom.golden_model.scene.files import load

    scene = load.BUILT_IN["cornell-box"]()
    monkeypatch.setitem(load.BUILT_IN, "cornell-box", lambda: replace(scene, texel_size=50.0))


def files_below(folder: Path) -> set[str]:
    """Everything in a folder, hidden files too: to see that nothing was left behind."""
    return {str(path.relative_to(folder)) for path in folder.rglob("*")}


ROOM = """
name = "room"
texel_size = 0.5
[camera]
position = [0, 1, 4]
target = [0, 1, 0]
fov_y_tan = 0.5
[[camera.path]]
frame = 0
position = [0, 1, 4]
target = [0, 1, 0]
[[camera.path]]
frame = 8
position = [1, 1, 4]
target = [0, 1, 0]
[[quad]]
name = "floor"
corners = [[-2, 0, 2], [2, 0, 2], [2, 0, -2], [-2, 0, -2]]
albedo = [0.7, 0.2, 0.2]
[[quad]]
name = "wall"
corners = [[-2, 0, -2], [2, 0, -2], [2, 3, -2], [-2, 3, -2]]
"""
LAMP = """
[[quad]]
name = "lamp"
corners = [[-1, 3, -1], [1, 3, -1], [1, 3, 1], [-1, 3, 1]]
albedo = [0, 0, 0]
emission = [5, 5, 5]
"""


@pytest.fixture
def room(tmp_path: Path) -> Path:
    """A scene with few texels: a floor, a wall and a lamp."""
    path = tmp_path / "room.toml"
    path.write_text(ROOM + LAMP)
    return path
