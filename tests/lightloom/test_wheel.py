"""The package as a user has it: a wheel in an environment of its own, beside folders that are called like our rooms."""

import os
import shutil
import subprocess
import sys
import sysconfig
import zipfile
from pathlib import Path

import pytest

from tests import ROOT
from tests.test_rooms import ROOMS, modules

from .conftest import LAMP, ROOM

ELSEWHERE = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}
"""The environment without what puts this checkout before anything that is installed."""
PACKAGED = (*ROOMS, "lightloom", "pyproject.toml", "README.md", "LICENSE")


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Built from a copy, so that what older builds have left does not get into it."""
    copy = tmp_path_factory.mktemp("checkout")
    for name in PACKAGED:
        if (ROOT / name).is_dir():
            shutil.copytree(ROOT / name, copy / name, symlinks=True, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            shutil.copy(ROOT / name, copy)
    command = [sys.executable, "-m", "pip", "wheel", "--no-deps", "--no-build-isolation", "--wheel-dir", "wheels", "."]
    done = subprocess.run(command, cwd=copy, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    (made,) = (copy / "wheels").iterdir()
    return made


@pytest.fixture(scope="module")
def installed(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The programs of an environment that has the wheel, and what it needs from this one."""
    folder = tmp_path_factory.mktemp("environment")
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", str(folder)], check=True)
    python = folder / "bin" / "python"
    pip = [sys.executable, "-m", "pip", "--python", str(python), "install", "--no-deps", "--no-index", str(wheel)]
    done = subprocess.run(pip, env=ELSEWHERE, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    version = f"python{sys.version_info.major}.{sys.version_info.minor}"
    needed = folder / "lib" / version / "site-packages" / "needed.pth"
    needed.write_text(sysconfig.get_path("purelib"))  # as a folder: what is installed there as editable stays unknown
    return folder / "bin"


def test_every_module_is_in_it_once(wheel: Path) -> None:
    names = zipfile.ZipFile(wheel).namelist()
    python = [
        name.removesuffix(".py").replace("/", ".").removesuffix(".__init__") for name in names if ".py" in name[-3:]
    ]
    assert sorted(name.removesuffix(".__init__") for name in python) == sorted(modules())
    assert "lightloom/py.typed" in names
    rest = {Path(name).suffix for name in names if name.startswith("lightloom/")} - {".py", ".typed"}
    assert rest >= {".v", ".cpp", ".h", ".toml", ".vlt", ".html", ".css"}


COMMANDS = (
    "--help",
    "emit half_to_float --preset tiny --out verilog",
    "package half_to_float --preset tiny --out package",
    "prove --list queue",
    "pack cornell-box --out scene.bin",
    "render room.toml --frames 1 --size 24x16 --budget 2000 --backend numpy --out frames",
    "coverage --help",
)


def test_commands_work_beside_folders_of_the_same_names(installed: Path, tmp_path: Path) -> None:
    for room in ROOMS:
        (tmp_path / room).mkdir()
        (tmp_path / room / "__init__.py").write_text('raise ImportError("this is the user\'s own folder")\n')
    (tmp_path / "room.toml").write_text(ROOM + LAMP)
    environment = {**ELSEWHERE, "PYTHONPATH": str(tmp_path)}
    for command in COMMANDS:
        line = [str(installed / "lightloom"), *command.split()]
        done = subprocess.run(line, cwd=tmp_path, env=environment, capture_output=True, text=True)
        assert done.returncode == 0, f"{command}: {done.stdout}{done.stderr}"
    assert (tmp_path / "verilog" / "half_to_float.v").exists()


def test_it_is_the_wheel_that_runs(installed: Path, tmp_path: Path) -> None:
    program = "import lightloom.rtl.catalogue as c, lightloom.sim.runner; print(c.__file__)"
    line = [str(installed / "python"), "-c", program]
    done = subprocess.run(line, cwd=tmp_path, env=ELSEWHERE, capture_output=True, text=True)
    assert Path(done.stdout.strip()).is_relative_to(installed.parent), done
